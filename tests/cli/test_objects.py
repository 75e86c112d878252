"""``bayesgrasp objects``: tables and pictures of what is there, and one clear line for what is not."""

import json
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from bayesgrasp.cli.objects import fetch, list_objects, show
from bayesgrasp.errors import AssetError
from bayesgrasp.objects import household
from bayesgrasp.objects.shapes import box


@pytest.fixture(autouse=True)
def _private_directories(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("BAYESGRASP_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.delenv("BAYESGRASP_YCB_DIR", raising=False)


def test_list_prints_a_line_for_each_object_and_writes_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    list_objects(json=tmp_path / "objects.json")
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[1:]] == list(household.OBJECTS)
    assert "65 x 125 x 70" in next(line for line in lines if line.startswith("household_tea_box"))
    written = json.loads((tmp_path / "objects.json").read_text())
    assert written[3] == {
        "id": "household_carton",
        "source": "household",
        "split": "train",
        "mass_kg": 0.52,
        "extents_m": [0.07, 0.07, 0.19],
        "parts": 1,
    }


def test_list_marks_scans_that_are_not_cut_yet(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "ycb" / "061_foam_brick" / "google_16k"
    folder.mkdir(parents=True)
    box(0.05, 0.08, 0.05).mesh.to_trimesh().export(folder / "nontextured.ply")
    list_objects(ycb_dir=tmp_path / "ycb")
    out = capsys.readouterr().out
    assert out.splitlines()[1].split()[-1] == "-"
    assert "not cut into convex parts yet" in out


def test_show_describes_and_draws(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    show("household_coffee_mug", out=tmp_path / "mug.png", json=tmp_path / "mug.json")
    out = capsys.readouterr().out
    written = json.loads((tmp_path / "mug.json").read_text())
    assert (written["id"], written["mass_kg"], written["parts"]) == ("household_coffee_mug", 0.3, 16)
    assert "16 convex" in out
    assert "0.3 kg" in out
    picture = np.asarray(Image.open(tmp_path / "mug.png"))
    mesh, parts = picture[: len(picture) // 2], picture[len(picture) // 2 :]
    # The parts are drawn in many colours, the mesh in shades of one.
    assert len(np.unique(parts.reshape(-1, 3) // 32, axis=0)) > 2 * len(np.unique(mesh.reshape(-1, 3) // 32, axis=0))


def test_show_takes_a_file_of_ones_own(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    box(0.05, 0.06, 0.07).mesh.to_trimesh().export(tmp_path / "brick.stl")
    show(mesh=tmp_path / "brick.stl", mass=0.25, convex="paper", out=tmp_path / "brick.png")
    assert "brick (file, split other)" in capsys.readouterr().out
    assert (tmp_path / "brick.png").exists()


def test_show_wants_exactly_one_object(tmp_path: Path) -> None:
    with pytest.raises(AssetError, match="objects show ID"):
        show()
    with pytest.raises(AssetError, match="objects show ID"):
        show("household_egg", mesh=tmp_path / "brick.stl", mass=1.0)
    with pytest.raises(AssetError, match="unknown object 'egg'"):
        show("egg", out=tmp_path / "egg.png")
    assert not (tmp_path / "egg.png").exists()


class _Nothing(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        self.send_error(404)

    def log_message(self, *_: object) -> None:
        pass


def test_fetch_reports_every_failure(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with ThreadingHTTPServer(("127.0.0.1", 0), _Nothing) as http:
        thread = threading.Thread(target=http.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        address = f"http://127.0.0.1:{http.server_port}"
        with pytest.raises(AssetError) as failed:
            fetch(tmp_path / "ycb", ids=("025_mug", "024_bowl"), base_url=address)
        http.shutdown()
        thread.join()
    assert "025_mug_google_16k.tgz" in str(failed.value)
    assert "024_bowl_google_16k.tgz" in str(failed.value)
    assert "0 of 2 scans" in capsys.readouterr().out


def test_show_draws_all_objects_of_a_split(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "things.png"
    show(split="procedural:5@3", out=target, json=tmp_path / "things.json")
    assert len(json.loads((tmp_path / "things.json").read_text())) == 5
    assert "objects      5, " in capsys.readouterr().out
    with Image.open(target) as picture:
        assert picture.size == (3 * 154, 2 * 154)


def test_show_refuses_what_it_cannot_draw() -> None:
    with pytest.raises(AssetError, match="--split goes with none of ID, --mesh and --mass"):
        show("household_egg", split="procedural:5@3")
    with pytest.raises(AssetError, match="'procedural:500@3' is 500 objects; at most 400"):
        show(split="procedural:500@3")
