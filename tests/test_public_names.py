"""`import bayesgrasp` is light, and every public name is there once it is asked for."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import bayesgrasp

HEAVY = ("torch", "numpy", "scipy", "mujoco", "numba", "matplotlib", "pyarrow", "trimesh")
SOURCE = Path(bayesgrasp.__file__)


def python(*arguments: str) -> str:
    """What a fresh interpreter prints."""
    done = subprocess.run([sys.executable, *arguments], capture_output=True, text=True, check=True)
    return done.stdout


@pytest.mark.parametrize("module", ["bayesgrasp", "bayesgrasp.cli.main"])
def test_importing_brings_nothing_heavy(module: str) -> None:
    code = f"import sys, {module}; print(*(name for name in {HEAVY} if name in sys.modules))"
    assert python("-c", code).split() == []


def test_a_name_brings_what_it_needs() -> None:
    code = "import sys, bayesgrasp; bayesgrasp.Camera; print('numpy' in sys.modules, 'torch' in sys.modules)"
    assert python("-c", code).split() == ["True", "False"]


@pytest.mark.parametrize("name", bayesgrasp.__all__)
def test_every_public_name_is_there(name: str) -> None:
    found = getattr(bayesgrasp, name)
    assert found is not None
    assert name in dir(bayesgrasp)
    assert found is getattr(bayesgrasp, name)


def test_type_checkers_see_the_same_names_from_the_same_places() -> None:
    """The imports for type checkers, the table of homes and `__all__` say the same."""
    block = next(node for node in ast.parse(SOURCE.read_text()).body if isinstance(node, ast.If))
    seen = {
        alias.asname or alias.name: f"{node.module.removeprefix('bayesgrasp.')}:{alias.name}"
        for node in block.body
        if isinstance(node, ast.ImportFrom) and node.module
        for alias in node.names
    }
    assert seen == bayesgrasp._HOMES
    assert sorted({*seen, "__version__"}) == sorted(bayesgrasp.__all__)
    assert len(bayesgrasp.__all__) <= 20


def test_a_name_that_is_not_there_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="grasp_now"):
        bayesgrasp.grasp_now  # noqa: B018


def test_star_import_gives_the_public_names() -> None:
    namespace: dict[str, object] = {}
    exec("from bayesgrasp import *", namespace)
    assert {*bayesgrasp.__all__} <= {*namespace}


def test_the_module_is_the_command() -> None:
    assert python("-m", "bayesgrasp", "--version").startswith("bayesgrasp ")
    assert "Plan grasps from a depth image." in python("-m", "bayesgrasp", "--help")
