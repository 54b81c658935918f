"""Who may import whom: recipes -> tstar_rl -> (furniture_env.py only) -> tstar_envs, and layers inside the world."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
WORLD, LEARNING, RECIPES = ROOT / "envs" / "tstar_envs", ROOT / "tstar_rl", ROOT / "recipes"

# Inside the world a module imports from its own layer or from one above it in this list.
LAYERS = (
    ("checks", "geometry", "furniture", "settings"),
    ("robots",),
    ("scene", "rendering"),
    ("physics",),
    ("connection",),
    ("tasks",),
    ("experts", "snapshot_check", "state_edit"),
    ("environment",),
    ("registry", "dm_environment", "gymnasium_shared"),
    ("gymnasium_env", "gymnasium_vector_env"),
    ("inspection",),
    ("__main__",),  # a command line, whichever room it is of
)
SIMULATORS = {"mujoco", "mujoco_warp", "warp", "dm_control", "dm_env"}
MEASURES_THE_SIMULATOR = {"bench.py", "bench_device.py", "bench_wrapped.py"}


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


def layer(module: str) -> int:
    found = [i for i, names in enumerate(LAYERS) if module in names]
    assert found, f"tstar_envs.{module} is in no layer: add it to LAYERS in {Path(__file__).name}"
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
def test_learning_reaches_the_world_through_one_file(path):
    assert not roots(path) & (SIMULATORS | {"recipes"})
    if path != LEARNING / "furniture_env.py":
        assert "tstar_envs" not in roots(path), "only furniture_env.py may import the world"


def test_equations_import_torch_alone():
    assert roots(LEARNING / "equations.py") <= {"torch", "__future__"}


@pytest.mark.parametrize("path", sources(RECIPES))
def test_recipes_use_the_learning_library_only(path):
    if path.name not in MEASURES_THE_SIMULATOR:
        assert not roots(path) & (SIMULATORS | {"tstar_envs"})


def test_furniture_is_named_in_data_configs_and_tests_only():
    data = [path.stem for path in (WORLD / "furniture" / "data").glob("*.yaml")]
    for path in [*WORLD.rglob("*.py"), *LEARNING.rglob("*.py")]:
        strings = [
            node.value
            for node in ast.walk(ast.parse(path.read_text()))
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and "\n" not in node.value
        ]
        assert not set(strings) & set(data), f"{path.relative_to(ROOT)} names a piece of furniture"
