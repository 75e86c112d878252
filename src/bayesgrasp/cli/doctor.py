"""``bayesgrasp doctor``: what this machine has, what is missing, and what to do about it, in words."""

import importlib.metadata
import importlib.resources
import os
import platform
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from bayesgrasp.errors import AssetError, clipped
from bayesgrasp.files import PART, make_directory, write_json
from bayesgrasp.meshes.cache_directory import cache_directory
from bayesgrasp.objects import ycb

FOR_DEVELOPERS = frozenset({"dev", "docs", "bench"})
"""Extras that no command needs."""
LEFT_AFTER = 3600
"""A file that is not finished after so many seconds never will be."""


@dataclass(frozen=True)
class Report:
    """What was found; sizes in bytes.

    Attributes:
        python: Version.
        platform: Operating system and processor.
        packages: Installed version by name; None where a package is missing.
        optional: The same for packages that only some commands need.
        cores: That this process may use.
        memory: Of the machine.
        gpu: Name of the CUDA device that torch sees, or None.
        cache: Directory, whether it can be written, and its size.
        ycb: Directory named by the environment and the number of objects in it, or None.
        model: Whether a trained model ships with the package.
        missing: Advice, one sentence each; empty where nothing is missing.
    """

    python: str
    platform: str
    packages: dict[str, str | None]
    optional: dict[str, str | None]
    cores: int
    memory: int
    gpu: str | None
    cache: dict[str, Any]
    ycb: dict[str, Any] | None
    model: bool
    missing: list[str]


def doctor(json: Path | None = None, fix: bool = False) -> None:
    """Report versions, hardware, caches, and what is missing.

    Args:
        json: Also write the report to this file.
        fix: First mend what can be mended without asking: install missing packages with pip, make the cache directory,
            and remove what killed processes left in it, an hour old or more.
    """
    for sentence in mend() if fix else ():
        print(sentence)
    report = examine()
    print("\n".join(_lines(report)))
    if json is not None:
        write_json(json, asdict(report), indent=2)


def mend() -> Iterator[str]:
    """Mend what can be mended; says what was done or why it was not, one sentence each."""
    for name in (name for name, version in _versions()[0].items() if version is None):
        done = subprocess.run([sys.executable, "-m", "pip", "install", "--quiet", name], capture_output=True, text=True)
        yield f"installed {name}" if done.returncode == 0 else f"could not install {name}: {clipped(done.stderr)}"
    cache = cache_directory()
    if not cache.exists() and _can_write(cache):
        make_directory(cache)
        yield f"made the cache directory {cache}"
    for part in _left_parts(cache):
        part.unlink(missing_ok=True)
        yield f"removed {part}"


def _left_parts(directory: Path) -> list[Path]:
    """Files that nobody is writing to any more, though they were never finished."""
    latest = time.time() - LEFT_AFTER
    return [path for path in sorted(directory.rglob(f".*{PART}")) if path.is_file() and path.stat().st_mtime < latest]


def examine() -> Report:
    """Look at this machine and this environment."""
    packages, optional = _versions()
    gpu, cache, model = _gpu(packages.get("torch")), _cache(), _has_model()
    ycb, ycb_advice = _ycb()
    return Report(
        python=platform.python_version(),
        platform=f"{platform.system()} {platform.release()}, {platform.machine()}",
        packages=packages,
        optional=optional,
        cores=len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1,
        memory=os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"),
        gpu=gpu,
        cache=cache,
        ycb=ycb,
        model=model,
        missing=list(_advice(packages, optional, gpu, cache, ycb_advice, model)),
    )


def _versions() -> tuple[dict[str, str | None], dict[str, str | None]]:
    """Installed versions of what the package's own metadata asks for, required and optional."""
    found: tuple[dict[str, str | None], dict[str, str | None]] = {}, {}
    for requirement in importlib.metadata.requires("bayesgrasp") or []:
        name = re.split(r"[\s\[<>=!~;(]", requirement, maxsplit=1)[0]
        extra = re.search(r"extra\s*==\s*['\"](\w+)['\"]", requirement)
        if extra is None or extra[1] not in FOR_DEVELOPERS:
            found[extra is not None][name] = _version(name)
    return found


def _version(name: str) -> str | None:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None


def _gpu(torch_version: str | None) -> str | None:
    if torch_version is None:
        return None
    import torch  # there, as its version was found

    return torch.cuda.get_device_name(0) if torch.cuda.is_available() else None


def _cache() -> dict[str, Any]:
    path = cache_directory()
    size = sum(file.stat().st_size for file in path.rglob("*") if file.is_file()) if path.is_dir() else 0
    return {"path": str(path), "writable": _can_write(path), "size": size}


def _can_write(path: Path) -> bool:
    """Whether ``path``, or the nearest directory above it that exists, is a directory that can be written."""
    while not path.exists() and path != path.parent:
        path = path.parent
    return path.is_dir() and os.access(path, os.W_OK)


def _ycb() -> tuple[dict[str, Any] | None, str | None]:
    """The directory of scans with the number of objects in it, or advice."""
    try:
        path = ycb.directory()
    except AssetError as error:
        return None, f"YCB scans: {error}."
    if path is None:
        advice = f"No YCB scans: name their directory in {ycb.DIRECTORY_VARIABLE}; the household objects need none."
        return None, advice
    return {"path": str(path), "objects": len(ycb.scans(path))}, None


def _has_model() -> bool:
    files = importlib.resources.files("bayesgrasp")
    return isinstance(files, Path) and any(files.rglob("*.safetensors"))


def _advice(
    packages: dict[str, str | None],
    optional: dict[str, str | None],
    gpu: str | None,
    cache: dict[str, Any],
    ycb: str | None,
    model: bool,
) -> Iterator[str]:
    for name in (name for name, version in packages.items() if version is None):
        yield f"The package {name} is not installed: run `make setup`, or install it with pip."
    for name in (name for name, version in optional.items() if version is None):
        yield f"The optional package {name} is not installed: `pip install 'bayesgrasp[{name}]'` if you need it."
    if gpu is None:
        yield "No CUDA device: everything runs on the processor; only training would gain much from a GPU."
    if not cache["writable"]:
        yield f"The cache {cache['path']} cannot be written: name another directory in BAYESGRASP_CACHE_DIR."
    if ycb is not None:
        yield ycb
    if not model:
        yield "No trained model ships with this installation: planning needs one made by training."


def _lines(report: Report) -> Iterator[str]:
    yield f"python     {report.python} on {report.platform}"
    yield f"hardware   {report.cores} cores, {report.memory / 2**30:.1f} GiB memory, GPU: {report.gpu or 'none'}"
    cache = report.cache
    yield f"cache      {cache['path']}, {cache['size'] / 2**20:.1f} MiB{'' if cache['writable'] else ', NOT WRITABLE'}"
    ycb = report.ycb
    yield "YCB scans  " + (f"{ycb['path']}, {ycb['objects']} objects" if ycb else "none named")
    yield f"model      {'shipped' if report.model else 'none'}"
    yield f"bayesgrasp {_version('bayesgrasp')}"
    for name, version in {**report.packages, **report.optional}.items():
        yield f"  {name:14} {version or 'missing'}"
    yield ""
    yield from (f"* {sentence}" for sentence in report.missing or ["Nothing is missing."])
