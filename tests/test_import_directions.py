"""Who may import whom: recipes -> tstar_rl -> (env only) -> tstar_envs, and the layers inside both packages."""

import ast
import re
from pathlib import Path

import pytest

import tstar_rl
import tstar_rl.config
import tstar_rl.spirl

ROOT = Path(__file__).resolve().parents[1]
WORLD, LEARNING, RECIPES = ROOT / "envs" / "tstar_envs", ROOT / "tstar_rl", ROOT / "recipes"

# Inside the world a module imports from its own layer or from one above it in this list.
LAYERS = (
    ("checks", "whole_file", "geometry", "furniture", "settings"),
    ("robots",),
    ("scene", "rendering"),
    ("look", "player"),
    ("physics",),
    ("connection",),
    ("tasks",),
    ("experts", "snapshot_check", "state_edit"),
    ("environment",),
    ("dm_physics",),
    ("registry", "dm_environment", "gymnasium_shared"),
    ("gymnasium_env", "gymnasium_vector_env"),
    ("stable_baselines_env",),
    ("inspection",),
    ("__main__",),  # a command line, whichever room it is of
)
# In tstar_rl a room imports from itself and from the rooms above it in this list; the files of the root are above all.
ROOMS = (
    ("equations", "signal_equations", "seeds", "checks", "intervals", "deferred"),
    ("runs",),
    ("env",),
    ("models",),
    ("transforms",),
    ("objectives",),
    ("updates",),
    ("rollouts",),
    ("demonstrations",),
    ("chaining", "spirl"),
    ("seams",),
    ("shipped",),
    ("config",),
    ("launch",),
    ("experiments",),
    ("analysis",),
)
SIMULATORS = {"mujoco", "mujoco_warp", "warp", "dm_control", "dm_env"}
MEASURES_THE_SIMULATOR = {"bench_bare.py", "bench_device.py", "bench_wrapped.py"}


def imports(path: Path) -> set[str]:
    """Returns the dotted names of every import in a file, those inside functions too."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(), str(path))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import, write the package's name"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def roots(path: Path) -> set[str]:
    return {name.split(".")[0] for name in imports(path)}


def layer(module: str, layers: tuple[tuple[str, ...], ...] = LAYERS) -> int:
    found = [i for i, names in enumerate(layers) if module in names]
    assert found, f"{module} is in no layer: add it to LAYERS or ROOMS in {Path(__file__).name}"
    return found[0]


def sources(folder: Path) -> list:
    return [pytest.param(path, id=str(path.relative_to(ROOT))) for path in sorted(folder.rglob("*.py"))]


@pytest.mark.parametrize("path", sources(WORLD))
def test_the_world_knows_no_learning(path):
    assert not roots(path) & {"torchrl", "tstar_rl", "recipes", "hydra"}


@pytest.mark.parametrize("path", [p for p in sources(WORLD) if p.values[0] != WORLD / "__init__.py"])
def test_the_world_imports_downwards(path):
    own = path.stem if path.stem == "__main__" else path.relative_to(WORLD).parts[0].removesuffix(".py")
    for name in imports(path):
        package, _, rest = name.partition(".")
        if package == "tstar_envs":
            other = rest.split(".")[0]
            assert layer(other) <= layer(own), f"{path.relative_to(ROOT)} imports {name}, which is above it"


@pytest.mark.parametrize("path", sources(LEARNING))
def test_learning_reaches_the_world_through_one_room(path):
    assert not roots(path) & (SIMULATORS | {"recipes"})
    if path.parent != LEARNING / "env":
        assert "tstar_envs" not in roots(path), "only tstar_rl/env may import the world"


@pytest.mark.parametrize("path", [p for p in sources(LEARNING) if p.values[0] != LEARNING / "__init__.py"])
def test_a_room_imports_from_itself_and_from_the_rooms_above_it(path):
    own = path.relative_to(LEARNING).parts[0].removesuffix(".py")
    for name in imports(path):
        package, _, rest = name.partition(".")
        other = rest.split(".")[0]
        if package == "tstar_rl" and other != own:
            assert layer(other, ROOMS) < layer(own, ROOMS), f"{path.relative_to(ROOT)} imports {name}"


def test_only_recipes_import_experiments_and_analysis_and_but_for_experiments_launch():
    for path in LEARNING.rglob("*.py"):
        own = path.relative_to(LEARNING).parts[0]
        allowed = {own, "launch"} if own == "experiments" else {own}
        used = {name.split(".")[1] for name in imports(path) if name.startswith("tstar_rl.")}
        forbidden = {"launch", "experiments", "analysis"} - allowed
        assert not used & forbidden, f"{path.relative_to(ROOT)} imports {used & forbidden}"


@pytest.mark.parametrize("path", sources(LEARNING / "analysis"))
def test_reading_results_needs_no_torchrl(path):
    assert not roots(path) & {"torchrl", "tensordict"}


@pytest.mark.parametrize("package", [tstar_rl, tstar_rl.spirl])
def test_every_public_name_is_found_in_its_room(package):
    assert set(package.HOMES) == set(package.__all__) - {"__version__"}
    for name in package.__all__:
        assert getattr(package, name) is not None
    with pytest.raises(AttributeError, match=f"{package.__name__}' has no attribute 'nothing'; it has "):
        package.nothing  # noqa: B018


def test_equations_import_torch_alone():
    for name in ("equations", "signal_equations"):
        assert roots(LEARNING / f"{name}.py") <= {"torch", "collections", "__future__"}


@pytest.mark.parametrize("path", sources(RECIPES))
def test_recipes_use_the_learning_library_only(path):
    if path.name not in MEASURES_THE_SIMULATOR:
        assert not roots(path) & (SIMULATORS | {"tstar_envs"})


def test_furniture_is_named_in_data_configs_and_tests_only():
    data = [path.stem for path in (WORLD / "furniture" / "data").glob("*.yaml")]
    for path in [*WORLD.rglob("*.py"), *LEARNING.rglob("*.py")]:
        nodes = list(ast.walk(ast.parse(path.read_text())))
        docstrings = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
        for node in nodes:
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings:
                named = set(re.findall(r"\w+", node.value)) & set(data)
                assert not named, f"{path.relative_to(ROOT)} names {', '.join(named)}: {node.value!r}"
