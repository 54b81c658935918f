"""Learning to chain skills: T-STAR and its baselines on TorchRL.

    import tstar_rl as rl

The public names are imported when they are asked for: `import tstar_rl` loads no simulator and no TorchRL. A recipe
says `rl.GAILReward(...)`, so that its --help does not wait for TorchRL.
"""

from typing import TYPE_CHECKING

from tstar_rl.deferred import deferred

if TYPE_CHECKING:
    from tstar_rl.chaining.chain import ChainPolicy, save_chain
    from tstar_rl.chaining.skill import NetworkSettings, Skill
    from tstar_rl.config.build import load_demonstrations, new_skill, skill_training
    from tstar_rl.config.chain import chain_turns, load_skills
    from tstar_rl.config.load import plain, recipe, settings
    from tstar_rl.demonstrations.data_set import Demonstrations
    from tstar_rl.env.furniture_env import FurnitureEnv
    from tstar_rl.rollouts.collection import Collection
    from tstar_rl.rollouts.state_sets import InitiationSet, TerminationSet
    from tstar_rl.runs.run import Run
    from tstar_rl.seeds import derive_seed
    from tstar_rl.shipped.catalogue import load_pretrained, pretrained
    from tstar_rl.shipped.chain import ShippedChain
    from tstar_rl.transforms.episode_start import EpisodeStart
    from tstar_rl.transforms.gail_reward import GAILReward
    from tstar_rl.transforms.hand_over_rewards import FeasibilityReward, HandOverValueReward
    from tstar_rl.transforms.proximity_reward import ProximityReward
    from tstar_rl.transforms.reward_mixture import RewardMixture, weighted
    from tstar_rl.transforms.skill_chain_reset import SkillChainReset
    from tstar_rl.transforms.terminal_state_reward import ConstantBonus, TerminalStateReward
    from tstar_rl.updates.cloning import BehaviourCloningSettings, behaviour_cloning
    from tstar_rl.updates.discriminator import DiscriminatorSettings

__version__ = "0.1.0"
HOMES = {
    "BehaviourCloningSettings": "updates",
    "ChainPolicy": "chaining.chain",
    "Collection": "rollouts.collection",
    "ConstantBonus": "transforms",
    "Demonstrations": "demonstrations.data_set",
    "DiscriminatorSettings": "updates",
    "EpisodeStart": "transforms",
    "FeasibilityReward": "transforms",
    "FurnitureEnv": "env.furniture_env",
    "GAILReward": "transforms",
    "HandOverValueReward": "transforms",
    "InitiationSet": "rollouts.state_sets",
    "NetworkSettings": "chaining.skill",
    "ProximityReward": "transforms",
    "RewardMixture": "transforms",
    "Run": "runs.run",
    "ShippedChain": "shipped.chain",
    "Skill": "chaining.skill",
    "SkillChainReset": "transforms",
    "TerminalStateReward": "transforms",
    "TerminationSet": "rollouts.state_sets",
    "behaviour_cloning": "updates",
    "chain_turns": "config.chain",
    "derive_seed": "seeds",
    "load_demonstrations": "config.build",
    "load_skills": "config.chain",
    "new_skill": "config.build",
    "plain": "config.load",
    "recipe": "config.load",
    "save_chain": "chaining.chain",
    "settings": "config.load",
    "skill_training": "config.build",
    "weighted": "transforms",
    "load_pretrained": "shipped.catalogue",
    "pretrained": "shipped.catalogue",
}
"""The room of each public name."""
__all__ = [
    "BehaviourCloningSettings",
    "ChainPolicy",
    "Collection",
    "ConstantBonus",
    "Demonstrations",
    "DiscriminatorSettings",
    "EpisodeStart",
    "FeasibilityReward",
    "FurnitureEnv",
    "GAILReward",
    "HandOverValueReward",
    "InitiationSet",
    "NetworkSettings",
    "ProximityReward",
    "RewardMixture",
    "Run",
    "ShippedChain",
    "Skill",
    "SkillChainReset",
    "TerminalStateReward",
    "TerminationSet",
    "__version__",
    "behaviour_cloning",
    "chain_turns",
    "derive_seed",
    "load_demonstrations",
    "load_skills",
    "new_skill",
    "plain",
    "recipe",
    "save_chain",
    "settings",
    "skill_training",
    "weighted",
    "load_pretrained",
    "pretrained",
]

__getattr__ = deferred(__name__, HOMES)
