"""Skills one after another: the policy that runs them, and the trials that decide what each hands over."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor, nn
from torchrl.envs import ExplorationType, TransformedEnv, set_exploration_type

from tstar_rl.chaining.skill import Skill
from tstar_rl.env.layout import NUM_PHASES, PARTS
from tstar_rl.rollouts.episodes import run_episodes
from tstar_rl.rollouts.state_sets import StateSet, TerminationSet

__all__ = [
    "ChainPolicy",
    "TurnEnd",
    "chain_folders",
    "chain_progress",
    "keep_better",
    "load_chain",
    "save_chain",
    "seed_sets",
    "states",
    "terminal_poses",
    "try_out",
]


class ChainPolicy(TensorDictModuleBase):
    """Map from "observation", "subtask" to "action": each row acts with the policy of its own subtask.

    Rows past the last subtask (the task is done) act with the last skill. Sampling follows TorchRL's
    `set_exploration_type`, as each skill's own policy does.

    Args:
        skills: in the order of the subtasks.

    Raises:
        ValueError: if there are none, or one stands in another's place.
    """

    def __init__(self, skills: Sequence[Skill]) -> None:
        super().__init__()
        order = [skill.subtask for skill in skills]
        if not order or order != list(range(len(order))):
            raise ValueError(f"a chain needs the skills of subtasks 0, 1, ... in order; got {order}")
        self.in_keys, self.out_keys = ["observation", "subtask"], ["action"]
        self.policies = nn.ModuleList(skill.policy for skill in skills)

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """tensordict: batch [N] -> the same with "action" (N, 9)."""
        subtask = tensordict["subtask"].squeeze(-1).clamp(0, len(self.policies) - 1)
        observation = tensordict.select("observation")
        action = None
        for index, policy in enumerate(self.policies):
            rows = (subtask == index).nonzero().squeeze(-1)
            if not len(rows):
                continue
            part = policy(observation[rows])["action"]
            if action is None:
                action = torch.zeros((*subtask.shape, part.shape[-1]), dtype=part.dtype, device=part.device)
            action[rows] = part
        return tensordict.set("action", action)


def states(state_set: StateSet) -> Tensor:
    """The observations in a set, (n, O); (0, 1) from an empty one, which knows none."""
    return state_set.buffer[:]["observation"] if len(state_set) else torch.zeros(0, 1)


def terminal_poses(rollout: TensorDictBase, number: int) -> Tensor:
    """Poses of all parts in the first `number` terminal states of successes in a rollout (N, T): (n, 7 P), world."""
    reached = rollout["next", "observation"][rollout["next", "success"].squeeze(-1)]
    return reached[:number, PARTS:-NUM_PHASES]


def save_chain(skills: Sequence[Skill], path: Path, **record: Any) -> None:
    """Writes every skill of a chain to <path>/skill<i>, each with the record."""
    for index, skill in enumerate(skills):
        skill.save(path / f"skill{index}", **record)


def chain_folders(path: Path) -> list[Path]:
    """The folders of the skills of the chain at `path`, in order; none if there is no chain."""
    return sorted(path.glob("skill*"), key=lambda folder: int(folder.name.removeprefix("skill")))


def load_chain(path: Path, **expected: Any) -> list[Skill]:
    """What `save_chain` wrote to `path`; see `Skill.load` for what is expected.

    Raises:
        FileNotFoundError: if there is none.
    """
    folders = chain_folders(path)
    if not folders:
        raise FileNotFoundError(f"no chain at {path}")
    return [Skill.load(folder, **expected) for folder in folders]


def chain_progress(skills: Sequence[Skill], env: TransformedEnv) -> float:
    """Mean share of a chain's subtasks that are done in one deterministic episode of every simulation; closes `env`."""
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        last = run_episodes(env, ChainPolicy(skills))
    env.close()
    return float(last["next", "completed"].clamp(max=len(skills)).double().mean()) / len(skills)


def try_out(skill: Skill, env: TransformedEnv) -> tuple[float, TensorDictBase]:
    """One deterministic episode of every simulation: the share that succeeds, and the last steps; closes `env`."""
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        last = run_episodes(env, skill.policy)
    env.close()
    return float(last["next", "success"].double().mean()), last


def hand_over(skill: Skill, last: TensorDictBase) -> None:
    """Lets the termination set be what this trial reached, and the initiation set grow by where it succeeded from.

    Of a policy that a gate has rejected, what it reached while training leaves the termination set with this: the next
    skill would never start there. The starts it succeeded from stay in the initiation set, though the policy that is
    kept need not succeed from them.
    """
    before = skill.termination_set
    skill.termination_set = TerminationSet(before.capacity, before.device)
    skill.termination_set.extend_from(last)
    skill.initiation_set.extend_from(last)


def seed_sets(skills: Sequence[Skill], make_trial: Callable[[int], TransformedEnv]) -> None:
    """Tries the skills in order, each from where the one before arrives, so that every set has members."""
    for index, skill in enumerate(skills):
        _, last = try_out(skill, make_trial(index))
        hand_over(skill, last)


def keep_better(
    skill: Skill,
    before: dict[str, Any],
    make_trial: Callable[[], TransformedEnv],
    margin: float,
    progress: Callable[[], float] | None = None,
    progress_before: float | None = None,
) -> dict[str, float]:
    """Puts a skill back to what it was unless it is now at least as good, less a margin, on the same episodes.

    Whichever stays hands over what it reached.

    Args:
        skill: as trained.
        before: its `network_state` before.
        make_trial: makes the environment of the trial, each time with the same seed.
        margin: in share of episodes, or of progress.
        progress: of the whole chain as it stands; it is then what has to be as good, and not the skill's own success.
        progress_before: what `progress` gave with `before`, where that is known: the trial is not run again.
    """
    after, last_after = try_out(skill, make_trial())
    chain_after = progress() if progress else after
    trained = skill.network_state()
    skill.load_network_state(before)
    was, last_before = try_out(skill, make_trial())
    chain_was = was
    if progress:
        chain_was = progress() if progress_before is None else progress_before
    accepted = chain_after >= chain_was - margin
    if accepted:
        skill.load_network_state(trained)
    hand_over(skill, last_after if accepted else last_before)
    log = {"trial_before": was, "trial_after": after, "accepted": int(accepted)}
    return log | ({"trial_progress": chain_after if accepted else chain_was} if progress else {})


@dataclass
class TurnEnd:
    """What ends a turn of fine-tuning: the gate, and the trial of the whole chain that tells its best. Returns the log.

    A trial of the chain after one turn is that before the next, and is not run twice; one that is not in memory, as
    after a run was killed, is run again with the same result.

    Args:
        whole_trial: progress of the chain as it stands, on the same starts whenever it is asked.
        gate: whether a turn that lost is put back.
        gate_on: what must not lose, "skill" or "chain".
        gate_margin: see `keep_better`.
        whole_trial_every: turns between trials of the chain that no gate asks for.
    """

    whole_trial: Callable[[], float]
    gate: bool
    gate_on: str
    gate_margin: float
    whole_trial_every: int
    _progress: float | None = field(default=None, init=False)

    def __call__(
        self, skill: Skill, before: dict[str, Any], make_trial: Callable[[], TransformedEnv], turn: int
    ) -> dict[str, float]:
        """Judges `skill`, which was `before`, after turn number `turn`."""
        log: dict[str, float] = {}
        if self.gate:
            judge = self.whole_trial if self.gate_on == "chain" else None
            log |= keep_better(skill, before, make_trial, self.gate_margin, judge, self._progress)
        if "trial_progress" not in log and (turn + 1) % self.whole_trial_every == 0:
            log["trial_progress"] = self.whole_trial()
        self._progress = log.get("trial_progress")
        return log
