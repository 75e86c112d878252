"""Named tensors in one safetensors file: weights of estimators and states of training runs; reading runs no code.

A file is read whole and bounded, so that what was checked (its checksum, its header) is what is used. Weights are
checked against the module that they are for by name, shape and type, and by value: one NaN among them makes every plan
nonsense.
"""

import hashlib
from collections.abc import Mapping
from pathlib import Path

from safetensors import SafetensorError
from safetensors.torch import load, save
from torch import Tensor, nn

from bayesgrasp.errors import CheckpointError, FileError, clipped, shown
from bayesgrasp.files import MIB, make_directory, parsed_json, read_bytes, write_bytes

LARGEST = 1024 * MIB
"""Bytes of a file of weights."""
LARGEST_HEADER = MIB
LARGEST_WEIGHT = 1e6
"""In absolute value; trained weights are below a hundred, and their squares must not overflow."""


def write_tensors(path: Path, tensors: Mapping[str, Tensor], metadata: dict[str, str]) -> str:
    """Write a safetensors file that appears whole or not at all, and return its SHA-256."""
    make_directory(path.parent)
    # A file must not share memory between tensors, and keeps no memory format.
    plain = {name: value.detach().cpu().contiguous().clone() for name, value in tensors.items()}
    content = save(plain, metadata)
    write_bytes(path, content)
    return hashlib.sha256(content).hexdigest()


def read_weights(path: Path) -> bytes:
    """The bytes of a file of tensors.

    Raises:
        CheckpointError: The file is missing, too large, or cannot be read.
    """
    try:
        return read_bytes(path, LARGEST)
    except FileError as error:
        raise CheckpointError(f"weights: {error}") from error


def parse_tensors(content: bytes, path: Path) -> tuple[dict[str, Tensor], dict[str, str]]:
    """Tensors and metadata of a safetensors file; parsing one runs no code.

    Raises:
        CheckpointError: It is none, or it is damaged.
    """
    try:
        tensors: dict[str, Tensor] = load(content)
        return tensors, _metadata(content)
    except (SafetensorError, KeyError, ValueError, TypeError) as error:  # KeyError: a type that torch does not know
        raise CheckpointError(f"the weights {path} are damaged, or no safetensors file: {clipped(error)}") from error


def read_tensors(path: Path) -> tuple[dict[str, Tensor], dict[str, str]]:
    """Tensors and metadata of a safetensors file; raises `CheckpointError` where it is missing or damaged."""
    return parse_tensors(read_weights(path), path)


def check_values(tensors: Mapping[str, Tensor], path: Path | str) -> None:
    """Refuse weights that are not finite or are absurdly large.

    Raises:
        CheckpointError: Naming the first of them.
    """
    for name, value in tensors.items():
        if value.is_floating_point() and not bool((value.abs() <= LARGEST_WEIGHT).all()):
            raise CheckpointError(
                f"the weights {path} cannot be used: {shown(name)} has values that are not finite, or beyond "
                f"{LARGEST_WEIGHT:g}"
            )


def check_weights(module: nn.Module, tensors: Mapping[str, Tensor], path: Path | str) -> None:
    """Refuse weights that do not fit a module.

    Raises:
        CheckpointError: Another name, shape, type or value than the module's.
    """
    expected = module.state_dict()
    if different := sorted(expected.keys() ^ tensors.keys()):
        raise CheckpointError(
            f"the weights {path} do not fit {type(module).__name__}: {shown(different[0])} is "
            f"{'missing' if different[0] in expected else 'not in it'}"
        )
    for name, value in expected.items():
        found = tensors[name]
        if (found.shape, found.dtype) != (value.shape, value.dtype):
            raise CheckpointError(
                f"the weights {path} do not fit {type(module).__name__}: {shown(name)} is {_kind(found)}, "
                f"not {_kind(value)}"
            )
    check_values(tensors, path)


def load_weights(module: nn.Module, tensors: Mapping[str, Tensor], path: Path | str) -> None:
    """Load weights, all of them and nothing else.

    Raises:
        CheckpointError: Names, shapes or types differ, or a value is not finite.
    """
    check_weights(module, tensors, path)
    module.load_state_dict(dict(tensors))


def _metadata(content: bytes) -> dict[str, str]:
    """The strings beside the tensors: `__metadata__` of the header, which follows its own length."""
    length = int.from_bytes(content[:8], "little")
    if length > LARGEST_HEADER:
        raise ValueError(f"its header has {length} bytes, at most {LARGEST_HEADER} are read")
    header = parsed_json(content[8 : 8 + length].decode())
    metadata: dict[str, str] = header.get("__metadata__", {})
    return metadata


def _kind(value: Tensor) -> str:
    return f"{str(value.dtype).removeprefix('torch.')} {list(value.shape)}"
