"""A training whose loss is no finite number ends, and leaves what it had before."""

import math

import pytest
import torch
from saved_run import a_run

from tstar_rl.checks import DivergedError
from tstar_rl.runs.csv_tables import read_table


@pytest.mark.parametrize(
    ("name", "value"),
    [("loss_policy", math.nan), ("bc_loss", math.inf), ("loss_critic", torch.tensor(math.nan))],
)
def test_a_training_that_has_diverged_ends_with_what_it_had(tmp_path, name, value):
    """Nothing is written of what comes after; what has the word in another one, or is empty, is no loss."""
    run = a_run(tmp_path)
    run.log(10, **{name: 0.5, "lossless": math.nan, "loss_actor": None})
    with pytest.raises(
        DivergedError, match=f"diverged: {name} is {float(value)} after 20 environment steps of {run.work}"
    ):
        run.log(20, **{name: value})
    assert read_table(run.results / "metrics.csv")["env_steps"].tolist() == [10] and run.env_steps == 10
