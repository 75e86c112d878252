"""Imports between rooms run one way, read from the source text; printing stays in the command line."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "src" / "bayesgrasp"

# Lower rooms may import upper ones. Rooms on the same level do not know one another.
LEVELS: tuple[frozenset[str], ...] = tuple(
    frozenset(names.split())
    for names in (
        "types errors seeding files locks",
        "geometry",
        "meshes",
        "objects",
        "robot",
        "prior",
        "observation",
        "lift depth known",
        "data",
        "generation",
        "ratio",
        "training",
        "posterior",
        "planning",
        "diagnostics",
        "evaluation",
        "viewer",
        "workflows",
        "cli",
    )
)
LEVEL_OF = {room: level for level, rooms in enumerate(LEVELS) for room in rooms}

SIMULATORS = frozenset({"lift", "depth", "known"})
# Stricter than the order: these meet elsewhere, by protocol, in `generation` or in `workflows`.
FORBIDDEN: dict[str, frozenset[str]] = {
    "lift": frozenset({"prior"}),
    "depth": frozenset({"prior"}),
    "known": frozenset({"prior"}),
    "data": SIMULATORS,
    "ratio": SIMULATORS | {"generation", "robot"},
    "training": SIMULATORS | {"generation", "robot"},
    "posterior": SIMULATORS | {"ratio", "training", "data", "generation"},
    "planning": SIMULATORS | {"ratio", "training", "data", "generation"},
    "diagnostics": SIMULATORS | {"ratio", "training", "posterior", "planning", "data", "generation"},
}


def imported_modules(tree: ast.AST, module: str) -> Iterator[tuple[int, str]]:
    """Line and full dotted name of every import anywhere in ``tree``, relative ones resolved against ``module``."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parent = module.split(".")[: -node.level] if node.level else []
            base = ".".join([*parent, *([node.module] if node.module else [])])
            yield from ((node.lineno, f"{base}.{alias.name}") for alias in node.names)


def _complaint(room: str, name: str) -> str | None:
    """Why a file of ``room`` may not import ``name``, or None where it may."""
    parts = name.split(".")
    if parts[0] != "bayesgrasp":
        return None
    if len(parts) == 1 or parts[1] not in LEVEL_OF:
        return f"imports the package's top level ({name})"
    target = parts[1]
    if target == room:
        return None
    if room in LEVELS[0]:
        return None if target in LEVELS[0] else f"{room} imports {target}"
    if LEVEL_OF[target] >= LEVEL_OF[room]:
        return f"{room} imports {target}, which comes after it"
    if target in FORBIDDEN.get(room, frozenset()):
        return f"{room} must not know {target}"
    return None


def _is_print(node: ast.AST) -> bool:
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "print"


def violations(source: str, module: str) -> list[str]:
    """Everything in ``source`` that breaks the rules, were it the module ``module`` (dotted, with the package)."""
    tree = ast.parse(source)
    room = module.split(".")[1]
    found = [
        f"{module}:{line}: {complaint}"
        for line, name in imported_modules(tree, module)
        if (complaint := _complaint(room, name)) is not None
    ]
    if room != "cli":
        found += [f"{module}:{node.lineno}: prints" for node in ast.walk(tree) if _is_print(node)]  # type: ignore[attr-defined]
    return found


def module_name(path: Path) -> str:
    """Dotted name of a source file; a room's ``__init__`` keeps its last part, so that relative imports resolve."""
    return ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts)


SOURCES = sorted(path for path in PACKAGE.rglob("*.py") if path != PACKAGE / "__init__.py")


@pytest.mark.parametrize("path", SOURCES, ids=module_name)
def test_file_keeps_to_the_architecture(path: Path) -> None:
    assert violations(path.read_text(), module_name(path)) == []


@pytest.mark.parametrize("path", [p for p in SOURCES if p.name == "__init__.py"], ids=module_name)
def test_a_room_opens_with_a_docstring_only(path: Path) -> None:
    body = ast.parse(path.read_text()).body
    assert len(body) == 1
    assert ast.get_docstring(ast.parse(path.read_text()))


def test_every_folder_is_a_room_and_there_is_no_utils() -> None:
    rooms = {path.name for path in PACKAGE.iterdir() if (path / "__init__.py").exists()}
    assert rooms <= LEVEL_OF.keys()
    assert not [path for path in SOURCES if path.stem in {"utils", "util", "helpers", "configs", "common"}]


def test_rooms_do_not_import_one_another_in_circles() -> None:
    """Files inside a room may import one another in any order, but not in a circle."""
    edges = {module_name(p): _file_imports(p) for p in SOURCES}
    done: set[str] = set()

    def visit(name: str, path: tuple[str, ...]) -> None:
        assert name not in path, f"import circle: {' -> '.join((*path, name))}"
        if name not in done:
            for target in sorted(edges[name]):
                visit(target, (*path, name))
            done.add(name)

    for name in edges:
        visit(name, ())


def _file_imports(path: Path) -> set[str]:
    known = {module_name(p) for p in SOURCES}
    names = [name for _, name in imported_modules(ast.parse(path.read_text()), module_name(path))]
    return {candidate for name in names for candidate in (name, name.rpartition(".")[0]) if candidate in known}


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("bayesgrasp.geometry.so3", "from bayesgrasp.robot.arm import HOME"),
        ("bayesgrasp.geometry.so3", "def f():\n    import bayesgrasp.cli.main"),
        ("bayesgrasp.errors", "from bayesgrasp.geometry import so3"),
        ("bayesgrasp.prior.grasp", "from bayesgrasp.lift import lift_test"),
        ("bayesgrasp.lift.lift_test", "from ..prior.grasp import GraspPrior"),
        ("bayesgrasp.lift.bullet.engine", "from ...prior.grasp import GraspPrior"),
        ("bayesgrasp.lift.lift_test", "from bayesgrasp.depth.sensor import DepthSensor"),
        ("bayesgrasp.training.losses", "from bayesgrasp.generation.chunks import ChunkMaker"),
        ("bayesgrasp.ratio.model", "from bayesgrasp.known import analytic"),
        ("bayesgrasp.posterior.ascent", "from bayesgrasp.ratio.estimators import Ratio"),
        ("bayesgrasp.diagnostics.coverage", "import bayesgrasp.ratio.estimators as e"),
        ("bayesgrasp.data.store", "from bayesgrasp import Hands"),
        ("bayesgrasp.data.store", "import bayesgrasp"),
        ("bayesgrasp.data.store", "print(1)"),
    ],
)
def test_a_planted_violation_is_caught(module: str, source: str) -> None:
    assert len(violations(source, module)) == 1


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("bayesgrasp.generation.chunks", "from bayesgrasp.prior.grasp import GraspPrior\nimport numpy"),
        ("bayesgrasp.training.train_model", "from bayesgrasp.data.loader import Loader"),
        ("bayesgrasp.training.train_model", "from bayesgrasp.types import Hands"),
        ("bayesgrasp.cli.demo", "from bayesgrasp.viewer import scene\nprint(1)"),
    ],
)
def test_a_permitted_import_passes(module: str, source: str) -> None:
    assert violations(source, module) == []


def test_test_files_have_names_of_their_own() -> None:
    """Without packages among the tests, two files of one name cannot be collected in one process."""
    names = [path.name for path in Path(__file__).parent.rglob("*.py")]
    assert sorted({name for name in names if names.count(name) > 1} - {"conftest.py"}) == []
