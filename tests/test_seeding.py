"""Random streams: one table, no two purposes on one path, and no random number of the package from anywhere else."""

import ast
import itertools
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import torch

from bayesgrasp.seeding import Stream, generator, torch_child, torch_generator

PACKAGE = Path(__file__).parents[1] / "src" / "bayesgrasp"
ADDRESSED = frozenset({"generator", "torch_generator", "seed_sequence"})
"""Calls that name a stream."""
UNADDRESSED = frozenset(
    {"default_rng", "SeedSequence", "RandomState", "PCG64", "PCG64DXSM", "Generator", "manual_seed"}
)
"""Calls that make a source of random numbers, or seed one, without a name; `seeding` alone may."""


def _called(node: ast.Call) -> str:
    return node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")


def _names_a_stream(node: ast.Call) -> bool:
    """Whether the path of an addressed call begins with ``Stream.X`` or a field of that type."""
    where = node.args[1] if len(node.args) > 1 else None
    if not isinstance(where, ast.Attribute):
        return False
    return where.attr == "stream" or (isinstance(where.value, ast.Name) and where.value.id == "Stream")


def unnamed(source: str) -> Iterator[str]:
    """Every call in ``source`` that takes random numbers from outside the table."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and node.module == "bayesgrasp.seeding":
            yield from (f"line {node.lineno}: {a.name} as {a.asname}" for a in node.names if a.asname is not None)
        if not isinstance(node, ast.Call):
            continue
        inside = [part for part in ast.walk(node) if isinstance(part, ast.Call) and part is not node]
        if _called(node) in ADDRESSED and not _names_a_stream(node):
            yield f"line {node.lineno}: {ast.unparse(node)}"
        if _called(node) in UNADDRESSED and not any(_called(part) in ADDRESSED for part in inside):
            yield f"line {node.lineno}: {ast.unparse(node)}"


@pytest.mark.parametrize(
    "path", [p for p in sorted(PACKAGE.rglob("*.py")) if p.name != "seeding.py"], ids=lambda p: p.stem
)
def test_every_stream_of_the_package_begins_with_an_entry_of_the_table(path: Path) -> None:
    assert list(unnamed(path.read_text())) == []


@pytest.mark.parametrize(
    "source",
    [
        "rng = generator(seed)",
        "rng = generator(seed, 3, 7)",
        "rng = seeding.torch_generator(seed, number)",
        "rng = np.random.default_rng(seed)",
        "rng = torch.Generator().manual_seed(int(rng.integers(2**62)))",
        "from bayesgrasp.seeding import generator as stream",
    ],
)
def test_a_planted_unnamed_stream_is_caught(source: str) -> None:
    assert list(unnamed(source))


def test_a_named_stream_passes() -> None:
    assert not list(unnamed("a = generator(seed, Stream.PLAN)\nb = torch_generator(self.seed, self.stream, 3)"))


def test_no_entry_of_the_table_begins_with_another() -> None:
    entries = [stream.value for stream in Stream.__members__.values()]
    assert all(entries)
    for first, second in itertools.permutations(entries, 2):
        assert second[: len(first)] != first


def test_streams_differ_and_repeat() -> None:
    firsts = {generator(0, stream).random() for stream in Stream} | {
        generator(0, Stream.PLAN, k).random() for k in range(9)
    }
    assert len(firsts) == len(Stream) + 9
    assert generator(0, Stream.ATTEMPT, 3, 7).random() == generator(0, 4, 0, 3, 7).random()
    assert generator(0, Stream.PLAN).random() != generator(1, Stream.PLAN).random()


def test_a_child_is_addressed_and_not_drawn() -> None:
    rng, drawn = (generator(0, Stream.PLAN, 5) for _ in range(2))
    drawn.random(100)
    first, second = torch_child(rng), torch_child(rng)
    assert torch.equal(torch.rand(3, generator=torch_child(drawn)), torch.rand(3, generator=first))
    expected = torch.rand(3, generator=torch_generator(0, Stream.PLAN, 5, 1))
    assert torch.equal(torch.rand(3, generator=second), expected)
    np.testing.assert_array_equal(rng.random(4), generator(0, Stream.PLAN, 5).random(4))
