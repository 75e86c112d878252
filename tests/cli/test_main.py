"""The entry point: fast help, one line per error, exit codes, and a registry whose entries exist."""

import inspect
import logging
import subprocess
import sys
from collections.abc import Iterator

import pytest

from bayesgrasp.cli import main as entry
from bayesgrasp.cli.main import COMMANDS, Command, main
from bayesgrasp.errors import AssetError

HEAVY = ("torch", "mujoco", "matplotlib", "scipy", "trimesh", "numpy", "tyro")


def run_in_process(args: list[str]) -> int:
    with pytest.raises(SystemExit) as leaving:
        main(args)
    return int(leaving.value.code or 0)


@pytest.fixture
def command(monkeypatch: pytest.MonkeyPatch) -> dict[str, object]:
    """A command ``act --number N`` and a group ``group one``, which record their calls or raise what they are told."""
    told: dict[str, object] = {"raise": None, "number": None}

    def act(number: int = 1) -> None:
        """Act.

        Args:
            number: How often.
        """
        told["number"] = number
        if isinstance(told["raise"], BaseException):
            raise told["raise"]

    monkeypatch.setattr(Command, "load", lambda self: act)
    monkeypatch.setattr(entry, "COMMANDS", {"act": Command("a:act", "Act."), "group one": Command("g:one", "One.")})
    return told


@pytest.fixture(autouse=True)
def _logging_restored() -> Iterator[None]:
    root = logging.getLogger()
    level, handlers = root.level, list(root.handlers)
    yield
    root.setLevel(level)
    root.handlers[:] = handlers


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_exists_is_documented_and_says_what_it_says_here(name: str) -> None:
    function = COMMANDS[name].load()
    assert function.__doc__
    assert function.__doc__.splitlines()[0] == COMMANDS[name].summary
    assert all(p.annotation is not p.empty for p in inspect.signature(function).parameters.values())


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_in_process([*name.split(), "--help"]) == 0
    assert f"usage: bayesgrasp {name}" in capsys.readouterr().out


def test_overview_lists_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    main(["--help"])
    out = capsys.readouterr().out
    for name, command in COMMANDS.items():
        assert name in out
        assert command.summary in out


def test_overview_imports_nothing_heavy() -> None:
    code = (
        "import sys; from bayesgrasp.cli.main import main; main(['--help']); "
        f"print([name for name in {HEAVY} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_the_installed_script_tells_its_version() -> None:
    code = "from bayesgrasp.cli.main import main; main(['--version'])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("bayesgrasp 0.")


def test_options_reach_the_command(command: dict[str, object]) -> None:
    main(["act", "--number", "7"])
    assert command["number"] == 7


def test_a_group_s_command_runs_and_the_group_alone_lists_itself(
    command: dict[str, object], capsys: pytest.CaptureFixture[str]
) -> None:
    main(["group", "one", "--number", "3"])
    assert command["number"] == 3
    assert run_in_process(["group"]) == 0
    out = capsys.readouterr().out
    assert "group one" in out
    assert "Act." not in out


@pytest.mark.usefixtures("command")
@pytest.mark.parametrize(
    "args", [["nothing"], ["group", "two"], ["--nothing"], ["act", "--nothing"], ["act", "--number", "x"]]
)
def test_wrong_input_leaves_with_2_and_says_so(args: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run_in_process(args) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert args[-1] in captured.err


def test_our_errors_become_one_line(command: dict[str, object], capsys: pytest.CaptureFixture[str]) -> None:
    command["raise"] = AssetError("no object 'x'; there are 'a' and 'b'")
    assert run_in_process(["act"]) == 2
    assert capsys.readouterr().err == "error: no object 'x'; there are 'a' and 'b'\n"


def test_a_file_that_cannot_be_opened_is_named(command: dict[str, object], capsys: pytest.CaptureFixture[str]) -> None:
    command["raise"] = FileNotFoundError(2, "No such file or directory", "nowhere/report.json")
    assert run_in_process(["act"]) == 2
    assert capsys.readouterr().err == "error: nowhere/report.json: No such file or directory\n"


def test_an_interruption_leaves_with_130(command: dict[str, object], capsys: pytest.CaptureFixture[str]) -> None:
    command["raise"] = KeyboardInterrupt()
    assert run_in_process(["act"]) == 130
    assert "Traceback" not in capsys.readouterr().err


def test_errors_that_are_not_ours_are_not_hidden(command: dict[str, object]) -> None:
    for bug in (ZeroDivisionError("a bug"), OSError("a failure without a file")):
        command["raise"] = bug
        with pytest.raises(type(bug)):
            main(["act"])


@pytest.mark.parametrize(("words", "level"), [([], logging.WARNING), (["--verbose"], logging.INFO)])
def test_verbose_sets_the_level_wherever_it_stands(command: dict[str, object], words: list[str], level: int) -> None:
    logging.getLogger().handlers.clear()
    main(["act", *words])
    assert logging.getLogger().level == level
    assert command["number"] == 1
