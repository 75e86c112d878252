"""The second output, p(held | i, h): learned beside the first, started from weights that do not have it, told."""

import numpy as np
import pytest
import torch
from small_batches import make_batch

from bayesgrasp.errors import CheckpointError
from bayesgrasp.planning.selection import Candidates, SelectionConfig
from bayesgrasp.ratio.evidence import PointsConfig, ViewConfig, canonical_view
from bayesgrasp.ratio.local import LocalConfig, LocalSuccess
from bayesgrasp.ratio.model import GraspModel
from bayesgrasp.training.objectives import SuccessObjective
from bayesgrasp.training.train_estimator import initialised
from bayesgrasp.training.train_model import weights_for


def network(held: bool) -> LocalSuccess:
    view = canonical_view()
    small = ViewConfig(20, 32, (29.0, 24.0), (15.5, 9.5), view.rotation, view.translation)
    config = LocalConfig(evidence=PointsConfig(small), channels=(2, 2, 2, 2), widths=(8, 8), held=held)
    return initialised(lambda: LocalSuccess(config), 0)  # type: ignore[return-value]


def test_both_outputs_are_learned_and_the_first_is_as_without_the_second() -> None:
    batch = make_batch(2, 4, 0)
    one, two = network(False), network(True)
    two.load_state_dict(weights_for(two, one))
    images = torch.linspace(0.5, 0.9, 2 * 20 * 32).reshape(2, 1, 20, 32)
    one.eval(), two.eval()
    context = two.encode(images)
    success, held = two.both(context, batch.hands)
    torch.testing.assert_close(success, one(one.encode(images), batch.hands))
    torch.testing.assert_close(held, success)  # the new output begins as that for success
    objective = SuccessObjective()
    changed = type(batch)(**{**vars(batch), "images": images, "held": 1 - batch.success})
    same = type(batch)(**{**vars(batch), "images": images})
    rng = torch.Generator()
    alone = objective.loss(one, same, rng)
    torch.testing.assert_close(objective.loss(two, same, rng), 2 * alone)
    assert objective.loss(two, changed, rng) != 2 * alone


def test_a_model_says_whether_it_knows() -> None:
    batch, image = make_batch(1, 4, 1), torch.linspace(0.5, 0.9, 20 * 32).reshape(1, 20, 32)
    old, new = (GraspModel({"success": network(held).eval()}, {}) for held in (False, True))
    assert not old.holds
    assert new.holds
    assert (new.held_given_image(image)(batch.hands[0]) < 0).all()
    with pytest.raises(CheckpointError, match="not trained"):
        old.held_given_image(image)(batch.hands[0])


def test_candidates_are_ranked_by_what_is_asked_for() -> None:
    hands = make_batch(1, 3, 2).hands[0]
    three = Candidates(
        hands, torch.tensor([1.0, 2.0, 3.0]), torch.tensor([0.9, 0.5, 0.6]), torch.tensor([0.1, 0.8, 0.4])
    )
    order = {rank: three.ranked(SelectionConfig(rank=rank)) for rank in ("success", "held", "posterior")}  # type: ignore[arg-type]
    assert order == {"success": [0, 2, 1], "held": [1, 2, 0], "posterior": [2, 1, 0]}
    assert np.isfinite(three.probability.numpy()).all()
