"""The doctor's report: true where it can be checked, in words where something is missing."""

import json
import os
import subprocess
from pathlib import Path

import pytest

from bayesgrasp.cli import doctor as module
from bayesgrasp.cli.doctor import doctor, examine
from bayesgrasp.objects.ycb import DIRECTORY_VARIABLE


@pytest.fixture(autouse=True)
def _private_directories(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("BAYESGRASP_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.delenv(DIRECTORY_VARIABLE, raising=False)


def test_versions_and_hardware() -> None:
    report = examine()
    assert report.packages["numpy"]
    assert report.packages["mujoco"]
    assert "pytest" not in report.packages
    assert "ray" in report.optional
    assert report.cores >= 1
    assert report.memory > 2**27


def test_the_cache_is_measured(tmp_path: Path) -> None:
    (tmp_path / "cache" / "parts").mkdir(parents=True)
    (tmp_path / "cache" / "parts" / "a").write_bytes(bytes(1000))
    (tmp_path / "cache" / "b").write_bytes(bytes(24))
    assert examine().cache == {"path": str(tmp_path / "cache"), "writable": True, "size": 1024}


def test_a_cache_that_is_no_directory_is_reported(tmp_path: Path) -> None:
    (tmp_path / "cache").write_text("a file")
    report = examine()
    assert not report.cache["writable"]
    assert any("cannot be written" in sentence for sentence in report.missing)


def test_ycb_scans_are_counted(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert any(DIRECTORY_VARIABLE in sentence for sentence in examine().missing)
    for name in ("002_a", "003_b"):
        (tmp_path / "ycb" / name / "google_16k").mkdir(parents=True)
        (tmp_path / "ycb" / name / "google_16k" / "nontextured.ply").touch()
    monkeypatch.setenv(DIRECTORY_VARIABLE, str(tmp_path / "ycb"))
    report = examine()
    assert report.ycb == {"path": str(tmp_path / "ycb"), "objects": 2}
    assert not any("YCB" in sentence for sentence in report.missing)


@pytest.mark.parametrize("name", ["nowhere", "."])
def test_a_ycb_directory_without_scans_is_reported(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, name: str) -> None:
    monkeypatch.setenv(DIRECTORY_VARIABLE, str(tmp_path / name))
    report = examine()
    assert report.ycb is None
    assert any(DIRECTORY_VARIABLE in sentence and str(tmp_path) in sentence for sentence in report.missing)


def test_a_missing_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module.importlib.metadata, "requires", lambda _: ["numpy>=2", "nowhere", 'ray; extra == "ray"'])
    report = examine()
    assert report.packages["numpy"]
    assert report.packages["nowhere"] is None
    assert any("nowhere is not installed" in sentence for sentence in report.missing)


def test_the_command_prints_words_and_writes_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    doctor(json=tmp_path / "report.json")
    report = json.loads((tmp_path / "report.json").read_text())
    out = capsys.readouterr().out
    assert report["packages"]["torch"] in out
    assert all(sentence in out for sentence in report["missing"])


def test_fix_makes_the_cache_and_removes_what_was_left(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cache = tmp_path / "cache"
    doctor(fix=True)
    assert cache.is_dir()
    assert f"made the cache directory {cache}" in capsys.readouterr().out
    old, new, kept = (cache / name for name in (".parts.1234.part", ".parts.5678.part", "parts"))
    for path in (old, new, kept):
        path.touch()
    for path in (old, kept):
        os.utime(path, (0, 0))
    doctor(fix=True)
    assert f"removed {old}" in capsys.readouterr().out
    assert [path for path in (old, new, kept) if path.exists()] == [new, kept]


def test_fix_installs_what_is_missing_or_says_why_not(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = []

    def run(words: list[str], **_: object) -> subprocess.CompletedProcess[str]:
        asked.append(words[-1])
        return subprocess.CompletedProcess(words, asked[-1] == "nowhere", "", "no such thing")

    monkeypatch.setattr(
        module.importlib.metadata, "requires", lambda _: ["numpy", "absent>=1", "nowhere", 'x; extra == "ray"']
    )
    monkeypatch.setattr(module.subprocess, "run", run)
    doctor(fix=True)
    assert asked == ["absent", "nowhere"]
    said = capsys.readouterr().out
    assert "installed absent" in said
    assert "could not install nowhere: no such thing" in said
