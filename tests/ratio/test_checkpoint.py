"""Models on disk: what is read gives the values that were written; what does not fit is refused by name."""

import hashlib
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from safetensors.torch import load_file, save
from torch import Tensor

from bayesgrasp.data.schema import Batch
from bayesgrasp.errors import CheckpointError
from bayesgrasp.geometry.camera import canonical_camera
from bayesgrasp.ratio.card import CARD, read_card, write_card
from bayesgrasp.ratio.checkpoint import Origin, join_models, load_model, save_model
from bayesgrasp.ratio.estimators import FullConfig, SuccessRatioConfig
from bayesgrasp.ratio.kinds import build
from bayesgrasp.ratio.local import LocalConfig
from bayesgrasp.ratio.model import GraspModel
from bayesgrasp.training.train_estimator import initialised
from bayesgrasp.types import UNSTATED_HAND, HandIdentity, Hands
from bayesgrasp.workflows.load import PAPER_MODEL

HAND = "robotiq-3f"


@pytest.fixture
def directory(tmp_path: Path, local: LocalConfig) -> Path:
    estimators = {
        "success": initialised(lambda: build("local", local), 0).eval(),
        "success_ratio": initialised(lambda: build("success_ratio", SuccessRatioConfig()), 0).eval(),
    }
    save_model(tmp_path, estimators, Origin(HAND, data="abc", objects=("mug",)), {"success_ratio": {"loss": 1.25}})
    return tmp_path


def edit(directory: Path, **changes: object) -> None:
    """Change entries of the card and seal it again; None removes an entry."""
    card = json.loads((directory / CARD).read_text()) | changes
    write_card(directory, {name: value for name, value in card.items() if value is not None})


def test_a_model_gives_the_same_values_after_a_round_trip(
    directory: Path, local: LocalConfig, batch: Callable[..., Batch], hands: Callable[..., Hands]
) -> None:
    model = load_model(directory)
    original = GraspModel({"success": initialised(lambda: build("local", local), 0).eval().requires_grad_(False)}, {})
    image, some = batch(1, 1, 0).images[0], hands((9,), torch.Generator().manual_seed(0))
    assert torch.equal(model.given_image(image)(some), original.given_image(image)(some))
    assert not any(p.requires_grad for e in model.estimators.values() for p in e.parameters())
    assert model.card["data"] == "abc"
    assert model.card["estimators"]["success_ratio"]["metrics"] == {"loss": 1.25}


def test_another_gripper_is_refused(directory: Path) -> None:
    with pytest.raises(CheckpointError, match="'robotiq-3f', not for 'hand-e'"):
        load_model(directory, hand=HandIdentity("hand-e"))


def test_another_description_of_the_same_name_is_refused(directory: Path) -> None:
    load_model(directory, hand=HandIdentity(HAND))
    with pytest.raises(CheckpointError, match=f"description {UNSTATED_HAND[:8]}, not for 'robotiq-3f' of .* 00000000"):
        load_model(directory, hand=HandIdentity(HAND, 64 * "0"))


def test_a_card_without_a_hash_is_of_the_one_hand_that_there_was(directory: Path) -> None:
    edit(directory, gripper_sha256=None)
    load_model(directory, hand=HandIdentity(HAND))
    with pytest.raises(CheckpointError, match="not for"):
        load_model(directory, hand=HandIdentity(HAND, 64 * "0"))


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
        ({"kind": "pickle"}, "unknown kind 'pickle'; known: success_ratio"),
        ({"kind": "local"}, "unknown kind 'local'; known: success_ratio"),
        ({"kind": ["local"]}, "unknown kind"),
        ({"config": {"widths": [4]}}, "'head.4.bias' is not in it"),
        ({"config": {"widths": [100_000] * 400}}, "fewer than the configuration on the card asks for"),
        ({"config": {"widths": [100_000]}}, "fewer than the configuration on the card asks for"),
        ({"config": {"widths": [10**9]}}, "widths must be a whole number, got 1000000000"),
        ({"config": {"widths": [128.0, 128]}}, "widths must be a whole number, got 128.0"),
        ({"config": {"widths": ["128", 128]}}, "widths must be a whole number, got '128'"),
        ({"config": {"widths": [True, 128]}}, "widths must be a whole number, got True"),
        ({"config": {"hand": {"low": [float("nan"), 0, 0]}}}, r"hand\.low must be a finite number"),
        ({"config": {"hand": {"low": [0, 0]}}}, r"hand\.low must be a list of 3"),
        ({"config": {"activation": "sine"}}, "activation must be one of"),
        ({"config": {"depth": 3}}, "configuration of the success_ratio estimator is not valid"),
        ({"config": []}, "configuration of the success_ratio estimator is not valid"),
        ({"sha256": "0"}, "needs a SHA-256"),
        ({"sha256": "0" * 64}, "checksum"),
        ({"metrics": 3}, "needs a SHA-256 and metrics"),
        ({"more": 3}, "must have kind, config, sha256, metrics"),
    ],
)
def test_a_wrong_entry_is_refused(directory: Path, change: dict[str, object], message: str) -> None:
    card = json.loads((directory / CARD).read_text())
    card["estimators"]["success_ratio"] |= change
    edit(directory, estimators=card["estimators"])
    with pytest.raises(CheckpointError, match=message) as refused:
        load_model(directory)
    assert len(str(refused.value)) < 400


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"estimators": {"../../x": {}}}, r"unknown roles: '\.\./\.\./x'"),
        ({"estimators": {}}, "estimators by role"),
        ({"estimators": ["success"]}, "estimators by role"),
        ({"estimators": {"success": None}}, "the entry of success must have"),
        ({"schema": True}, "has schema True"),
        ({"schema": "1"}, "has schema '1'"),
        ({"gripper": 3}, "gripper must be a name, got 3"),
        ({"gripper": "x" * 10**5}, "gripper must be a name"),
        ({"gripper_sha256": "robotiq"}, "gripper_sha256 must be the SHA-256"),
        ({"camera": {"intrinsics": {}}}, "missing: width"),
        ({"camera": [1]}, "`intrinsics` must be an object"),
        ({"prior": {"kappa": "30"}}, "kappa must be a finite number, got '30'"),
        ({"prior": {"kappa": -1}}, "the prior is not valid"),
        ({"prior": {"types": [0, 0]}}, "the prior is not valid"),
        ({"prior": {"x": [1e9, 2e9]}}, "x must be a finite number"),
        ({"prior": 3}, "the prior is not valid"),
        ({"success_rate": 1.5}, "success_rate must be a rate"),
        ({"success_rate": float("nan")}, "success_rate must be a rate"),
        ({"objects": ["mug", "mug"]}, "objects must be a list of distinct names"),
        ({"objects": "mug"}, "objects must be a list of distinct names"),
        ({"power": {"success": 0}}, "power must be"),
        ({"power": {"success": True}}, "power must be"),
        ({"power": {"other": 1}}, "power must be"),
        ({"familiarity": {"threshold": 1}}, "image statistics"),
        ({"familiarity": 3}, "image statistics"),
        ({"powre": {"success": 1}}, "there is no entry 'powre' in a card"),
        ({"data": 3}, "data must be a fingerprint"),
    ],
)
def test_an_entry_of_another_name_type_or_range_is_refused(
    directory: Path, changes: dict[str, object], message: str
) -> None:
    edit(directory, **changes)
    for read in (read_card, load_model):
        with pytest.raises(CheckpointError, match=message) as refused:
            read(directory)
        assert len(str(refused.value)) < 400
        assert str(refused.value).isprintable()


def test_as_many_objects_as_the_full_estimator_knows(tmp_path: Path) -> None:
    full = initialised(lambda: build("full", FullConfig(objects=2, widths=(8,))), 0)
    save_model(tmp_path, {"full": full}, Origin(HAND, objects=("mug", "bowl")))
    load_model(tmp_path)
    edit(tmp_path, objects=["mug"])
    with pytest.raises(CheckpointError, match="names 1 objects, its full estimator knows 2"):
        load_model(tmp_path)


def test_an_altered_card_is_refused(directory: Path) -> None:
    """A number of its camera, its prior, its power: each would change plans and nothing else would tell."""
    text = (directory / CARD).read_text()
    for old, new in (("580.0", "581.0"), ('"mug"', '"jug"'), ("1.25", "1.26"), ('"abc"', '"abd"')):
        assert old in text
        (directory / CARD).write_text(text.replace(old, new, 1))
        with pytest.raises(CheckpointError, match="was altered or damaged after it was written: its checksum differs"):
            load_model(directory)
    (directory / CARD).write_text(text)
    load_model(directory)
    content = json.loads(text)
    del content["checksum"]
    (directory / CARD).write_text(json.dumps(content))
    with pytest.raises(CheckpointError, match="has no checksum"):
        load_model(directory)


def test_the_shipped_card_is_sealed() -> None:
    shipped = PAPER_MODEL
    assert set(load_model(shipped).estimators) == set(read_card(shipped)["estimators"])


def reseal(directory: Path, tensors: dict[str, Tensor]) -> None:
    """Other weights for log r(S | h), with the checksum that fits them."""
    content = save(tensors, {"role": "success_ratio"})
    (directory / "success_ratio.safetensors").write_bytes(content)
    entries = json.loads((directory / CARD).read_text())["estimators"]
    entries["success_ratio"]["sha256"] = hashlib.sha256(content).hexdigest()
    edit(directory, estimators=entries)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda w: w.masked_fill(w > 0.1, torch.nan), r"'head\.0\.bias' has values that are not finite"),
        (lambda w: w.masked_fill(w > 0.1, torch.inf), "not finite"),
        (lambda w: w * 1e30, "beyond 1e.06"),
        (lambda w: w.double(), r"is float64 \[128\], not float32 \[128\]"),
        (lambda w: w[:5], r"is float32 \[5\], not float32 \[128\]"),
        (lambda w: w.to(torch.int32), "is int32"),
    ],
)
def test_weights_that_are_no_weights_of_the_module_are_refused(
    directory: Path, change: Callable[[Tensor], Tensor], message: str
) -> None:
    tensors = load_file(directory / "success_ratio.safetensors")
    reseal(directory, tensors | {"head.0.bias": change(tensors["head.0.bias"])})
    with pytest.raises(CheckpointError, match=message):
        load_model(directory)


def test_weights_that_are_missing_or_too_many_are_refused(directory: Path) -> None:
    tensors = load_file(directory / "success_ratio.safetensors")
    reseal(directory, tensors | {"x" * 10**5: torch.zeros(1)})
    with pytest.raises(CheckpointError, match="is not in it") as refused:
        load_model(directory)
    assert len(str(refused.value)) < 400
    del tensors["head.0.bias"]
    reseal(directory, tensors)
    with pytest.raises(CheckpointError, match=r"'head\.0\.bias' is missing"):
        load_model(directory)


def test_a_model_with_nan_is_not_written(tmp_path: Path) -> None:
    broken = initialised(lambda: build("success_ratio", SuccessRatioConfig()), 0)
    torch.nn.init.constant_(next(broken.parameters()), torch.nan)
    with pytest.raises(CheckpointError, match="not finite"):
        save_model(tmp_path, {"success_ratio": broken}, Origin(HAND))
    assert list(tmp_path.iterdir()) == []


def test_damaged_or_missing_weights_are_refused(directory: Path) -> None:
    weights = directory / "success_ratio.safetensors"
    weights.write_bytes(weights.read_bytes()[:200])
    with pytest.raises(CheckpointError, match="damaged or altered"):
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
        save_model(tmp_path, {"success_ratio": torch.nn.Identity()}, Origin(HAND))
    with pytest.raises(CheckpointError, match="no role 'best'"):
        save_model(tmp_path, {"best": torch.nn.Identity()}, Origin(HAND))


def test_joined_models_have_the_last_of_every_estimator(
    directory: Path, tmp_path: Path, hands: Callable[..., Hands]
) -> None:
    later = tmp_path / "later"
    success_ratio = initialised(lambda: build("success_ratio", SuccessRatioConfig()), 7).eval()
    save_model(
        later, {"success_ratio": success_ratio}, Origin(HAND, objects=("mug",)), extra={"power": {"success_ratio": 0.5}}
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
    save_model(tmp_path / "other", {"success_ratio": success_ratio}, Origin(HAND, objects=("bowl",)))
    with pytest.raises(CheckpointError, match="objects differ"):
        join_models([directory, tmp_path / "other"], tmp_path / "joined")


def test_models_of_other_descriptions_are_not_joined(directory: Path, tmp_path: Path) -> None:
    success_ratio = initialised(lambda: build("success_ratio", SuccessRatioConfig()), 7)
    origin = Origin(HAND, objects=("mug",), gripper_sha256=64 * "0")
    save_model(tmp_path / "other", {"success_ratio": success_ratio}, origin)
    with pytest.raises(CheckpointError, match="gripper_sha256 differ"):
        join_models([directory, tmp_path / "other"], tmp_path / "joined")


def test_a_model_with_a_role_of_another_name_is_refused(directory: Path) -> None:
    """Before roles were named after what they are, that of log r(S | h) was called `metric`."""
    entries = json.loads((directory / CARD).read_text())["estimators"]
    edit(directory, estimators={"success": entries["success"], "metric": entries["success_ratio"]})
    with pytest.raises(CheckpointError, match="unknown roles: 'metric'; this version knows success_ratio, image"):
        load_model(directory)
