"""``bayesgrasp reproduce``: the small experiment climbs the ladder."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from bayesgrasp.cli.main import main


def test_the_small_experiment_climbs_the_ladder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Prior < no image < image < full observation, in minutes; in a process of its own, as a user would run it."""
    words = ["reproduce", "--out", str(tmp_path / "small"), "--scale", "small", "--workers", "1"]
    command = [sys.executable, "-c", "from bayesgrasp.cli.main import main; main()", *words]
    subprocess.run(command, check=True, capture_output=True)
    summary = json.loads((tmp_path / "small" / "benchmark-stand-ins" / "summary.json").read_text())
    ladder = ("prior_sample", "map_success_ratio", "map_image", "map_full")
    rates = [summary["strategies"][name]["success_rate"] for name in ladder]
    assert rates == sorted(rates)
    assert len(set(rates)) == len(rates), rates
    page = (tmp_path / "small" / "report.html").read_text()
    assert page.count('src="data:image/png;base64,') == 8
    assert "There is no" not in page
    main(words)
    assert capsys.readouterr().out.count("done before") == 7
