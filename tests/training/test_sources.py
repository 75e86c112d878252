"""Several sources as one: every batch once an epoch, in an order of its own that can be asked for again."""

from collections.abc import Iterator
from dataclasses import dataclass

from bayesgrasp.training.sources import InterleavedSources


@dataclass(frozen=True)
class Numbered:
    name: str
    count: int

    def __len__(self) -> int:
        return self.count

    def batches(self, epoch: int) -> Iterator[tuple[str, int, int]]:
        return ((self.name, epoch, k) for k in range(self.count))


SOURCE = InterleavedSources((Numbered("base", 20), Numbered("practice", 5)), seed=1)


def test_every_batch_comes_once() -> None:
    batches = list(SOURCE.batches(3))
    assert len(batches) == len(SOURCE) == 25
    assert sorted(batches) == sorted([*Numbered("base", 20).batches(3), *Numbered("practice", 5).batches(3)])


def test_the_order_mixes_and_depends_on_the_epoch_alone() -> None:
    names = ["".join(name[0] for name, _, _ in SOURCE.batches(epoch)) for epoch in (0, 0, 1)]
    assert names[0] == names[1]
    assert names[0] != names[2]
    assert "bp" in names[0]
    assert "pb" in names[0]
