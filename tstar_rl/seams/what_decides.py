"""What decides whether a skill succeeds: a quick classifier of the states it began in, and what it looks at.

The classifier is a diagnosis, not a reward: it is trained on the episodes of one evaluation and thrown away. Every
state is scored by a classifier that did not see it (cross-validation).

Source: permutation importance, Breiman, Random Forests, 2001, section 10; the area under the curve as Mann-Whitney's U.
"""

import itertools
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import torch
from torch import Tensor, nn

from tstar_rl.chaining.calibration import area_under_curve
from tstar_rl.env.layout import NUM_PHASES, PARTS
from tstar_rl.seams.one_sided import one_sided

__all__ = ["Decision", "input_groups", "input_names", "one_sided_states", "strongest_input", "what_decides"]

FOLDS, STEPS, MINIBATCH, RATE, DECAY = 4, 400, 128, 1e-3, 1e-2
HIDDEN, NOISE, CLIP = 64, 0.1, 5.0
LEAST = 20
"""Successes, and failures, below which nothing is said: each fold would have five."""
REPEATS = 5


_ROBOT = (
    *(("joint", 7), ("joint speed", 7), ("finger", 2)),
    *(("hand", 3), ("hand turn", 4), ("hand speed", 3), ("hand spin", 3)),
)
_AXES = ("x", "y", "z"), ("w", "x", "y", "z")


class Decision(NamedTuple):
    """What a cross-validated classifier says of outcomes."""

    area: float
    """Probability that it scores a success above a failure; .5 is chance, nan where there are too few of either."""
    falls: dict[str, float]
    """Of each group of inputs, by how much the area falls when the group is shuffled among the states."""


def input_groups(parts: Sequence[str]) -> dict[str, list[int]]:
    """The inputs of an observation by name: robot, then position and orientation of each part.

    Args:
        parts: names, in the order of the observation. The phase is in no group: it is the same at every seam.
    """
    groups = {"robot": list(range(PARTS))}
    for index, name in enumerate(parts):
        first = PARTS + 7 * index
        groups[f"{name} position"] = list(range(first, first + 3))
        groups[f"{name} orientation"] = list(range(first + 3, first + 7))
    return groups


def input_names(parts: Sequence[str]) -> list[str]:
    """The name of each input, in the order of the observation, less the phase.

    Source: docs/task.md, "Observation".
    """
    blocks = list(_ROBOT)
    for part in parts:
        blocks += [(part, 3), (f"{part} turn", 4)]
    axes = {3: _AXES[0], 4: _AXES[1]}
    return [f"{name} {axes.get(size, range(size))[i]}" for name, size in blocks for i in range(size)]


def one_sided_states(observations: Tensor) -> Tensor:
    """The same states (n, O) on the processor, float32, each part's quaternions on one side (`one_sided`)."""
    out = observations.float().cpu().clone()
    out[:, PARTS:-NUM_PHASES] = torch.from_numpy(one_sided(out[:, PARTS:-NUM_PHASES].numpy()))
    return out


def strongest_input(observations: Tensor, outcomes: Tensor, names: Sequence[str]) -> tuple[str, float]:
    """The one number that alone tells outcomes best, and its area under the curve: below .5, less of it succeeds.

    The numbers are those of `one_sided_states`. The area is the largest of some sixty, of the states that chose it: by
    chance alone, with 20 failures and 80 successes, it is some .65 to .7.

    Args:
        observations, outcomes: see `what_decides`, which has no say in this.
        names: of the inputs, from the first on.

    Returns:
        An empty name and nan where there are too few successes or failures.
    """
    if min(int(outcomes.sum()), int((~outcomes).sum())) < LEAST:
        return "", float("nan")
    states = one_sided_states(observations)
    areas = [area_under_curve(states[:, index], outcomes.cpu()) for index in range(len(names))]
    best = max(range(len(names)), key=lambda index: abs(areas[index] - 0.5))
    return names[best], areas[best]


def what_decides(
    observations: Tensor, outcomes: Tensor, groups: Mapping[str, Sequence[int]], seed: int = 0
) -> Decision:
    """Fits classifiers of outcomes to observations, and shuffles one group of inputs after the other.

    Args:
        observations: (n, O), states in which a skill began. Its phase is not looked at.
        outcomes: (n,) bool, whether the skill succeeded.
        groups: indices of the inputs of each group.
        seed: of folds, weights, minibatches and shuffles.
    """
    few = min(int(outcomes.sum()), int((~outcomes).sum())) < LEAST
    if few:
        return Decision(float("nan"), dict.fromkeys(groups, float("nan")))
    generator = torch.Generator().manual_seed(seed)
    inputs, outcomes = one_sided_states(observations), outcomes.cpu()
    fold = torch.randperm(len(inputs), generator=generator) % FOLDS
    shuffled = [torch.randperm(len(inputs), generator=generator) for _ in range(REPEATS)]
    scores = torch.zeros(len(inputs))
    others = {name: torch.zeros(REPEATS, len(inputs)) for name in groups}
    for index in range(FOLDS):
        kept, tried = (fold != index).nonzero().squeeze(-1), (fold == index).nonzero().squeeze(-1)
        classifier = _fit(inputs[kept], outcomes[kept], generator)
        scores[tried] = classifier(inputs[tried])
        for name, columns in groups.items():
            for repeat, order in enumerate(shuffled):
                swapped = inputs[tried].clone()
                swapped[:, list(columns)] = inputs[order[tried]][:, list(columns)]
                others[name][repeat, tried] = classifier(swapped)
    area = area_under_curve(scores, outcomes)
    falls = {
        name: area - sum(area_under_curve(row, outcomes) for row in rows) / REPEATS
        for name, rows in others.items()
    }
    return Decision(area, falls)


class _Classifier(nn.Module):
    """Logit of success (n,) of observations (n, O), standardised by those it is fitted to."""

    def __init__(self, inputs: Tensor, generator: torch.Generator) -> None:
        super().__init__()
        self.columns = inputs.shape[-1] - NUM_PHASES
        known = inputs[:, : self.columns]
        self.loc, self.scale = known.mean(0), known.std(0).clamp_min(1e-4)
        sizes = (self.columns, HIDDEN, HIDDEN, 1)
        layers: list[nn.Module] = []
        for fan_in, fan_out in itertools.pairwise(sizes):
            layer = nn.utils.skip_init(
                nn.Linear, fan_in, fan_out
            )  # which draws nothing from torch's generator
            for values in (layer.weight, layer.bias):
                nn.init.uniform_(values, -(fan_in**-0.5), fan_in**-0.5, generator=generator)
            layers += [layer, nn.Tanh()]
        self.layers = nn.Sequential(*layers[:-1])

    def standard(self, inputs: Tensor) -> Tensor:
        """Inputs of the network, (n, columns)."""
        return ((inputs[:, : self.columns] - self.loc) / self.scale).clamp(-CLIP, CLIP)

    @torch.no_grad()
    def forward(self, inputs: Tensor) -> Tensor:
        """inputs: (n, O) -> (n,)."""
        return self.layers(self.standard(inputs)).squeeze(-1)


def _fit(inputs: Tensor, outcomes: Tensor, generator: torch.Generator) -> _Classifier:
    classifier = _Classifier(inputs, generator)
    optimizer = torch.optim.AdamW(classifier.layers.parameters(), lr=RATE, weight_decay=DECAY)
    standard, labels = classifier.standard(inputs), outcomes.float()
    for _ in range(STEPS):
        rows = torch.randint(len(inputs), (MINIBATCH,), generator=generator)
        noise = NOISE * torch.randn(MINIBATCH, classifier.columns, generator=generator)
        logits = classifier.layers(standard[rows] + noise).squeeze(-1)
        loss = nn.functional.binary_cross_entropy_with_logits(logits, labels[rows])
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    return classifier
