"""Joint samples and products of marginals inside a batch, and the weights that go with them."""

from collections.abc import Callable
from dataclasses import replace

import pytest
import torch
from torch import Tensor, nn

from bayesgrasp.data.schema import Batch
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.training.losses import LossConfig
from bayesgrasp.training.objectives import (
    FullObjective,
    ImageObjective,
    SuccessObjective,
    image_samples,
    shifted,
    success_ratio_samples,
    successes,
)
from bayesgrasp.types import Hands

MakeBatch = Callable[..., Batch]


class Stub(nn.Module):
    """Answers with the x coordinate of the hand plus the brightness of the image, so that pairs can be told apart."""

    def encode(self, images: Tensor) -> Tensor:
        return images[:, 0, 0, :1]

    def forward(self, context: Tensor, hands: Hands) -> Tensor:
        return hands.position[..., 0] + 10 * context.expand(hands.shape)


def labelled(batch: Batch, success: list[list[float]], weight: list[list[float]]) -> Batch:
    return replace(batch, success=torch.tensor(success).float(), weight=torch.tensor(weight))


def test_successes_come_first_and_keep_the_weight_of_the_scene(batch: MakeBatch) -> None:
    three = labelled(batch(2, 3, 0), [[0, 1, 1], [0, 0, 0]], [[5.0, 1.0, 3.0], [1.0, 1.0, 1.0]])
    chosen, weight = successes(three, 2)
    assert torch.equal(chosen.position[0], three.hands.position[0, [1, 2]])
    assert weight.tolist() == [[1.0, 3.0], [0.0, 0.0]]
    _, first = successes(three, 1)
    assert first.tolist() == [[4.0], [0.0]]


def test_padding_is_not_a_success(batch: MakeBatch) -> None:
    padded = labelled(batch(1, 3, 0), [[1, 1, 0]], [[0.0, 2.0, 1.0]])
    _, weight = successes(padded, 3)
    assert weight.sum() == 2.0
    assert weight[0, 0] == 2.0


@pytest.mark.parametrize("shifts", [1, 2, 3])
def test_a_scene_never_meets_its_own_hands(batch: MakeBatch, rng: torch.Generator, shifts: int) -> None:
    four = batch(4, 5, 0)
    for _ in range(10):
        hands, weight = shifted(four.hands, four.weight, shifts, rng)
        assert weight.shape == (4, 5 * shifts)
        own = (hands.position[:, :, None] == four.hands.position[:, None]).all(-1).any(-1)
        assert not own.any()


def test_too_few_scenes_are_refused(batch: MakeBatch, rng: torch.Generator) -> None:
    one = batch(1, 5, 0)
    with pytest.raises(InvalidConfigurationError, match="at least two scenes"):
        shifted(one.hands, one.weight, 2, rng)


def test_a_small_batch_meets_all_its_other_scenes_once(batch: MakeBatch, rng: torch.Generator) -> None:
    three = batch(3, 2, 0)
    hands, _ = shifted(three.hands, three.weight, 5, rng)
    assert hands.shape == (3, 4)
    assert len(hands.position[0].unique(dim=0)) == 4


def test_image_pairs_are_weighted_by_both_sides(batch: MakeBatch, rng: torch.Generator) -> None:
    two = labelled(batch(2, 2, 0), [[1, 1], [1, 0]], [[1.0, 2.0], [5.0, 1.0]])
    samples = image_samples(Stub(), two, 2, 1, rng)
    brightness, x = 10 * two.images[:, 0, 0, 0], two.hands.position[..., 0]
    torch.testing.assert_close(samples.joint, x + brightness[:, None])
    torch.testing.assert_close(samples.marginal, x.flip(0) + brightness[:, None])
    assert samples.joint_weight.tolist() == [[1.0, 2.0], [5.0, 0.0]]
    assert samples.marginal_weight.tolist() == [[15.0, 0.0], [5.0, 10.0]]


def test_success_ratio_samples_are_balanced_in_success(batch: MakeBatch) -> None:
    two = labelled(batch(1, 4, 0), [[1, 0, 0, 0]], [[1.0, 1.0, 2.0, 4.0]])
    samples = success_ratio_samples(lambda success, hands: success, two)
    expected = torch.tensor([[0.0, 1 / 7, 2 / 7, 4 / 7], [1.0, 0.0, 0.0, 0.0]])
    torch.testing.assert_close(samples.joint_weight, expected)
    torch.testing.assert_close(samples.marginal_weight, torch.tensor([[1.0, 1, 2, 4]]).expand(2, 4) / 8)


def test_a_batch_without_successes_says_nothing_about_them(batch: MakeBatch) -> None:
    none = labelled(batch(1, 3, 0), [[0, 0, 0]], [[1.0, 1.0, 1.0]])
    samples = success_ratio_samples(lambda success, hands: success, none)
    assert samples.joint_weight[1].sum() == 0
    assert samples.marginal_weight[1].sum() == 0


@pytest.mark.parametrize("emphasis", [1.0, 4.0, 20.0])
def test_emphasis_leaves_the_success_probability_alone(batch: MakeBatch, emphasis: float) -> None:
    """3 of 10 hands succeed: the best constant logit is that of 0.3, whatever the emphasis."""
    ten = replace(batch(1, 10, 0), success=torch.tensor([[1.0] * 3 + [0.0] * 7]))
    objective = SuccessObjective(emphasis)
    logit = torch.zeros(1, 1, requires_grad=True)
    optimizer = torch.optim.LBFGS([logit], line_search_fn="strong_wolfe", max_iter=50)

    def closure() -> Tensor:
        optimizer.zero_grad()
        loss = objective.cross_entropy(logit.expand(1, 10), ten.success, ten)
        loss.backward()
        return loss

    optimizer.step(closure)
    assert float(logit.detach().sigmoid()) == pytest.approx(0.3, abs=1e-3)


def test_success_uses_the_selection_weight_only(batch: MakeBatch) -> None:
    one = batch(1, 6, 0)
    other = replace(one, weight=one.weight * torch.arange(6.0))
    logit = one.hands.position[..., 0]
    changed = replace(one, selection_weight=torch.arange(6.0)[None])
    loss, same, different = (
        SuccessObjective().cross_entropy(logit, batch.success, batch) for batch in (one, other, changed)
    )
    assert torch.equal(loss, same)
    assert not torch.equal(loss, different)


def test_full_objective_passes_the_object_on(batch: MakeBatch, rng: torch.Generator) -> None:
    seen = []

    def estimator(state: object, hands: Hands) -> Tensor:
        seen.append(state)
        return hands.position[..., 0]

    three = batch(3, 2, 0)
    assert FullObjective().loss(estimator, three, rng).isfinite()
    assert torch.equal(seen[0].pose, three.object_pose)  # type: ignore[attr-defined]
    assert torch.equal(seen[0].friction, three.friction)  # type: ignore[attr-defined]


@pytest.mark.parametrize("criterion", ["nre-a", "balanced", "nre-c"])
def test_every_criterion_trains_on_a_batch(batch: MakeBatch, rng: torch.Generator, criterion: str) -> None:
    loss = ImageObjective(LossConfig(criterion), hands=4).loss(Stub(), batch(4, 6, 0), rng)
    assert loss.isfinite()


def test_invalid_objectives_are_refused() -> None:
    with pytest.raises(InvalidConfigurationError, match="emphasis"):
        SuccessObjective(0.0)
    with pytest.raises(InvalidConfigurationError, match="shifts"):
        ImageObjective(shifts=0)
