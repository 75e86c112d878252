"""Small batches and small estimators, as fixtures, for the tests of the learner: `ratio` and `training`."""

from collections.abc import Callable, Iterator

import pytest
import torch

from bayesgrasp.data.schema import Batch
from bayesgrasp.geometry.camera import canonical_camera
from bayesgrasp.geometry.so3 import quaternion_to_matrix
from bayesgrasp.ratio.evidence import PointsConfig, ViewConfig
from bayesgrasp.ratio.layers import ConvConfig
from bayesgrasp.ratio.local import LocalConfig
from bayesgrasp.types import Hands

HEIGHT, WIDTH = 32, 48


def make_hands(shape: tuple[int, ...], rng: torch.Generator, dtype: torch.dtype = torch.float32) -> Hands:
    position = torch.rand(*shape, 3, generator=rng, dtype=dtype) * torch.tensor([0.3, 0.3, 0.22]).to(dtype)
    quaternion = torch.nn.functional.normalize(torch.randn(*shape, 4, generator=rng, dtype=dtype), dim=-1)
    position = position + torch.tensor([-0.15, -0.15, 0.12]).to(dtype)
    return Hands(position, quaternion_to_matrix(quaternion), torch.randint(3, shape, generator=rng))


def make_batch(scenes: int, hands: int, seed: int) -> Batch:
    """Success is likelier for high hands over bright images, so there is something to learn."""
    rng = torch.Generator().manual_seed(seed)
    drawn = make_hands((scenes, hands), rng)
    images = (0.6 + 0.3 * torch.rand(scenes, 1, 1, 1, generator=rng)).expand(-1, 1, HEIGHT, WIDTH).contiguous()
    logit = 40 * (drawn.position[..., 2] - 0.23) + 20 * (images[:, 0, 0, :1] - 0.75)
    success = (torch.rand(scenes, hands, generator=rng) < logit.sigmoid()).float()
    ones = torch.ones(scenes, hands)
    index = torch.randint(3, (scenes,), generator=rng)
    return Batch(drawn, success, ones, ones, images, index, torch.ones(scenes), torch.zeros(scenes, 3), ones, success)


class ListSource:
    """The same batches in every epoch."""

    def __init__(self, kept: list[Batch]) -> None:
        self.kept = kept

    def __len__(self) -> int:
        return len(self.kept)

    def batches(self, epoch: int) -> Iterator[Batch]:
        return iter(self.kept)


@pytest.fixture
def rng() -> torch.Generator:
    return torch.Generator().manual_seed(3)


@pytest.fixture(scope="session")
def batch() -> Callable[..., Batch]:
    return make_batch


@pytest.fixture(scope="session")
def hands() -> Callable[..., Hands]:
    return make_hands


@pytest.fixture(scope="session")
def source() -> ListSource:
    return ListSource([make_batch(4, 8, seed) for seed in range(5)])


@pytest.fixture(scope="session")
def encoder() -> ConvConfig:
    return ConvConfig((HEIGHT, WIDTH), (4, 8), 8)


@pytest.fixture(scope="session")
def local() -> LocalConfig:
    view = ViewConfig.of(canonical_camera(), HEIGHT, WIDTH)
    return LocalConfig(evidence=PointsConfig(view), channels=(4, 4, 4, 4), vector=4, widths=(16, 8))
