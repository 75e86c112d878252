"""The rooms of the package are as CONTRIBUTING.md says: order, limits, and what is stricter, read from the source text.

The table there is the one statement of the order: each row is a level, and a room imports only rooms of rows above its
own that its last column does not name.
"""

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "bayesgrasp"
RULES = (ROOT / "CONTRIBUTING.md").read_text()

Row = tuple[frozenset[str], frozenset[str]]
"""Rooms of one level, and the rooms above them that they must not know all the same."""


def room_table(page: str) -> list[Row]:
    """The rows of the table of rooms in a page."""
    body = page.partition("| room |")[2].split("\n\n")[0].splitlines()[2:]
    cells = [line.strip("| ").split(" | ") for line in body]
    return [(frozenset(quoted(row[0])), frozenset(quoted(row[2] if len(row) > 2 else ""))) for row in cells]


def quoted(text: str) -> list[str]:
    return re.findall(r"`(\w+)`", text)


TABLE = room_table(RULES)
LEVEL_OF = {room: level for level, (rooms, _) in enumerate(TABLE) for room in rooms}
FORBIDDEN = {room: forbidden for rooms, forbidden in TABLE for room in rooms}
BASE = TABLE[0][0]
SIMULATORS = frozenset({"lift", "depth", "known"})
PHYSICS = frozenset({"mujoco", "pybullet", "embreex"})
DOORS = frozenset({"__init__", "__main__"})
"""Files beside the rooms: what `import bayesgrasp` and `python -m bayesgrasp` run."""

MOST_FILES, MOST_LINES, MOST_PARAMETERS = 12, 300, 8
ONE_FILE_A_COMMAND = frozenset({"cli"})


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
    if target == room or room in DOORS or {room, target} <= BASE:
        return None
    if LEVEL_OF[target] >= LEVEL_OF[room]:
        return f"{room} imports {target}, which comes after it"
    if target in FORBIDDEN[room]:
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


SOURCES = sorted(PACKAGE.rglob("*.py"))


@pytest.mark.parametrize("path", SOURCES, ids=module_name)
def test_file_keeps_to_the_architecture(path: Path) -> None:
    assert violations(path.read_text(), module_name(path)) == []


INITS = [path for path in SOURCES if path.name == "__init__.py" and path.parent != PACKAGE]


@pytest.mark.parametrize("path", INITS, ids=module_name)
def test_a_room_opens_with_a_docstring_only(path: Path) -> None:
    body = ast.parse(path.read_text()).body
    assert len(body) == 1
    assert ast.get_docstring(ast.parse(path.read_text()))


def eager_imports(source: str) -> list[str]:
    """What importing a file imports, beside Python's own: not in functions, and not for the type checker alone."""
    waiting: list[ast.AST] = list(ast.parse(source).body)
    found = []
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Import | ast.ImportFrom):
            found += [name for _, name in imported_modules(node, "bayesgrasp.__init__")]
        elif not isinstance(node, ast.FunctionDef) and not _is_for_types(node):
            waiting += ast.iter_child_nodes(node)
    return [name for name in found if name.split(".")[0] not in sys.stdlib_module_names]


def _is_for_types(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)


def test_importing_the_package_imports_nothing_else() -> None:
    assert eager_imports((PACKAGE / "__init__.py").read_text()) == []


def test_a_planted_eager_import_is_caught() -> None:
    delayed = "import os\nif TYPE_CHECKING:\n    import a\ndef f():\n    import b\n"
    assert eager_imports(delayed) == []
    assert sorted(eager_imports(delayed + "try:\n    import c\nfinally:\n    from . import d")) == ["bayesgrasp.d", "c"]


def test_rooms_are_those_of_the_table_and_there_is_no_utils() -> None:
    folders = {path.name for path in PACKAGE.iterdir() if (path / "__init__.py").exists()}
    files = {path.stem for path in PACKAGE.glob("*.py")} - DOORS
    assert folders | files == LEVEL_OF.keys()
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


def reached_from(room: str) -> set[str]:
    """Top-level names of all packages that importing any file of a room may import, however far away."""
    files = {module_name(path): path for path in SOURCES}
    waiting = [name for name in files if name.split(".")[1] == room]
    seen: set[str] = set()
    found: set[str] = set()
    while waiting:
        name = waiting.pop()
        if name not in seen:
            seen.add(name)
            found |= {n.split(".")[0] for _, n in imported_modules(ast.parse(files[name].read_text()), name)}
            waiting += _file_imports(files[name])
    return found


@pytest.mark.parametrize("room", ["ratio", "training", "posterior"])
def test_learning_and_inference_need_no_physics_engine(room: str) -> None:
    assert not reached_from(room) & PHYSICS


def test_priors_and_simulators_meet_where_it_is_said() -> None:
    said = re.search(r"meet only in\s(.*?):", RULES, re.DOTALL)
    assert said is not None
    may = {room for room in LEVEL_OF if not _complaint(room, "bayesgrasp.prior.x")}
    both = {room for room in may for simulator in SIMULATORS if not _complaint(room, f"bayesgrasp.{simulator}.x")}
    assert both - {"prior"} == set(quoted(said[1]))


@pytest.mark.parametrize("folder", sorted({path.parent for path in SOURCES}), ids=lambda folder: folder.name)
def test_a_room_has_at_most_a_dozen_files(folder: Path) -> None:
    files = [path for path in folder.glob("*.py") if path.name != "__init__.py"]
    assert len(files) <= MOST_FILES or folder.name in ONE_FILE_A_COMMAND


@pytest.mark.parametrize("path", SOURCES, ids=module_name)
def test_a_file_is_short(path: Path) -> None:
    assert len(path.read_text().splitlines()) <= MOST_LINES


def oddities(source: str) -> list[str]:
    """Functions of many parameters, and classes, protocols aside, whose instances are called like functions."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef):
            names = [a.arg for a in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]
            if len([name for name in names if name not in {"self", "cls"}]) > MOST_PARAMETERS:
                found.append(f"{node.name} takes more than {MOST_PARAMETERS} parameters")
        elif isinstance(node, ast.ClassDef) and not any("Protocol" in ast.unparse(base) for base in node.bases):
            calls = any(isinstance(method, ast.FunctionDef) and method.name == "__call__" for method in node.body)
            found += [f"{node.name} is called"] if calls else []
    return found


@pytest.mark.parametrize("path", SOURCES, ids=module_name)
def test_functions_take_few_parameters_and_methods_are_verbs(path: Path) -> None:
    assert oddities(path.read_text()) == []


def test_planted_oddities_are_caught() -> None:
    call = "    def __call__(self): ..."
    assert oddities(f"class A(Protocol):\n{call}\ndef f(self, a, b, c, d, *, e, f, g, h, **more): ...") == []
    assert len(oddities(f"class A(B):\n{call}\ndef f(a, b, c, d, e, f, g, /, h, *, i): ...")) == 2


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("bayesgrasp.geometry.so3", "from bayesgrasp.robot.arm import HOME"),
        ("bayesgrasp.geometry.so3", "def f():\n    import bayesgrasp.cli.main"),
        ("bayesgrasp.errors", "from bayesgrasp.geometry import so3"),
        ("bayesgrasp.prior.grasp", "from bayesgrasp.lift import lift_test"),
        ("bayesgrasp.lift.lift_test", "from ..prior.grasp import GraspPrior"),
        ("bayesgrasp.lift.bullet.bullet_engine", "from ...prior.grasp import GraspPrior"),
        ("bayesgrasp.lift.lift_test", "from bayesgrasp.depth.sensor import DepthSensor"),
        ("bayesgrasp.training.losses", "from bayesgrasp.generation.chunks import ChunkMaker"),
        ("bayesgrasp.ratio.model", "from bayesgrasp.known import analytic"),
        ("bayesgrasp.posterior.ascent", "from bayesgrasp.ratio.estimators import Ratio"),
        ("bayesgrasp.diagnostics.coverage", "import bayesgrasp.ratio.estimators as e"),
        ("bayesgrasp.data.store", "from bayesgrasp import Hands"),
        ("bayesgrasp.data.store", "import bayesgrasp"),
        ("bayesgrasp.data.store", "print(1)"),
        ("bayesgrasp.locks", "from bayesgrasp.geometry import so3"),
        ("bayesgrasp.evaluation.__init__", "from ..cli import main"),
        ("bayesgrasp.viewer.film", "from bayesgrasp.prior.grasp import GraspPrior"),
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
        ("bayesgrasp.locks", "from bayesgrasp.errors import DataError"),
        ("bayesgrasp.__init__", "def load():\n    from bayesgrasp.workflows.load import load_planner"),
    ],
)
def test_a_permitted_import_passes(module: str, source: str) -> None:
    assert violations(source, module) == []


def missing_modules(text: str) -> list[str]:
    """Files of the repository, and modules with their room, that are named in backticks and that are not there."""
    wrong = []
    for name in re.findall(r"`(?:bayesgrasp\.)?([\w./-]+)`", text):
        room, _, module = name.partition(".")
        if name.strip("/") in FORMER or (name.split("/")[0] in KEPT and not (ROOT / name).exists()):
            wrong.append(name)
        elif name.endswith(".py"):
            wrong += [] if any(f"/{path.relative_to(ROOT)}".endswith(f"/{name}") for path in EVERY_FILE) else [name]
        elif re.fullmatch("[a-z_]+", module) and room in FOLDERS_THEN_AND_NOW and module not in FILE_ENDINGS:
            wrong += [] if (PACKAGE / room / f"{module}.py").exists() or (PACKAGE / room / module).is_dir() else [name]
    return wrong


EVERY_FILE = [path for folder in ("src", "tests", "benchmarks", ".ci") for path in (ROOT / folder).rglob("*.py")]
PAGES = [*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), *ROOT.glob("results/*.md")]
KEPT = {"results", "docs", "tests", "benchmarks", "examples"}
FORMER = {"assets", "simulators"}
"""Rooms that are no more, and whose names are no other words."""
FOLDERS_THEN_AND_NOW = {path.parent.name for path in INITS} | FORMER | {"benchmark"}
FILE_ENDINGS = {"json", "md", "png", "toml"}


def test_modules_that_are_named_are_there() -> None:
    missing = {path: missing_modules(path.read_text()) for path in {*EVERY_FILE, *PAGES} - {Path(__file__)}}
    assert {path.relative_to(ROOT): names for path, names in missing.items() if names} == {}


def test_a_module_that_is_named_and_missing_is_caught() -> None:
    there = "`lift.hold`, `lift/hold.py`, `hold.py`, `lift/`, `bayesgrasp.lift.hold`, `ray.wait`, `docs/index.md`"
    assert missing_modules(there) == []
    gone = "`simulators.hold`, `bayesgrasp.assets`, `assets/`, `lift/nowhere.py`, `nowhere.py`, `results/nowhere.json`"
    assert len(missing_modules(gone)) == 6


def test_test_files_have_names_of_their_own() -> None:
    """Without packages among the tests, two files of one name cannot be collected in one process."""
    names = [path.name for path in Path(__file__).parent.rglob("*.py")]
    assert sorted({name for name in names if names.count(name) > 1} - {"conftest.py"}) == []
