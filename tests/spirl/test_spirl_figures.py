"""Latents drawn from a prior, played and drawn."""

import subprocess
import sys

import imageio.v3
import numpy as np
import pandas as pd
import pytest
import torch
from spirl_agent import make_agent
from torch.testing import assert_close

from tstar_rl import FurnitureEnv
from tstar_rl.analysis import save_figure
from tstar_rl.checks import InvalidValueError
from tstar_rl.demonstrations.data_set import Demonstrations
from tstar_rl.rollouts.collection import with_starts
from tstar_rl.spirl.figures import evenly_spread_rows, latents_figure, play_latents


def demonstration(env: FurnitureEnv, steps: int) -> Demonstrations:
    """One simulation that stands still."""
    env.reset()
    rows = [
        (env.world.observation().float()[:1], env.snapshot()[:1], env.world.step(torch.zeros(2, 9)))[:2]
        for _ in range(steps)
    ]
    observations, snapshots = torch.cat([row[0] for row in rows]), torch.cat([row[1] for row in rows])
    actions, one = torch.zeros(steps, 9), torch.ones(1, dtype=torch.int64)
    return Demonstrations(
        "table_lack", 0, "plain", {}, one, steps * one, observations, actions, actions, one.bool(), snapshots
    )


def test_rows_are_of_the_last_demonstration_and_leave_room_for_a_latent():
    expert = Demonstrations.__new__(Demonstrations)
    expert.lengths = torch.tensor([7, 21])
    assert evenly_spread_rows(expert, 3, 10).tolist() == [7, 12, 17]
    with pytest.raises(InvalidValueError, match="a latent plays 21 steps, and the last demonstration has 21"):
        evenly_spread_rows(expert, 3, 21)


def test_latents_are_played_from_the_demonstrated_state_and_drawn(tmp_path):
    env = FurnitureEnv("table_lack", 2, 0, nthread=1, seed=0)
    expert = demonstration(env, 9)
    agent = make_agent()
    paths = play_latents(agent, with_starts(env), expert, torch.tensor([3]))
    assert paths.groupby("latent").size().to_dict() == {-1: 5, 0: 5, 1: 5}
    shown = paths[paths.step == 0][["x", "y", "z"]].to_numpy()
    assert_close(torch.tensor(shown).float(), expert.observations[3, 16:19].expand(3, -1), atol=1e-4, rtol=0)
    last = paths[paths.step == 4].set_index("latent")[["x", "y", "z"]]
    assert (last.loc[0] - last.loc[1]).abs().max() > 1e-5, "two draws do two things"
    width, height = latents_figure(paths).get_size_inches() * 100
    picture = imageio.v3.imread(
        save_figure(latents_figure(paths), tmp_path / "some" / "latents.png", dpi=100)
    )
    assert picture.shape[:2] == (height, width) and picture.std() > 0


def test_the_figure_shows_paths_in_cm_from_where_they_begin():
    """One state, a demonstration that rises by 1 cm a step and a latent that moves along x."""
    steps = range(3)
    demonstrated = [{"latent": -1, "step": step, "x": 0.5, "y": 0.1, "z": 0.01 * step} for step in steps]
    played = [{"latent": 0, "step": step, "x": 0.5 + 0.02 * step, "y": 0.1, "z": 0.3} for step in steps]
    figure = latents_figure(pd.DataFrame([*demonstrated, *played]).assign(state=7))
    above, side = figure.axes
    assert above.get_title() == "state 7" and side.get_ylabel() == "z, cm"
    (black, colored), (risen, level) = above.lines, side.lines
    assert black.get_color() == "black" and colored.get_color() != "black"
    np.testing.assert_allclose(black.get_xydata(), np.zeros((3, 2)), atol=1e-9)
    np.testing.assert_allclose(colored.get_xydata(), [[0, 0], [2, 0], [4, 0]], atol=1e-9)
    np.testing.assert_allclose(risen.get_xydata(), [[0, 0], [0, 1], [0, 2]], atol=1e-9)
    np.testing.assert_allclose(level.get_xydata(), [[0, 0], [2, 0], [4, 0]], atol=1e-9)


def test_the_room_and_its_figures_leave_pyplot_and_its_backend_alone():
    code = "import sys, tstar_rl.spirl.figures; sys.exit('matplotlib.pyplot' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
