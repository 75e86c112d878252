"""Calibration: the same report for any number of processes, told as it goes on, and refused before the work."""

from pathlib import Path

import numpy as np
import pytest
import torch
from untrained_model import save_untrained

from bayesgrasp.errors import CheckpointError
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.workflows.calibrate import CalibrationJob, calibrate
from bayesgrasp.workflows.success_pairs import Attempted, SuccessPairs

PAIRS = 4


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> CalibrationJob:
    return CalibrationJob((save_untrained(tmp_path_factory.mktemp("calibrate") / "model"),), proposals=200, seed=3)


def evidence() -> tuple[SuccessPairs, list[Attempted]]:
    rng = np.random.default_rng(0)
    images = torch.from_numpy(rng.uniform(0.6, 0.8, (PAIRS, 1, 160, 256)).astype(np.float32))
    hands = GraspPrior().sample(PAIRS, rng)
    success = torch.tensor([[1.0], [0.0], [1.0], [0.0]])
    return SuccessPairs(images, hands), [Attempted(images, hands[:, None], success, torch.ones(PAIRS, 1))]


def test_the_report_is_the_same_for_any_number_of_processes(job: CalibrationJob) -> None:
    told: list[int] = []
    alone, together = (calibrate(job, *evidence(), workers, told.append).to_dict() for workers in (1, 2))
    assert told == 2 * list(range(1, PAIRS + 1))
    assert alone == together
    assert alone["expected_coverage"]["count"] == alone["reliability"]["count"] == PAIRS  # type: ignore[index]


def test_a_missing_model_is_refused_before_the_work(tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match="no model"):
        CalibrationJob((tmp_path / "nothing",))
