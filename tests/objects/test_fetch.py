"""Downloads against a local server: whole, broken off, resumed, changed, truncated, refused, and hostile archives."""

import hashlib
import io
import json
import tarfile
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from bayesgrasp.errors import AssetError, InvalidConfigurationError
from bayesgrasp.meshes.mesh_file import read_mesh
from bayesgrasp.objects.fetch import MANIFEST, FetchConfig, fetch
from bayesgrasp.objects.shapes import box

MUG = "025_mug"


def archive(files: dict[str, bytes], links: dict[str, str] | None = None) -> bytes:
    made = io.BytesIO()
    with tarfile.open(fileobj=made, mode="w:gz") as members:
        for name, content in files.items():
            member = tarfile.TarInfo(name)
            member.size = len(content)
            members.addfile(member, io.BytesIO(content))
        for name, target in (links or {}).items():
            member = tarfile.TarInfo(name)
            member.type, member.linkname = tarfile.SYMTYPE, target
            members.addfile(member)
    return made.getvalue()


@lru_cache
def good_archive(size: float = 0.05) -> bytes:
    """Made once for each size: a gzip file carries the second in which it was made."""
    ply = box(size, size, size).mesh.to_trimesh().export(file_type="ply")
    padding = hashlib.shake_128(b"texture").digest(300_000)
    return archive({f"{MUG}/google_16k/nontextured.ply": ply, f"{MUG}/google_16k/texture_map.png": padding})


@dataclass
class Server:
    """What the server has and does, and what it was asked.

    Attributes:
        content: The archive.
        cuts: Bytes after which each connection in turn is broken off.
        ranges: Whether it honours Range.
        status: Sent for every request instead of the archive, as long as there are some.
        tag: Entity tag; by default the MD5 sum, as S3 does it.
        asked: Path and Range header of every request.
    """

    content: bytes = b""
    cuts: list[int] = field(default_factory=list)
    ranges: bool = True
    status: list[int] = field(default_factory=list)
    tag: str | None = None
    asked: list[tuple[str, str | None]] = field(default_factory=list)
    url: str = ""

    def answer(self, request: BaseHTTPRequestHandler) -> None:
        asked = request.headers.get("Range")
        self.asked.append((request.path, asked))
        if self.status:
            return request.send_error(self.status.pop(0))
        tag = self.tag or f'"{hashlib.md5(self.content).hexdigest()}"'
        start = 0
        if asked and self.ranges and request.headers.get("If-Range") == tag:
            start = int(asked.removeprefix("bytes=").removesuffix("-"))
            if start >= len(self.content):
                return request.send_error(416)
        request.send_response(206 if start else 200)
        request.send_header("ETag", tag)
        request.send_header("Content-Length", str(len(self.content) - start))
        request.end_headers()
        request.wfile.write(self.content[start : start + self.cuts.pop(0)] if self.cuts else self.content[start:])


@pytest.fixture
def server() -> Iterator[Server]:
    state = Server(good_archive())

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            state.answer(self)

        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as http:
        thread = threading.Thread(target=http.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        state.url = f"http://127.0.0.1:{http.server_port}/data"
        yield state
        http.shutdown()
        thread.join()


def config(server: Server, attempts: int = 2) -> FetchConfig:
    return FetchConfig(base_url=server.url, attempts=attempts, pause_s=0.0, timeout_s=5.0)


def left_behind(root: Path) -> set[str]:
    return {path.name for path in root.iterdir()} - {".fetch.lock"}


def test_an_archive_becomes_a_scan(server: Server, tmp_path: Path) -> None:
    seen: list[tuple[int, int | None]] = []
    path = fetch(MUG, tmp_path / "new" / "ycb", config(server), lambda done, total: seen.append((done, total)))
    assert path == tmp_path / "new" / "ycb" / MUG / "google_16k" / "nontextured.ply"
    assert read_mesh(path).extents == pytest.approx([0.05] * 3)
    assert server.asked == [(f"/data/google/{MUG}_google_16k.tgz", None)]
    assert seen[-1] == (len(server.content), len(server.content))
    assert [done for done, _ in seen] == sorted(done for done, _ in seen)
    assert left_behind(path.parents[2]) == {MUG, MANIFEST}
    recorded = json.loads((path.parents[2] / MANIFEST).read_text())
    assert recorded == {f"{MUG}_google_16k.tgz": hashlib.sha256(server.content).hexdigest()}


def test_a_scan_that_is_there_is_left_alone(server: Server, tmp_path: Path) -> None:
    first = fetch(MUG, tmp_path, config(server))
    assert fetch(MUG, tmp_path, config(server)) == first
    assert len(server.asked) == 1


def test_a_connection_that_breaks_is_resumed_at_once(server: Server, tmp_path: Path) -> None:
    server.cuts = [100_000, 50_000, 1]
    fetch(MUG, tmp_path, config(server))
    assert [asked for _, asked in server.asked] == [None, "bytes=100000-", "bytes=150000-", "bytes=150001-"]


def test_an_interrupted_download_goes_on_in_the_next_run(server: Server, tmp_path: Path) -> None:
    server.cuts = [100_000, 0]
    with pytest.raises(AssetError, match="100000 bytes are kept, run the command again"):
        fetch(MUG, tmp_path, config(server, attempts=1))
    assert left_behind(tmp_path) == {f"{MUG}_google_16k.tgz.part", f"{MUG}_google_16k.tgz.part.etag"}
    server.cuts.clear()
    fetch(MUG, tmp_path, config(server))
    assert server.asked[-1][1] == "bytes=100000-"
    assert left_behind(tmp_path) == {MUG, MANIFEST}


def test_an_archive_that_changed_in_between_starts_again(server: Server, tmp_path: Path) -> None:
    server.cuts = [100_000, 0]
    with pytest.raises(AssetError, match="kept"):
        fetch(MUG, tmp_path, config(server, attempts=1))
    server.cuts.clear()
    server.content = good_archive(0.06)
    assert read_mesh(fetch(MUG, tmp_path, config(server))).extents == pytest.approx([0.06] * 3)


def test_a_server_without_ranges_starts_again(server: Server, tmp_path: Path) -> None:
    server.cuts, server.ranges = [100_000], False
    assert read_mesh(fetch(MUG, tmp_path, config(server))).extents == pytest.approx([0.05] * 3)


def test_kept_bytes_beyond_the_end_start_again(server: Server, tmp_path: Path) -> None:
    part = tmp_path / f"{MUG}_google_16k.tgz.part"
    part.write_bytes(server.content + b"more")
    Path(f"{part}.etag").write_text(f'"{hashlib.md5(server.content).hexdigest()}"')
    assert read_mesh(fetch(MUG, tmp_path, config(server))).extents == pytest.approx([0.05] * 3)


def test_a_busy_server_is_tried_again(server: Server, tmp_path: Path) -> None:
    server.status = [503, 500]
    fetch(MUG, tmp_path, config(server, attempts=3))
    server.status = [503, 503]
    with pytest.raises(AssetError, match="503"):
        fetch("024_bowl", tmp_path, config(server))


@pytest.mark.parametrize("status", [403, 404])
def test_a_missing_archive_is_named_at_once(server: Server, tmp_path: Path, status: int) -> None:
    server.status = [status] * 9
    with pytest.raises(AssetError, match=f"{MUG}_google_16k.tgz: the server has no such archive"):
        fetch(MUG, tmp_path, config(server))
    assert len(server.asked) == 1
    assert left_behind(tmp_path) == set()


def test_a_server_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(AssetError, match=r"127\.0\.0\.1"):
        fetch(MUG, tmp_path, FetchConfig(base_url="http://127.0.0.1:9", attempts=2, pause_s=0.0))


def test_an_archive_damaged_on_the_way_does_not_meet_the_tag(server: Server, tmp_path: Path) -> None:
    server.tag = f'"{"0" * 32}"'
    with pytest.raises(AssetError, match="MD5"):
        fetch(MUG, tmp_path, config(server))
    assert left_behind(tmp_path) == set()


def test_a_truncated_archive_leaves_nothing(server: Server, tmp_path: Path) -> None:
    server.content, server.tag = server.content[:200_000], '"not-an-md5"'
    with pytest.raises(AssetError, match="damaged"):
        fetch(MUG, tmp_path, config(server))
    assert left_behind(tmp_path) == set()


@pytest.mark.parametrize("fault", ["empty", "cut off", "without the scan"])
def test_an_archive_that_fails_is_not_recorded(server: Server, tmp_path: Path, fault: str) -> None:
    """Or its sum would have to be met by the good archives that come after it."""
    bad = {"empty": b"", "cut off": good_archive()[:200_000], "without the scan": archive({f"{MUG}/readme": b"sorry"})}
    server.content, server.tag = bad[fault], '"not-an-md5"'
    with pytest.raises(AssetError):
        fetch(MUG, tmp_path, config(server))
    assert left_behind(tmp_path) == set()
    server.content = good_archive()
    fetch(MUG, tmp_path, config(server))
    assert left_behind(tmp_path) == {MUG, MANIFEST}


@pytest.mark.parametrize("record", ["", "[]", '{"a": "b"'])
def test_a_damaged_record_is_named(server: Server, tmp_path: Path, record: str) -> None:
    (tmp_path / MANIFEST).write_text(record)
    with pytest.raises(AssetError, match=f"{MANIFEST}.*remove it to begin a new"):
        fetch(MUG, tmp_path, config(server))


def test_another_archive_than_recorded_is_refused(server: Server, tmp_path: Path) -> None:
    scan = fetch(MUG, tmp_path, config(server))
    scan.unlink()
    server.content = good_archive(0.07)
    with pytest.raises(AssetError, match="SHA-256"):
        fetch(MUG, tmp_path, config(server))
    server.content = good_archive()
    assert fetch(MUG, tmp_path, config(server)) == scan


@pytest.mark.parametrize("name", ["../evil.ply", "/tmp/evil.ply", f"{MUG}/google_16k/../../../evil.ply"])
def test_a_path_that_leads_elsewhere_is_refused(server: Server, tmp_path: Path, name: str) -> None:
    server.content = archive({f"{MUG}/google_16k/nontextured.ply": b"ply", name: b"evil"})
    with pytest.raises(AssetError, match="unsafe"):
        fetch(MUG, tmp_path / "ycb", config(server))
    assert not list(tmp_path.rglob("evil.ply"))
    assert not list(tmp_path.rglob("nontextured.ply"))


def test_links_and_other_objects_are_not_unpacked(server: Server, tmp_path: Path) -> None:
    files = {f"{MUG}/google_16k/nontextured.ply": b"ply", "024_bowl/google_16k/nontextured.ply": b"ply"}
    server.content = archive(files, {f"{MUG}/google_16k/textured.obj": "/etc/passwd"})
    fetch(MUG, tmp_path, config(server))
    assert {path.name for path in tmp_path.rglob("*") if path.is_file()} <= {"nontextured.ply", MANIFEST, ".fetch.lock"}
    assert not (tmp_path / "024_bowl").exists()


def test_an_archive_without_the_scan_is_refused(server: Server, tmp_path: Path) -> None:
    server.content = archive({f"{MUG}/google_16k/readme.txt": b"sorry"})
    with pytest.raises(AssetError, match="holds no 025_mug/google_16k"):
        fetch(MUG, tmp_path, config(server))
    assert not (tmp_path / MUG).exists()


def test_unknown_ids_and_addresses(tmp_path: Path) -> None:
    with pytest.raises(AssetError, match="'mug' is no YCB id; valid are 002_master_chef_can"):
        fetch("mug", tmp_path / "new")
    assert not (tmp_path / "new").exists()
    for wrong in ({"base_url": "ftp://x"}, {"attempts": 0}, {"timeout_s": 0.0}):
        with pytest.raises(InvalidConfigurationError):
            FetchConfig(**wrong)  # type: ignore[arg-type]
