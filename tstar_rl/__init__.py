"""Learning to chain skills: T-STAR and its baselines on TorchRL.

The public names are imported when they are asked for: `import tstar_rl` loads no simulator and no TorchRL.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tstar_rl.chaining.chain import ChainPolicy
    from tstar_rl.chaining.skill import NetworkSettings, Skill
    from tstar_rl.demonstrations.data_set import Demonstrations
    from tstar_rl.env.furniture_env import FurnitureEnv
    from tstar_rl.rollouts.collection import Collection
    from tstar_rl.rollouts.state_sets import InitiationSet, TerminationSet
    from tstar_rl.shipped.catalogue import load_pretrained, pretrained
    from tstar_rl.shipped.chain import ShippedChain
    from tstar_rl.transforms.episode_start import EpisodeStart
    from tstar_rl.transforms.gail_reward import GAILReward
    from tstar_rl.transforms.reward_mixture import RewardMixture
    from tstar_rl.transforms.skill_chain_reset import SkillChainReset
    from tstar_rl.transforms.terminal_state_reward import ConstantBonus, TerminalStateReward

__version__ = "0.1.0"
HOMES = {
    "ChainPolicy": "chaining.chain",
    "Collection": "rollouts.collection",
    "ConstantBonus": "transforms",
    "Demonstrations": "demonstrations.data_set",
    "EpisodeStart": "transforms",
    "FurnitureEnv": "env.furniture_env",
    "GAILReward": "transforms",
    "InitiationSet": "rollouts.state_sets",
    "NetworkSettings": "chaining.skill",
    "RewardMixture": "transforms",
    "ShippedChain": "shipped.chain",
    "Skill": "chaining.skill",
    "SkillChainReset": "transforms",
    "TerminalStateReward": "transforms",
    "TerminationSet": "rollouts.state_sets",
    "load_pretrained": "shipped.catalogue",
    "pretrained": "shipped.catalogue",
}
"""The room of each public name."""
__all__ = [
    "ChainPolicy",
    "Collection",
    "ConstantBonus",
    "Demonstrations",
    "EpisodeStart",
    "FurnitureEnv",
    "GAILReward",
    "InitiationSet",
    "NetworkSettings",
    "RewardMixture",
    "ShippedChain",
    "Skill",
    "SkillChainReset",
    "TerminalStateReward",
    "TerminationSet",
    "__version__",
    "load_pretrained",
    "pretrained",
]


def __getattr__(name: str) -> Any:
    """Imports a public name from its room."""
    if name in HOMES:
        return getattr(import_module(f"tstar_rl.{HOMES[name]}"), name)
    raise AttributeError(f"module 'tstar_rl' has no attribute {name!r}; it has {', '.join(__all__)}")
