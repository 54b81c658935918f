"""A file of demonstrations that is there is kept if it is what would be made, and else named."""

from recorded import leave_demonstrations


def test_a_file_is_kept_or_what_is_another_in_it_is_told(call, say, tmp_path):
    values = ["scale=quick", "subtask=0", "kinds=[noisy]", f"demonstrations_dir={tmp_path}"]
    path = tmp_path / "table_lack" / "seed0" / "subtask0_noisy.npz"
    env = {"velocity_scale": 0.4, "gripper": "sign", "preassembled": "jitter"}
    made = {"task": {"name": "table_lack"}, "env": env, "demonstrations": {"episodes": 100, "noise": 0.15}}
    leave_demonstrations(path, made)
    kept = path.read_bytes()
    call("make_demonstrations", *values)
    assert path.read_bytes() == kept
    told = say("make_demonstrations", *values, "demonstrations.episodes=200", "demonstrations.noise=0.3")
    for text in (
        str(path),
        "has 100 episodes, and demonstrations.episodes is 200",
        "a noise of 0.15",
        "resume=false",
    ):
        assert text in told
    assert "velocity_scale was 0.4" in say("make_demonstrations", *values, "env.velocity_scale=0.5")
    assert path.read_bytes() == kept
