"""What the fuzzer damages and how the library reads it: images, cameras, models, data sets, states and journals.

A damaged file is refused with a `BayesgraspError` of one short line, or gives a value that makes sense; and where the
format has a checksum, no other value than the undamaged one. Everything else is a failure.
"""

import hashlib
import io
import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from fake_world import SMALL
from mutations import mutated
from torch import nn
from training_set import make_training_set
from untrained_model import save_untrained

from bayesgrasp.data.loader import GraspDataset
from bayesgrasp.data.store import Store
from bayesgrasp.errors import BayesgraspError
from bayesgrasp.evaluation.journal import Journal, SceneResult, Trial
from bayesgrasp.geometry.camera import Camera, canonical_camera
from bayesgrasp.observation.depth_files import read_depth, write_depth_png
from bayesgrasp.ratio.card import CARD, write_card
from bayesgrasp.ratio.estimators import SuccessRatio, SuccessRatioConfig
from bayesgrasp.training.state import TrainingState, load_state, save_state
from bayesgrasp.workflows.load import load_planner, load_trained
from bayesgrasp.workflows.stages import Stages

LONGEST_MESSAGE = 400
SETTINGS = {"scale": "small", "seed": 1, "settings": {"attempts": 32}}


@dataclass(frozen=True)
class Target:
    """A file and its reader.

    Attributes:
        name: Of the file, below a folder.
        make: Writes it, and what belongs to it, into the folder.
        read: Reads it as a user's program would; returns a digest of what was read.
        is_json: Whether its values can be edited, too.
        exact: Whether only the undamaged value may be read.
        mend: Makes checksums fit the damaged file, to get at what lies behind them.
    """

    name: str
    make: Callable[[Path], object]
    read: Callable[[Path], str]
    is_json: bool = False
    exact: bool = False
    mend: Callable[[Path], object] | None = None


@dataclass(frozen=True)
class Verdict:
    """How a case ended: the damage, and the message of the refusal, None where a value was read."""

    damage: str
    refusal: str | None


class Corpus:
    """An undamaged file in a folder of its own, to be damaged again and again."""

    def __init__(self, target: Target, folder: Path) -> None:
        self.target, self.folder = target, folder
        folder.mkdir(parents=True, exist_ok=True)
        target.make(folder)
        (self.path,) = folder.glob(target.name)
        self.whole, self.expected = self.path.read_bytes(), target.read(folder)
        self.others = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}

    def attempt(self, number: int) -> Verdict:
        """Damage the file in the way of this number, and read it.

        Raises:
            AssertionError: A value that makes no sense was read, or the refusal is not one short line.
        """
        seed = int.from_bytes(hashlib.sha256(self.target.name.encode()).digest()[:4], "big")
        damage, content = mutated(self.whole, np.random.default_rng([seed, number]), self.target.is_json)
        self.restore()
        self.path.write_bytes(content)
        try:
            if self.target.mend is not None:
                self.target.mend(self.folder)
            found = self.target.read(self.folder)
        except BayesgraspError as error:
            message = str(error).replace(str(self.folder), "")
            if len(message) >= LONGEST_MESSAGE or not message.isprintable():
                raise AssertionError(f"not one short line: {message[:LONGEST_MESSAGE]!r}") from error
            return Verdict(damage, message)
        if self.target.exact and self.target.mend is None and found != self.expected:
            raise AssertionError("another value than the undamaged one was read")
        return Verdict(damage, None)

    def restore(self) -> None:
        """Undo all damage."""
        for path, content in self.others.items():
            if not path.is_file() or path.read_bytes() != content:
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(content)


def digest(*values: Any) -> str:
    """SHA-256 of arrays, tensors, bytes, and of the text of anything else."""
    found = hashlib.sha256()
    for value in values:
        array = value.numpy() if isinstance(value, torch.Tensor) else value
        found.update(np.ascontiguousarray(array).tobytes() if isinstance(array, np.ndarray) else repr(array).encode())
    return found.hexdigest()


def depth() -> np.ndarray:
    """A small depth image, metres, with holes."""
    image = np.random.default_rng(0).uniform(0.5, 1.2, (24, 32)).astype(np.float32)
    image[:3] = 0
    return image


def read_image(folder: Path) -> str:
    """A depth image makes sense if its depths could be some."""
    (path,) = folder.glob("depth.*")
    image = read_depth(path)
    assert image.dtype == np.float32
    assert np.isfinite(image).all()
    assert 0 < image.max() <= 1000
    assert image.min() >= 0
    return digest(image)


def read_camera(folder: Path) -> str:
    """A camera makes sense if it is written and read again as itself."""
    camera = Camera.load(folder / "camera.json")
    again = Camera.from_dict(json.loads(json.dumps(camera.to_dict())))
    assert again.to_dict() == camera.to_dict()
    assert np.isfinite(camera.matrix).all()
    return digest(camera.to_dict())


def read_model(folder: Path) -> str:
    """A model makes sense if a planner can be made of it, which asks it once."""
    planner, model = load_planner(folder), load_trained(folder)
    assert np.isfinite([*planner.prior.low, *planner.prior.high]).all()
    weights = [value for name in sorted(model.estimators) for value in model.estimators[name].state_dict().values()]
    return digest(json.dumps(model.card, sort_keys=True), *weights)


def seal(folder: Path) -> None:
    """Make the card's checksum fit whatever it says now; one that is no object stays as it is."""
    try:
        content = json.loads((folder / CARD).read_bytes())
    except (ValueError, RecursionError):
        return
    if isinstance(content, dict):
        write_card(folder, content)


def seal_weights(folder: Path) -> None:
    """Make the card name the checksum of weights that were damaged."""
    content = json.loads((folder / CARD).read_bytes())
    for role, entry in content["estimators"].items():
        entry["sha256"] = hashlib.sha256((folder / f"{role}.safetensors").read_bytes()).hexdigest()
    write_card(folder, content)


def make_data(folder: Path) -> None:
    """A data set of two chunks."""
    make_training_set(folder / "data", 2 * SMALL.attempts_per_chunk)


def read_data(folder: Path) -> str:
    """A data set makes sense if all its columns are those of its shards."""
    shutil.rmtree(folder / "data" / "cache", ignore_errors=True)
    return read_cached(folder)


def read_cached(folder: Path) -> str:
    """The same, by way of the unpacked columns that are there."""
    dataset = GraspDataset(folder / "data")
    columns = {**dataset.scene_columns, **{f"attempt_{k}": v for k, v in dataset.attempt_columns.items()}}
    return digest(dataset.manifest, *(part for name in sorted(columns) for part in (name, columns[name])))


def make_cache(folder: Path) -> None:
    """A data set that was unpacked."""
    make_data(folder)
    read_cached(folder)


def read_shard(folder: Path) -> str:
    """A chunk without its checksums makes sense if its columns have their types and one length."""
    chunk = Store(folder / "data").chunk(0)
    for records in (chunk.attempts, chunk.scenes, chunk.hands):
        assert len({len(column) for column in records.columns().values()}) == 1
    return digest(*chunk.attempts.columns().values())


def parts_of_a_run() -> tuple[nn.Module, nn.Module, nn.Module, torch.optim.Optimizer]:
    """An estimator, its average, its best, and its optimiser after a step."""
    with torch.random.fork_rng():
        torch.manual_seed(0)
        modules = [SuccessRatio(SuccessRatioConfig(widths=(8,))) for _ in range(3)]
    optimizer = torch.optim.AdamW(modules[0].parameters())
    for parameter in modules[0].parameters():
        parameter.grad = torch.ones_like(parameter)
    optimizer.step()
    return modules[0], modules[1], modules[2], optimizer


def make_state(folder: Path) -> None:
    """A saved state of training."""
    state = TrainingState("a run", 2, 3, 0.5, 1, [1.0, 0.5], [1.0, 0.6])
    save_state(folder / "state.safetensors", state, *parts_of_a_run())


def read_state(folder: Path) -> str:
    """A state makes sense if it is the one that was saved."""
    parts = parts_of_a_run()
    state = load_state(folder / "state.safetensors", "a run", *parts)
    return digest(state, *(value for module in parts[:3] for value in module.state_dict().values()))


def make_journal(folder: Path) -> None:
    """The journal of a benchmark of two scenes."""
    journal = Journal(folder, {"seed": 1}, resume=False)
    for number in range(2):
        trials = {"plan": Trial("success", 0.5, True, (0.1, 0.0, 0.2), (1.0, 0.0, 0.0, 0.0), 1)}
        journal.add(SceneResult(number, "mug", 0, 1.0, (0.0, 0.01, 0.5), 0.8, 0.004, 1.0, trials))


def read_journal(folder: Path) -> str:
    """A journal makes sense if its scenes can be written again."""
    results = Journal(folder, {"seed": 1}, resume=True).results
    return digest(*(result.to_line() for result in results.values()))


def _npy(folder: Path) -> None:
    np.save(folder / "depth.npy", depth())


def _npz(folder: Path) -> None:
    content = io.BytesIO()
    np.savez_compressed(content, depth=depth(), mask=depth() > 0)
    (folder / "depth.npz").write_bytes(content.getvalue())


TARGETS: dict[str, Target] = {
    "png": Target("depth.png", lambda folder: write_depth_png(folder / "depth.png", depth()), read_image, exact=True),
    "npy": Target("depth.npy", _npy, read_image),
    "npz": Target("depth.npz", _npz, read_image),
    "camera": Target("camera.json", lambda f: canonical_camera().save(f / "camera.json"), read_camera, is_json=True),
    "card": Target("card.json", save_untrained, read_model, is_json=True, exact=True),
    "card, sealed again": Target("card.json", save_untrained, read_model, is_json=True, mend=seal),
    "weights": Target("success.safetensors", save_untrained, read_model, exact=True),
    "weights, sealed again": Target("success.safetensors", save_untrained, read_model, mend=seal_weights),
    "manifest": Target("data/manifest.json", make_data, read_data, is_json=True, exact=True),
    "journal": Target("data/journal.jsonl", make_data, read_data, exact=True),
    "shard": Target("data/scenes/000000000.parquet", make_data, read_data, exact=True),
    "shard, unchecked": Target("data/scenes/000000000.parquet", make_data, read_shard),
    "unpacked column": Target("data/cache/scenes-*/image.npy", make_cache, read_cached, exact=True),
    "unpacked index": Target("data/cache/scenes-*/index.json", make_cache, read_cached, is_json=True, exact=True),
    "training state": Target("state.safetensors", make_state, read_state, exact=True),
    "benchmark journal": Target("scenes.jsonl", make_journal, read_journal),
    "experiment": Target(
        "experiment.json",
        lambda folder: Stages(folder, SETTINGS),
        lambda folder: digest(Stages(folder, SETTINGS).done),
        is_json=True,
    ),
}
