"""A mixed model lies between two; what does not fit, or would overwrite a model, is refused."""

from pathlib import Path

import pytest
import torch
from safetensors.torch import load_file
from untrained_model import save_untrained

from bayesgrasp.errors import CheckpointError, InvalidConfigurationError
from bayesgrasp.ratio.card import read_card, write_card
from bayesgrasp.ratio.checkpoint import load_model, save_estimators
from bayesgrasp.training.mix import mix

WEIGHTS = "success.safetensors"


@pytest.fixture(scope="module")
def models(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Two models of the same shape; the second has other weights."""
    folder = tmp_path_factory.mktemp("mix")
    further, start = save_untrained(folder / "further"), save_untrained(folder / "start")
    earlier = load_model(start)
    for estimator in earlier.estimators.values():
        for weight in estimator.parameters():
            weight.data.mul_(-2.0)
    card = read_card(start)
    write_card(start, card | {"estimators": save_estimators(start, earlier.estimators, card["estimators"])})
    return further, start


@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
def test_weights_lie_between(models: tuple[Path, Path], tmp_path: Path, share: float) -> None:
    mix(*models, share, tmp_path / "mixed")
    mixed, (further, start) = load_file(tmp_path / "mixed" / WEIGHTS), (load_file(one / WEIGHTS) for one in models)
    for name, value in mixed.items():
        if value.is_floating_point():
            torch.testing.assert_close(value, (1 - share) * further[name] + share * start[name])
    load_model(tmp_path / "mixed")  # and the card fits


def test_a_share_is_a_share_and_a_model_is_not_overwritten(models: tuple[Path, Path], tmp_path: Path) -> None:
    with pytest.raises(InvalidConfigurationError, match=r"between 0 and 1, got 1\.5"):
        mix(*models, 1.5, tmp_path / "mixed")
    with pytest.raises(CheckpointError, match="holds a model already"):
        mix(*models, 0.5, models[0])
