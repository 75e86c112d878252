"""Stretched copies are objects at rest like the ones they come from."""

import numpy as np
import pytest

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.objects.stretch import StretchConfig, stretched, with_copies

FACTORS = np.array([1.2, 0.8, 1.1])


@pytest.fixture(scope="module")
def carton():
    return load_objects("household_carton")[0]


def test_the_bounding_box_is_stretched_and_still_rests_on_the_table(carton):
    copy = stretched(carton, FACTORS, "copy")
    np.testing.assert_allclose(copy.extents, FACTORS * carton.extents)
    assert abs(min(part.vertices[:, 2].min() for part in copy.parts)) < 1e-9


def test_the_centre_of_mass_stays_above_the_origin(carton):
    copy = stretched(carton, FACTORS, "copy")
    np.testing.assert_allclose(copy.center_of_mass, FACTORS * carton.center_of_mass, atol=1e-9)


def test_the_mass_grows_with_the_volume(carton):
    assert stretched(carton, FACTORS, "copy").mass_kg == pytest.approx(carton.mass_kg * 1.2 * 0.8 * 1.1)


def test_inertia_is_that_of_the_stretched_body(carton):
    """Second moments of a uniform body scale with the square of each axis: I_xx = M_yy + M_zz and so on."""
    moments = np.trace(carton.inertia) / 2 - np.diag(carton.inertia)
    scaled = moments * FACTORS**2
    np.testing.assert_allclose(np.diag(stretched(carton, FACTORS, "copy").inertia), scaled.sum() - scaled, rtol=1e-6)


def test_copies_follow_the_originals_and_depend_on_the_generator_alone(carton):
    objects = with_copies((carton,), StretchConfig(copies=2), np.random.default_rng(3))
    again = with_copies((carton,), StretchConfig(copies=2), np.random.default_rng(3))
    assert [o.id for o in objects] == ["household_carton", "household_carton~1", "household_carton~2"]
    assert objects[0] is carton
    np.testing.assert_array_equal(objects[2].vertices, again[2].vertices)
    assert not np.allclose(objects[1].extents, objects[2].extents)


@pytest.mark.parametrize("factors", [[0.0, 1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, np.nan]])
def test_factors_must_be_positive(carton, factors):
    with pytest.raises(InvalidConfigurationError, match="positive"):
        stretched(carton, np.array(factors), "copy")


def test_impossible_settings_are_refused():
    with pytest.raises(InvalidConfigurationError, match="most"):
        StretchConfig(copies=1, most=0.5)
