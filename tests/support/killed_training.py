"""Runs ``bayesgrasp train`` undisturbed, and again and again with SIGKILL until it has been killed often enough.

Started by `test_train_killed.py` as a program of its own: it imports everything once and forks for each run. A run is
killed a random moment after its state was saved anew. The undisturbed model is in FOLDER/whole, the other one in
FOLDER/killed. Usage: ``killed_training.py KILLS SEED FOLDER OPTIONS...``.
"""

import os
import random
import signal
import sys
import time
from pathlib import Path

import torch
import torch._dynamo  # the first optimiser imports it, which would be once in every fork

from bayesgrasp.cli.main import main


def train(out: Path, options: list[str]) -> None:
    main(["train", "--out", str(out), "--resume", *options])


def states(out: Path) -> set[tuple[str, int]]:
    return {(path.name, path.stat().st_mtime_ns) for path in (out / "state").glob("*.safetensors")}


def forked(out: Path, options: list[str]) -> int:
    """Start a run in a process of its own."""
    child = os.fork()
    if child == 0:
        train(out, options)
        os._exit(0)
    return child


def killed(out: Path, options: list[str], patience: float) -> bool:
    """Start a run and kill it a while after the next saved state; whether it was still running."""
    before, child, status = states(out), forked(out, options), None
    while status is None and states(out) <= before:
        done, result = os.waitpid(child, os.WNOHANG)
        status = result if done else None
        time.sleep(0.005)
    if status is None:
        time.sleep(patience)
        os.kill(child, signal.SIGKILL)
        _, status = os.waitpid(child, 0)
    if os.WIFEXITED(status) and os.WEXITSTATUS(status) != 0:
        raise SystemExit(f"a run failed with {status}")
    return os.WIFSIGNALED(status)


def run() -> None:
    kills, rng, folder, options = int(sys.argv[1]), random.Random(int(sys.argv[2])), Path(sys.argv[3]), sys.argv[4:]
    torch.set_num_threads(1)  # a fork has no copies of the threads
    out, count = folder / "killed", 0
    while count < kills and killed(out, options, rng.uniform(0.0, 0.2)):
        count += 1
    sys.stdout.write(f"killed {count} times\n")
    train(out, options)
    train(folder / "whole", options)


if __name__ == "__main__":
    run()
