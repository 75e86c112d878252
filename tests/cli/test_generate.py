"""``bayesgrasp generate`` and ``bayesgrasp data inspect`` on real objects, once, small."""

import json
from pathlib import Path

import pytest
from PIL import Image

from bayesgrasp.cli.data import inspect
from bayesgrasp.cli.generate import Drawn, Running, generate
from bayesgrasp.cli.main import main
from bayesgrasp.cli.object_set import ObjectSet
from bayesgrasp.data.loader import GraspDataset

CAN = ObjectSet("household_drink_can")
DRAWN = Drawn(attempts_per_draw=40, scenes_per_draw=2, draws_per_chunk=2, hands=8)


def test_a_small_set_on_a_real_object(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "set"
    generate(100, out, seed=3, objects=CAN, drawn=DRAWN, running=Running(workers=1))
    manifest = json.loads((out / "manifest.json").read_text())
    assert manifest["totals"]["attempts"] == 100 == sum(manifest["totals"]["outcomes"].values())
    assert manifest["objects"][0]["id"] == "household_drink_can"
    assert manifest["gripper"] == "robotiq-3f"
    assert "100 attempts" in capsys.readouterr().out
    dataset = GraspDataset(out)
    assert len(dataset.scene_columns["draw"]) == 2 * 3
    image = next(iter(dataset.scenes("all").batches(0))).images
    assert ((image == 0) | ((image >= 0.45 - 1e-4) & (image <= 1.0 + 1e-4))).all()
    assert 0.5 < (image > 0).float().mean() < 1
    inspect(out, verify=True, json=tmp_path / "set.json")
    written = json.loads((tmp_path / "set.json").read_text())["per_object"]["household_drink_can"]
    assert written["attempts"] == 100
    assert written["outcomes"] == manifest["totals"]["outcomes"]
    printed = capsys.readouterr().out
    assert "household_drink_can" in printed
    assert "bytes an attempt" in printed
    assert "2 chunks are as they were written" in printed
    if (dataset.scene_columns["hand_outcome"] == 4).any():
        assert Image.open(out / "sheet.png").size[0] > 256


def refused(words: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(words)
    assert stop.value.code == 2
    assert message in capsys.readouterr().err


def test_wrong_options_are_one_clear_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    base = ["generate", "--attempts", "10", "--out", str(tmp_path / "x"), "--split", "household_drink_can"]
    refused([*base, "--workers=-1"], "workers must be at least 1", capsys)
    refused([*base, "--prior-share", "0"], "prior_share must be in (0, 1)", capsys)
    refused([*base, "--ray-address", "auto"], "--ray-address goes with --executor ray", capsys)
    refused([*base[:2], "0", *base[3:]], "attempts must be at least 1", capsys)
    refused(["data", "inspect", "--directory", str(tmp_path)], "holds no data set", capsys)
    assert not (tmp_path / "x").exists()


def test_a_set_of_an_older_schema_is_one_clear_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    old = tmp_path / "old"
    old.mkdir()
    (old / "manifest.json").write_text(json.dumps({"schema_version": 1, "seed": 1}))
    message = "has schema version 1; this version of bayesgrasp reads 3"
    refused(["data", "inspect", "--directory", str(old)], message, capsys)
    refused(["train", "--data", str(old), "--out", str(tmp_path / "model")], message, capsys)
    resumed = ["generate", "--attempts", "10", "--out", str(old), "--split", "household_drink_can", "--resume"]
    refused(resumed, message, capsys)
    assert [path.name for path in tmp_path.rglob("*")] == ["old", "manifest.json"]
