"""Learning to chain skills: T-STAR and its baselines on TorchRL.

    import tstar_rl as rl

The public names are imported when they are asked for: `import tstar_rl` loads no simulator and no TorchRL. A recipe
says `rl.GAILReward(...)`, so that its --help does not wait for TorchRL.
"""

from typing import TYPE_CHECKING

from tstar_rl.deferred import deferred

if TYPE_CHECKING:
    from tstar_rl.chaining.chain import ChainPolicy, load_chain, save_chain
    from tstar_rl.chaining.chain_settings import ChainSettings
    from tstar_rl.chaining.chain_training import ChainTraining
    from tstar_rl.chaining.gate import Gate, GateSettings
    from tstar_rl.chaining.recovery import RecoverySettings, judge_outcomes, learn_outcomes
    from tstar_rl.chaining.signals import StateValue, value_scale
    from tstar_rl.chaining.skill import Skill
    from tstar_rl.chaining.skill_training import SkillTraining
    from tstar_rl.chaining.training import TrainingSettings
    from tstar_rl.chaining.trials import run_trial
    from tstar_rl.checks import InvalidValueError
    from tstar_rl.config.build import (
        environment,
        load_demonstrations,
        new_skill,
        new_spirl_agent,
        skill_training,
    )
    from tstar_rl.config.chain import chain_run, chain_turns, load_skills, trial_env
    from tstar_rl.config.compose import compose
    from tstar_rl.config.load import recipe
    from tstar_rl.config.schema import Section
    from tstar_rl.config.values import plain, settings
    from tstar_rl.demonstrations.data_set import Demonstrations
    from tstar_rl.env.furniture_env import FurnitureEnv
    from tstar_rl.models.exploration import Exploration
    from tstar_rl.models.network_settings import NetworkSettings
    from tstar_rl.rollouts.collection import Collection, with_starts
    from tstar_rl.rollouts.labels import Label
    from tstar_rl.rollouts.starts import MixedStarts, make_starts
    from tstar_rl.rollouts.state_sets import InitiationSet, TerminationSet
    from tstar_rl.runs.chain_rows import calibration_rows
    from tstar_rl.runs.run import Run
    from tstar_rl.seeds import derive_seed
    from tstar_rl.shipped.catalogue import load_pretrained, pretrained
    from tstar_rl.shipped.chain import ShippedChain
    from tstar_rl.signal_equations import outcome_loss, squared_error_loss
    from tstar_rl.transforms.episode_start import EpisodeStart
    from tstar_rl.transforms.gail_reward import GAILReward
    from tstar_rl.transforms.hand_over_rewards import FeasibilityReward, HandOverValueReward
    from tstar_rl.transforms.proximity_reward import ProximityReward
    from tstar_rl.transforms.reward_mixture import RewardMixture, weighted
    from tstar_rl.transforms.reward_transform import RewardTransform
    from tstar_rl.transforms.skill_chain_reset import SkillChainReset
    from tstar_rl.transforms.terminal_state_reward import ConstantBonus, TerminalStateReward
    from tstar_rl.updates.cloning import BehaviourCloningSettings, behaviour_cloning
    from tstar_rl.updates.discriminator import DiscriminatorSettings, DiscriminatorUpdate
    from tstar_rl.updates.labelled import LabelledSettings, LabelledUpdate
    from tstar_rl.updates.ppo import PolicyUpdate, PPOSettings

__version__ = "0.1.0"
HOMES = {
    "BehaviourCloningSettings": "updates",
    "ChainPolicy": "chaining.chain",
    "ChainSettings": "chaining.chain_settings",
    "ChainTraining": "chaining.chain_training",
    "Collection": "rollouts.collection",
    "ConstantBonus": "transforms",
    "Demonstrations": "demonstrations.data_set",
    "DiscriminatorSettings": "updates",
    "DiscriminatorUpdate": "updates",
    "EpisodeStart": "transforms",
    "Exploration": "models.exploration",
    "FeasibilityReward": "transforms",
    "FurnitureEnv": "env.furniture_env",
    "GAILReward": "transforms",
    "Gate": "chaining.gate",
    "GateSettings": "chaining.gate",
    "HandOverValueReward": "transforms",
    "InitiationSet": "rollouts.state_sets",
    "InvalidValueError": "checks",
    "Label": "rollouts.labels",
    "LabelledSettings": "updates",
    "LabelledUpdate": "updates",
    "MixedStarts": "rollouts.starts",
    "NetworkSettings": "models.network_settings",
    "PPOSettings": "updates",
    "PolicyUpdate": "updates",
    "ProximityReward": "transforms",
    "RecoverySettings": "chaining.recovery",
    "RewardMixture": "transforms",
    "RewardTransform": "transforms",
    "Run": "runs.run",
    "Section": "config.schema",
    "ShippedChain": "shipped.chain",
    "Skill": "chaining.skill",
    "SkillChainReset": "transforms",
    "SkillTraining": "chaining.skill_training",
    "StateValue": "chaining.signals",
    "TerminalStateReward": "transforms",
    "TerminationSet": "rollouts.state_sets",
    "TrainingSettings": "chaining.training",
    "behaviour_cloning": "updates",
    "calibration_rows": "runs.chain_rows",
    "chain_run": "config.chain",
    "chain_turns": "config.chain",
    "compose": "config.compose",
    "derive_seed": "seeds",
    "environment": "config.build",
    "judge_outcomes": "chaining.recovery",
    "learn_outcomes": "chaining.recovery",
    "load_chain": "chaining.chain",
    "load_demonstrations": "config.build",
    "load_pretrained": "shipped.catalogue",
    "load_skills": "config.chain",
    "make_starts": "rollouts.starts",
    "new_skill": "config.build",
    "new_spirl_agent": "config.build",
    "outcome_loss": "signal_equations",
    "plain": "config.values",
    "pretrained": "shipped.catalogue",
    "recipe": "config.load",
    "run_trial": "chaining.trials",
    "save_chain": "chaining.chain",
    "settings": "config.values",
    "skill_training": "config.build",
    "squared_error_loss": "signal_equations",
    "trial_env": "config.chain",
    "value_scale": "chaining.signals",
    "weighted": "transforms",
    "with_starts": "rollouts.collection",
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
    "InvalidValueError",
    "Label",
    "LabelledSettings",
    "MixedStarts",
    "NetworkSettings",
    "PPOSettings",
    "PolicyUpdate",
    "ProximityReward",
    "RecoverySettings",
    "RewardMixture",
    "RewardTransform",
    "Run",
    "Section",
    "ShippedChain",
    "Skill",
    "SkillChainReset",
    "StateValue",
    "TerminalStateReward",
    "TerminationSet",
    "__version__",
    "behaviour_cloning",
    "calibration_rows",
    "chain_run",
    "chain_turns",
    "compose",
    "derive_seed",
    "environment",
    "judge_outcomes",
    "learn_outcomes",
    "load_chain",
    "load_demonstrations",
    "load_skills",
    "new_skill",
    "new_spirl_agent",
    "outcome_loss",
    "plain",
    "recipe",
    "run_trial",
    "save_chain",
    "settings",
    "skill_training",
    "squared_error_loss",
    "trial_env",
    "value_scale",
    "weighted",
    "with_starts",
    "load_pretrained",
    "pretrained",
    "ChainSettings",
    "ChainTraining",
    "DiscriminatorUpdate",
    "Exploration",
    "Gate",
    "GateSettings",
    "LabelledUpdate",
    "SkillTraining",
    "TrainingSettings",
    "make_starts",
]

__getattr__ = deferred(__name__, HOMES)


def __dir__() -> list[str]:
    return sorted({*globals(), *HOMES})
