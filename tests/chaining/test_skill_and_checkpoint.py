"""Skills and checkpoints come back as they were, or say why not."""

import shutil

import pytest
import torch
from spirl_agent import make_agent
from tensordict import TensorDict
from torchrl.envs import ExplorationType, set_exploration_type

import tstar_envs
from tstar_rl.chaining.chain import ChainPolicy, chain_folders, load_chain
from tstar_rl.chaining.skill import Skill
from tstar_rl.checks import InvalidValueError, MissingFileError
from tstar_rl.config.build import load_skill
from tstar_rl.env.task_tables import observation_dim
from tstar_rl.models.draws import generators_stay
from tstar_rl.models.network_settings import NetworkSettings
from tstar_rl.runs import checkpoint
from tstar_rl.runs.checkpoint import DamagedCheckpointError
from tstar_rl.runs.mismatch import CheckpointMismatchError, differences
from tstar_rl.shipped.catalogue import CHAINS
from tstar_rl.spirl import SpirlAgent

SMALL = NetworkSettings(hidden=(16,), std="fixed", discriminator_hidden=(16,))


def test_a_skill_comes_back(tmp_path):
    skill = Skill("table_lack", 1, SMALL)
    skill.normalizer.fit(torch.randn(50, 72))
    skill.initiation_set.extend(TensorDict({"observation": torch.randn(5, 72)}, [5]))
    skill.save(tmp_path / "skill", env_steps=7)
    back = Skill.load(tmp_path / "skill", task="table_lack", subtask=1)
    obs = torch.randn(4, 72)
    assert torch.equal(skill.f_phi(obs), back.f_phi(obs))
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        rows = TensorDict({"observation": obs}, [4])
        assert torch.equal(skill.policy(rows.clone())["action"], back.policy(rows.clone())["action"])
    assert torch.equal(skill.initiation_set.all()["observation"], back.initiation_set.all()["observation"])
    assert checkpoint.read_record(tmp_path / "skill")["env_steps"] == 7


@pytest.mark.parametrize("load", [Skill.load, SpirlAgent.load, load_skill, load_chain])
def test_what_a_run_goes_on_from_is_no_skill(tmp_path, load):
    checkpoint.save_step(tmp_path, 8, {"module": torch.nn.Linear(1, 1)}, {"seed": 0})
    told = "what a run goes on from: what it has trained lies beside its checkpoints"
    with pytest.raises((InvalidValueError, MissingFileError), match=told):
        load(checkpoint.latest(tmp_path))


def test_a_skill_reads_the_observations_of_its_piece():
    sizes = {name: Skill(name, 0, SMALL).obs_dim for name in tstar_envs.names()}
    assert sizes == {name: observation_dim(name) for name in sizes} and len(set(sizes.values())) > 1
    assert Skill("push", 0, SMALL, obs_dim=10).obs_dim == 10
    with pytest.raises(
        InvalidValueError, match="obs_dim must be given for 'push', which is no piece of furniture"
    ):
        Skill("push", 0, SMALL)


def test_a_skill_of_a_newer_version_is_refused_by_what_is_not_known(tmp_path, monkeypatch):
    built = Skill.built
    monkeypatch.setattr(Skill, "built", lambda skill: built(skill) | {"settings": {"depth": 3}})
    Skill("table_lack", 0, SMALL).save(tmp_path / "newer")
    with pytest.raises(
        CheckpointMismatchError, match="newer: the networks have a setting depth, which this version"
    ):
        Skill.load(tmp_path / "newer")


def test_a_skill_of_another_task_is_refused(tmp_path):
    Skill("table_lack", 1, SMALL).save(tmp_path / "skill")
    with pytest.raises(
        CheckpointMismatchError, match="task was 'table_lack' when it was saved, and is 'chair_ingolf'"
    ):
        Skill.load(tmp_path / "skill", task="chair_ingolf")
    with pytest.raises(CheckpointMismatchError, match="subtask was 1"):
        Skill.load(tmp_path / "skill", subtask=0)


def test_no_checkpoint_is_said(tmp_path):
    with pytest.raises(FileNotFoundError, match="no checkpoint at"):
        Skill.load(tmp_path / "nothing")


def test_the_newest_complete_checkpoint_is_found(tmp_path):
    module = torch.nn.Linear(1, 1)
    assert checkpoint.latest(tmp_path) is None
    for step in (1, 2):
        module.weight.data.fill_(step)
        checkpoint.save_step(tmp_path, step, {"module": module}, {"step": step})
    (tmp_path / ".checkpoint_3.stage-half-written").mkdir()
    module.weight.data.zero_()
    assert checkpoint.load(checkpoint.latest(tmp_path), {"module": module}) == {"step": 2}
    assert float(module.weight) == 2.0


def test_differences_are_named_by_their_path():
    texts = differences({"ppo": {"epochs": 4}, "seed": 0}, {"ppo": {"epochs": 5}, "seed": 0})
    assert texts == ["ppo.epochs was 4 when it was saved, and is 5 now"]


def test_a_chain_acts_with_the_skill_of_each_row():
    skills = [Skill("table_lack", index, SMALL) for index in range(2)]
    obs, subtask = torch.randn(5, 72), torch.tensor([[0], [1], [1], [0], [2]])
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        action = ChainPolicy(skills)(TensorDict({"observation": obs, "subtask": subtask}, [5]))["action"]
        for row, index in enumerate((0, 1, 1, 0, 1)):
            alone = skills[index].policy(TensorDict({"observation": obs[row : row + 1]}, [1]))["action"][0]
            torch.testing.assert_close(action[row], alone)


@pytest.mark.parametrize("shape", [(3, 2), (2, 3), (6, 1), ()])
def test_a_chain_labels_batches_of_any_shape(shape):
    skills, rows = [Skill("table_lack", index, SMALL) for index in range(2)], TensorDict(batch_size=[6])
    rows.set("observation", torch.randn(6, 72)).set("subtask", torch.tensor([[0], [1], [1], [0], [2], [1]]))
    rows = rows if shape else rows[:1]
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        one_by_one = ChainPolicy(skills)(rows.clone())["action"]
        action = ChainPolicy(skills)(rows.reshape(shape))["action"]
    torch.testing.assert_close(action, one_by_one.reshape(*shape, 9))


def test_a_skill_and_an_agent_of_spirl_are_not_taken_for_each_other(tmp_path):
    agent = make_agent()
    agent.save(tmp_path / "agent")
    Skill("table_lack", 0, SMALL).save(tmp_path / "skill")
    with pytest.raises(
        InvalidValueError,
        match="agent is an agent of SPiRL: SpirlAgent.load reads it; a chain is made of skills of",
    ):
        Skill.load(tmp_path / "agent")
    with pytest.raises(
        InvalidValueError, match="skill is no agent of SPiRL, which spirl.py trains: it is one skill: Skill"
    ):
        SpirlAgent.load(tmp_path / "skill")
    with pytest.raises(InvalidValueError, match=r"as load_chain\(path\) gives them; got SpirlAgent, Skill$"):
        ChainPolicy([agent, Skill("table_lack", 1, SMALL)])
    with pytest.raises(InvalidValueError, match="gives them; got Skill$"):
        ChainPolicy(Skill("table_lack", 0, SMALL))


def test_a_shipped_chain_is_no_skill_no_agent_and_no_folder_of_skills():
    place = CHAINS / "table_lack" / "tstar"
    for load in (Skill.load, SpirlAgent.load, load_chain):
        with pytest.raises((InvalidValueError, MissingFileError), match="a shipped chain: load_pretrained"):
            load(place)


def test_skills_that_say_nothing_of_a_chain_are_taken_as_they_stand(tmp_path):
    assert chain_folders(tmp_path) == []
    for index in range(11):
        Skill("table_lack", index, SMALL).save(tmp_path / f"skill{index}")
    (tmp_path / "skill11").mkdir()
    (tmp_path / "skills").mkdir()
    assert [folder.name for folder in chain_folders(tmp_path)] == [f"skill{index}" for index in range(11)]
    shutil.rmtree(tmp_path / "skill4")
    with pytest.raises(DamagedCheckpointError, match="skill4 is missing"):
        chain_folders(tmp_path)


def test_a_chain_needs_its_skills_in_order():
    with pytest.raises(ValueError, match=r"in order; got \[1\]"):
        ChainPolicy([Skill("table_lack", 1, SMALL)])


def test_features_need_their_geometry():
    with pytest.raises(ValueError, match="no geometry"):
        Skill("table_lack", 0, NetworkSettings(features=True))


def test_a_chain_acts_on_a_tensordict():
    policy = ChainPolicy([Skill("table_lack", 0, SMALL)])
    with pytest.raises(InvalidValueError, match='acts on a TensorDict with "observation".*, got Tensor'):
        policy(torch.zeros(2, 72))


def test_a_chain_policy_is_made_of_skills_and_acts_on_its_own_piece():
    with pytest.raises(ValueError, match=r"made of skills, as load_chain\(path\) gives them; got 'runs/x'"):
        ChainPolicy("runs/x")  # pyright: ignore[reportArgumentType]
    policy = ChainPolicy([Skill("table_lack", index, SMALL) for index in range(2)])
    state = TensorDict(
        {"observation": torch.zeros(1, 58), "subtask": torch.zeros(1, 1, dtype=torch.int64)}, [1]
    )
    with pytest.raises(ValueError, match="of table_lack, whose observations have 72 numbers; got 58"):
        policy(state)


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda", marks=pytest.mark.gpu)])
def test_what_is_drawn_on_a_device_leaves_its_generator_as_it_was(device):
    torch.manual_seed(0)
    first = torch.rand(3, device=device)
    with generators_stay(torch.device(device)):
        torch.manual_seed(7)
        torch.rand(3, device=device)
    second = torch.rand(3, device=device)
    torch.manual_seed(0)
    drawn = [torch.rand(3, device=device) for _ in range(2)]
    assert torch.equal(first, drawn[0]) and torch.equal(second, drawn[1])


def test_an_agent_of_a_newer_version_is_refused_by_what_is_not_known(tmp_path):
    agent = make_agent()
    built = {"latent_model": {"depth": 3}, "obs_dim": agent.obs_dim, "geometry": None}
    agent.save(tmp_path / "newer", built=built)
    with pytest.raises(
        CheckpointMismatchError, match="newer: the latent model has a setting depth, which this version"
    ):
        SpirlAgent.load(tmp_path / "newer")


@pytest.mark.parametrize(("value_hidden", "sizes"), [(None, [8, 16]), ((32, 4), [32, 4]), ((), [])])
def test_a_value_network_has_sizes_of_its_own(value_hidden, sizes, tmp_path):
    Skill("table_lack", 0, NetworkSettings(hidden=(8, 16), value_hidden=value_hidden)).save(
        tmp_path / "skill"
    )
    skill = Skill.load(tmp_path / "skill")
    policy, value = (
        [layer.out_features for layer in network.modules() if isinstance(layer, torch.nn.Linear)]
        for network in (skill.policy, skill.value)
    )
    assert policy == [8, 16, 18] and value == [*sizes, 1]
