"""A small agent of SPiRL, for the tests of its parts."""

import torch

from tstar_rl.spirl.agent import SkillAgent
from tstar_rl.spirl.skill_model import SkillModelSettings

SMALL = {"latent": 3, "recurrent_size": 16, "hidden": (16,)}
DECODERS = ("open_loop", "closed_loop")


def make_agent(decoder: str = "open_loop", horizon: int = 4) -> SkillAgent:
    torch.manual_seed(0)
    settings = SkillModelSettings(horizon=horizon, decoder=decoder, **SMALL)
    return SkillAgent("table_lack", 0, settings, critic_hidden=(16,))
