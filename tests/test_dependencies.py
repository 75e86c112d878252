"""What is imported is declared, what is declared is imported, and all of it is pinned in `constraints.txt`."""

import ast
import re
import sys
import tomllib
from collections.abc import Iterable, Iterator
from importlib.metadata import PackageNotFoundError, packages_distributions, requires
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
EXTRAS: dict[str, list[str]] = PROJECT["optional-dependencies"]
FOR_DEVELOPERS = {"dev", "docs", "bench"}
TOOLS = {
    "mypy": "$(BIN)/mypy",
    "ruff": "$(BIN)/ruff",
    "pytest-xdist": "pytest -q -n",
    "scipy-stubs": "[tool.mypy]",
    "mkdocs-material": "name: material",
    "mkdocstrings": "- mkdocstrings",
}
"""Programs and plugins that nothing imports, and what in the configuration runs them."""
OWN = {"bayesgrasp"} | {path.stem for folder in ("tests/support", "benchmarks") for path in ROOT.glob(f"{folder}/*.py")}
DISTRIBUTIONS = packages_distributions()


def imported(source: str) -> Iterator[str]:
    """Top-level names of what a source imports, also by `import_module`, by `find_spec` and through torch."""
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Import(names=names):
                yield from (alias.name.split(".")[0] for alias in names)
            case ast.ImportFrom(module=str(module), level=0):
                yield "tensorboard" if module == "torch.utils.tensorboard" else module.split(".")[0]
            case ast.Call(func=ast.Attribute(attr="import_module" | "find_spec" | "importorskip"), args=[name, *_]):
                if isinstance(name, ast.Constant):
                    yield str(name.value).split(".")[0]
            case ast.Call(func=ast.Attribute(attr="install_import_hook"), args=[_, ast.Constant(value=str(checker))]):
                yield checker.split(".")[0]


def distributions(sources: Iterable[str]) -> dict[str, set[str]]:
    """Imported packages by the distributions that may hold them, without our own and Python's."""
    names = {name for source in sources for name in imported(source)} - OWN - sys.stdlib_module_names
    return {name: {canonicalize_name(d) for d in DISTRIBUTIONS.get(name, [name])} for name in names}


def declared(requirements: Iterable[str]) -> set[str]:
    """Names of required distributions."""
    return {canonicalize_name(Requirement(requirement).name) for requirement in requirements}


def texts(*folders: str) -> list[str]:
    return [path.read_text() for folder in folders for path in sorted((ROOT / folder).rglob("*.py"))]


CORE = declared(PROJECT["dependencies"])
OPTIONAL = declared(r for name, listed in EXTRAS.items() if name not in FOR_DEVELOPERS for r in listed)
DEVELOPERS = declared(r for name in FOR_DEVELOPERS for r in EXTRAS[name])


def undeclared(sources: Iterable[str], names: set[str]) -> list[str]:
    return sorted(name for name, found in distributions(sources).items() if not found & names)


def unused(sources: Iterable[str], names: set[str]) -> list[str]:
    return sorted(names - set().union(*distributions(sources).values()))


def test_the_package_imports_what_it_declares_and_declares_what_it_imports() -> None:
    sources = texts("src")
    assert undeclared(sources, CORE | OPTIONAL) == []
    assert unused(sources, CORE | OPTIONAL) == []


def test_so_do_tests_and_benchmarks() -> None:
    sources = texts("tests", "benchmarks", "examples", ".ci")
    assert undeclared(sources, CORE | OPTIONAL | DEVELOPERS) == []
    assert unused(sources, DEVELOPERS - TOOLS.keys() - OPTIONAL) == []


def test_every_tool_is_run_by_something() -> None:
    text = "".join((ROOT / name).read_text() for name in ("Makefile", "mkdocs.yml", "pyproject.toml"))
    assert [tool for tool, words in TOOLS.items() if words not in text] == []
    assert declared(r for listed in EXTRAS.values() for r in listed) >= TOOLS.keys()


def pins() -> dict[str, str]:
    lines = [line for line in (ROOT / "constraints.txt").read_text().splitlines() if not line.startswith("#")]
    assert lines == sorted(lines, key=str.upper)
    found = dict(re.fullmatch(r"([\w.-]+)==([\w.+!]+)", line).groups() for line in lines)  # type: ignore[union-attr]
    return {canonicalize_name(name): version for name, version in found.items()}


def test_the_constraints_pin_all_that_is_declared() -> None:
    pinned = pins()
    for requirement in map(Requirement, [*PROJECT["dependencies"], *(r for listed in EXTRAS.values() for r in listed)]):
        assert pinned[canonicalize_name(requirement.name)] in requirement.specifier


def test_and_what_that_brings() -> None:
    """As far as it is installed here. The default build of torch pins the CUDA libraries that it brings by itself."""
    pinned, queue = pins(), sorted(CORE | OPTIONAL | DEVELOPERS)
    seen: set[str] = set()
    while queue:
        name = queue.pop()
        if name in seen or name.startswith(("nvidia-", "cuda-", "triton")):
            continue
        seen.add(name)
        queue += _brought(name)
    assert sorted(seen - pinned.keys()) == []


def _brought(name: str) -> list[str]:
    try:
        found = [Requirement(requirement) for requirement in requires(name) or []]
    except PackageNotFoundError:
        return []
    return [canonicalize_name(r.name) for r in found if r.marker is None or r.marker.evaluate({"extra": ""})]


@pytest.mark.parametrize(
    "source",
    ["import nowhere", "def f():\n    from nowhere.deep import x", "importlib.import_module('nowhere')"],
)
def test_a_planted_import_is_caught(source: str) -> None:
    assert undeclared([source], CORE) == ["nowhere"]
    assert unused([source], {"numpy"}) == ["numpy"]


def test_one_s_own_and_python_s_modules_are_no_dependencies() -> None:
    assert undeclared(["import bayesgrasp, os.path", "from . import x", "import numpy as np"], {"numpy"}) == []
