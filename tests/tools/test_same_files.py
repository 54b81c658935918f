"""What the tool that kills recipes takes for the same."""

import torch
from same_files import differing
from small_skill import small_skill
from tensordict import TensorDict


def test_what_is_missing_or_was_never_written_differs(tmp_path):
    whole, folder = tmp_path / "whole", tmp_path / "folder"
    nothing = ["results/*.csv (nothing was written)", "runs/*/last (nothing was written)"]
    assert differing(("results/*.csv", "runs/*/last"), whole, folder) == nothing
    for place, text in ((whole, "a,minutes\n1,2\n"), (folder, "a,minutes\n1,3\n")):
        (place / "results").mkdir(parents=True)
        (place / "results" / "table.csv").write_text(text)
    assert differing(("results/*.csv",), whole, folder) == []
    (folder / "results" / "table.csv").write_text("a,minutes\n2,3\n")
    (whole / "results" / "other.csv").write_text("a\n1\n")
    assert differing(("results/*.csv",), whole, folder) == ["results/other.csv", "results/table.csv"]


def test_other_files_differ_by_their_bytes_and_folders_by_what_is_in_them(tmp_path):
    whole, folder = tmp_path / "whole", tmp_path / "folder"
    for place, number in ((whole, 1), (folder, 2)):
        (place / "run/last").mkdir(parents=True)
        (place / "run/config.yaml").write_text(f"a: {number}\n")
        (place / "run/last/order.json").write_text("{}")
    assert differing(("run/*.yaml", "run/last", "run/last/*"), whole, folder) == ["run/config.yaml"]
    (whole / "run/last/more.json").write_text("{}")
    assert differing(("run/last",), whole, folder) == ["run/last"]


def test_skills_differ_by_any_network_or_set_that_one_has(tmp_path):
    places = [tmp_path / name / "runs/last" for name in ("whole", "killed")]
    skills = [small_skill(), small_skill()]

    def differs():
        for skill, place in zip(skills, places, strict=True):
            skill.save(place)
        return differing(("runs/last",), tmp_path / "whole", tmp_path / "killed") == ["runs/last"]

    assert not differs()
    row = TensorDict({"observation": torch.ones(1, 72)}, [1])
    skills[0].initiation_set.extend(row)
    assert differs()
    skills[1].initiation_set.extend(row)
    assert not differs()
    skills[0].add_network("feasibility")
    assert differs()
