"""An assembly to look at, in any browser: writes one HTML file and prints its path.

python recipes/watch.py                                   # make watch
python recipes/watch.py "variants=[tstar,tstar]" +env.part_noise=0.06
python recipes/watch.py task=chair_ingolf variants=null noise=0.1 seed=3

Two trained chains that come with the package, from the same start: on the left one that fails, on the right one that
was mended. With variants=null the scripted assembler, on the left with Gaussian noise on the arm.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import torch
from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig

from tstar_rl.checks import InvalidValueError
from tstar_rl.config.build import environment
from tstar_rl.config.load import recipe
from tstar_rl.config.overrides import key_of, section_of
from tstar_rl.config.pretrained import chain_env
from tstar_rl.rollouts.watching import StepSignal, d_omega_signal, log_episodes, rows_to_show
from tstar_rl.seeds import evaluation_seed
from tstar_rl.shipped.catalogue import load_pretrained, pretrained


class Shown(NamedTuple):
    """One side of the page: `policy` makes, of the environment, a map of TensorDicts of batch [N]."""

    title: str
    policy: Callable[[Any], Callable]
    success: bool
    settings: Mapping[str, Any] = {}
    signals: Mapping[str, StepSignal] = {}
    links: int | None = None


@recipe("watch", path=str, variants=tuple[str, str] | None, noise=float, simulations=int)
def main(config: DictConfig) -> None:
    """Runs some episodes of each side, keeps one of each that ended as wanted, and writes the page."""
    seed = evaluation_seed(config.seed, "own_starts", config.subtask)
    sides, logs = both_sides(config, HydraConfig.get().overrides.task), []
    for shown in sides:
        env = environment(config, config.subtask, config.simulations, seed, snapshots=True, **shown.settings)
        logs.append(log_episodes(env, shown.policy(env.base_env), signals=shown.signals, enough=shown.links))
        env.close()
    rows = rows_to_show(logs, [shown.success for shown in sides])
    episodes = [log.episode(row, shown.title) for log, row, shown in zip(logs, rows, sides, strict=True)]
    for episode in episodes:
        print(f"{episode['title']}: {'success' if episode['success'] else 'failure'}", end=" ")
        print(f"after {len(episode['reward'])} steps")
    print(env.base_env.write_player(config.path, episodes))


def both_sides(config: DictConfig, given: Sequence[str]) -> list[Shown]:
    """What is shown, from left to right."""
    asked = any(section_of(value) == "variants" for value in given)
    shipped = set(config.variants or ()) <= set(pretrained().get(config.task.name, ()))
    if not (shipped or asked):
        print(f"{config.task.name} has no such trained chains: the scripted assembler is shown")
    if config.variants is None or not (shipped or asked):
        generator = torch.Generator().manual_seed(config.seed % 2**63)
        disturbed = "scripted assembler, arm disturbed"
        return [
            Shown(disturbed, lambda env: env.expert(config.noise, generator), False),
            Shown("scripted assembler", lambda env: env.expert(), True),
        ]
    if any(section_of(value) == "scale" for value in given):
        raise InvalidValueError(
            "trained chains bring their own world, which a scale would be mixed with: leave scale=... out, or set "
            "variants=null"
        )
    if any(key_of(value) == "env" for value in given):
        raise InvalidValueError(
            "trained chains bring their own world: give single settings of it, env.<setting>=..., not env={...}; or "
            "set variants=null"
        )
    if any(section_of(value) == "noise" for value in given):
        raise InvalidValueError(
            "noise disturbs the scripted assembler, and trained chains are shown: set variants=null, or leave "
            f"noise=... out; got noise={config.noise}"
        )
    chains = [load_pretrained(config.task.name, name).to(config.device) for name in config.variants]
    judges = next((chain.d_omega for chain in reversed(chains) if len(chain.d_omega)), None)
    signals = {"d_omega": d_omega_signal(judges)} if judges else {}
    return [
        Shown(
            _title(chain),
            lambda env, chain=chain: chain,
            side > 0,
            chain_env(chain, config, given),
            signals,
            len(chain.policies),
        )
        for side, chain in enumerate(chains)
    ]


def _title(chain: Any) -> str:
    """What a chain is, and how often it succeeds."""
    figures = next(iter(chain.record["figures"].values()))
    return f"{chain.record['says']} ({figures['success']:.0%} of {figures['episodes']} succeed)"


if __name__ == "__main__":
    main()
