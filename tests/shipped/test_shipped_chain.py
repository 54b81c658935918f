"""A shipped chain acts as the one it was made from, takes little room, and is refused when damaged."""

import collections
import importlib.util
from pathlib import Path

import pytest
import torch
from tensordict import TensorDict
from torchrl.envs import ExplorationType, set_exploration_type

from tstar_rl.chaining.chain import ChainPolicy
from tstar_rl.chaining.skill import Skill
from tstar_rl.checks import InvalidValueError
from tstar_rl.models.network_settings import NetworkSettings
from tstar_rl.runs.mismatch import CheckpointMismatchError
from tstar_rl.shipped.catalogue import load_pretrained, pretrained
from tstar_rl.shipped.chain import load_shipped, save_shipped

spec = importlib.util.spec_from_file_location(
    "damage_checkpoints", Path(__file__).resolve().parents[2] / "tools" / "damage_checkpoints.py"
)
tool = importlib.util.module_from_spec(spec)
spec.loader.exec_module(tool)
SMALL = NetworkSettings(hidden=(16,), discriminator_hidden=(16,))
ENV = {"velocity_scale": 0.4}
FIGURES = {"deterministic": {"episodes": 8, "progress": 0.5, "success": 0.25, "episode_length": 20.0}}


def some_skills(seed: int = 0) -> list[Skill]:
    torch.manual_seed(seed)
    skills = [Skill("table_lack", index, SMALL) for index in range(3)]
    for skill in skills:
        skill.normalizer.fit(torch.randn(50, 72))
    return skills


def save(path: Path, skills: list[Skill], signal: bool = True) -> Path:
    save_shipped(skills, path, signal, task="table_lack", env=ENV, seed=3, figures=FIGURES)
    return path


def rows() -> TensorDict:
    torch.manual_seed(1)
    return TensorDict({"observation": torch.randn(9, 72), "subtask": torch.arange(9).unsqueeze(-1) % 4}, [9])


def test_it_acts_to_the_bit_as_the_chain_that_it_was_made_from(tmp_path):
    skills = some_skills()
    chain = load_shipped(save(tmp_path / "chain", skills), task="table_lack")
    assert chain.task == "table_lack" and chain.env_settings == ENV and chain.record["seed"] == 3
    for mode in (ExplorationType.DETERMINISTIC, ExplorationType.RANDOM):
        with set_exploration_type(mode), torch.no_grad():
            torch.manual_seed(2)
            expected = ChainPolicy(skills)(rows())["action"]
            torch.manual_seed(2)
            assert torch.equal(chain(rows())["action"], expected)


def test_its_d_omega_says_what_that_of_the_next_skills_said(tmp_path):
    skills, observation = some_skills(), rows()["observation"]
    chain = load_shipped(save(tmp_path / "chain", skills))
    assert len(chain.d_omega) == 2
    for shipped, skill in zip(chain.d_omega, skills[1:], strict=True):
        said, told = shipped(observation), skill.d_omega(observation)
        torch.testing.assert_close(said, told, atol=2e-3, rtol=2e-3)
        assert not torch.equal(said, told)  # half precision
    assert not len(load_shipped(save(tmp_path / "plain", skills, signal=False)).d_omega)


def test_policies_alone_are_kept_and_nothing_is_drawn(tmp_path):
    skills = some_skills()
    skills[0].save(tmp_path / "skill")
    path = save(tmp_path / "chain", skills, signal=False)
    archive = (path / "components/0000-chain/state.tdz").stat().st_size
    numbers = sum(value.numel() for skill in skills for value in skill.policy.state_dict().values())
    assert 4 * numbers < archive < 4 * numbers + 20_000
    before = torch.get_rng_state()
    chain = load_shipped(path)
    assert torch.equal(torch.get_rng_state(), before)
    assert not any(parameter.requires_grad for parameter in chain.parameters())


def test_a_damaged_one_is_refused_by_the_name_of_its_file(tmp_path):
    whole, other = (save(tmp_path / str(seed), some_skills(seed)) for seed in (0, 1))
    copies = tool.damaged_copies(whole, other, 40, tmp_path)
    found = {(kind, name, tool.outcome(copy, name, load_shipped)) for kind, name, copy in copies}
    assert {result for *_, result in found} == {tool.REFUSED}
    of_kinds = collections.Counter(kind for kind, *_ in found)
    assert of_kinds.keys() == set(tool.KINDS) and min(of_kinds.values()) >= 2


def test_chains_are_found_by_name(tmp_path):
    for name in ("narrow", "tstar", "a_third"):
        save(tmp_path / "table_lack" / name, some_skills())
    (tmp_path / "chair_ingolf" / "empty").mkdir(parents=True)
    assert pretrained(folder=tmp_path) == {"table_lack": ["tstar", "a_third", "narrow"]}
    assert load_pretrained("table_lack", "narrow", folder=tmp_path).task == "table_lack"
    assert load_pretrained("table_lack/narrow", folder=tmp_path).task == "table_lack"
    with pytest.raises(
        InvalidValueError, match="of table_lack: 'narow'; .* tstar, a_third, narrow; did you mean na"
    ):
        load_pretrained("table_lack", "narow", folder=tmp_path)
    with pytest.raises(
        ValueError, match="task with trained chains: 'table_lak'; there are table_lack; did you mean"
    ):
        load_pretrained("table_lak", folder=tmp_path)
    with pytest.raises(ValueError, match="there are none in"):
        load_pretrained("table_lack", folder=tmp_path / "nowhere")
    (tmp_path / "table_lack").rename(tmp_path / "chair_agne")
    with pytest.raises(CheckpointMismatchError, match="task was 'table_lack'"):
        load_pretrained("chair_agne", folder=tmp_path)


def test_figures_are_compared_with_those_recorded(tmp_path):
    chain = load_shipped(save(tmp_path / "chain", some_skills()))
    row = {"mode": "deterministic", "seed": 3, **FIGURES["deterministic"]}
    env = chain.env_settings
    assert chain.compare(row, env) == "deterministic: the figures recorded"
    assert chain.compare({**row, "success": 0.5}, env) == "deterministic: success was 0.25, is 0.5"
    assert "another world" in chain.compare(row, {**env, "part_noise": 0.04})
    for other in ({"seed": 0}, {"episodes": 4}, {"mode": "stochastic"}):
        assert "other episodes" in chain.compare({**row, **other}, env)


def test_what_is_no_shipped_chain_is_told(tmp_path):
    some_skills()[0].save(tmp_path / "skill")
    with pytest.raises(
        InvalidValueError, match=r"is one skill: Skill.load reads it; ship.py makes a shipped chain"
    ):
        load_shipped(tmp_path / "skill")
