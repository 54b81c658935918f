"""When a chain sends its arm home, and what it does on the way. The way home here is one step a row: see `home`."""

import pandas as pd
import pytest
import torch
from omegaconf import OmegaConf
from point_chain import NETWORKS
from tensordict import TensorDict

from tstar_rl.chaining.chain import chain_folders, load_chain
from tstar_rl.chaining.recovery import FEASIBILITY, RecoveringChain, RecoverySettings, learn_outcomes
from tstar_rl.chaining.skill import Skill
from tstar_rl.checks import InvalidValueError
from tstar_rl.config.recovery import chain_policy
from tstar_rl.config.seams import chain_of
from tstar_rl.updates import LabelledSettings

HOMEWARD = 0.5
"""Every component of an action on the way home; a skill's own mean action is 0."""


def home(observation):
    """The arm has arrived where observation 0 is not positive."""
    return torch.full((len(observation), 9), HOMEWARD), observation[:, 0] <= 0


def skill(subtask: int, logit: float | None) -> Skill:
    """A skill that stands still, with an F that says 1 / (1 + e^-logit) of every state; None: without F."""
    made = Skill("table_lack", subtask, NETWORKS)
    torch.nn.init.zeros_(made.policy[0][1].module[0][-1].weight)
    torch.nn.init.zeros_(made.policy[0][1].module[0][-1].bias)
    if logit is not None:
        f = made.add_network(FEASIBILITY)
        *_, last = (one for one in f.modules() if isinstance(one, torch.nn.Linear))
        torch.nn.init.zeros_(last.weight)
        torch.nn.init.constant_(last.bias, logit)
    return made


def chain(shares=(1.0, 1.0), logits=(None, -1.0, 1.0), **settings) -> RecoveringChain:
    """Of three skills; F expects skill 1 to fail (.27) and skill 2 to succeed (.73)."""
    skills = [skill(index, logit) for index, logit in enumerate(logits)]
    return RecoveringChain(skills, home, RecoverySettings(**settings), shares)


def went(policy, subtask, away=1.0, step=1, done=False) -> list[bool]:
    """Runs one step of rows at these subtasks, `away` of home or not; which went homewards."""
    n = len(subtask)
    observation = torch.zeros(n, 72)
    observation[:, 0] = torch.as_tensor(away)
    rows = TensorDict({"observation": observation, "subtask": torch.tensor(subtask).unsqueeze(-1)}, [n])
    rows["step_count"] = torch.full((n, 1), step)
    rows["done"] = torch.as_tensor(done).expand(n).unsqueeze(-1)
    with torch.no_grad():
        action = policy(rows)["action"]
    homeward = (action == HOMEWARD).all(-1)
    assert (homeward | (action.abs() < HOMEWARD).any(-1)).all()
    return homeward.tolist()


def test_the_arm_goes_home_where_f_expects_failure_and_the_skill_acts_from_there():
    policy = chain(at_most=0.5)
    assert went(policy, [0, 0], step=0) == [False, False]  # the first skill begins at home
    assert went(policy, [1, 0]) == [True, False]
    assert went(policy, [1, 0]) == [True, False]  # still on its way
    assert went(policy, [1, 1], away=[0.0, 1.0]) == [False, True]  # one has arrived, one is handed over
    assert went(policy, [1, 1], away=0.0) == [False, False]
    assert went(policy, [1, 1]) == [False, False]  # F is asked once, where the skill takes over
    assert went(policy, [2, 2]) == [False, False]  # where F expects success nobody goes home
    assert policy.homings.tolist() == [1, 1]


@pytest.mark.parametrize(
    ("at_most", "logits", "expected"),
    [
        (1.0, (None, None, None), [True, True]),
        (0.2, (None, -1.0, 1.0), [False, False]),
        (None, (None, None, None), [False, False]),
        (0.5, (None, None, 1.0), [True, False]),
    ],
)
def test_always_never_and_where_f_is_unknown(at_most, logits, expected):
    """F is not needed where it has no say, and the arm goes home where it is unknown."""
    share = RecoverySettings(at_most=at_most, patience=100).share_of(None)
    policy = chain(shares=(share, share), at_most=at_most, patience=100, logits=logits)
    went(policy, [0, 1], step=0)
    assert went(policy, [1, 2]) == expected


def test_a_way_home_ends_after_most_steps():
    policy = chain(at_most=1.0, logits=(None, None, None), most_steps=3)
    went(policy, [0], step=0)
    assert [went(policy, [1])[0] for _ in range(5)] == [True, True, True, False, False]


def test_after_its_patience_a_skill_begins_again_from_home():
    policy = chain(shares=(0.0, 0.0), at_most=None, patience=3)
    assert [went(policy, [0], step=step)[0] for step in range(5)] == [False, False, False, True, True]
    assert [went(policy, [0], away=0.0)[0] for _ in range(2)] == [False, False]  # arrived, and the skill acts
    assert went(policy, [1]) == [False]  # the next skill has as much time
    assert [went(policy, [1])[0] for _ in range(3)] == [False, False, True]
    assert policy.homings.tolist() == [2]


def test_an_arm_that_is_at_home_is_not_sent_there():
    policy = chain(shares=(1.0, 1.0), at_most=1.0, patience=3)
    went(policy, [0], away=0.0, step=0)
    assert not any(went(policy, [1], away=0.0)[0] for _ in range(10)) and policy.homings.tolist() == [0]
    assert [went(policy, [1])[0] for _ in range(3)] == [
        False,
        False,
        True,
    ]  # its patience began anew at each try


def test_rows_that_have_done_all_skills_of_the_chain_are_left_alone():
    policy = chain(shares=(0.0, 0.0), at_most=None, patience=2)
    went(policy, [2], step=0)
    assert not any(went(policy, [3])[0] for _ in range(5)) and policy.homings.tolist() == [0]


def test_an_episode_that_begins_has_forgotten_the_one_before_and_one_that_is_done_is_left_alone():
    policy = chain(at_most=1.0)
    went(policy, [0], step=0)
    assert went(policy, [1]) == [True]
    assert went(policy, [0], step=0) == [False] and policy.homings.tolist() == [0]
    assert went(policy, [1], done=True) == [False] and policy.homings.tolist() == [0]


def test_drawn_blindly_it_happens_as_often_as_its_shares_say():
    torch.manual_seed(0)
    policy = chain(shares=(1.0, 0.25), at_most=0.5, blind=True)
    went(policy, [0] * 400, step=0)
    assert all(went(policy, [1] * 400))
    went(policy, [1] * 400, away=0.0)
    assert 70 < sum(went(policy, [2] * 400)) < 130


def test_what_cannot_be_is_refused():
    with pytest.raises(ValueError, match="every skill but the first: 2, got 1"):
        chain(shares=(0.5,))
    with pytest.raises(InvalidValueError, match="the arm would never go home"):
        RecoverySettings(at_most=None)
    for at_most in (None, 1.0):
        with pytest.raises(InvalidValueError, match=f"recovery.at_most must be below 1, got {at_most}"):
            RecoverySettings(at_most=at_most, blind=True)
    for wrong in ({"at_most": 1.5}, {"patience": 0}, {"most_steps": 0}):
        with pytest.raises(InvalidValueError, match=f"RecoverySettings.{next(iter(wrong))} must be"):
            RecoverySettings(**wrong)


def test_the_recipe_teaches_f_and_saves_when_the_arm_goes_home(point_chain, tmp_path):
    """On the point skill 0 ends on both sides of y = 0, skill 1 succeeds above it alone, and skill 2 always then."""
    table = point_chain("recover", "chain.seed_episodes=256")
    place = tmp_path / "runs/table_lack/recover/seed0/last"
    assert table.skill.tolist() == [1, 2, 3] and (table.env_steps > 0).all()
    succeeded, sent = table.feasibility_label, table.sent_home
    assert 0.3 < succeeded[0] < 0.7 and succeeded[1] == 1.0
    assert sent[0] == pytest.approx(1 - succeeded[0], abs=0.1) and sent[1] == 0.0
    assert table.feasibility_auc[0] > 0.9 and table.feasibility_brier[0] < 0.15  # of starts that F never saw
    assert (table.trial_steps > 0).tolist() == [True, False, False]  # of the whole trial, once
    assert table.handed[:2].tolist() == [64, round(64 * table.next_success[0])]
    curves = pd.read_csv(tmp_path / "results/table_lack/recover/seed0/calibration.csv")
    assert curves.groupby("skill").states.sum().to_dict() == dict(
        enumerate(table.handed)
    )  # by the skill before
    skills = load_chain(place)
    states = torch.zeros(2, 72)
    states[:, 0], states[:, 1] = 1.2, torch.tensor([-0.5, 0.5])
    below, above = torch.sigmoid(skills[1].network(FEASIBILITY)(states)).squeeze(-1).tolist()
    assert below < 0.2 and above > 0.8
    policy = chain_policy(OmegaConf.create({"env": {}}), skills, chain_folders(place))
    assert isinstance(policy, RecoveringChain) and policy.settings == RecoverySettings()
    assert policy.shares == pytest.approx(sent.tolist())


def test_what_f_learns_hangs_on_the_seed_alone():
    starts, succeeded = torch.rand(64, 72), torch.rand(64) > 0.5
    states = []
    for noise in range(2):
        torch.manual_seed(noise)
        made = skill(1, None)
        learn_outcomes(made, starts, succeeded, LabelledSettings(steps=2), seed=3)
        states.append(made.network(FEASIBILITY).state_dict())
    assert all(torch.equal(one, states[1][name]) for name, one in states[0].items())
    made = skill(1, None)
    learn_outcomes(made, starts, succeeded, LabelledSettings(steps=2, floor=0.02), seed=3)
    assert float(made.network(FEASIBILITY).normalizer.floor) == pytest.approx(0.02)
    with pytest.raises(ValueError, match="skill 1 has a network feasibility already"):
        learn_outcomes(made, starts, succeeded, LabelledSettings(steps=2), seed=3)


def test_recipes_that_would_run_the_skills_without_recovery_refuse_it(point_chain, tmp_path):
    point_chain("recover", "chain.seed_episodes=64", "recovery.at_most=1")
    places = {f"{place}_dir": str(tmp_path / place) for place in ("results", "runs")}
    config = OmegaConf.create({**places, "task": {"name": "table_lack"}, "seed": 0, "checkpoint": "last"})
    with pytest.raises(
        InvalidValueError, match="last is a chain with recovery, which evaluate.py and ways_home.py alone run"
    ):
        chain_of(config, "recover")


def test_f_needs_a_run_of_the_chain(point_chain):
    with pytest.raises(InvalidValueError, match="chain.seed_episodes must be at least 1, got 0"):
        point_chain("recover", "chain.seed_episodes=0")


def test_a_batch_of_several_dimensions_is_its_rows_laid_end_to_end():
    policy, rows = chain(shares=(1.0, 1.0)), torch.zeros(2, 3, 72)
    rows[..., 0] = 1.0
    batch = TensorDict({"observation": rows, "done": torch.zeros(2, 3, 1, dtype=torch.bool)}, [2, 3])
    for step, subtask in enumerate(([[0, 0, 0], [0, 0, 0]], [[0, 1, 0], [0, 0, 1]])):
        batch["subtask"] = torch.tensor(subtask).unsqueeze(-1)
        batch["step_count"] = torch.full((2, 3, 1), step)
        with torch.no_grad():
            action = policy(batch)["action"]
    homeward = [[False, True, False], [False, False, True]]
    assert (action == HOMEWARD).all(-1).tolist() == homeward and policy.homings.tolist() == [0, 1, 0, 0, 0, 1]
    assert policy(batch[0, 1])["action"].shape == (9,)
