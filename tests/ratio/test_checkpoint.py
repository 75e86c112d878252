"""Models on disk: what is read gives the values that were written; what does not fit is refused by name."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from bayesgrasp.data.schema import Batch
from bayesgrasp.errors import CheckpointError
from bayesgrasp.geometry.camera import canonical_camera
from bayesgrasp.ratio.checkpoint import CARD, Origin, join_models, load_model, save_model
from bayesgrasp.ratio.estimators import SuccessRatioConfig
from bayesgrasp.ratio.kinds import build
from bayesgrasp.ratio.local import LocalConfig
from bayesgrasp.ratio.model import GraspModel
from bayesgrasp.training.train_estimator import initialised
from bayesgrasp.types import Hands


@pytest.fixture
def directory(tmp_path: Path, local: LocalConfig) -> Path:
    estimators = {
        "success": initialised(lambda: build("local", local), 0).eval(),
        "success_ratio": initialised(lambda: build("success_ratio", SuccessRatioConfig()), 0).eval(),
    }
    save_model(tmp_path, estimators, Origin(data="abc", objects=("mug",)), {"success_ratio": {"loss": 1.25}})
    return tmp_path


def edit(directory: Path, **changes: object) -> None:
    card = json.loads((directory / CARD).read_text())
    (directory / CARD).write_text(json.dumps(card | changes))


def test_a_model_gives_the_same_values_after_a_round_trip(
    directory: Path, local: LocalConfig, batch: Callable[..., Batch], hands: Callable[..., Hands]
) -> None:
    model = load_model(directory)
    original = GraspModel({"success": initialised(lambda: build("local", local), 0).eval()}, {})
    image, some = batch(1, 1, 0).images[0], hands((9,), torch.Generator().manual_seed(0))
    assert torch.equal(model.given_image(image)(some), original.given_image(image)(some))
    assert not any(p.requires_grad for e in model.estimators.values() for p in e.parameters())
    assert model.card["data"] == "abc"
    assert model.card["estimators"]["success_ratio"]["metrics"] == {"loss": 1.25}


def test_another_gripper_is_refused(directory: Path) -> None:
    with pytest.raises(CheckpointError, match="'robotiq-3f', not for 'hand-e'"):
        load_model(directory, gripper="hand-e")


def test_another_camera_is_refused(directory: Path) -> None:
    camera = canonical_camera()
    pose = camera.pose.copy()
    pose[2, 3] += 0.05
    for other in (replace(camera, fx=600.0), camera.with_pose(pose), camera.with_pose(None)):
        with pytest.raises(CheckpointError, match="another camera"):
            load_model(directory, camera=other)


def test_another_schema_is_refused(directory: Path) -> None:
    edit(directory, schema=99)
    with pytest.raises(CheckpointError, match="schema 99, this version reads schema 1"):
        load_model(directory)


def test_a_missing_or_broken_card_is_refused(directory: Path, tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match="no model in"):
        load_model(tmp_path / "elsewhere")
    (directory / CARD).write_text("{")
    with pytest.raises(CheckpointError, match="not JSON"):
        load_model(directory)
    (directory / CARD).write_text("{}")
    with pytest.raises(CheckpointError, match="lacks schema, gripper, camera, estimators"):
        load_model(directory)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"kind": "pickle"}, "unknown kind 'pickle'"),
        ({"config": {"widths": [4]}}, "success_ratio"),
        ({"config": {"depth": 3}}, "configuration of the success_ratio estimator is not valid"),
        ({"sha256": "0"}, "checksum"),
    ],
)
def test_a_wrong_entry_is_refused(directory: Path, change: dict[str, object], message: str) -> None:
    card = json.loads((directory / CARD).read_text())
    card["estimators"]["success_ratio"] |= change
    edit(directory, estimators=card["estimators"])
    with pytest.raises(CheckpointError, match=message):
        load_model(directory)


def test_damaged_or_missing_weights_are_refused(directory: Path) -> None:
    weights = directory / "success_ratio.safetensors"
    weights.write_bytes(weights.read_bytes()[:200])
    with pytest.raises(CheckpointError, match="cannot read the weights"):
        load_model(directory)
    weights.unlink()
    with pytest.raises(CheckpointError, match=r"success_ratio\.safetensors"):
        load_model(directory)


def test_changed_weights_are_refused(directory: Path) -> None:
    weights = directory / "success_ratio.safetensors"
    content = bytearray(weights.read_bytes())
    content[-1] ^= 1
    weights.write_bytes(bytes(content))
    with pytest.raises(CheckpointError, match="checksum"):
        load_model(directory)


def test_a_model_says_what_it_lacks(directory: Path) -> None:
    with pytest.raises(CheckpointError, match="no 'full' estimator; it has success, success_ratio"):
        load_model(directory).given_object(0, 1.0, (0.0, 0.0, 0.0), 0.8)


def test_only_known_estimators_are_saved(tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match="Identity is no estimator"):
        save_model(tmp_path, {"success_ratio": torch.nn.Identity()}, Origin())
    with pytest.raises(CheckpointError, match="no role 'best'"):
        save_model(tmp_path, {"best": torch.nn.Identity()}, Origin())


def test_joined_models_have_the_last_of_every_estimator(
    directory: Path, tmp_path: Path, hands: Callable[..., Hands]
) -> None:
    later = tmp_path / "later"
    success_ratio = initialised(lambda: build("success_ratio", SuccessRatioConfig()), 7).eval()
    save_model(
        later, {"success_ratio": success_ratio}, Origin(objects=("mug",)), extra={"power": {"success_ratio": 0.5}}
    )
    join_models([directory, later], tmp_path / "joined")
    model = load_model(tmp_path / "joined")
    assert set(model.estimators) == {"success", "success_ratio"}
    assert model.card["power"] == {"success_ratio": 0.5}
    some = hands((5,), torch.Generator().manual_seed(0))
    assert torch.equal(
        model.given_success()(some), GraspModel({"success_ratio": success_ratio}, {}).given_success()(some)
    )
    assert model.card["estimators"]["success"] == load_model(directory).card["estimators"]["success"]


def test_models_of_other_objects_are_not_joined(directory: Path, tmp_path: Path) -> None:
    success_ratio = initialised(lambda: build("success_ratio", SuccessRatioConfig()), 7)
    save_model(tmp_path / "other", {"success_ratio": success_ratio}, Origin(objects=("bowl",)))
    with pytest.raises(CheckpointError, match="objects differ"):
        join_models([directory, tmp_path / "other"], tmp_path / "joined")


def test_a_model_with_a_role_of_another_name_is_refused(directory: Path) -> None:
    """Before roles were named after what they are, that of log r(S | h) was called `metric`."""
    entries = json.loads((directory / CARD).read_text())["estimators"]
    edit(directory, estimators={"success": entries["success"], "metric": entries["success_ratio"]})
    with pytest.raises(CheckpointError, match="unknown roles: metric; this version knows success_ratio, image"):
        load_model(directory)
