"""Cuts that keep a cavity open, and what becomes of meshes on which an algorithm fails."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from bayesgrasp.errors import AssetError, InvalidConfigurationError
from bayesgrasp.meshes import decompose as room
from bayesgrasp.meshes.convex import ConvexPart
from bayesgrasp.meshes.cutting import CutLimits, CuttingFailedError
from bayesgrasp.meshes.decompose import DEFAULT, PAPER, ConvexConfig, decompose
from bayesgrasp.meshes.deviation import deviation
from bayesgrasp.meshes.mesh import signed_volume
from bayesgrasp.objects.shapes import box, hollow, prism, turned

CONFIGS = [ConvexConfig(concavity_m=0.01, search_iterations=10), replace(PAPER, voxels=10_000)]
BOX = box(0.05, 0.06, 0.07).mesh


def convex_and_outward(part: ConvexPart) -> bool:
    normals, offsets = part.halfspaces()
    return bool((part.vertices @ normals.T <= offsets + 1e-9).all()) and signed_volume(part.vertices[part.faces]) > 0


@pytest.mark.parametrize("config", CONFIGS, ids=["coacd", "vhacd"])
def test_a_cup_is_cut_without_filling_it(config: ConvexConfig) -> None:
    cup = hollow([(0.035, 0.0), (0.035, 0.08)], wall=0.008, floor=0.01)
    found = decompose(cup.mesh.vertices, cup.mesh.faces, config)
    assert found.remark == ""
    assert len(found.parts) <= config.max_parts
    assert all(convex_and_outward(part) for part in found.parts)
    assert all(len(part.vertices) <= config.max_vertices for part in found.parts)
    middle = np.array([[0.0, 0.0, z] for z in np.linspace(0.02, 0.08, 5)])
    assert min(part.depth(middle).min() for part in found.parts) > 0.005
    measured = deviation(cup.mesh, found.parts)
    assert measured.gap_max < 0.003
    assert measured.excess_max < 0.015


def test_the_same_mesh_is_cut_alike() -> None:
    bottle = turned([(0.04, 0.0), (0.04, 0.04), (0.01, 0.05), (0.01, 0.1)]).mesh
    config = ConvexConfig(search_iterations=10)
    first, second = (decompose(bottle.vertices, bottle.faces, config).parts for _ in range(2))
    assert len(first) > 1
    assert len(first) == len(second)
    for one, other in zip(first, second, strict=True):
        np.testing.assert_array_equal(one.vertices, other.vertices)


def test_cutting_is_silent(capfd: pytest.CaptureFixture[str]) -> None:
    decompose(BOX.vertices, BOX.faces, DEFAULT)
    assert capfd.readouterr() == ("", "")


def test_an_octagonal_post_through_a_box_does_not_end_the_process() -> None:
    """CoACD 1.0.14 crashes on these 40 faces; whatever another one does, there are parts that cover the mesh."""
    solid = (box(0.066, 0.058, 0.066) + prism(0.033, 0.08, 8)).mesh
    found = decompose(solid.vertices, solid.faces, replace(DEFAULT, voxels=20_000), CutLimits(seconds=20))
    assert all(convex_and_outward(part) for part in found.parts)
    assert np.min([part.depth(solid.vertices) for part in found.parts], axis=0).max() < 0.005


@pytest.fixture
def failing(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[str]]:
    """Makes algorithms fail for the reasons given, others give the mesh itself; returns who is asked, in order."""

    def fail(**reasons: str) -> list[str]:
        asked: list[str] = []

        def cut(vertices, faces, options, limits):
            asked.append(options["algorithm"])
            if options["algorithm"] in reasons:
                raise CuttingFailedError(reasons[options["algorithm"]])
            return [vertices]

        monkeypatch.setattr(room, "cut_apart", cut)
        return asked

    return fail


def test_where_coacd_fails_v_hacd_cuts(failing) -> None:
    asked = failing(coacd="crashed (SIGSEGV)")
    found = decompose(BOX.vertices, BOX.faces)
    assert asked == ["coacd", "vhacd"]
    assert found.remark == "CoACD crashed (SIGSEGV), so V-HACD cut the mesh"
    assert len(found.parts) == 1


def test_where_both_fail_the_hull_is_the_only_part(failing) -> None:
    asked = failing(coacd="needed more than 120 s", vhacd="crashed (SIGABRT)")
    cup = hollow([(0.035, 0.0), (0.035, 0.08)], wall=0.008, floor=0.01).mesh
    found = decompose(cup.vertices, cup.faces)
    assert asked == ["coacd", "vhacd"]
    assert found.remark == (
        "CoACD needed more than 120 s and V-HACD crashed (SIGABRT), so the convex hull is its only part"
    )
    assert len(found.parts) == 1
    assert found.parts[0].depth(cup.vertices).max() < 0.001


def test_the_paper_s_preset_does_not_fall_back_on_coacd(failing) -> None:
    asked = failing(vhacd="failed (why ever)")
    assert "convex hull" in decompose(BOX.vertices, BOX.faces, PAPER).remark
    assert asked == ["vhacd"]


def test_pieces_without_a_volume_are_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    sliver = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 1e-7]], np.float64)

    def cut(vertices, faces, options, limits):
        return [sliver] if options["algorithm"] == "coacd" else [vertices, sliver]

    monkeypatch.setattr(room, "cut_apart", cut)
    found = decompose(BOX.vertices, BOX.faces)
    assert found.remark == "CoACD gave no part with a volume, so V-HACD cut the mesh"
    assert len(found.parts) == 1


def test_a_mesh_that_nothing_can_be_made_of_is_one_error(failing) -> None:
    failing(coacd="crashed (SIGSEGV)", vhacd="crashed (SIGSEGV)")
    with pytest.raises(AssetError, match=r"CoACD crashed .* and V-HACD crashed .*, and its convex hull has no volume"):
        decompose(np.c_[BOX.vertices[:, :2], np.zeros(8)], BOX.faces)


@pytest.mark.parametrize(
    "wrong",
    [
        {"algorithm": "magic"},
        {"concavity_m": 0.0},
        {"concavity_m": float("nan")},
        {"max_parts": 0},
        {"max_vertices": 4},
    ],
)
def test_a_wrong_configuration_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises((InvalidConfigurationError, TypeError)):
        ConvexConfig(**wrong)  # type: ignore[arg-type]
