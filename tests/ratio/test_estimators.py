"""Estimators as functions on R^3 x SO(3) x G: shapes, the double cover, independence of hands, gradients."""

import copy
import json
from collections.abc import Callable
from dataclasses import replace

import pytest
import torch

from bayesgrasp.data.schema import Batch
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry import so3
from bayesgrasp.ratio.estimators import FullConfig, ImageConfig, ObjectState, SuccessRatioConfig, in_object_frame
from bayesgrasp.ratio.evidence import View, canonical_view, sample
from bayesgrasp.ratio.hand_success import HandSuccessConfig
from bayesgrasp.ratio.kinds import KINDS, build, config_from_dict, config_to_dict
from bayesgrasp.ratio.layers import ConvConfig, HandConfig, HandFeatures
from bayesgrasp.ratio.local import WORKSPACE_WINDOW, LocalConfig
from bayesgrasp.ratio.model import GraspModel, SuccessGivenObject
from bayesgrasp.types import Hands

MakeBatch = Callable[..., Batch]
LogRatio = Callable[[Hands], torch.Tensor]
MakeHands = Callable[..., Hands]


@pytest.fixture(scope="module")
def model(encoder: ConvConfig, local: LocalConfig) -> GraspModel:
    config = ImageConfig(encoder=encoder, widths=(16, 16))
    configs = {
        "success_ratio": SuccessRatioConfig(),
        "hand_success": HandSuccessConfig(success_rate=0.02),
        "image": config,
        "joint": config,
        "full": FullConfig(objects=3, octaves=2),
    }
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        estimators = {role: build(role, value) for role, value in configs.items()} | {"success": build("local", local)}
    return GraspModel({role: module.eval().requires_grad_(False) for role, module in estimators.items()}, {})


def every_ratio(model: GraspModel, image: torch.Tensor) -> dict[str, LogRatio]:
    paper, joint = (
        GraspModel({role: model.estimators[role] for role in roles}, {})
        for roles in (("success_ratio", "image"), ("joint",))
    )
    blind = GraspModel({"success_ratio": model.estimators["hand_success"]}, {})
    return {
        "success": model.given_image(image),
        "factorised": paper.given_image(image),
        "joint": joint.given_image(image),
        "success_ratio": model.given_success(),
        "hand_success": blind.given_success(),
        "full": model.given_object(1, 1.05, (0.02, -0.01, 2.0), 0.8),
    }


NAMES = ["success", "factorised", "joint", "success_ratio", "hand_success", "full"]


@pytest.fixture(autouse=True)
def _own_stream() -> object:
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        yield


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("shape", [(), (1,), (5,), (2, 3), (0,)])
def test_any_batch_shape(
    name: str, shape: tuple[int, ...], model: GraspModel, batch: MakeBatch, hands: MakeHands, rng: torch.Generator
) -> None:
    values = every_ratio(model, batch(1, 1, 0).images[0])[name](hands(shape, rng))
    assert values.shape == shape
    assert values.isfinite().all()


@pytest.mark.parametrize("name", NAMES)
def test_a_value_does_not_depend_on_the_other_hands(
    name: str, model: GraspModel, batch: MakeBatch, hands: MakeHands, rng: torch.Generator
) -> None:
    ratio, many = every_ratio(model, batch(1, 1, 0).images[0])[name], hands((7,), rng)
    one_by_one = torch.stack([ratio(many[i]) for i in range(7)])
    torch.testing.assert_close(ratio(many), one_by_one, atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize("name", NAMES)
def test_a_rotation_and_its_antipodal_quaternion_have_one_value(
    name: str, model: GraspModel, batch: MakeBatch, hands: MakeHands, rng: torch.Generator
) -> None:
    ratio, some = every_ratio(model, batch(1, 1, 0).images[0])[name], hands((6,), rng)
    q = so3.matrix_to_quaternion(some.rotation)
    values = [ratio(Hands(some.position, so3.quaternion_to_matrix(s * q), some.grasp_type)) for s in (1.0, -1.0)]
    assert torch.equal(values[0], values[1])
    assert values[0].std() > 0


@pytest.mark.parametrize("name", NAMES)
def test_gradient_along_geodesics(
    name: str, model: GraspModel, batch: MakeBatch, hands: MakeHands, rng: torch.Generator
) -> None:
    """Autograd against central differences, in double precision."""
    model = copy.deepcopy(model)
    for module in model.estimators.values():
        module.double()
    image = batch(1, 1, 0).images[0].double()
    image = image + 0.02 * torch.rand(image.shape, generator=rng, dtype=torch.float64)
    # Above the table and in view: where a look-up leaves the image the value has kinks.
    some = hands((4,), rng, torch.float64)
    some = Hands(some.position * 0.3 + torch.tensor([0.0, 0.0, 0.1]).double(), some.rotation, some.grasp_type)
    ratio = every_ratio(model, image)[name] if name != "full" else _double_full(model)
    direction = torch.randn(4, 6, generator=rng, dtype=torch.float64) * torch.tensor([0.1] * 3 + [1.0] * 3).double()

    def along(t: torch.Tensor) -> torch.Tensor:
        turned = some.rotation @ so3.exp(t[:, None] * direction[:, 3:])
        return ratio(Hands(some.position + t[:, None] * direction[:, :3], turned, some.grasp_type))

    t = torch.zeros(4, dtype=torch.float64, requires_grad=True)
    (slope,) = torch.autograd.grad(along(t).sum(), t)
    step = torch.full((4,), 1e-7, dtype=torch.float64)
    with torch.no_grad():
        difference = (along(step) - along(-step)) / (2 * step)
    torch.testing.assert_close(slope, difference, rtol=1e-3, atol=1e-6)


def _double_full(model: GraspModel) -> LogRatio:
    scale, pose = torch.tensor([1.05]).double(), torch.tensor([[0.02, -0.01, 2.0]]).double()
    return SuccessGivenObject(model.estimators["full"], torch.tensor([1]), scale, pose, 0.8).log_ratio


def test_both_ratios_of_success_come_from_one_probability(
    model: GraspModel, hands: MakeHands, rng: torch.Generator
) -> None:
    """p(S=1) r(S=1 | h) is the probability, and the probabilities of S = 0 and S = 1 add up to one."""
    estimator, some = model.estimators["hand_success"], hands((6,), rng)
    failure, success = (estimator(torch.full((6,), float(s)), some).exp() for s in (0, 1))
    torch.testing.assert_close(0.02 * success, estimator.logit(some).sigmoid())
    torch.testing.assert_close(0.98 * failure + 0.02 * success, torch.ones(6))
    with pytest.raises(InvalidConfigurationError, match="success_rate"):
        HandSuccessConfig(success_rate=0.0)


def test_the_hand_enters_as_thirteen_numbers_scaled_to_the_prior() -> None:
    config = HandConfig()
    corner = Hands(torch.tensor(config.high), torch.eye(3), torch.tensor(1))
    vector = HandFeatures(config)(corner)
    assert vector.shape == (13,)
    torch.testing.assert_close(vector[:3], torch.ones(3))
    torch.testing.assert_close(vector[3:12], torch.eye(3).flatten())


def test_object_frame_features_do_not_change_when_hand_and_object_move_together(
    hands: MakeHands, rng: torch.Generator
) -> None:
    some, ones = hands((1, 5), rng), torch.ones(1, 5)
    still = ObjectState(torch.tensor([0]), torch.tensor([1.1]), torch.tensor([[0.01, 0.02, 0.3]]), ones)
    turn = so3.exp(torch.tensor([0.0, 0.0, 1.2]))
    shift = torch.tensor([0.03, -0.02, 0.0])
    place = turn @ torch.tensor([0.01, 0.02, 0.0]) + shift
    pose = torch.tensor([[place[0], place[1], 1.5]])
    moved = Hands((turn @ some.position[..., None]).squeeze(-1) + shift, turn @ some.rotation, some.grasp_type)
    after = in_object_frame(ObjectState(still.index, still.scale, pose, ones), moved)
    torch.testing.assert_close(after, in_object_frame(still, some), atol=1e-5, rtol=1e-5)


def test_a_mesh_modulates_what_the_full_estimator_sees(hands: MakeHands, rng: torch.Generator) -> None:
    """Without a modulation it changes nothing; one of a mesh changes the values of this mesh alone."""
    config = FullConfig(objects=3, octaves=2, modulated=True)
    estimator = build("full", config).eval()
    plain = build("full", replace(config, modulated=False)).eval()
    plain.load_state_dict({name: v for name, v in estimator.state_dict().items() if "modulation" not in name})
    some, ones = hands((3, 4), rng), torch.ones(3, 4)
    state = ObjectState(torch.arange(3), torch.ones(3), torch.zeros(3, 3), ones)
    torch.testing.assert_close(estimator(state, some), plain(state, some))
    with torch.no_grad():
        estimator.modulation.weight[1] += 0.5
    changed = (estimator(state, some) - plain(state, some)).abs().amax(-1)
    assert changed[1] > 1e-3
    assert changed[[0, 2]].max() < 1e-6


def test_local_evidence_sees_an_obstacle_only_where_the_hand_is(local: LocalConfig) -> None:
    """A patch of the image changes the look-up of the hand over it, and leaves the raw look-up of another one."""
    estimator = build("local", local).eval()
    plane = estimator.points.view.fill(torch.zeros(1, 1, 32, 48))
    bump = plane.clone()
    bump[..., 14:18, 22:26] -= 0.1
    down = torch.tensor([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])
    hands = Hands(
        torch.tensor([[[0.0, 0.0, 0.2], [0.0, -0.15, 0.2]]]), down.expand(1, 2, 3, 3), torch.zeros(1, 2).long()
    )
    raw = len(local.evidence.points) * len(local.evidence.scales)
    with torch.no_grad():
        change = [estimator.look_up(estimator.encode(image), hands)[0, :, :raw] for image in (plane, bump)]
    difference = (change[0] - change[1]).abs().amax(-1)
    assert difference[0] > 0.5
    assert difference[1] < 1e-4


def test_a_window_is_sampled_where_the_whole_image_would_be(local: LocalConfig) -> None:
    """A map of the window, made of the image's own columns, gives the same columns at the same points."""
    window = (4, 8, 16, 32)
    whole, part = (build("local", replace(local, window=w)) for w in (None, window))
    columns = torch.arange(48.0).expand(1, 1, 32, 48)
    grid = torch.rand(1, 3, 5, 2, generator=torch.Generator().manual_seed(0)) * 0.4 - 0.2
    cut = columns[..., 4:20, 8:40]
    torch.testing.assert_close(sample(cut, part.in_window(grid)), sample(columns, whole.in_window(grid)))
    with pytest.raises(InvalidConfigurationError, match="does not fit"):
        replace(local, window=(0, 0, 33, 48))


def test_the_window_of_the_workspace_shows_the_workspace() -> None:
    corners = torch.cartesian_prod(torch.tensor([-0.15, 0.15]), torch.tensor([-0.15, 0.15]), torch.tensor([0.0, 0.3]))
    grid = build("local", LocalConfig(window=WORKSPACE_WINDOW)).in_window(
        View(canonical_view()).project(corners)[0][None, None]
    )
    assert grid.abs().max() < 1.001


@pytest.mark.parametrize("kind", list(KINDS))
def test_configurations_survive_json(kind: str) -> None:
    config = KINDS[kind].config() if kind != "local" else LocalConfig(window=WORKSPACE_WINDOW)
    assert config_from_dict(kind, json.loads(json.dumps(config_to_dict(config)))) == config


def test_wrong_configurations_are_refused() -> None:
    with pytest.raises(InvalidConfigurationError, match="widths"):
        SuccessRatioConfig(widths=())
    with pytest.raises(InvalidConfigurationError, match="low < high"):
        HandConfig(low=(0.0, 0.0, 0.0), high=(1.0, 0.0, 1.0))
    with pytest.raises(InvalidConfigurationError, match="choose from"):
        build("transformer", SuccessRatioConfig())
    with pytest.raises(InvalidConfigurationError, match="needs a ImageConfig"):
        build("image", SuccessRatioConfig())
