"""The folder of a chain: all of its skills or none, of one chain, in order."""

import functools
import shutil

import pytest
import torch

from tstar_rl.chaining.chain import chain_folders, load_chain, save_chain
from tstar_rl.chaining.skill import Skill
from tstar_rl.checks import InvalidValueError
from tstar_rl.models.network_settings import NetworkSettings
from tstar_rl.runs.checkpoint import DamagedCheckpointError
from tstar_rl.runs.mismatch import CheckpointMismatchError

SMALL = NetworkSettings(hidden=(16,), std="fixed", discriminator_hidden=(16,))


@pytest.fixture
def chain(tmp_path):
    """The folder of a saved chain of three skills."""
    save_chain([Skill("table_lack", index, SMALL) for index in range(3)], tmp_path / "last", recipe="tstar")
    return tmp_path / "last"


@pytest.mark.parametrize("lost", range(3))
def test_a_chain_that_has_lost_a_skill_is_refused_by_its_name(chain, lost):
    assert [skill.subtask for skill in load_chain(chain)] == [0, 1, 2]
    shutil.rmtree(chain / f"skill{lost}")
    for read in (chain_folders, load_chain):
        with pytest.raises(
            DamagedCheckpointError, match=rf"last is damaged: skill{lost} is missing\. Put it back"
        ):
            read(chain)


def test_a_skill_of_another_chain_or_place_is_refused_by_its_name(chain, tmp_path):
    other = Skill("table_lack", 2, SMALL)
    other.save(chain / "skill2", recipe="tstar")  # says nothing of a chain
    with pytest.raises(DamagedCheckpointError, match="skill2 is not of the chain of the others"):
        chain_folders(chain)
    save_chain([Skill("table_lack", index, SMALL) for index in range(3)], tmp_path / "best")
    shutil.rmtree(chain / "skill2")
    shutil.copytree(tmp_path / "best/skill2", chain / "skill2")
    with pytest.raises(DamagedCheckpointError, match="skill2 is not of the chain of the others"):
        chain_folders(chain)
    shutil.rmtree(chain / "skill2")
    shutil.copytree(chain / "skill1", chain / "skill2")
    with pytest.raises(DamagedCheckpointError, match="skill2 is the skill of subtask 1"):
        chain_folders(chain)


def test_what_is_no_checkpoint_and_no_chain_is_not_replaced(chain, tmp_path):
    """As a folder of runs is, which ship.py was told to write into."""
    skills, run = [Skill("table_lack", 0, SMALL)], tmp_path / "runs/table_lack/tstar"
    (run / "seed0").mkdir(parents=True)
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "mine/skill0").mkdir(parents=True)
    (tmp_path / "mine/skill0/notes.txt").write_text("mine")
    (tmp_path / "project/components").mkdir(parents=True)
    (tmp_path / "clone/.git").mkdir(parents=True)
    for save in (skills[0].save, functools.partial(save_chain, skills)):
        with pytest.raises(
            InvalidValueError, match=r"table_lack/tstar holds seed0, which a checkpoint there would"
        ):
            save(run)
        with pytest.raises(InvalidValueError, match=r"runs holds table_lack, which"):
            save(run.parent.parent)
        for place, held in (("mine", "skill0/notes.txt"), ("project", "components"), ("clone", r"\.git")):
            with pytest.raises(InvalidValueError, match=rf"{place} holds {held}, which"):
                save(tmp_path / place)
        with pytest.raises(InvalidValueError, match=r"notes\.txt is a file: a checkpoint is a folder"):
            save(tmp_path / "notes.txt")
        save(chain)  # of three skills, and then of what the save before left
        (tmp_path / "empty").mkdir(exist_ok=True)
        (tmp_path / "empty/.DS_Store").touch()
        save(tmp_path / "empty")
    assert (run / "seed0").is_dir() and (tmp_path / "notes.txt").read_text() == "mine"
    assert [skill.subtask for skill in load_chain(chain)] == [0]


def test_a_chain_that_is_replaced_while_it_is_read_is_not_read_by_halves(chain, monkeypatch):
    load = Skill.load

    def replaced_after_the_first(path, **expected):
        found = load(path, **expected)
        if path.name == "skill0":
            save_chain([Skill("table_lack", index, SMALL) for index in range(3)], chain, recipe="tstar")
        return found

    monkeypatch.setattr(Skill, "load", replaced_after_the_first)
    with pytest.raises(CheckpointMismatchError, match="skill1 does not belong here: chain.id was"):
        load_chain(chain)
    monkeypatch.undo()
    assert len(load_chain(chain)) == 3


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ([("table_lack", 1), ("table_lack", 0)], r"subtasks 0, 1, \.\.\. in order; got \[1, 0\]"),
        ([("table_lack", 0), ("bench_bjursta", 1)], "of one task; got skills of bench_bjursta, table_lack"),
    ],
)
def test_skills_that_make_no_chain_do_not_take_the_place_of_one(chain, wrong, said):
    with pytest.raises(InvalidValueError, match=said):
        save_chain([Skill(task, index, SMALL) for task, index in wrong], chain)
    assert len(load_chain(chain)) == 3


def test_a_shorter_chain_takes_the_place_of_a_longer_one(chain):
    save_chain([Skill("table_lack", index, SMALL) for index in range(2)], chain)
    assert [folder.name for folder in chain_folders(chain)] == ["skill0", "skill1"]


def test_a_chain_stays_as_it_was_where_a_kill_comes_between_two_skills(chain, monkeypatch):
    before = [skill.network_state()["policy"] for skill in load_chain(chain)]
    save = Skill.save

    def killed(skill, path, **record):
        if skill.subtask == 1:
            raise KeyboardInterrupt
        save(skill, path, **record)

    monkeypatch.setattr(Skill, "save", killed)
    with pytest.raises(KeyboardInterrupt):
        save_chain([Skill("table_lack", index, SMALL) for index in range(3)], chain)
    for skill, policy in zip(load_chain(chain), before, strict=True):
        for name, value in skill.network_state()["policy"].items():
            assert torch.equal(value, policy[name])
    assert [folder.name for folder in chain.parent.iterdir()] == [chain.name]


def test_a_chain_that_lies_nearby_is_named(chain, tmp_path):
    """The folder of a run, that of a chain in the place of a skill, and the other way round."""
    place = chain.parent
    with pytest.raises(FileNotFoundError, match=f"no chain at {place}: there is one at {chain}$"):
        load_chain(place)
    with pytest.raises(FileNotFoundError, match=r"skill0, which is one skill: Skill.load reads it"):
        load_chain(chain / "skill0")
    with pytest.raises(
        FileNotFoundError, match=f"no checkpoint at {chain}: there is one at {chain / 'skill0'}$"
    ):
        Skill.load(chain)
    assert [skill.subtask for skill in load_chain(str(chain))] == [
        skill.subtask for skill in load_chain(chain)
    ]


def test_a_chain_that_a_kill_left_aside_is_not_lost_where_the_next_save_fails(chain, monkeypatch):
    """The kill came after the old chain was moved away, and before the new one took its place."""
    chain.rename(chain.with_name(f".last.old-{'0' * 32}"))

    def no_space(*arguments, **record):
        raise OSError("disk full")

    monkeypatch.setattr(Skill, "save", no_space)
    with pytest.raises(OSError, match="disk full"):
        save_chain([Skill("table_lack", 0, SMALL)], chain)
    assert [skill.subtask for skill in load_chain(chain)] == [0, 1, 2]
