"""``bayesgrasp completion``: what a shell needs to complete commands, options and choices.

The entry point runs one command at a time, so tyro never sees them together. For the script they are put together as
one program, each command read as its help is (`outline`), so nothing heavy is imported.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, Literal, Union

import tyro

from bayesgrasp.cli.main import COMMANDS, Command
from bayesgrasp.cli.outline import outlined

PLAIN = (tyro.conf.DisallowNone, tyro.conf.OmitSubcommandPrefixes, tyro.conf.OmitArgPrefixes)


def completion(shell: Annotated[Literal["bash", "zsh", "tcsh"], tyro.conf.Positional]) -> None:
    """Print a script that makes a shell complete commands and options.

    For bash, once: `bayesgrasp completion bash > ~/.local/share/bash-completion/completions/bayesgrasp`. For zsh, into
    a directory of $fpath: `bayesgrasp completion zsh > ~/.zfunc/_bayesgrasp`.

    Args:
        shell: Which shell.
    """
    with outlined():
        program = _together(COMMANDS)
        tyro.cli(program, prog="bayesgrasp", args=["--tyro-print-completion", shell], config=PLAIN)


def _together(commands: dict[str, Command]) -> Any:
    """All commands as one type of tyro's, those of two words below their first."""
    groups: dict[str, dict[str, Command]] = {}
    for name, command in commands.items():
        first, _, second = name.partition(" ")
        groups.setdefault(first, {})[second] = command
    return _choice({first: _one(first, below) for first, below in groups.items()})


def _one(first: str, below: dict[str, Command]) -> tuple[str, Callable[..., None]]:
    """What a first word stands for, in words and as a function: a command, or a choice of commands."""
    if "" in below:
        return below[""].summary, below[""].load()
    summary = f"The commands {', '.join(f'{first} {second}' for second in below)}."

    def group(command: Any) -> None: ...

    chosen = _choice({second: (command.summary, command.load()) for second, command in below.items()})
    group.__annotations__["command"] = Annotated[chosen, tyro.conf.arg(name="")]
    return summary, group


def _choice(functions: dict[str, tuple[str, Callable[..., None]]]) -> Any:
    described = (
        Annotated[Any, tyro.conf.subcommand(name=name, constructor=function, description=summary)]
        for name, (summary, function) in functions.items()
    )
    return Union[tuple(described)]  # noqa: UP007 - of a number that only the table knows
