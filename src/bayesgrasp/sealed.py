"""JSON objects that know when they were altered: each holds a checksum of its other entries.

The checksum is SHA-256 of the entries as compact JSON in the order of their names, so that layout does not matter and
one changed character of a name or a value does. It finds damage and forgotten edits; it is no signature.
"""

import hashlib
import json
from collections.abc import Mapping
from typing import Any

CHECKSUM = "checksum"


def sealed(content: Mapping[str, Any]) -> dict[str, Any]:
    """An object with its checksum, as its last entry; an old one is replaced."""
    entries = {name: value for name, value in content.items() if name != CHECKSUM}
    return entries | {CHECKSUM: _digest(entries)}


def unsealed(content: Mapping[str, Any], required: bool = True) -> dict[str, Any]:
    """An object without its checksum, which must be right.

    Args:
        content: As `sealed` made it, perhaps written and read since.
        required: Refuse an object that never had a checksum.

    Raises:
        ValueError: It is wrong, or there is none.
    """
    entries = {name: value for name, value in content.items() if name != CHECKSUM}
    if CHECKSUM not in content:
        if required:
            raise ValueError("it has no checksum: an earlier version wrote it, or it was altered")
    elif content[CHECKSUM] != _digest(entries):
        raise ValueError("it was altered or damaged after it was written: its checksum differs")
    return entries


def _digest(entries: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(entries, sort_keys=True, separators=(",", ":")).encode()).hexdigest()
