"""An assembly to look at, in any browser: writes one HTML file and prints its path.

python recipes/watch.py                                   # make watch
python recipes/watch.py task=chair_ingolf noise=0.1 seed=3

On the right the scripted assembler, on the left the same with Gaussian noise on the arm, which does not get through.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import torch
from omegaconf import DictConfig

from tstar_rl.config.build import environment
from tstar_rl.config.load import recipe
from tstar_rl.rollouts.watching import Signal, record_episode
from tstar_rl.seeds import derive_seed


class Shown(NamedTuple):
    """One side of the page: `policy` makes, of the environment, a map of TensorDicts of batch [N]."""

    title: str
    policy: Callable[[Any], Callable]
    success: bool
    signals: Mapping[str, Signal] = {}


@recipe("watch", path=str, noise=float, simulations=int)
def main(config: DictConfig) -> None:
    """Runs some episodes of each, keeps the first that ended as wanted, and writes the page."""
    seed, episodes = derive_seed(config.seed, "evaluate", 3, config.subtask), []
    for title, policy, success, signals in both_sides(config):
        env = environment(config, config.subtask, config.simulations, seed, snapshots=True)
        episodes.append(record_episode(env, policy(env.base_env), title, success, signals))
        path = env.base_env.write_player(config.path, episodes)
        shown = episodes[-1]
        print(f"{title}: {'success' if shown['success'] else 'failure'} after {len(shown['reward'])} steps")
    print(path)


def both_sides(config: DictConfig) -> list[Shown]:
    """What is shown, from left to right."""
    generator = torch.Generator().manual_seed(config.seed)
    return [
        Shown("scripted assembler, arm disturbed", lambda env: env.expert(config.noise, generator), False),
        Shown("scripted assembler", lambda env: env.expert(), True),
    ]


if __name__ == "__main__":
    main()
