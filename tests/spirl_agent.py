"""A small agent of SPiRL for the tests of its parts."""

import torch

from tstar_rl.spirl import LatentModelSettings, SpirlAgent

SMALL = {"latent_dim": 3, "recurrent_size": 16, "hidden": (16,)}
OBS_DIM = 72
DECODERS = ("open_loop", "closed_loop")


def make_agent(decoder: str = "open_loop", horizon: int = 4) -> SpirlAgent:
    torch.manual_seed(0)
    settings = LatentModelSettings(horizon=horizon, decoder=decoder, **SMALL)
    return SpirlAgent("table_lack", 0, settings, OBS_DIM)
