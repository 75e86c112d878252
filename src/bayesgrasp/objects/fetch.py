"""Download scans from the official archives of the YCB Object and Model Set (Calli et al. 2015, CC BY 4.0).

An interrupted download continues where it stopped: the bytes so far wait in a ``.part`` file, and the server is asked
for the rest provided that the archive is still the same one (HTTP Range and If-Range). No official checksums are
published. So an archive is checked against its length and, where the server's entity tag is an MD5 sum (as Amazon S3's
is for a file stored in one piece), against that; its SHA-256 sum is written to ``checksums.json`` beside the scans once
it could be unpacked, and must be met by every later download. Files are unpacked aside and moved into place when
complete.
"""

from __future__ import annotations

import hashlib
import http.client
import logging
import os
import re
import shutil
import tarfile
import tempfile
import time
import urllib.error
import urllib.request
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from filelock import FileLock

from bayesgrasp.errors import AssetError, FileError, InvalidConfigurationError, clipped
from bayesgrasp.files import MIB, read_json, write_json
from bayesgrasp.objects import ycb

log = logging.getLogger(__name__)

BASE_URL = "https://ycb-benchmarks.s3.amazonaws.com/data"
MANIFEST = "checksums.json"
MANIFEST_LIMIT = MIB
CHUNK = 1 << 16
MAX_UNPACKED = 1 << 30  # bytes; an archive of this kind holds some ten megabytes
Progress = Callable[[int, int | None], None]


@dataclass(frozen=True)
class FetchConfig:
    """How archives are downloaded.

    Attributes:
        base_url: Address above ``google/<id>_google_16k.tgz``.
        attempts: Connections tried in a row without a single new byte before giving up.
        pause_s: Wait before the second attempt; doubled for each further one.
        timeout_s: Silence of the server that ends an attempt.
    """

    base_url: str = BASE_URL
    attempts: int = 4
    pause_s: float = 1.0
    timeout_s: float = 30.0

    def __post_init__(self) -> None:
        if not re.match(r"https?://", self.base_url):
            raise InvalidConfigurationError(f"base URL is {self.base_url!r}; it must start with http:// or https://")
        if self.attempts < 1 or self.pause_s < 0 or self.timeout_s <= 0:
            raise InvalidConfigurationError(f"attempts and timeout_s must be positive, pause_s not negative: {self}")


@dataclass(frozen=True)
class _Tag:
    """What the server says about an archive: its entity tag and its whole length in bytes, where known."""

    etag: str | None
    length: int | None

    @property
    def md5(self) -> str | None:
        match = re.fullmatch(r'"([0-9a-f]{32})"', self.etag or "")
        return match[1] if match else None


def fetch(object_id: str, root: Path, config: FetchConfig | None = None, progress: Progress | None = None) -> Path:
    """Download one object and unpack it below ``root``; does nothing if its scan is there already.

    Args:
        object_id: A YCB id.
        root: Directory of scans; made if need be.
        config: Where from, and how patiently.
        progress: Called with the bytes there so far, and all bytes where known.

    Returns:
        The mesh file.

    Raises:
        AssetError: The id is unknown, the archive cannot be had, is damaged, is not the one recorded, or is unsafe.
    """
    config = config or FetchConfig()
    if object_id not in ycb.masses():
        raise AssetError(f"'{object_id}' is no YCB id; valid are {', '.join(ycb.masses())}")
    if (there := ycb.scans(root).get(object_id)) is not None:
        return there
    root.mkdir(parents=True, exist_ok=True)
    with FileLock(root / ".fetch.lock"):
        _fetch(object_id, root, config, progress or (lambda done, total: None))
    return ycb.scans(root)[object_id]


def _fetch(object_id: str, root: Path, config: FetchConfig, progress: Progress) -> None:
    name = f"{object_id}_google_16k.tgz"
    archive = root / name
    url = f"{config.base_url.rstrip('/')}/google/{name}"
    tag = _download(url, archive, config, progress)
    try:
        found = _verify(archive, tag, root / MANIFEST)
        _unpack(archive, object_id, root)
        _record(archive.name, found, root / MANIFEST)  # of an archive that holds the scan, and of no other
    finally:
        archive.unlink()


def _download(url: str, archive: Path, config: FetchConfig, progress: Progress) -> _Tag:
    """Bring the whole archive to its place, over as many connections as it takes."""
    part = archive.with_name(archive.name + ".part")
    failures = 0
    while True:
        before = _size(part)
        try:
            tag = _transfer(url, part, config.timeout_s, progress)
        except (OSError, http.client.HTTPException) as error:
            if isinstance(error, urllib.error.HTTPError):
                _check_refusal(error, url, part)
            failures = 1 if _size(part) > before else failures + 1
            if failures >= config.attempts:
                advice = f"{_size(part)} bytes are kept, run the command again to go on"
                raise AssetError(f"{url}: {error}; {advice}") from error
            log.info("%s: %s; trying again", url, error)
            time.sleep(config.pause_s * 2 ** (failures - 1))
        else:
            os.replace(part, archive)
            _tag_file(part).unlink(missing_ok=True)
            return tag


def _check_refusal(error: urllib.error.HTTPError, url: str, part: Path) -> None:
    """Drop kept bytes that do not fit the archive; give up where trying again cannot help."""
    if error.code == http.HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE and part.exists():
        part.unlink()
    elif error.code in (http.HTTPStatus.FORBIDDEN, http.HTTPStatus.NOT_FOUND):
        raise AssetError(f"{url}: the server has no such archive (HTTP {error.code}); see --base-url") from error
    elif error.code < http.HTTPStatus.INTERNAL_SERVER_ERROR:
        raise AssetError(f"{url}: the server answered HTTP {error.code} {error.reason}") from error


def _size(part: Path) -> int:
    return part.stat().st_size if part.exists() else 0


def _transfer(url: str, part: Path, timeout: float, progress: Progress) -> _Tag:
    """One connection: append what is missing to ``part``; raises OSError where it breaks off early."""
    start = _size(part)
    headers = {"User-Agent": "bayesgrasp"}
    if start and (etag := _read_tag(part)):
        headers |= {"Range": f"bytes={start}-", "If-Range": etag}
    with urllib.request.urlopen(urllib.request.Request(url, headers=headers), timeout=timeout) as answer:
        resumed = answer.status == http.HTTPStatus.PARTIAL_CONTENT
        start = start if resumed else 0
        rest = answer.headers.get("Content-Length")
        tag = _Tag(answer.headers.get("ETag"), None if rest is None else start + int(rest))
        _tag_file(part).write_text(tag.etag or "")
        with part.open("ab" if resumed else "wb") as file:
            while chunk := answer.read(CHUNK):
                file.write(chunk)
                progress(file.tell(), tag.length)
            done = file.tell()
    if tag.length is not None and done < tag.length:
        raise ConnectionError(f"the connection broke off after {done} of {tag.length} bytes")
    return tag


def _tag_file(part: Path) -> Path:
    return part.with_name(part.name + ".etag")


def _read_tag(part: Path) -> str:
    path = _tag_file(part)
    return path.read_text() if path.exists() else ""


def _verify(archive: Path, tag: _Tag, manifest: Path) -> str:
    """Compare an archive with the server's sum and with the one recorded, if any; its SHA-256 sum."""
    content = archive.read_bytes()
    if tag.md5 is not None and hashlib.md5(content, usedforsecurity=False).hexdigest() != tag.md5:
        raise AssetError(
            f"{archive.name}: damaged on the way (its MD5 sum is not the server's {tag.md5}); fetch it again"
        )
    found = hashlib.sha256(content).hexdigest()
    if _recorded(manifest).get(archive.name, found) != found:
        raise AssetError(
            f"{archive.name}: its SHA-256 sum {found} is not the one recorded in {manifest}; the archive has changed: "
            "remove the line there if that is right"
        )
    return found


def _recorded(manifest: Path) -> dict[str, str]:
    """Sums of earlier downloads by the archive's name."""
    if not manifest.exists():
        return {}
    try:
        sums = read_json(manifest, MANIFEST_LIMIT)
    except FileError as error:
        raise AssetError(f"{error}; remove it to begin a new record") from error
    if not isinstance(sums, dict):
        raise AssetError(f"{manifest} is no record of sums; remove it to begin a new one")
    return sums


def _record(name: str, found: str, manifest: Path) -> None:
    """Keep the sum of a first download."""
    write_json(manifest, dict(sorted((_recorded(manifest) | {name: found}).items())))


def _unpack(archive: Path, object_id: str, root: Path) -> None:
    with tempfile.TemporaryDirectory(dir=root, prefix=".unpack-") as aside:
        try:
            with tarfile.open(archive, "r:gz") as members:
                _extract(members, object_id, Path(aside))
        except (tarfile.TarError, EOFError, zlib.error, OSError) as error:
            said = clipped(error, 80)
            raise AssetError(f"{archive.name}: the archive is damaged ({said}); fetch it again") from error
        if object_id not in ycb.scans(Path(aside)):
            raise AssetError(f"{archive.name}: holds no {object_id}/google_16k/{ycb.MESH_FILES[0]}")
        _move(Path(aside) / object_id / "google_16k", root / object_id / "google_16k")


def _move(source: Path, target: Path) -> None:
    """Move files into a folder, meshes last, so that a scan is there only with everything that belongs to it."""
    target.mkdir(parents=True, exist_ok=True)
    for file in sorted(source.iterdir(), key=lambda file: file.name in ycb.MESH_FILES):
        os.replace(file, target / file.name)


def _extract(members: tarfile.TarFile, object_id: str, aside: Path) -> None:
    """Write the plain files below ``<id>/google_16k``; a name that leads elsewhere condemns the whole archive."""
    total = 0
    for member in members:
        path = PurePosixPath(member.name)
        if path.is_absolute() or ".." in path.parts:
            raise AssetError(f"the archive is unsafe: it names {member.name!r}")
        content = members.extractfile(member) if member.isfile() else None
        if content is None or path.parts[:-1] != (object_id, "google_16k"):
            continue
        total += member.size
        if total > MAX_UNPACKED:
            raise AssetError(f"the archive unpacks to more than {MAX_UNPACKED} bytes")
        target = aside / path
        target.parent.mkdir(parents=True, exist_ok=True)
        with target.open("wb") as file:
            shutil.copyfileobj(content, file)
