"""Plans tried on fresh objects: refused where the objects are not fresh, kept in the card, and used by the planner."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from untrained_model import OBJECTS, save_untrained

from bayesgrasp.errors import CheckpointError, InvalidConfigurationError
from bayesgrasp.evaluation.journal import NO_PLAN, SceneResult, Trial
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.ratio.card import read_card, write_card
from bayesgrasp.ratio.checkpoint import join_models
from bayesgrasp.seeding import generator
from bayesgrasp.workflows.delivery import DeliveryJob, Uncalibrated
from bayesgrasp.workflows.load import load_planner

COUNT = 120


@pytest.fixture
def model(tmp_path: Path) -> Path:
    return save_untrained(tmp_path / "model")


def fresh(count: int = COUNT):
    """As many objects, of which there is only one."""
    asset = load_objects("household_hammer")[0]
    return tuple(replace(asset, id=f"made-up-{number}") for number in range(count))


def results(rate: float) -> list[SceneResult]:
    """Plans that promise 90 % and deliver another rate, and one that was declined."""
    success = generator(0).random(COUNT) < rate
    trials = [Trial("success" if won else "dropped", 0.1, promised=0.9) for won in success]
    trials.append(Trial(NO_PLAN, 0.1))
    scene = {"object_pose": (0.0, 0.0, 0.0), "lateral_friction": 1.0, "spinning_friction": 0.001, "mass_factor": 1.0}
    return [
        SceneResult(number, f"made-up-{number}", number, 1.0, trials={"plan": trial}, **scene)
        for number, trial in enumerate(trials)
    ]


def test_what_plans_delivered_is_kept_and_calibrates_the_planner(model: Path) -> None:
    job = DeliveryJob(model, fresh(), "made up")
    before = load_planner(model).likelihood.success_probability(torch.log(torch.tensor([0.9])))
    delivery = job.write(results(0.6))
    assert len(delivery.promised) == COUNT
    planner = load_planner(model)
    assert planner.likelihood.delivered is not None
    assert planner.likelihood.delivered.objects == "made up"
    after = planner.likelihood.success_probability(torch.log(torch.tensor([0.9])))
    assert before.item() == pytest.approx(0.9, abs=1e-5)
    assert after.item() == pytest.approx(delivery.success.mean(), abs=0.02)
    raw = Uncalibrated(model).load().planner
    assert raw.likelihood.delivered is None
    assert raw.likelihood.success_probability(torch.log(torch.tensor([0.9]))).item() == pytest.approx(0.9, abs=1e-5)
    assert raw.config.selection.least_success == 0.0


def test_what_other_weights_delivered_is_refused_and_not_joined(model: Path, tmp_path: Path) -> None:
    DeliveryJob(model, fresh(), "made up").write(results(0.6))
    card = read_card(model)
    join_models([model], tmp_path / "same")
    assert read_card(tmp_path / "same")["delivery"] == card["delivery"]
    write_card(tmp_path / "same", card | {"delivery": card["delivery"] | {"weights": ["0" * 64]}})
    with pytest.raises(CheckpointError, match="what other weights delivered: calibrate"):
        read_card(tmp_path / "same")


def test_objects_of_the_training_are_not_fresh(model: Path) -> None:
    with pytest.raises(InvalidConfigurationError, match="were trained with"):
        DeliveryJob(model, load_objects(OBJECTS[0]) + fresh(), "mixed")
    with pytest.raises(InvalidConfigurationError, match="at least 100 objects"):
        DeliveryJob(model, fresh(99), "few")
    with pytest.raises(CheckpointError, match="no model"):
        DeliveryJob(model / "nothing", fresh(), "made up")


def test_too_few_plans_change_nothing(model: Path) -> None:
    before = read_card(model)
    with pytest.raises(InvalidConfigurationError, match="at least 100 plans"):
        DeliveryJob(model, fresh(), "made up").write(results(0.6)[:50])
    assert read_card(model) == before


def test_plans_are_tried_whatever_they_promise(model: Path, tmp_path: Path) -> None:
    """The untrained model promises less than 50 % everywhere or more; both are tried."""
    job = DeliveryJob(model, fresh(), "made up")
    object.__setattr__(job, "objects", job.objects[:2])
    first = job.run(tmp_path / "run")
    assert [result.object for result in first] == ["made-up-0", "made-up-1"]
    promised = [result.trials["plan"].promised for result in first]
    assert all(p is None or 0 <= p <= 1 for p in promised)
    again = job.run(tmp_path / "run", resume=True)
    assert np.array_equal([r.object_pose for r in again], [r.object_pose for r in first])
