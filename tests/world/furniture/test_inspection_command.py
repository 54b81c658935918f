"""The command that checks a furniture file: what it prints and draws, and what it says of one that it cannot read."""

import pytest

from tstar_envs import rendering
from tstar_envs.inspection.command import main


def test_the_command_checks_draws_and_tries(table, tmp_path, capsys):
    picture = tmp_path / "look.png"
    arguments = ["check", str(table()), "--picture", str(picture), "--episodes", "0"]
    assert main(arguments) == 0
    said = capsys.readouterr().out
    assert "my_table: 5 parts, 4 steps" in said and "nothing is wrong or doubtful" in said
    if rendering.backend() is not None:
        from matplotlib import image

        drawn = image.imread(picture)
        assert drawn.shape[:2] == (540, 1080) and drawn[..., :3].std() > 0.05


def test_the_command_refuses_a_file_that_cannot_be_read(table, tmp_path, capsys):
    def far(data):
        data["parts"]["leg_2"]["connectors"]["top_end"]["pos"] = [0, 0, 1e9]

    assert main(["check", str(table(far))]) == 1
    assert "WRONG     my_table.yaml: parts.leg_2.connectors.top_end.pos: got" in capsys.readouterr().out
    assert main(["check", str(tmp_path / "none.yaml")]) == 1
    assert "none.yaml: there is no such file" in capsys.readouterr().out
    assert main(["check", "table_lak"]) == 1
    assert "did you mean 'table_lack'" in capsys.readouterr().out


def test_a_name_that_the_library_would_not_see_is_doubtful(table, tmp_path, capsys):
    odd = table().rename(tmp_path / "My-Table.yaml")
    assert main(["check", str(odd), "--picture", str(tmp_path / "look.png"), "--episodes", "0"]) == 0
    said = capsys.readouterr().out
    assert "doubtful  the file's name: 'My-Table' is no name of a piece of the library" in said
    assert "words of small letters and digits, joined by _" in said and "nothing is wrong" not in said


@pytest.mark.parametrize(
    ("file", "words"),
    [
        ("my_table.yml", "the library would not see my_table.yml: its files end in .yaml"),
        ("chair_agne.yaml", "chair_agne.yaml has it already: beside that one neither would be loaded"),
        ("chairagne.yaml", None),
        (
            "table_bjorkudden0206.yaml",
            "table_bjorkudden_0206 has the same id in Gymnasium, TableBjorkudden0206: one",
        ),
    ],
)
def test_a_name_that_another_piece_has_is_doubtful(file, words, table, tmp_path, capsys):
    odd = table().rename(tmp_path / file)
    assert main(["check", str(odd), "--picture", str(tmp_path / "look.png"), "--episodes", "0"]) == 0
    said = capsys.readouterr().out
    assert (words or "nothing is wrong or doubtful") in said and ("the file's name" in said) == bool(words)


def test_the_command_tells_what_mujoco_does_not_take(table, capsys):
    path = table(lambda d: d["parts"]["leg_2"].update(boxes=[{"size": [0.0001, 0.0001, 0.0001]}]))
    assert main(["check", str(path)]) == 1
    said = capsys.readouterr().out
    assert "WRONG     my_table: MuJoCo does not take its scene: " in said and "mass and inertia" in said


def test_a_start_in_which_nothing_settles_is_told(table, monkeypatch, capsys, tmp_path):
    monkeypatch.setattr("tstar_envs.physics.cpu.CpuPhysics.settle", lambda self, mask, substeps: mask)
    assert main(["check", str(table()), "--picture", str(tmp_path / "look.png")]) == 1
    said = capsys.readouterr().out
    assert (
        "WRONG     my_table, subtask 0: 20 simulations failed while their parts settled, 10 times each"
        in said
    )


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"parts: &x [*x]\n", "my.yaml: parts[0]: is an alias of what it stands in"),
        (b"parts: &x {a: {b: *x}}\n", "my.yaml: parts.a.b: is an alias of what it stands in"),
        (b"? [a, b]\n: 1\n", "my.yaml: the file: got a list or a mapping in line 1, expected a name"),
        (b"z_finedist: \xff\n", "my.yaml: is not text in UTF-8"),
        (b"z_finedist: 1" + 400 * b"0" + b"\n", "my.yaml: z_finedist: got 1000"),
        (b"z_finedist: 1" + 5000 * b"0" + b"\n", "my.yaml: Exceeds the limit (4300 digits)"),
        (b"z_finedist: 2020-99-99\n", "my.yaml: month must be in 1..12"),
        (
            b"z_finedist: " + 3000 * b"[" + 3000 * b"]" + b"\n",
            "my.yaml: lists or mappings are nested too deeply",
        ),
    ],
)
def test_the_command_tells_what_yaml_stumbles_over(text, words, tmp_path, capsys):
    path = tmp_path / "my.yaml"
    whole = (
        b"steps: []\nparts: {a: {initial_pose: [0,0,0,1,0,0,0], boxes: [{size: [.1,.1,.1]}], density: 5}}\n"
    )
    path.write_bytes(text if b"parts" in text or b"?" in text else text + whole)
    assert main(["check", str(path), "--episodes", "0"]) == 1
    assert capsys.readouterr().out.startswith(f"WRONG     {words}")


@pytest.mark.parametrize("name", ["hand", "base", "world", "right_l0", "left_finger", "right_j0"])
def test_a_part_cannot_have_a_name_of_the_robot_s(table, name, capsys):
    def call(data):
        data["parts"] = {name if key == "leg_2" else key: part for key, part in data["parts"].items()}
        data["steps"][0]["moving_part"] = name

    assert main(["check", str(table(call)), "--episodes", "0"]) == 1
    assert f"WRONG     parts.{name}: the scene has this name" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (["check", "table_lack", "--picture", "x.txt"], "ends in .png, got 'x.txt'"),
        (["check", "table_lack", "--picture", "x"], "ends in .png, got 'x'"),
        (["draw", "table_lack", "x.jpg"], "ends in .png, got 'x.jpg'"),
        (["check", "table_lack", "--episodes=-3"], "must be a whole number from 0, got '-3'"),
        (["check", "table_lack", "--episodes", "many"], "must be a whole number from 0, got 'many'"),
    ],
)
def test_an_argument_that_cannot_be_is_told(values, words, capsys):
    with pytest.raises(SystemExit) as ended:
        main(values)
    assert ended.value.code == 2 and words in capsys.readouterr().err


@pytest.mark.skipif(rendering.backend() is None, reason="nothing is drawn here")
def test_a_picture_that_cannot_be_written_is_told(table, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert main(["draw", str(table()), str(tmp_path / "file" / "x.png")]) == 1
    assert capsys.readouterr().out.startswith("WRONG     [Errno ")
