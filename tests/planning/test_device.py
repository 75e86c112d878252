"""A plan is computed where the model is: tensors follow the hands."""

import numpy as np
import pytest
import torch
from box_scene import Box as Thing
from box_scene import box_depth_image
from torch.overrides import TorchFunctionMode
from untrained_model import save_untrained

import bayesgrasp
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry.box import Box
from bayesgrasp.geometry.camera import canonical_camera
from bayesgrasp.planning.constraints import Constraints
from bayesgrasp.planning.planner import Planner

CAMERA = canonical_camera()
LIMITS = Constraints(keep_out=(Box((-0.4, -0.4, 0.0), (0.4, -0.12, 0.6)),))


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> str:
    return str(save_untrained(tmp_path_factory.mktemp("device") / "model"))


@pytest.fixture(scope="module")
def depth() -> np.ndarray:
    return box_depth_image(CAMERA, (Thing(x=0.02),))


def answers(planner: Planner, depth: np.ndarray) -> list[object]:
    """Everything that a search, a chain and a mode compute, as plain numbers."""
    plans = [planner.plan(depth, CAMERA, samples=60, seed=1, constraints=c) for c in (Constraints(), LIMITS)]
    found = [{k: v for k, v in plan.to_dict().items() if k != "timings_ms"} for plan in plans]
    posterior = plans[0].posterior
    assert posterior is not None
    assert plans[0].samples is not None
    mode, drawn = posterior.mode(), plans[0].samples.hands
    return [found, mode.position.tolist(), posterior.log_prob(drawn).tolist(), posterior.marginals(100).to_dict()]


class DevicesNamed(TorchFunctionMode):
    """Refuses to make a tensor whose device is not named."""

    MAKERS = frozenset(
        {
            *(torch.arange, torch.empty, torch.eye, torch.full, torch.linspace, torch.ones, torch.rand, torch.randint),
            *(torch.randn, torch.randperm, torch.tensor, torch.zeros),
        }
    )

    def __torch_function__(self, func, types, args=(), kwargs=None):  # type: ignore[no-untyped-def]
        if func in self.MAKERS and (kwargs or {}).get("device") is None:
            raise AssertionError(f"{func.__name__} makes a tensor on the default device")
        return func(*args, **(kwargs or {}))


def test_no_tensor_is_made_on_the_default_device(model: str, depth: np.ndarray) -> None:
    planner = bayesgrasp.load(model)
    expected = answers(planner, depth)
    with DevicesNamed():
        assert answers(planner, depth) == expected


def test_a_tensor_of_the_default_device_is_noticed() -> None:
    with DevicesNamed(), pytest.raises(AssertionError, match="zeros makes"):
        torch.zeros(3)
    with DevicesNamed():
        assert torch.zeros(3, device="cpu").add(1).tolist() == [1.0, 1.0, 1.0]


@pytest.mark.skipif(not torch.cuda.is_available(), reason="torch has no CUDA device here")
def test_a_plan_on_the_gpu_is_as_good(model: str, depth: np.ndarray) -> None:
    here, there = (bayesgrasp.load(model, device=device).plan(depth, CAMERA, samples=60) for device in ("cpu", "cuda"))
    assert there.posterior is not None
    assert here.posterior is not None
    assert there.samples is not None
    drawn = there.samples.hands
    assert drawn.position.device.type == "cpu"
    values = [posterior.log_prob(drawn) for posterior in (here.posterior, there.posterior)]
    torch.testing.assert_close(*values, atol=0.01, rtol=0)
    assert there.grasps[0].success_probability == pytest.approx(here.grasps[0].success_probability, abs=0.02)


@pytest.mark.parametrize("name", ["abacus", "cuda:99", "meta"])
def test_a_device_that_cannot_be_used_is_refused(model: str, name: str) -> None:
    with pytest.raises(InvalidConfigurationError, match="valid: cpu"):
        bayesgrasp.load(model, device=name)
