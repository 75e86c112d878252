"""The compiled head against the graph that it stands for: values, gradients, and when it is used."""

from collections.abc import Callable
from dataclasses import replace

import pytest
import torch

from bayesgrasp.data.schema import Batch
from bayesgrasp.geometry.grasp_space import GraspSpace
from bayesgrasp.ratio.fused.local_head import ROWS
from bayesgrasp.ratio.kinds import build
from bayesgrasp.ratio.local import Context, LocalConfig, LocalSuccess
from bayesgrasp.types import Hands

MakeHands = Callable[..., Hands]
SHAPES = {
    "whole image": {},
    "window": {"window": (4, 6, 24, 32)},
    "one surface, every point": {"surfaces": 1, "every": 1, "features": 3},
    "one hidden layer": {"widths": (8,)},
}


@pytest.fixture(params=SHAPES)
def estimator(request: pytest.FixtureRequest, local: LocalConfig) -> LocalSuccess:
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(4)
        module = build("local", replace(local, **SHAPES[request.param]))
        assert isinstance(module, LocalSuccess)
        # An untrained head hardly looks at the image.
        for weight in module.head.parameters():
            weight.data.mul_(3.0)
    return module.eval().requires_grad_(False)


@pytest.fixture
def context(estimator: LocalSuccess, batch: Callable[..., Batch]) -> Context:
    rng = torch.Generator().manual_seed(5)
    images = batch(1, 1, 0).images
    rough = 0.1 * torch.rand(images.shape, generator=rng)
    return estimator.encode((images + rough) * (torch.rand(images.shape, generator=rng) > 0.1))


def row(hands: Hands) -> Hands:
    return Hands(hands.position[None], hands.rotation[None], hands.grasp_type[None])


def by_graph(estimator: LocalSuccess, context: Context, hands: Hands) -> torch.Tensor:
    """Through the graph: weights that want a gradient are not for the compiled head."""
    estimator.requires_grad_(True)
    try:
        return estimator(context, hands)
    finally:
        estimator.requires_grad_(False)


def with_gradient(forward: Callable[[Hands], torch.Tensor], hands: Hands) -> tuple[torch.Tensor, ...]:
    position, rotation = (part.clone().requires_grad_() for part in (hands.position, hands.rotation))
    value = forward(Hands(position, rotation, hands.grasp_type))
    return value.detach(), *torch.autograd.grad(value.sum(), (position, rotation))


def off(found: torch.Tensor, expected: torch.Tensor) -> torch.Tensor:
    """Relative error of each hand's derivative."""
    difference = (found - expected).flatten(2).norm(dim=-1)
    return difference / expected.flatten(2).norm(dim=-1)


def test_values_and_gradients_are_those_of_the_graph(
    estimator: LocalSuccess, context: Context, hands: MakeHands, rng: torch.Generator
) -> None:
    """Wherever a point is: in view, at the border, outside; exactly between two pixels rounding decides the slope."""
    some = row(hands((500,), rng))
    some = replace(some, position=some.position * torch.tensor([3.0, 3.0, 1.0]))
    found = with_gradient(lambda h: estimator(context, h), some)
    expected = with_gradient(lambda h: by_graph(estimator, context, h), some)
    torch.testing.assert_close(found[0], expected[0], rtol=1e-4, atol=1e-4)
    for mine, other in zip(found[1:], expected[1:], strict=True):
        assert off(mine, other).quantile(0.9) < 1e-4
        assert off(mine, other).quantile(0.99) < 1e-2


def test_behind_the_camera_the_gradients_are_those_of_the_graph(
    estimator: LocalSuccess, context: Context, hands: MakeHands, rng: torch.Generator
) -> None:
    some = row(hands((50,), rng))
    some = replace(some, position=some.position + torch.tensor([0.4, 0.0, 0.6]))
    found = with_gradient(lambda h: estimator(context, h), some)
    expected = with_gradient(lambda h: by_graph(estimator, context, h), some)
    torch.testing.assert_close(found[0], expected[0], rtol=1e-4, atol=1e-4)
    for mine, other in zip(found[1:], expected[1:], strict=True):
        assert off(mine, other).quantile(0.9) < 1e-4


def test_values_do_not_depend_on_how_many_are_asked_for(
    estimator: LocalSuccess, context: Context, hands: MakeHands, rng: torch.Generator
) -> None:
    some = row(hands((2 * ROWS + 3,), rng))
    whole = estimator(context, some)
    assert whole.shape == (1, 2 * ROWS + 3)
    torch.testing.assert_close(estimator(context, some[:, 5:9]), whole[:, 5:9])
    assert estimator(context, some[:, :0]).shape == (1, 0)


def test_the_compiled_head_is_used_for_plans_and_for_nothing_else(
    estimator: LocalSuccess, context: Context, hands: MakeHands, rng: torch.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []
    fused = LocalSuccess._fused
    monkeypatch.setattr(LocalSuccess, "_fused", lambda self, context: asked.append(1) or fused(self, context))
    some = row(hands((4,), rng))
    estimator(context, some)
    assert len(asked) == 1
    by_graph(estimator, context, some)
    estimator(Context(*(part.requires_grad_() for part in context)), some)
    estimator.double()
    estimator(Context(*(part.detach().double() for part in context)), some.to(dtype=torch.float64))
    assert len(asked) == 1


def test_a_value_has_a_slope_along_the_manifold(
    estimator: LocalSuccess, context: Context, hands: MakeHands, rng: torch.Generator
) -> None:
    """The compiled gradient predicts what a small displacement changes, for nearly every hand."""
    some = hands((200,), rng)
    _, by_position, by_rotation = with_gradient(lambda h: estimator(context, h), row(some))
    tangent = 1e-3 * torch.randn(200, 6, generator=rng) * torch.tensor([0.1] * 3 + [1.0] * 3)
    moved = [GraspSpace().retract(some, sign * tangent) for sign in (1.0, -1.0)]
    change = estimator(context, row(moved[0])) - estimator(context, row(moved[1]))
    predicted = (by_position[0] * (moved[0].position - moved[1].position)).sum(-1)
    predicted = predicted + (by_rotation[0] * (moved[0].rotation - moved[1].rotation)).sum((-2, -1))
    error = (change[0] - predicted).abs()
    assert error.quantile(0.8) < 0.1 * change.abs().quantile(0.8)


def test_a_network_that_looks_at_more_points_begins_as_the_one_it_starts_from(
    estimator: LocalSuccess, context: Context, hands: MakeHands, rng: torch.Generator
) -> None:
    """Whatever the further points show, and with an output for holding, which begins as that for success."""
    config = estimator.config
    further = tuple((x + 0.011, y - 0.007, z) for x, y, z in config.evidence.points[:7])
    evidence = replace(config.evidence, points=config.evidence.points + further)
    with torch.random.fork_rng(devices=[]):
        wider = build("local", replace(config, evidence=evidence, held=True)).eval().requires_grad_(False)
    assert isinstance(wider, LocalSuccess)
    wider.load_state_dict(wider.weights_from(estimator))
    some = row(hands((20,), rng))
    torch.testing.assert_close(wider(context, some), estimator(context, some), atol=1e-4, rtol=1e-4)
    success, held = wider.both(context, some)
    torch.testing.assert_close(held, success, atol=1e-5, rtol=1e-5)
