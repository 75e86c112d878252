"""Results scene by scene, and their file: one line of JSON a scene, so that an interrupted run goes on where it was.

The first line says what the run is (seed, objects, model, strategies, search, shift); only the same run is resumed. A
line is written in one piece and synced; a last line that was torn by a crash is dropped and its scene is run again.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bayesgrasp.errors import DataError, clipped
from bayesgrasp.files import MIB, append, make_directory, parsed_json, read_text, write_text
from bayesgrasp.plain_data import restored
from bayesgrasp.types import Attempts, Outcome

FILE = "scenes.jsonl"
LARGEST = 1024 * MIB
"""Bytes; a scene has about two thousand."""
NO_PLAN = "no_plan"
"""The outcome of a strategy that declined to grasp; otherwise an `Outcome` in lower case."""
FORMER = {"mle_metric": "mle_success_ratio", "map_metric": "map_success_ratio"}
"""Strategies that had other names: a journal that has those is read, and gone on with, under the new ones."""


@dataclass(frozen=True)
class Trial:
    """What one strategy did in one scene.

    Attributes:
        outcome: `NO_PLAN`, or the `Outcome` of the lift test in lower case.
        seconds: Wall-clock time of the plan.
        held: Whether the lifted object was also held against pushes; never without success.
        position, quaternion, grasp_type: The hand (metres; w, x, y, z); None where there was no plan.
        promised: The strategy's own p(S=1 | i, h) of the hand; None where it does not say.
    """

    outcome: str
    seconds: float
    held: bool = False
    position: tuple[float, ...] | None = None
    quaternion: tuple[float, ...] | None = None
    grasp_type: int | None = None
    promised: float | None = None

    @property
    def success(self) -> bool:
        """S."""
        return self.outcome == Outcome.SUCCESS.name.lower()


@dataclass(frozen=True)
class SceneResult:
    """One scene and what every strategy did in it.

    Attributes:
        number: i.
        object: Id of the object.
        object_index, scale, object_pose: See `Scenes`.
        lateral_friction, spinning_friction, mass_factor: See `Nuisances`.
        trials: By strategy; those that are not defined on the object are absent.
    """

    number: int
    object: str
    object_index: int
    scale: float
    object_pose: tuple[float, ...]
    lateral_friction: float
    spinning_friction: float
    mass_factor: float
    trials: Mapping[str, Trial]

    def attempt(self, strategy: str) -> Attempts | None:
        """The lift test of a strategy's hand, one row; None where there was no plan."""
        trial = self.trials[strategy]
        if trial.position is None or trial.quaternion is None or trial.grasp_type is None:
            return None
        names = ("scale", "object_pose", "lateral_friction", "spinning_friction", "mass_factor")
        return Attempts(
            position=np.array([trial.position], dtype=np.float32),
            quaternion=np.array([trial.quaternion], dtype=np.float32),
            grasp_type=np.array([trial.grasp_type], dtype=np.uint8),
            object_index=np.array([self.object_index], dtype=np.int32),
            **{name: np.array([getattr(self, name)], dtype=np.float32) for name in names},
        )

    def to_line(self) -> str:
        """One line of JSON."""
        return json.dumps({**vars(self), "trials": {name: vars(trial) for name, trial in self.trials.items()}})

    @staticmethod
    def from_line(line: str) -> SceneResult:
        """The inverse of `to_line`; ValueError where the line is none."""
        return restored(SceneResult, parsed_json(line))


class Journal:
    """The file of a run.

    Args:
        directory: Of the run; made if it is not there.
        identity: What the run is; JSON-able.
        resume: Go on with the run in the directory.

    Raises:
        DataError: There is a run already and ``resume`` is False, or it is of another kind, or it is damaged.
    """

    def __init__(self, directory: Path, identity: Mapping[str, Any], resume: bool) -> None:
        self.path = directory / FILE
        self.results: dict[int, SceneResult] = {}
        make_directory(directory)
        if self.path.exists() and self.path.stat().st_size > 0:
            if not resume:
                raise DataError(f"{directory} holds a run already: give --resume to go on with it, or another --out")
            self._read(identity)
        else:
            self._append(json.dumps({"identity": identity}))

    def add(self, result: SceneResult) -> None:
        """Keep a result."""
        self._append(result.to_line())
        self.results[result.number] = result

    def _read(self, identity: Mapping[str, Any]) -> None:
        text = read_text(self.path, LARGEST)
        whole, _, torn = text.rpartition("\n")
        if torn:
            write_text(self.path, whole + "\n" if whole else "")
        lines = _as_named_now(whole).split("\n")
        try:
            found = dict(parsed_json(lines[0])["identity"])
            results = [SceneResult.from_line(line) for line in lines[1:]]
        except (ValueError, KeyError, TypeError) as error:
            raise DataError(f"{self.path} is not the file of a benchmark, or is damaged: {clipped(error)}") from error
        if different := _differences(found, json.loads(json.dumps(identity))):
            raise DataError(
                f"{self.path} belongs to another run ({', '.join(different)} differ): give the same options, or "
                "another --out"
            )
        self.results = {result.number: result for result in results}

    def _append(self, line: str) -> None:
        append(self.path, f"{line}\n".encode())


def _as_named_now(text: str) -> str:
    """The lines of a journal with the names that strategies have now."""
    for former, name in FORMER.items():
        text = text.replace(f'"{former}"', f'"{name}"')
    return text


def _differences(left: Mapping[str, Any], right: Mapping[str, Any]) -> Sequence[str]:
    return [name for name in sorted(left.keys() | right.keys()) if left.get(name) != right.get(name)]
