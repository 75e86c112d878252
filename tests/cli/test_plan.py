"""``bayesgrasp plan`` and ``bayesgrasp.load`` from files to files, with weights that were never trained."""

import json
import math

import numpy as np
import pytest
import torch
from box_scene import Box, box_depth_image

import bayesgrasp
from bayesgrasp.cli.main import main
from bayesgrasp.errors import CheckpointError
from bayesgrasp.geometry.camera import Camera, canonical_camera
from bayesgrasp.observation.depth_files import read_depth, write_depth_png
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.ratio.checkpoint import Origin, save_model
from bayesgrasp.ratio.estimators import GlobalSuccess, ImageConfig, ImageRatio, SuccessRatio, SuccessRatioConfig
from bayesgrasp.ratio.model import GraspModel
from bayesgrasp.robot.robotiq_3f import robotiq_3f
from bayesgrasp.types import GraspType
from bayesgrasp.workflows.load import success_probability, trained_prior


def untrained(kind: type, config: object) -> torch.nn.Module:
    with torch.random.fork_rng():
        torch.manual_seed(0)
        return kind(config)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A model, a depth image and a camera file, in one directory."""
    directory = tmp_path_factory.mktemp("plan")
    prior = {"x": [-0.15, 0.15], "y": [-0.15, 0.15], "z": [0.12, 0.34], "kappa": 30.0}
    origin = Origin(robotiq_3f().name, prior=prior)
    save_model(directory / "model", {"success": untrained(GlobalSuccess, ImageConfig())}, origin)
    camera = canonical_camera()
    write_depth_png(directory / "depth.png", box_depth_image(camera, (Box(x=0.02),)))
    np.save(directory / "empty.npy", box_depth_image(camera))
    camera.save(directory / "camera.json")
    return directory


def command(files, *extra: str, depth: str = "depth.png", camera: str = "camera.json") -> None:
    paths = ("--depth", str(files / depth), "--camera", str(files / camera), "--model", str(files / "model"))
    main(["plan", *paths, *extra])


def test_plan_prints_ranked_grasps_and_writes_json_and_figure(files, tmp_path, capsys) -> None:
    json_file, figure = tmp_path / "plan.json", tmp_path / "plan.png"
    command(files, "--top", "3", "--samples", "200", "--json", str(json_file), "--figure", str(figure))
    printed = capsys.readouterr().out
    content = json.loads(json_file.read_text())
    assert 1 <= len(content["grasps"]) <= 3
    assert f"{len(content['grasps'])}. " in printed
    assert "planned in" in printed
    assert content["reason"] is None
    assert content["samples"]["hands"] == 200
    assert content["timings_ms"]["total"] > 0
    assert figure.stat().st_size > 20_000
    for grasp in content["grasps"]:
        assert GraspType[grasp["grasp_type"].upper()] in GraspType
        assert math.isfinite(grasp["log_posterior"])
        assert 0 <= grasp["success_probability"] <= 1
        joints = [q for path in grasp["motion"].values() for q in path]
        assert {len(q) for q in joints} == {6}


@pytest.mark.parametrize("suffix", ["npz", "json"])
def test_samples_are_written_as_python_has_them(files, tmp_path, suffix) -> None:
    path = tmp_path / f"samples.{suffix}"
    command(files, "--samples", "50", "--samples-out", str(path))
    written = np.load(path) if suffix == "npz" else json.loads(path.read_text())
    camera = Camera.load(files / "camera.json")
    plan = bayesgrasp.load(files / "model").plan(read_depth(files / "depth.png"), camera, samples=50)
    hands = plan.samples.hands
    for name in ("position", "rotation", "grasp_type"):
        np.testing.assert_allclose(written[name], getattr(hands, name), atol=1e-6)
    for name in ("log_prob", "success_probability"):
        np.testing.assert_allclose(written[name], getattr(plan.posterior, name)(hands), rtol=1e-4, atol=1e-5)
    assert float(written["acceptance"]) == plan.samples.acceptance


def test_names_in_json_are_those_of_python(files) -> None:
    camera = Camera.load(files / "camera.json")
    limits = bayesgrasp.Constraints(lowest=-0.1)
    plan = bayesgrasp.load(files / "model").plan(read_depth(files / "depth.png"), camera, samples=5, constraints=limits)
    content = plan.to_dict()
    for inner, thing in [
        (content, plan),
        (content["observed"], plan.observed),
        (content["samples"], plan.samples),
        (content["samples"]["evidence"], plan.samples.evidence),
        (content["constraints"], plan.constraints),
        (content["grasps"][0], plan.grasps[0]),
        (content["grasps"][0]["motion"], plan.grasps[0].motion),
    ]:
        assert [name for name in inner if not hasattr(thing, name)] == []


def test_limits_are_kept_and_echoed(files, tmp_path, capsys) -> None:
    box = ("-0.4", "-0.4", "0", "0.4", "-0.12", "0.6")
    limits = ("--types", "pinch", "wide", "--lowest", "-0.002", "--keep-out", *box)
    command(files, *limits, "--keep-out", *["0.3", "0", "0", "0.4", "1", "1"], "--json", str(tmp_path / "plan.json"))
    content = json.loads((tmp_path / "plan.json").read_text())
    assert content["constraints"] == {
        "keep_out": [
            {"low": [-0.4, -0.4, 0.0], "high": [0.4, -0.12, 0.6]},
            {"low": [0.3, 0.0, 0.0], "high": [0.4, 1.0, 1.0]},
        ],
        "lowest": -0.002,
        "grasp_types": ["pinch", "wide"],
        "confidence": None,
    }
    assert content["grasps"]
    assert {grasp["grasp_type"] for grasp in content["grasps"]} <= {"pinch", "wide"}
    assert all(grasp["hand_to_world"]["position"][1] > -0.12 for grasp in content["grasps"])


def test_limits_that_leave_nothing_are_a_reason(files, capsys) -> None:
    with pytest.raises(SystemExit) as stopped:
        command(files, "--lowest", "0.8")
    assert stopped.value.code == 3
    assert "no grasp: no hand keeps the constraints" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--keep-out", "0", "0", "0", "1", "1", "-1"), "error: box needs low < high"),
        (("--confidence", "95"), "error: confidence must be between 0 and 1"),
        (("--confidence", "0.9"), "error: this model does not know what its plans deliver"),
        (("--device", "abacus"), "error: the device 'abacus' cannot be used; valid: cpu, and cuda"),
        (("--device", "meta"), "error: the device 'meta' cannot be used"),
    ],
)
def test_limits_and_devices_that_cannot_be_are_refused(files, capsys, options, words) -> None:
    with pytest.raises(SystemExit) as stopped:
        command(files, *options)
    assert stopped.value.code == 2
    assert words in capsys.readouterr().err


def test_an_empty_table_is_an_answer_with_a_reason(files, tmp_path, capsys) -> None:
    with pytest.raises(SystemExit) as stopped:
        command(files, "--json", str(tmp_path / "plan.json"), depth="empty.npy")
    assert stopped.value.code == 3
    content = json.loads((tmp_path / "plan.json").read_text())
    assert content["grasps"] == []
    assert "nothing on the table" in content["reason"]
    assert "no grasp: nothing on the table" in capsys.readouterr().out


def test_a_camera_without_a_pose_is_enough(files, tmp_path, capsys) -> None:
    canonical_camera().with_pose(None).save(files / "no_pose.json")
    command(files, "--json", str(tmp_path / "plan.json"), camera="no_pose.json")
    content = json.loads((tmp_path / "plan.json").read_text())
    assert content["grasps"]
    assert any("camera_to_world was not given" in warning for warning in content["warnings"])
    # In the camera frame the hand is in front of the camera, near the object.
    assert 0.3 < content["grasps"][0]["hand_to_camera"]["position"][2] < 0.9
    assert "warning: camera_to_world" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"depth": "missing.png"}, "missing.png"),
        ({"camera": "missing.json"}, "missing.json"),
        ({"camera": "depth.png"}, "depth.png"),
    ],
)
def test_wrong_files_are_one_line_and_exit_code_2(files, capsys, change, words) -> None:
    with pytest.raises(SystemExit) as stopped:
        command(files, **change)
    error = capsys.readouterr().err
    assert stopped.value.code == 2
    assert error.startswith("error: ")
    assert words in error
    assert error.count("\n") == 1


def test_nothing_is_planned_for_outputs_that_cannot_be_written(files, capsys, tmp_path) -> None:
    for option in (
        ("--json", str(tmp_path / "no" / "plan.json")),
        ("--figure", str(tmp_path / "plan.gif")),
        ("--samples-out", str(tmp_path / "samples.csv")),
    ):
        with pytest.raises(SystemExit):
            command(files, *option)
        assert option[1] in capsys.readouterr().err


def test_a_model_for_another_gripper_is_refused(files, tmp_path) -> None:
    save_model(tmp_path, {"success": untrained(GlobalSuccess, ImageConfig())}, Origin(gripper="two-finger"))
    with pytest.raises(CheckpointError, match="two-finger"):
        bayesgrasp.load(tmp_path)
    with pytest.raises(CheckpointError, match="no model"):
        bayesgrasp.load(tmp_path / "nowhere")


def test_load_plans_from_arrays_as_the_command_does_from_files(files) -> None:
    camera = canonical_camera()
    depth = box_depth_image(camera, (Box(x=0.02),))
    plan = bayesgrasp.load(files / "model").plan(depth, camera.matrix, camera.pose, top=2)
    assert len(plan.grasps) == 2
    for grasp in plan.grasps:
        assert grasp.motion.approach.shape[1] == 6
        np.testing.assert_allclose(grasp.hand_to_world[:3, :3] @ grasp.hand_to_world[:3, :3].T, np.eye(3), atol=1e-5)


def test_success_probability_of_both_kinds_of_model() -> None:
    values = torch.tensor([math.log(0.5), -math.inf, 5.0])
    alone = GraspModel({"success": untrained(GlobalSuccess, ImageConfig())}, {})
    torch.testing.assert_close(success_probability(alone)(values), torch.tensor([0.5, 0.0, 1.0]))
    tempered = GraspModel(alone.estimators, {"power": {"success": 0.5}})
    torch.testing.assert_close(success_probability(tempered)(values), torch.tensor([0.25, 0.0, 1.0]))
    parts = {
        "image": untrained(ImageRatio, ImageConfig()),
        "success_ratio": untrained(SuccessRatio, SuccessRatioConfig()),
    }
    factorised = GraspModel(parts, {"success_rate": 0.01})
    torch.testing.assert_close(success_probability(factorised)(values), torch.tensor([0.005, 0.0, 1.0]))


def test_the_prior_is_that_of_the_card() -> None:
    assert trained_prior({"prior": {"z": [0.2, 0.3], "types": [0, 2]}}) == GraspPrior(z=(0.2, 0.3), types=(0, 2))
    with pytest.raises(CheckpointError, match="prior"):
        trained_prior({"prior": {"shape": "round"}})
