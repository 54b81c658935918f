"""Rewards and resets, the paper's and those of other chaining methods, as TorchRL transforms."""

from tstar_rl.transforms.episode_start import EpisodeStart
from tstar_rl.transforms.gail_reward import GAILReward
from tstar_rl.transforms.hand_over_rewards import FeasibilityReward, HandOverValueReward
from tstar_rl.transforms.proximity_reward import ProximityReward
from tstar_rl.transforms.reward_mixture import RewardMixture, weighted
from tstar_rl.transforms.reward_transform import RewardTransform
from tstar_rl.transforms.skill_chain_reset import SkillChainReset
from tstar_rl.transforms.terminal_state_reward import ConstantBonus, TerminalStateReward

__all__ = [
    "ConstantBonus",
    "EpisodeStart",
    "FeasibilityReward",
    "GAILReward",
    "HandOverValueReward",
    "ProximityReward",
    "RewardMixture",
    "RewardTransform",
    "SkillChainReset",
    "TerminalStateReward",
    "weighted",
]
