"""The one entry point: finds the command, turns its signature into options, and turns our errors into one line.

A command is a typed, documented function in a file of its own; it is imported only when it is the one to run, so
that ``bayesgrasp --help`` answers at once; so does ``bayesgrasp COMMAND --help``, for which what the file works with is
only outlined (`cli.outline`).

Exit codes: 0 done; 2 wrong input or options, or a disk that is full or refuses, said in one line; 3 `plan` found no
grasp, and says why; 130 interrupted (Ctrl-C); 143 terminated (SIGTERM); 141 standard output was closed by its reader.
1, with a traceback, is a bug.
"""

import importlib
import importlib.metadata
import logging
import sys
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from itertools import takewhile

from bayesgrasp.cli.endings import (
    EXIT_CLOSED,
    EXIT_ERROR,
    EXIT_INTERRUPTED,
    EXIT_TERMINATED,
    OrderlyEnd,
    TerminatedError,
    output_is_closed,
    turn_output_off,
)
from bayesgrasp.cli.outline import outlined
from bayesgrasp.errors import BayesgraspError
from bayesgrasp.files import NO_ROOM


@dataclass(frozen=True)
class Command:
    """Where a command lives and what it does, in one line.

    Attributes:
        target: ``module:function`` below ``bayesgrasp.cli``.
        summary: One line for ``bayesgrasp --help``.
    """

    target: str
    summary: str

    def load(self) -> Callable[..., None]:
        """Import the module and return the function."""
        module, function = self.target.split(":")
        loaded: Callable[..., None] = getattr(importlib.import_module(f"bayesgrasp.cli.{module}"), function)
        return loaded


ENDS = (
    "0 done; 2 wrong input; 3 `plan` found no grasp; 130 interrupted; 143 terminated; 141 output closed;\n"
    "            1 a bug, with its traceback"
)
"""Exit codes, for `bayesgrasp --help`."""
# In the order in which one would use them.
COMMANDS: dict[str, Command] = {
    "demo": Command("demo:demo", "Plan a grasp for a simulated object from its depth image, and try it."),
    "plan": Command("plan:plan", "Plan grasps from a depth image."),
    "view": Command(
        "view:view", "Look at a plan in the browser: points, posterior, ranked grasps, constraints set by hand."
    ),
    "serve": Command("serve:serve", "Plan grasps for whoever asks over HTTP."),
    "objects list": Command("objects:list_objects", "List the objects of the catalogue."),
    "objects show": Command(
        "objects:show",
        "Describe one object and draw it, its mesh and its convex parts, or draw all objects of a split.",
    ),
    "objects fetch": Command("objects:fetch", "Download YCB scans from the official archives."),
    "gripper show": Command("gripper:show", "Describe a gripper, and draw it open, half way and closed."),
    "simulate": Command("simulate:simulate", "Run lift tests on hand configurations drawn from the prior."),
    "render": Command("render:render", "Render the depth image of an object on the table."),
    "practice": Command(
        "practice:practice",
        "Try the hands that a model proposes for new scenes, and keep the outcomes as training data.",
    ),
    "generate": Command("generate:generate", "Simulate lift tests and depth images, and keep them for training."),
    "train": Command("train:train", "Train likelihood-to-evidence ratio estimators on a data set."),
    "mix": Command("mix:mix", "Mix the weights of a model with those that its training started from."),
    "benchmark": Command(
        "benchmark:benchmark", "Measure the success rates of the paper's strategies and of two baselines."
    ),
    "transfer": Command(
        "transfer:transfer", "Measure what strategies lose to another engine, other objects, and another sensor."
    ),
    "data inspect": Command(
        "data:inspect",
        "Print the manifest, the outcomes, the success of each object, what its hands are worth and the disk use.",
    ),
    "diagnose": Command("diagnose:diagnose", "Judge a trained posterior by simulated successes that it has not seen."),
    "calibrate": Command(
        "calibrate:calibrate", "Calibrate what a model promises by what its plans deliver on fresh objects."
    ),
    "reproduce": Command(
        "reproduce:reproduce", "Run the whole experiment: data, training, diagnostics, benchmark, report."
    ),
    "doctor": Command("doctor:doctor", "Report versions, hardware, caches, and what is missing."),
    "completion": Command("completion:completion", "Print a script that makes a shell complete commands and options."),
}


def main(args: Sequence[str] | None = None) -> None:
    """Run the command line and leave with its exit code (see the module's docstring).

    Args:
        args: What was typed after ``bayesgrasp``; by default `sys.argv`.
    """
    words = list(sys.argv[1:] if args is None else args)
    logging.basicConfig(level=logging.INFO if "--verbose" in words else logging.WARNING, format="%(name)s: %(message)s")
    words = [word for word in words if word != "--verbose"]
    with OrderlyEnd() as end:
        try:
            _dispatch(words, end)
            sys.stdout.flush()
        except BayesgraspError as error:
            raise _leave(EXIT_ERROR, f"error: {error}") from error
        except OSError as error:
            raise _after_failure(error) from error
        except KeyboardInterrupt:
            raise _leave(EXIT_INTERRUPTED, "interrupted") from None
        except TerminatedError:
            raise _leave(EXIT_TERMINATED, "terminated") from None


def _leave(code: int, message: str) -> SystemExit:
    print(message, file=sys.stderr)
    return SystemExit(code)


def _after_failure(error: OSError) -> BaseException:
    """The end that a failure of the operating system asks for; the failure itself where it is one of ours."""
    if isinstance(error, BrokenPipeError) and output_is_closed():
        turn_output_off()
        return SystemExit(EXIT_CLOSED)
    if error.filename is not None:  # a file that the user named
        return _leave(EXIT_ERROR, f"error: {error.filename}: {error.strerror}")
    if error.errno in NO_ROOM:
        turn_output_off()
        return _leave(EXIT_ERROR, f"error: standard output cannot be written: {error.strerror}")
    return error


def _dispatch(words: list[str], end: OrderlyEnd) -> None:
    if words == ["--version"]:
        print(f"bayesgrasp {importlib.metadata.version('bayesgrasp')}")
        return
    if words in ([], ["--help"], ["-h"]):
        print(_overview(COMMANDS))
        return
    name = _find(words)
    _run(name, words[len(name.split()) :], end)


def _run(name: str, options: list[str], end: OrderlyEnd) -> None:
    # Imported here, so that `bayesgrasp --help` does not wait for it.
    import tyro

    with outlined() if _asks_for_help(options) else nullcontext():
        command = COMMANDS[name].load()
        end.loaded()
        tyro.cli(command, prog=f"bayesgrasp {name}", args=options, config=(tyro.conf.DisallowNone,))


def _asks_for_help(options: list[str]) -> bool:
    return not {"--help", "-h"}.isdisjoint(takewhile(lambda word: word != "--", options))


def _find(words: list[str]) -> str:
    """The longest command name that starts ``words``; leaves with help where there is none."""
    for length in (2, 1):
        if (name := " ".join(words[:length])) in COMMANDS:
            return name
    group = {name: command for name, command in COMMANDS.items() if name.split()[0] == words[0]}
    if group and words[1:] in ([], ["--help"], ["-h"]):
        print(_overview(group))
        raise SystemExit(0)
    print(_overview(group or COMMANDS), file=sys.stderr)
    print(f"\nerror: there is no command '{' '.join(words[:2] if group else words[:1])}'", file=sys.stderr)
    raise SystemExit(EXIT_ERROR)


def _overview(commands: dict[str, Command]) -> str:
    width = max(map(len, commands))
    lines = (f"  {name:{width}}  {command.summary}" for name, command in commands.items())
    return "\n".join(
        (
            "usage: bayesgrasp [--help] [--version] [--verbose] COMMAND [OPTIONS]",
            "",
            "Plan multi-fingered grasps from one depth image by simulation-based Bayesian inference.",
            "",
            "commands:",
            *lines,
            "",
            "`bayesgrasp COMMAND --help` lists the options of a command.",
            "",
            f"exit codes: {ENDS}",
        )
    )
