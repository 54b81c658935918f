"""A bonus as large as what another arm paid on average."""

import pandas as pd
import pytest
import torch

from tstar_rl.launch.bonus import mean_bonus, with_bonus, without_bonus
from tstar_rl.rollouts.collection import rollout_metrics, with_starts
from tstar_rl.runs.csv_tables import MetricsLog


def test_the_mean_bonus_is_over_successes(tmp_path):
    """Skill 1, in the last of these rollouts, is paid by nothing; in the one before skill 0 is not paid yet."""
    table = {
        "skill": [0, 0, 0, 0, 1],
        "episodes": [4, 0, 10, 8, 5],
        "success_rate": [0.5, None, 0.6, 0.25, 1.0],
        "tsr_on_success": [0.2, None, 0.6, None, None],
    }
    pd.DataFrame(table).to_csv(tmp_path / "metrics.csv")
    assert mean_bonus(tmp_path / "metrics.csv") == 0.4  # (2 x 0.2 + 6 x 0.6 + 2 x 0) / 10
    pd.DataFrame(table)[1:2].to_csv(tmp_path / "metrics.csv")
    assert mean_bonus(tmp_path / "metrics.csv") == 0.0


@pytest.mark.parametrize(("paid", "bonus"), [(-0.2, 0.0), (1.2, 1.0)])
def test_a_mean_bonus_is_one_that_an_arm_can_pay(paid, bonus, tmp_path):
    """d_omega less its running mean may be below 0 on average."""
    table = {"skill": [0], "episodes": [4], "success_rate": [0.5], "tsr_on_success": [paid]}
    pd.DataFrame(table).to_csv(tmp_path / "metrics.csv")
    assert mean_bonus(tmp_path / "metrics.csv") == bonus


def test_a_bonus_of_an_arm_with_a_term_of_its_own_is_refused(tmp_path):
    file = tmp_path / "metrics.csv"
    pd.DataFrame({"reward_env": [1.0], "reward_gail": [0.5], "reward": [1.0]}).to_csv(file)
    assert mean_bonus(file) == 0.0  # no success was paid by any next skill
    pd.DataFrame({"reward_env": [1.0], "reward_proximity": [0.5], "reward": [1.0]}).to_csv(file)
    with pytest.raises(
        ValueError, match="bonus_of is of an arm that pays the term tsr.*this one pays reward_proxim"
    ):
        mean_bonus(file)


def test_a_mean_bonus_is_what_the_rollouts_paid(make_env, policy, tmp_path):
    torch.manual_seed(0)
    env, log, paid = with_starts(make_env(num_envs=6)), MetricsLog(tmp_path / "metrics.csv"), []
    for steps in (3, 6, 9):
        rollout = env.rollout(steps, policy, break_when_any_done=False)
        rollout["next", "reward_tsr"] = torch.rand(6, steps, 1)
        paid.append(rollout["next", "reward_tsr"][rollout["next", "success"]])
        log.append({"skill": 0, **rollout_metrics(rollout)})
    mean = float(torch.cat(paid).mean())
    assert mean_bonus(tmp_path / "metrics.csv") == pytest.approx(mean, abs=1e-4)
    assert abs(float(torch.stack([each.mean() for each in paid]).mean()) - mean) > 1e-3


def test_a_bonus_is_known_once_its_arm_is_trained(tmp_path):
    step = ("policy_sequencing", "system=paid", "bonus_of=tstar")
    assert without_bonus(step) == step[:2]

    def known(results: str = "results", published: str | None = None) -> tuple[str, ...]:
        kept = None if published is None else tmp_path / published
        return with_bonus(step, "table_lack", 7, tmp_path / results, tmp_path / "runs", kept)

    with pytest.raises(
        FileNotFoundError, match=r"train it first \(python recipes/tstar.py task=table_lack seed=7, "
    ):
        known()
    table, ended = (tmp_path / f"{root}/table_lack/tstar/seed7" for root in ("results", "runs"))
    for folder in (table, ended):
        folder.mkdir(parents=True)
    rows = {"skill": [0, 0], "episodes": [10, 30], "success_rate": [1.0, 0.5], "tsr_on_success": [0.2, 0.4]}
    pd.DataFrame(rows).to_csv(table / "metrics.csv", index=False)
    with pytest.raises(FileNotFoundError, match="seed7 has not finished, and decides the bonus"):
        known()
    assert known("none", "results") == (*step[:2], "bonus=0.32"), "what is published has finished"
    (ended / "finished.json").write_text("{}")
    # Ten successes of .2 and fifteen of .4: a mean of 8 / 25.
    assert known() == (*step[:2], "bonus=0.32")
    pd.DataFrame({"episodes": [10], "success_rate": [0.0]}).to_csv(table / "metrics.csv", index=False)
    assert known() == (*step[:2], "bonus=0.0")
