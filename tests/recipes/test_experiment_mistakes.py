"""What the queue of a declared experiment refuses before its first step, in the words of its user."""

import pytest


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (
            ["seed=310"],
            r"every lane has a seed and a task of its own: seeds=\[...\] tasks=\[...\], not seed=310",
        ),
        (["task=toy_table"], "not task=toy_table"),
        (["minutes=60", "resume=false"], "experiment.py with a time limit goes on from call to call"),
        (["tasks=[nix]"], "experiment shelf has tasks table_lack, .*; got nix"),
        (["seeds=[310,310]"], "seeds must name each once, got 310, 310"),
        (["d_omega.stps=1"], "d_omega.stps|d_omega has no stps"),
        (["publish=true", "d_omega.steps=1"], "as it is declared, not with d_omega.steps=1: publish=false"),
        (["publish=true", "evaluation.whole_episodes=2"], "not with evaluation.whole_episodes=2"),
        (
            ["publish=true", "experiment.scale=quick"],
            "as it is declared, not with experiment.scale=quick: publish",
        ),
        (["publish=true", "++experiment.seeds=[1]"], "as it is declared, not with"),
        (["++experiment.name=d_omega"], "experiment.name in shelf.yaml must be shelf, got d_omega"),
    ],
)
def test_what_every_lane_would_stumble_over_is_told_before_the_first_step(queue, values, message):
    with pytest.raises(SystemExit, match=message):
        queue(*values, takes=lambda step: pytest.fail(f"ran {step}"))


@pytest.mark.parametrize(
    ("arm", "message"),
    [
        (("tstar", "nonsense=1"), "tstar seed=2 nonsense=1: the config has no nonsense"),
        (("tstar", "chain.round=2"), "tstar seed=2 chain.round=2: .*did you mean rounds"),
        (("policy_sequencing", "minutes=3"), "policy_sequencing seed=2 minutes=3: the config has no minutes"),
        (
            ("tstar", "chain.rounds=two"),
            "tstar seed=2 chain.rounds=two: chain.rounds must be a whole number, got",
        ),
        (("feasibility", "bonus_of=tstar"), "the config has no bonus"),
        (
            ("policy_sequencing", "reward.weights.tsr=0", "bonus_of=tstar"),
            "bonus is paid by reward.weights.tsr, which must not be 0 then",
        ),
        (("feasibility", "label=much"), "feasibility seed=2 label=much: label must be success or share"),
        (
            ("ppo", "reward.weights.gail=1"),
            "ppo seed=2 reward.weights.gail=1: reward.weights.gail must be 0 for ppo",
        ),
    ],
)
def test_a_mistake_is_told_before_the_first_step_whichever_lane_it_is_in(queue, monkeypatch, arm, message):
    """With unpublished=true the first lanes can be empty, or have some arms alone."""
    import experiment

    name, *values = arm
    lanes = [[], [(None, ("tstar", "seed=1")), (None, (name, "seed=2", *values))]]
    monkeypatch.setattr(experiment, "_lanes", lambda *_: lanes)
    with pytest.raises(SystemExit, match=message):
        queue(takes=lambda step: pytest.fail(f"ran {step}"))


def test_a_mistake_of_an_arm_of_another_commit_is_told_without_its_code(queue, monkeypatch):
    import experiment

    lanes = [[("abc", ("tstar", "seed=2", "chain.round=2"))]]
    monkeypatch.setattr(experiment, "_lanes", lambda *_: lanes)
    message = (
        r"tstar seed=2 chain.round=2: the configs of tstar at that commit have no .*; did you mean rounds"
    )
    with pytest.raises(SystemExit, match=message):
        queue(takes=lambda step: pytest.fail(f"ran {step}"))


def test_a_bonus_that_no_arm_decides_is_told_before_the_first_step(queue):
    """Of an arm that is neither chosen, nor trained, nor published."""
    values = ("experiment=narrow_no_gate", "tasks=[table_lack]", "seeds=[1300]")
    with pytest.raises(
        SystemExit, match="no results/narrow_no_gate/table_lack/tstar_no_gate/seed1300/metrics.csv"
    ):
        queue(*values, "arms=[buffer_bonus_no_gate]", takes=lambda step: pytest.fail(f"ran {step}"))


def test_steps_that_differ_in_their_seed_are_looked_at_once(queue, monkeypatch):
    import experiment

    looked = []
    monkeypatch.setattr(experiment, "check_step", lambda step, code: looked.append(step))
    lanes = [
        [(None, (name, f"seed={seed}", "subtask=0")) for name in ("gail_ppo", "ppo")] for seed in range(3)
    ]
    experiment._check(lanes, {})
    assert sorted(step[0] for step in looked) == ["gail_ppo", "ppo"]


def test_arms_that_no_seed_has_are_told(queue):
    """gaussian_tsr has seeds 100 to 104 there."""
    with pytest.raises(SystemExit, match=r"none of these seeds has an arm of arms=\[gaussian_tsr\]"):
        queue("experiment=no_return", "tasks=[table_lack]", "seeds=[105]", "arms=[gaussian_tsr]")
