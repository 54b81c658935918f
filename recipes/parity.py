"""The GPU's simulator against the processor's: how far they part, how often the scripted assembler succeeds on each.

python recipes/parity.py task=table_lack subtask=0 seed=0          # on Warp's CPU device; device=cuda on a GPU
"""

from pathlib import Path
from typing import Any

from omegaconf import DictConfig, OmegaConf
from torch import Tensor

from tstar_rl.checks import need_extra
from tstar_rl.config.build import environment
from tstar_rl.config.load import recipe
from tstar_rl.launch.overrides import chosen_scale
from tstar_rl.rollouts.episodes import run_episodes
from tstar_rl.runs.csv_tables import append_rows
from tstar_rl.seeds import evaluation_seed

HORIZONS = (1, 10, 20, 40, 60)
"""Control steps after which states are compared: reach, grasp, carry, connect."""


@recipe("parity", episodes=int, compared=int)
def main(config: DictConfig) -> None:
    """Compares each subtask and the whole task, or what is asked for; adds a row of each to parity.csv."""
    need_extra("mujoco_warp", "gpu", "parity.py")
    asked = [*range(config.task.subtasks), None] if config.subtask is None else [config.subtask]
    for subtask in asked:
        row = {
            "task": config.task.name,
            "scale": chosen_scale(),
            "subtask": "whole" if subtask is None else subtask,
            "seed": config.seed,
        }
        row = {**row, "device": config.device, **_success(config, subtask), **_parting(config, subtask)}
        path = Path(config.results_dir) / "parity.csv"
        table = append_rows(path, [row], ("task", "scale", "subtask", "seed", "device"))
        print(table.to_string(index=False))


def _pair(config: DictConfig, subtask: int | None, number: int) -> tuple[Any, Any]:
    """The same simulations with MuJoCo on the processor and with Warp on `device`."""
    seed = evaluation_seed(config.seed, "parity", number, subtask)
    on_processor = OmegaConf.merge(config, {"physics": "mujoco", "device": "cpu"})
    on_device = OmegaConf.merge(config, {"physics": "warp"})
    assert isinstance(on_processor, DictConfig) and isinstance(on_device, DictConfig)
    return environment(on_processor, subtask, number, seed), environment(on_device, subtask, number, seed)


def _success(config: DictConfig, subtask: int | None) -> dict[str, Any]:
    """Success of the scripted assembler from the same starts, each acting on what it sees."""
    ends = [run_episodes(env, env.base_env.expert()) for env in _pair(config, subtask, config.episodes)]
    ours, theirs = (end["next", "success"].flatten().cpu() for end in reversed(ends))
    return {
        "episodes": config.episodes,
        "success_mujoco": float(theirs.double().mean()),
        "success_warp": float(ours.double().mean()),
        "episodes_that_differ": int((ours != theirs).sum()),
    }


def _parting(config: DictConfig, subtask: int | None) -> dict[str, Any]:
    """Largest differences under the same actions from the same snapshots, after each horizon."""
    processor, device = (env.base_env for env in _pair(config, subtask, config.compared))
    given = processor.reset()
    device.reset()
    device.restore(processor.snapshot())
    act, out, wrong_phase, wrong_count = processor.expert(), {}, 0, 0
    for step in range(1, HORIZONS[-1] + 1):
        given = act(given)
        theirs = processor.step(given.select("action"))["next"]
        ours = device.step(given.select("action").to(device.device))["next"].cpu()
        wrong_phase += int((ours["phase"] != theirs["phase"]).sum())
        wrong_count += int((ours["completed"] != theirs["completed"]).sum())
        if step in HORIZONS:
            out[f"observation_{step}"] = _largest(ours["observation"][:, :-8], theirs["observation"][:, :-8])
            out[f"reward_{step}"] = _largest(ours["reward_env"], theirs["reward_env"])
        given = theirs
    return {
        "compared": config.compared,
        **out,
        "steps_of_another_phase": wrong_phase,
        "steps_apart": wrong_count,
    }


def _largest(one: Tensor, other: Tensor) -> float:
    return float((one - other).abs().max())


if __name__ == "__main__":
    main()
