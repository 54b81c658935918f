"""Every config that is there passes, and what is wrong with another one is told before a recipe begins."""

import importlib.util
from pathlib import Path

import pytest
from hydra import compose, initialize_config_dir

from tstar_rl.config.check import ConfigError
from tstar_rl.config.demonstrations import demonstrations_path
from tstar_rl.config.load import check_config, recipe
from tstar_rl.config.values import CONFIGS, settings
from tstar_rl.updates import PPOSettings

RECIPES = Path(__file__).resolve().parents[2] / "recipes"
NAMES = [path.stem for path in (CONFIGS / "recipe").glob("*.yaml")]
SCALES = [path.stem for path in (CONFIGS / "scale").glob("*.yaml")]
SPIRL_SCALES = [path.stem for path in (CONFIGS / "spirl").glob("*.yaml")]
TRAIN_NOTHING = {
    "anatomy", "bench", "bench_growth", "evaluate", "evaluate_expert", "evaluate_shelf", "exchanged", "export",
    "floored", "hand_over", "hand_over_gap", "make_demonstrations", "moved_parts", "parity", "plot", "plot_latents",
    "refitted", "report", "ship", "terminal_states", "watch", "ways_home",
}  # fmt: skip


@pytest.fixture(autouse=True, scope="module")
def own_keys():
    """Imports the recipes, each of which names its own keys."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(RECIPES)
        for path in RECIPES.glob("*.py"):
            spec = importlib.util.spec_from_file_location(f"recipe_{path.stem}", path)
            spec.loader.exec_module(importlib.util.module_from_spec(spec))
        yield


def checked(name: str, *overrides: str) -> None:
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        check_config(compose(f"recipe/{name}", list(overrides)), name)


@pytest.mark.parametrize("name", NAMES)
def test_the_config_of_every_recipe_passes_the_check(name):
    for scale in ("laptop", "whole") if name == "spirl" else ("laptop", "no_return"):
        checked(name, f"scale={scale}", "task=chair_ingolf")


@pytest.mark.parametrize("name", ["gail_ppo", "in_order", "tstar"])
def test_the_config_of_every_scale_passes_the_check(name):
    for scale in SCALES:
        # in_order lets the critic alone learn from 16 rollouts, which on a GPU are longer than its turns.
        longer = name == "in_order" and scale.endswith("gpu")
        own = ["chain.ppo.critic_warmup=1"] if longer else []
        checked(name, f"scale={scale}", "task=chair_ingolf", *own)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in NAMES if name not in TRAIN_NOTHING])
def test_every_recipe_that_trains_at_every_scale(name):
    # At some scales a turn of in_order has fewer rollouts than its warm-up.
    own = ["chain.ppo.critic_warmup=1"] if name == "in_order" else []
    for scale in SPIRL_SCALES if name == "spirl" else SCALES:
        checked(name, f"scale={scale}", "task=chair_ingolf", *own)


def test_what_a_user_may_add():
    checked("ablate", "ablation=[lambda_3,starts]")
    checked("tstar", "+env.part_noise=0.04", "chain.links=2", "+reward.scales.env=2", "ppo.learning_rate=1")
    checked("policy_sequencing", "bonus=0.4", "subtask=null", "exploration=null")


def test_what_reads_like_a_value_that_is_not_read_and_is():
    checked("tstar", "chain.gate=false", "chain.trial_every=100")  # no trials
    checked("tstar", "chain.links=2")  # and logs no states of skill 2
    checked("tstar", "task=chair_bernhard")  # nor does this, of two subtasks
    checked("tstar", "chain.logged_skill=9", "chain.logged_states=0")
    checked("in_order", "skills=gail_ppo", "demonstrated_ends=0")
    checked("in_order", "skills=wide/bc")
    checked("in_order_cloned", "skills=bc_noisy")
    checked("hand_over_value", "skills=bc", "chain.order=backward")
    checked("tstar", "chain.d_omega_of=own", "chain.rounds=2")
    checked("bc", "scale=paper", "subtask=0", "networks.std=fixed")  # an entropy_coeff that is PPO's
    checked("tstar", "scale=paper", "networks.std=fixed", "+chain.ppo.entropy_coeff=0")
    checked("gail_ppo", "subtask=0", "warm_start=false", "normalizer.running=true")


@pytest.mark.parametrize(
    ("name", "override", "message"),
    [
        ("gail_ppo", "+sede=1", "the config has no sede; it has .*did you mean seed"),
        ("gail_ppo", "+task.steps=1", "task has no steps; it has name, subtasks"),
        ("gail_ppo", "+training.horizons=1", "training has no horizons; it has .*did you mean horizon"),
        ("gail_ppo", "+reward.weight=1", "reward has no weight; it has .*did you mean weights"),
        ("tstar", "+terminal_reward.d_omega=1", "terminal_reward has no d_omega; it has score, baseline"),
        ("tstar", "+chain.ppo.epoch=1", "chain.ppo has no epoch; it has .*did you mean epochs"),
        ("spirl", "+spirl.model.hiden=[8]", "spirl.model has no hiden; it has .*did you mean hidden"),
        ("gail_ppo", "+from_checkpoint=best", "the config has no from_checkpoint"),
        ("bench", "+bench.step=1", "bench has no step; it has .*did you mean steps"),
        ("gail_ppo", "~training.horizon", "training lacks horizon, which must be a whole number"),
        (
            "tstar",
            "chain.order=sideways",
            "chain.order must be forward or backward or costliest, got 'sideways'",
        ),
        ("proximity", "chain.path_steps=-1", "chain.path_steps must be not negative, got -1"),
        ("feasibility", "label=successes", "label must be success or share, got 'successes'"),
        ("feasibility", "feasibility.floor=0", "feasibility.floor must be positive, got 0"),
        ("tstar", "chain.gate=success", "chain.gate must be true or false, got 'success'"),
        ("gail_ppo", "seed=one", "seed must be a whole number, got 'one'"),
        ("gail_ppo", "subtask=all", "subtask must be a whole number or null, got 'all'"),
        ("gail_ppo", "training.num_envs=2.5", "training.num_envs must be a whole number, got 2.5"),
        ("gail_ppo", "ppo.epochs=true", "ppo.epochs must be a whole number, got True"),
        ("gail_ppo", "ppo.learning_rate=fast", "ppo.learning_rate must be a number, got 'fast'"),
        ("gail_ppo", "networks.hidden=128", "networks.hidden must be a list, each a whole number, got 128"),
        ("gail_ppo", "exploration.arm=[0.1]", "exploration.arm must be a list of 2, each a number"),
        ("gail_ppo", "training=null", "training must be a section, got None"),
        ("tstar", "chain.starts={buffer: most}", "chain.starts must be a section, each value a number, got"),
        ("evaluate", "video=maybe", "video must be true or false, got 'maybe'"),
        ("gail_ppo", "env.velocity_scale=2.0", r"velocity_scale must be in \(0, 1\], got 2.0"),
        ("gail_ppo", "task.subtasks=3", "task.subtasks of table_lack must be 4.* got 3"),
        ("gail_ppo", "task.name=table_lak", "no furniture is called 'table_lak': did you mean 'table_lack'"),
        ("gail_ppo", "+env.velocity_scal=1", "unknown task setting 'velocity_scal'.*velocity_scale"),
    ],
)
def test_what_is_refused(name, override, message):
    with pytest.raises(ValueError, match=message):
        checked(name, override)


def test_a_settings_object_is_refused_alike():
    with pytest.raises(ConfigError, match="PPOSettings.minibatch must be a whole number, got 1.5"):
        settings(PPOSettings, {"minibatch": 1.5})


def test_a_kind_of_demonstrations_that_there_is_not():
    with pytest.raises(ValueError, match="kind of demonstrations must be one of plain, noisy; got 'nois'"):
        demonstrations_path(None, 0, "nois")


def test_a_recipe_begins_with_the_check():
    main = recipe("plot")(lambda config: pytest.fail("the recipe began"))
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        config = compose("recipe/plot", ["torch_threads=many"])
    with pytest.raises(ConfigError, match="torch_threads must be a whole number, got 'many'"):
        main(config)
