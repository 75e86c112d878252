"""Record what fixed seeds give, so that a change of the code's layout can be shown to change nothing else.

Every command that computes runs in small, through the command line, with one thread; what it writes is reduced to
hashes and counts. Run it before a change and after, on one machine, and compare:

    python benchmarks/behaviour.py --json before.json
    python benchmarks/behaviour.py --json after.json --against before.json
"""

import argparse
import hashlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from safetensors.torch import load_file, save_file

from bayesgrasp.files import write_json
from bayesgrasp.workflows.load import PAPER_MODEL

Record = dict[str, Any]
TIMES = ("second", "time", "timings")
"""Numbers under names that contain one of these are times of this run, not results."""


def main() -> None:
    """Run, write, compare."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, required=True, help="where the record goes")
    parser.add_argument("--against", type=Path, help="an earlier record; the exit code is 1 where they differ")
    parser.add_argument("--only", nargs="*", default=[], help="names of parts to run")
    options = parser.parse_args()
    record: Record = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, part in PARTS.items():
            if not options.only or name in options.only:
                record[name] = part(Path(folder))
                print(f"{name}: {record[name]}", flush=True)
                write_json(options.json, record)
    if options.against is not None:
        raise SystemExit(_compare(json.loads(options.against.read_text(encoding="utf-8")), record))


def _compare(before: Record, after: Record) -> int:
    different = [name for name in after if before.get(name) != after[name]]
    print(f"equal: {len(after) - len(different)} of {len(after)}; different: {different or 'none'}")
    return int(bool(different))


def _bayesgrasp(*words: object) -> None:
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    command = [str(Path(sys.executable).parent / "bayesgrasp"), *map(str, words)]
    done = subprocess.run(command, env=os.environ | threads, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{' '.join(command)}\n{done.stdout}{done.stderr}")


def _digest(*files: Path) -> str:
    found = hashlib.sha256()
    for file in files:
        found.update(file.read_bytes())
    return found.hexdigest()[:16]


def _without_times(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _without_times(v) for k, v in value.items() if not any(word in k for word in TIMES)}
    return [_without_times(v) for v in value] if isinstance(value, list) else value


def _json_digest(text: str) -> str:
    return hashlib.sha256(json.dumps(_without_times(json.loads(text)), sort_keys=True).encode()).hexdigest()[:16]


def outcomes(folder: Path) -> Record:
    """2,000 lift tests from the prior, held ones counted as successes."""
    _bayesgrasp("simulate", "--attempts", 2000, "--criterion", "hold", "--json", folder / "simulate.json")
    return {"digest": _json_digest((folder / "simulate.json").read_text(encoding="utf-8"))}


def image(folder: Path) -> Record:
    """A rendered depth image, with noise and without."""
    out = folder / "image"
    _bayesgrasp("render", "--object", "household_drink_can", "--pose", 0.02, -0.01, 0.7, "--seed", 3, "--out", out)
    return {name: _digest(out / name) for name in ("depth.png", "depth.npy", "clean.png", "camera.json")}


def data(folder: Path) -> Record:
    """Data sets: 4,096 attempts by the adaptive proposal, and what a model practises."""
    shape = ("--attempts-per-draw", 64, "--scenes-per-draw", 2)
    _bayesgrasp("generate", "--attempts", 4096, "--split", "stand-ins", "--proposal", "adaptive", *shape,
                "--out", folder / "data")  # fmt: skip
    return {"shards": _digest(*sorted((folder / "data").rglob("*.parquet")))}


def practice(folder: Path) -> Record:
    """What the shipped model proposes for new scenes, and how it ends."""
    shipped = PAPER_MODEL
    _bayesgrasp("practice", "--model", shipped, "--scenes", 16, "--split", "stand-ins", "--out", folder / "practice")
    return {"shards": _digest(*sorted((folder / "practice").rglob("*.parquet")))}


def weights(folder: Path) -> Record:
    """Models: an epoch of every estimator of both presets."""
    found: Record = {}
    first = "success_ratio"
    for preset, estimators in (("best", (first, "success", "full")), ("paper", (first, "image", "joint"))):
        _bayesgrasp("train", "--data", folder / "data", "--preset", preset, "--estimators", *estimators, "--epochs", 1,
                    "--batch-size", 8, "--threads", 1, "--out", folder / preset)  # fmt: skip
        for name in estimators:
            # Records call this estimator `metric`, as they did before its role was named after what it is; the file's
            # header holds the role.
            recorded = "metric" if name == first else name
            save_file(load_file(folder / preset / f"{name}.safetensors"), folder / "again", {"role": recorded})
            found[f"{preset}/{recorded}"] = _digest(folder / "again")
    return found


def plan(folder: Path) -> Record:
    """A plan with samples from the rendered image."""
    files = ("--depth", folder / "image" / "depth.png", "--camera", folder / "image" / "camera.json")
    _bayesgrasp("plan", *files, "--samples", 500, "--json", folder / "plan.json")
    return {"digest": _json_digest((folder / "plan.json").read_text(encoding="utf-8"))}


def diagnosis(folder: Path) -> Record:
    """Calibration on fresh successes."""
    _bayesgrasp("diagnose", "--fresh", 6, "--split", "stand-ins", "--proposals", 500, "--workers", 1,
                "--json", folder / "diagnose.json")  # fmt: skip
    return {"digest": _json_digest((folder / "diagnose.json").read_text(encoding="utf-8"))}


def benchmark(folder: Path) -> Record:
    """Every strategy in 40 scenes of the training objects."""
    _bayesgrasp("benchmark", "--attempts", 40, "--out", folder / "benchmark")
    # The first line says what the run is, in names and checksums; the others are results.
    lines = (folder / "benchmark" / "scenes.jsonl").read_text(encoding="utf-8").splitlines()[1:]
    scenes = sorted(json.dumps(_without_times(json.loads(line)), sort_keys=True) for line in lines)
    return {"scenes": hashlib.sha256("\n".join(scenes).encode()).hexdigest()[:16], "lines": len(scenes)}


PARTS: dict[str, Callable[[Path], Record]] = {
    part.__name__: part for part in (outcomes, image, data, practice, weights, plan, diagnosis, benchmark)
}

if __name__ == "__main__":
    main()
