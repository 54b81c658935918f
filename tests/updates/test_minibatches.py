"""How rows are divided into minibatches."""

import pytest
import torch

from tstar_rl.updates.minibatches import nearly_equal


@pytest.mark.parametrize(
    ("rows", "minibatch", "sizes"),
    [
        (33, 16, [11, 11, 11]),  # not 16, 16 and one row
        (50, 16, [13, 13, 12, 12]),
        (32, 16, [16, 16]),
        (5, 16, [5]),
        (3, 1, [1, 1, 1]),
    ],
)
def test_minibatches_are_nearly_equal(rows, minibatch, sizes):
    order = torch.randperm(rows)
    parts = nearly_equal(order, minibatch)
    assert [len(part) for part in parts] == sizes and torch.equal(torch.cat(parts), order)
    if rows % minibatch == 0:
        assert all(torch.equal(*both) for both in zip(parts, order.split(minibatch), strict=True))
