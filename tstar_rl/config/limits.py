"""Of each value in a config what it may be, where its type alone does not say it: tables, which `ranges` reads."""

from tstar_rl.demonstrations.header import KINDS
from tstar_rl.runs.run_folder import SAVED

__all__ = [
    "CHOICES",
    "CHOICES_OF_LISTS",
    "KINDS_OF_NUMBERS",
    "LEAST",
    "MODES",
    "MOST",
    "NAMES",
    "NOT_EMPTY",
]

NAMES = ("system", "skills")
"""Values that are folders of a run's place."""
MODES = ("deterministic", "stochastic")
"""How actions are taken in an evaluation: the names of `rollouts.episodes.MODES`, which needs torch."""
LEAST = {
    "seed": 0,
    "nthread": 0,
    "torch_threads": 1,
    "processes": 1,
    "collection.workers": 1,
    "demonstrations.episodes": 1,
    "demonstrations.seed": 0,
    "demonstrations.num_envs": 1,
    "training.num_envs": 1,
    "training.horizon": 1,
    "training.total_steps": 0,
    "training.max_steps": 1,
    "training.checkpoint_every": 1,
    "training.demonstration_steps": 1,
    "chain.steps_per_turn": 1,
    "chain.horizon": 1,
    "chain.capacity": 1,
    "chain.trial_episodes": 1,
    "chain.trial_max_steps": 1,
    "chain.trial_every": 1,
    "evaluation.episodes": 1,
    "evaluation.whole_episodes": 1,
    "evaluation.recorded": 0,
    "spirl.capacity": 1,
    "spirl.num_envs": 1,
    "spirl.max_steps": 1,
    "spirl.total_steps": 0,
    "spirl.checkpoint_every": 1,
    "simulations": 1,
    "episodes": 1,
    "compared": 1,
    "states": 1,
    "draws": 1,
    "influence_starts": 0,
    "influence_times": 2,
    **{
        f"bench.{name}": 1
        for name in ("steps", "rounds", "updates", "worker_steps", "chain_rounds", "single_steps")
    },
    **{f"growth.{name}": 1 for name in ("steps", "least", "rollouts", "rollout_envs", "rollout_horizon")},
}
"""Of each whole number, the least it may be. A recipe that has no such key is not asked for it."""
MOST = dict.fromkeys(("seed", "demonstrations.seed"), 2**32 - 1)
"""The same, the most: a larger seed would share its draws with another purpose of a smaller one (`seeds`)."""
KINDS_OF_NUMBERS = {
    "normalizer.floor": "positive",
    "floor": "positive",
    "from_metres": "positive",
    "from_degrees": "positive",
    "minutes": "positive",
    "noise": "not_negative",
    "chain.gate_margin": "finite",
    "demonstrations.noise": "not_negative",
    "training.demonstration_starts": "share",
    "bonus": "share",
    "hard_starts": "share",
    "demonstrated_ends": "share",
    "alpha": "not_negative",
    "value_scale": "positive",
    "decay": "positive_share",
}
"""Of each other number, its kind: see `checks.RANGES`."""
NOT_EMPTY = (
    "arms", "checkpoints", "formats", "kinds", "modes", "only", "scales", "seeds", "systems", "tasks", "variants",
)  # fmt: skip
"""Lists that name what a recipe does."""
CHOICES = {
    "launch": ("local", "ray"),
    "collection.backend": ("local", "ray"),
    "demonstrations.kind": KINDS,
    "checkpoint": SAVED,
    "from_checkpoint": ("last", "best"),
    "mode": MODES,
    "physics": ("mujoco", "warp", None),
}
CHOICES_OF_LISTS = {"checkpoints": SAVED, "kinds": KINDS, "modes": MODES}
"""The same of every entry of a list."""
