"""`benchmarks/code_profile.py` counts what it says it counts, on a tree small enough to count by hand."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

COMMAND = Path(__file__).parents[1] / "benchmarks" / "code_profile.py"
WIDE = '''"""A module of ten lines of code.

Its docstring is none of them.
"""

from typing import Protocol

FOUND: int = 3
_hidden = 4  # one comment


class Called:
    """Called like a function."""

    def __call__(self, a: int, b: int) -> int:
        from bayesgrasp.narrow import one

        return one(
            a + b)


class Callback(Protocol):
    def __call__(self) -> int: ...
'''
NARROW = "def one(a, b, c, d, e, f, g, h, i):\n    import os\n    return os, a\n"


@pytest.fixture(scope="module")
def profile(tmp_path_factory: pytest.TempPathFactory) -> dict[str, float]:
    root = tmp_path_factory.mktemp("tree")
    package = root / "src" / "bayesgrasp"
    (package / "room").mkdir(parents=True)
    (root / "tests").mkdir()
    for path, text in {
        package / "__init__.py": '"""A package."""\n',
        package / "narrow.py": NARROW,
        package / "room" / "__init__.py": "",
        package / "room" / "wide.py": WIDE,
        root / "tests" / "test_it.py": "# what is tested\nassert True\nassert True\n",
        root / "pyproject.toml": '[project]\ndependencies = ["numpy", "torch"]\n',
    }.items():
        path.write_text(text)
    out = root / "profile.json"
    command = [sys.executable, str(COMMAND), "--root", str(root), "--json", str(out), "--table", str(root / "it.md")]
    subprocess.run(command, check=True, capture_output=True)
    assert "| functions of more than 8 parameters | 1 |" in (root / "it.md").read_text()
    read: dict[str, dict[str, float]] = json.loads(out.read_text())
    return read["now"]


def test_files_and_folders(profile: dict[str, float]) -> None:
    assert profile["files"] == 2
    assert (profile["file_median"], profile["file_max"]) == (13, 23)
    assert profile["largest_folder"] == 1
    assert profile["dependencies"] == 2


def test_functions(profile: dict[str, float]) -> None:
    """Three functions, with bodies of 2, 3 and 1 lines, that take 9, 2 and no parameters."""
    assert (profile["body_median"], profile["body_90"], profile["body_max"]) == (2, 3, 3)
    assert (profile["parameters_mean"], profile["parameters_max"], profile["many_parameters"]) == (3.67, 9, 1)


def test_names_and_calls(profile: dict[str, float]) -> None:
    """`FOUND`, `Called` and `Callback` beside `one`; a protocol's method is what others define."""
    assert (profile["names_median"], profile["names_max"]) == (2, 3)
    assert profile["called_classes"] == 1
    assert profile["inner_imports"] == 1


def test_comments_and_tests_beside_thirteen_lines_of_code(profile: dict[str, float]) -> None:
    assert profile["comments"] == round(100 / 13, 2)
    assert profile["tests"] == round(2 / 13, 2)
