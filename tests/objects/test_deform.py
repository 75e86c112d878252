"""Deformed copies are objects at rest like the ones they come from, as bent as their parts allow."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.meshes.mesh import Mesh
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.objects.deform import Deformation, DeformConfig, deformed, with_copies

FACTORS = np.array([1.2, 0.8, 1.1])


@pytest.fixture(scope="module")
def carton():
    return load_objects("household_carton")[0]


@pytest.fixture(scope="module")
def hammer():
    return load_objects("household_hammer")[0]


def test_the_bounding_box_is_stretched_and_still_rests_on_the_table(carton):
    copy = deformed(carton, Deformation(FACTORS), "copy")
    np.testing.assert_allclose(copy.extents, FACTORS * carton.extents)
    assert abs(min(part.vertices[:, 2].min() for part in copy.parts)) < 1e-9


def test_the_centre_of_mass_stays_above_the_origin(carton):
    copy = deformed(carton, Deformation(FACTORS), "copy")
    np.testing.assert_allclose(copy.center_of_mass, FACTORS * carton.center_of_mass, atol=1e-9)


def test_the_mass_grows_with_the_volume(carton):
    assert deformed(carton, Deformation(FACTORS), "copy").mass_kg == pytest.approx(carton.mass_kg * 1.2 * 0.8 * 1.1)


def test_inertia_is_that_of_the_stretched_body(carton):
    """Second moments of a uniform body scale with the square of each axis: I_xx = M_yy + M_zz and so on."""
    moments = np.trace(carton.inertia) / 2 - np.diag(carton.inertia)
    scaled = moments * FACTORS**2
    np.testing.assert_allclose(
        np.diag(deformed(carton, Deformation(FACTORS), "copy").inertia), scaled.sum() - scaled, rtol=1e-6
    )


def test_copies_follow_the_originals_and_depend_on_the_generator_alone(carton):
    objects = with_copies((carton,), DeformConfig(copies=2), np.random.default_rng(3))
    again = with_copies((carton,), DeformConfig(copies=2), np.random.default_rng(3))
    assert [o.id for o in objects] == ["household_carton", "household_carton~1", "household_carton~2"]
    assert objects[0] is carton
    np.testing.assert_array_equal(objects[2].vertices, again[2].vertices)
    assert not np.allclose(objects[1].extents, objects[2].extents)


@pytest.mark.parametrize("factors", [[0.0, 1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, np.nan]])
def test_factors_must_be_positive(factors):
    with pytest.raises(InvalidConfigurationError, match="positive"):
        Deformation(np.array(factors))


def test_impossible_settings_are_refused():
    with pytest.raises(InvalidConfigurationError, match="stretch"):
        DeformConfig(copies=1, stretch=0.5)


def test_impossible_bends_and_tapers_are_refused():
    for wrong in ({"taper": 1.0}, {"taper": -0.1}, {"bend": 3.2}, {"bend": float("nan")}):
        with pytest.raises(InvalidConfigurationError, match="taper < 1 and 0 <= bend < pi"):
            DeformConfig(copies=1, **wrong)


def test_a_taper_changes_widths_with_height(carton):
    copy = deformed(carton, Deformation(np.ones(3), taper=0.4), "copy")
    height = carton.extents[2]
    for z, share in ((0.0, 1.2), (height, 0.8)):
        ends = copy.vertices[np.abs(copy.vertices[:, 2] - z) < 1e-6]
        np.testing.assert_allclose(np.ptp(ends[:, :2], axis=0), share * carton.extents[:2], rtol=1e-6)
    # A frustum has the mean of a b over its height, which is (1 + t^2 / 12) of the box.
    assert copy.mass_kg == pytest.approx(carton.mass_kg * (1 + 0.4**2 / 12), rel=1e-6)


def test_a_bend_keeps_the_length_of_the_middle_line(hammer):
    angle = 0.6
    copy = deformed(hammer, Deformation(np.ones(3), bend=angle), "copy")
    length = hammer.extents[0]
    mapped = Deformation(np.ones(3), bend=angle).apply(
        np.array([[x, 0.0, 0.0] for x in (-length / 2, 0.0, length / 2)]), hammer.extents
    )
    chord = np.linalg.norm(mapped[2] - mapped[0])
    assert chord == pytest.approx(2 * length / angle * np.sin(angle / 2))
    np.testing.assert_allclose(mapped[1], 0, atol=1e-12)
    assert copy.extents[2] == pytest.approx(hammer.extents[2], abs=1e-6)


@pytest.mark.parametrize("name", ["household_hammer", "household_coffee_mug", "household_bottle"])
def test_bent_and_tapered_copies_rest_and_have_parts_that_cover_them(name):
    (asset,) = load_objects(name)
    copy = deformed(asset, Deformation(np.array([1.1, 0.9, 1.0]), taper=-0.3, bend=0.7), "copy")
    assert min(part.vertices[:, 2].min() for part in copy.parts) == pytest.approx(0, abs=1e-9)
    np.testing.assert_allclose(copy.center_of_mass[:2], 0, atol=1e-9)
    before = np.min([part.depth(asset.vertices) for part in asset.parts], axis=0).max()
    assert np.min([part.depth(copy.vertices) for part in copy.parts], axis=0).max() < before + 0.0016
    assert Mesh(copy.vertices, copy.faces).volume > 0


def test_a_copy_bends_no_more_than_its_parts_allow():
    """A long smooth bar in one part cannot follow an arc: the mesh would leave the hull of the part's mapped ends."""
    (bar,) = load_objects("household_book")
    fine = Mesh(bar.vertices, bar.faces).to_trimesh().subdivide().subdivide().subdivide()
    smooth = replace(bar, vertices=np.array(fine.vertices), faces=np.array(fine.faces, np.int32))
    copy = deformed(smooth, Deformation(np.ones(3), bend=1.5), "copy")
    assert np.min([part.depth(copy.vertices) for part in copy.parts], axis=0).max() < 0.0016


def test_a_copy_of_a_procedural_object_goes_to_other_processes_as_it_is():
    (thing,) = load_objects("procedural:1@7")
    copy = pickle.loads(pickle.dumps(deformed(thing, Deformation(FACTORS), "copy")))
    assert copy.id == "copy"
    np.testing.assert_allclose(copy.extents, FACTORS * thing.extents)
