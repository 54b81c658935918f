"""The recipes of the signals beyond the paper's, run as users run them, on the simulator."""

import pandas as pd
import pytest
from recipe_runs import places, run

from tstar_rl.chaining.chain import load_chain

SIGNALS = {
    "feasibility": "feasibility",
    "hand_over_value": "hand_over_value",
    "proximity": "proximity",
    "scar_like": "d_seams",
}


@pytest.mark.slow
@pytest.mark.timeout(1800)  # a dozen processes: minutes on a machine that does other things
def test_signals_fine_tune_a_chain_and_are_judged(tmp_path):
    skills = [f"demonstrations_dir={tmp_path}", "demonstrations.episodes=96", "demonstrations.num_envs=96"]
    # Clones that succeed now and then.
    skills += ["bc.epochs=60", "training.total_steps=0", *places(tmp_path, "a")]
    for index in range(2):
        for recipe, own in (("make_demonstrations", ["kinds=[noisy]"]), ("gail_ppo", [])):
            done = run(recipe, *skills, f"subtask={index}", *own)
            assert done.returncode == 0, done.stderr
    chain = ["chain.links=2", "chain.steps_per_turn=512", "chain.trial_episodes=16"]
    chain += [*skills[:3], *places(tmp_path, "a")]
    for recipe, signal in SIGNALS.items():
        done = run(recipe, *chain)
        assert done.returncode == 0, done.stderr
        folder = tmp_path / "a" / "results" / "table_lack" / recipe / "seed0"
        table = pd.read_csv(folder / "metrics.csv")
        assert table.groupby("skill").size().tolist() == [4, 4], recipe
        judged = table.dropna(subset=["handed"])
        assert len(judged) == 1 and (judged.handed > 0).all()
        assert judged[f"{signal}_brier"].between(0, 1).all(), recipe
        assert pd.read_csv(folder / "calibration.csv").states.sum() == judged.handed.sum()
        assert len(load_chain(tmp_path / f"a/runs/table_lack/{recipe}/seed0/last")) == 2
    for index in range(2):
        assert run("bc", *skills, f"subtask={index}").returncode == 0
    for recipe, own in (("in_order", ["chain.ppo.critic_warmup=1"]), ("in_order_cloned", [])):
        done = run(recipe, *chain, *own)
        assert done.returncode == 0, done.stderr
        assert len(load_chain(tmp_path / f"a/runs/table_lack/{recipe}/seed0/last")) == 2
    done = run("evaluate", "system=feasibility", *chain, "evaluation.whole_episodes=4", "video=false")
    assert done.returncode == 0, done.stderr
