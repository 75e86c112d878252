"""What a data set says about itself: its manifest, and the entries of its journal, one for each chunk that counts.

Both are JSON, sealed (`sealed.py`): one flipped bit in a seed, a count or a checksum is found. Sets of versions that
did not seal them are read all the same.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from bayesgrasp.data.schema import SCHEMA_VERSION
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.files import parsed_json
from bayesgrasp.plain_data import restored
from bayesgrasp.sealed import sealed, unsealed
from bayesgrasp.types import UNSTATED_HAND, HandIdentity, Outcome

TABLES = ("attempts", "scenes")
Given = Literal["image", "object", "nothing"]


@dataclass(frozen=True)
class Manifest:
    """What a data set is. `identity` decides whether more chunks may be added to it.

    Attributes:
        seed: The one seed of everything.
        config: The configuration, as JSON values.
        objects: Ordered: `id`, `sha256`, `split`, `mass_kg` of each.
        gripper: Name of the gripper.
        attempts: How many attempts were asked for.
        commit: Commit of the program, where known.
        version: Version of the program.
        totals: Counts when the run ended: attempts, scenes, outcomes by name, per object; empty before.
        schema_version: Of the shards.
        gripper_sha256: Of the gripper's description.

    Raises:
        InvalidConfigurationError: No attempts, or a negative seed.
    """

    seed: int
    config: dict[str, Any]
    objects: list[dict[str, Any]]
    gripper: str
    attempts: int
    commit: str = ""
    version: str = ""
    totals: dict[str, Any] = field(default_factory=dict)
    schema_version: int = SCHEMA_VERSION
    gripper_sha256: str = UNSTATED_HAND

    def __post_init__(self) -> None:
        if self.attempts < 1:
            raise InvalidConfigurationError(f"the number of attempts must be at least 1, got {self.attempts}")
        if self.seed < 0:
            raise InvalidConfigurationError(f"the seed must be at least 0, got {self.seed}")

    @property
    def hand(self) -> HandIdentity:
        """The hand that it was made with."""
        return HandIdentity(self.gripper, self.gripper_sha256)

    @property
    def given(self) -> Given:
        """What the hands of a set of practice were proposed from (`generation.practice`)."""
        given: Given = self.config.get("practice", {}).get("given", "image")
        return given

    @property
    def cameras(self) -> Literal["canonical", "any"]:
        """Where the images were taken from (`prior.cameras`)."""
        return "any" if "elevation" in self.config.get("generate", {}).get("camera", {}) else "canonical"

    @property
    def identity(self) -> dict[str, Any]:
        """Everything that the content of a chunk depends on."""
        content = {
            "schema_version": self.schema_version,
            "seed": self.seed,
            "gripper": self.gripper,
            "objects": self.objects,
            "config": self.config,
        }
        # Left out where sets that do not state it leave it out, so that they can be added to.
        return content | ({} if self.gripper_sha256 == UNSTATED_HAND else {"gripper_sha256": self.gripper_sha256})

    def to_dict(self) -> dict[str, Any]:
        """As the content of its file, sealed."""
        return sealed(asdict(self))

    @staticmethod
    def from_dict(content: Mapping[str, Any]) -> Manifest:
        """From the content of its file.

        Raises:
            ValueError: It was altered, or is no manifest.
        """
        manifest = restored(Manifest, unsealed(content, required=False))
        if any(not isinstance(item.get("id"), str) for item in manifest.objects):
            raise ValueError("every one of its objects must have an id")
        return manifest


@dataclass(frozen=True)
class Entry:
    """One line of the journal.

    Attributes:
        chunk: Number of the chunk.
        attempts, scenes: Rows.
        outcomes: For each object that occurs, by its index as text: counts by `Outcome` value.
        sha256: Of the two files, in the order of `TABLES`.
    """

    chunk: int
    attempts: int
    scenes: int
    outcomes: dict[str, list[int]]
    sha256: list[str]

    def to_line(self) -> str:
        """As a line of the journal, sealed."""
        return json.dumps(sealed(asdict(self))) + "\n"

    @staticmethod
    def from_line(line: bytes) -> Entry:
        """The inverse of `to_line`.

        Raises:
            ValueError: The line was altered, or is none.
        """
        content = parsed_json(line.decode())
        if not isinstance(content, dict):
            raise ValueError("a line of it is no object")
        entry = restored(Entry, unsealed(content, required=False))
        counts = [count for of_object in entry.outcomes.values() for count in of_object]
        if len(entry.sha256) != len(TABLES) or min(entry.chunk, entry.attempts, entry.scenes, *counts, 0) < 0:
            raise ValueError(f"the line of chunk {entry.chunk} has impossible counts or checksums")
        if any(not key.isdigit() or len(c) != len(Outcome) for key, c in entry.outcomes.items()):
            raise ValueError(f"the line of chunk {entry.chunk} has impossible outcomes")
        return entry


def fingerprint(manifest: Manifest, entries: Mapping[int, Entry]) -> str:
    """A name for the very data: what they are, and the checksums of all their files."""
    content = json.dumps([manifest.identity, [entries[chunk].sha256 for chunk in sorted(entries)]], sort_keys=True)
    return hashlib.sha256(content.encode()).hexdigest()[:16]
