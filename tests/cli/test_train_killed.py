"""``bayesgrasp train`` after real kills: with --resume it ends with the very files of an undisturbed run."""

import subprocess
import sys
from pathlib import Path

from training_set import make_training_set

OPTIONS = ["--epochs", "3", "--batch-size", "8", "--preset", "paper", "--threads", "1"]
KILLS = 3


def test_a_killed_run_ends_with_the_weights_of_an_undisturbed_one(tmp_path: Path) -> None:
    make_training_set(tmp_path / "data", 2000)
    program = Path(__file__).parents[1] / "support" / "killed_training.py"
    command = [sys.executable, program, str(KILLS), "1", tmp_path, "--data", tmp_path / "data", *OPTIONS]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    assert f"killed {KILLS} times" in done.stdout
    for name in ("success_ratio.safetensors", "image.safetensors"):
        assert (tmp_path / "killed" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
