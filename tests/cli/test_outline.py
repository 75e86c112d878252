"""Help without the imports of what is described: the same text, soon, and nothing of it stays."""

import importlib
import json
import subprocess
import sys
from typing import Literal

import pytest

from bayesgrasp.cli.main import COMMANDS, main
from bayesgrasp.cli.outline import outlined, plain_names

EVERY_HELP = """
import contextlib, io, json, sys
from bayesgrasp.cli.main import COMMANDS, main
texts = {}
for name in COMMANDS:
    with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()) as text:
        main([*name.split(), "--help"])
    texts[name] = text.getvalue()
heavy = [name for name in ("torch", "numba", "mujoco", "scipy", "trimesh", "matplotlib") if name in sys.modules]
print(json.dumps([texts, heavy]))
"""


@pytest.fixture(scope="module")
def outlined_help() -> tuple[dict[str, str], list[str]]:
    """The help of each command where nothing was imported before, and the heavy packages that are imported after."""
    done = subprocess.run([sys.executable, "-c", EVERY_HELP], capture_output=True, text=True, check=True)
    texts, heavy = json.loads(done.stdout)
    return texts, heavy


@pytest.mark.parametrize("name", COMMANDS)
def test_help_is_as_with_everything_imported(
    name: str, outlined_help: tuple[dict[str, str], list[str]], capsys: pytest.CaptureFixture[str]
) -> None:
    COMMANDS[name].load()  # with all that it imports
    with pytest.raises(SystemExit):
        main([*name.split(), "--help"])
    assert outlined_help[0][name] == capsys.readouterr().out


def test_help_imports_nothing_heavy(outlined_help: tuple[dict[str, str], list[str]]) -> None:
    assert outlined_help[1] == []


def test_a_source_tells_choices_and_constants() -> None:
    text = 'A = Literal["x", "y"]\nB = 0.1\nC = f(3)\nD = frozenset({1})\nE, F = 1, 2\nfrom a import G\n'
    assert plain_names(text) == {"A": Literal["x", "y"], "B": 0.1}


def test_what_was_outlined_is_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    name, folder = "bayesgrasp.viewer.story", importlib.import_module("bayesgrasp.viewer")
    monkeypatch.setattr(folder, "story", importlib.import_module(name))  # and put back
    monkeypatch.delitem(sys.modules, name)
    with outlined():
        outline = importlib.import_module(name)
        assert isinstance(outline.draw_story, type)
    assert name not in sys.modules
    assert not hasattr(folder, "story")


def test_a_word_after_two_dashes_asks_for_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as leaving:
        main(["objects", "show", "--", "-h"])
    assert leaving.value.code == 2
    assert "usage" not in capsys.readouterr().out
