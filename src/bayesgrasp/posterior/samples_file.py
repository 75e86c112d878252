"""Posterior draws as a file that other programs read: one array a variable, under the names that Python has.

`position` (n, 3) metres and `rotation` (n, 3, 3) in the world frame, `grasp_type` (n,) as numbers (0 basic, 1 wide, 2
pinch), `log_prob` (n,) nats and `success_probability` (n,); beside them `effective_sample_size`, `acceptance` and
`jump_acceptance` of the draws. A .npz file holds them as arrays, a .json file as lists,
with null for what is no finite number.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.files import check_target, write_json, write_through
from bayesgrasp.posterior.posterior import Posterior
from bayesgrasp.posterior.sampling import PosteriorSample

QUALITY = ("effective_sample_size", "acceptance", "jump_acceptance")
SUFFIXES = (".npz", ".json")


def check_samples_target(path: Path) -> None:
    """Refuse a file before the work for it.

    Raises:
        InvalidConfigurationError: It ends in something else than .npz or .json.
        FileError: It cannot be written.
    """
    if path.suffix not in SUFFIXES:
        raise InvalidConfigurationError(f"samples are written to a .npz or .json file, got {path}")
    check_target(path)


def write_samples(path: Path, drawn: PosteriorSample, posterior: Posterior) -> None:
    """Write draws with their densities and estimates of success.

    Args:
        path: A .npz or .json file.
        drawn: Hands in the world frame.
        posterior: That they were drawn from.

    Raises:
        InvalidConfigurationError: As for `check_samples_target`.
        FileError: Likewise.
    """
    check_samples_target(path)
    arrays = sample_arrays(drawn, posterior)
    if path.suffix == ".npz":
        write_through(path, lambda file: np.savez_compressed(file, allow_pickle=False, **arrays))
    else:
        write_json(path, {name: _listed(array) for name, array in arrays.items()})


def sample_arrays(drawn: PosteriorSample, posterior: Posterior) -> dict[str, np.ndarray]:
    """The content of the file; arguments as for `write_samples`."""
    hands = drawn.hands
    columns = {
        "position": hands.position,
        "rotation": hands.rotation,
        "grasp_type": hands.grasp_type,
        "log_prob": posterior.log_prob(hands),
        "success_probability": posterior.success_probability(hands),
    }
    arrays = {name: column.cpu().numpy() for name, column in columns.items()}
    return arrays | {name: np.array(getattr(drawn, name)) for name in QUALITY}


def _listed(array: np.ndarray) -> Any:
    """As lists; JSON has no word for what is no finite number."""
    values = array.astype(object)
    values[~np.isfinite(array)] = None
    return values.tolist()
