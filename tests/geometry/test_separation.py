"""A separating face is found where there is one, and never where the bodies overlap."""

from itertools import product

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from bayesgrasp.geometry.separation import Body, Halfspaces, Regions
from bayesgrasp.seeding import generator

CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))
CUBE = Halfspaces(np.concatenate([np.eye(3), -np.eye(3)]), np.full(6, 0.1))


def test_being_certainly_apart_needs_a_separating_face() -> None:
    places = np.array([[0.2, 0.0, 0.0], [0.149, 0.0, 0.0], [0.151, 0.0, 0.0], [0.0, 0.0, 0.0]])
    turns = np.tile(0.05 * np.eye(3), (4, 1, 1))
    apart = Body(CORNERS).certainly_apart(turns, places, Regions.of([CUBE]))
    np.testing.assert_array_equal(apart, [True, False, True, False])


def test_all_regions_count() -> None:
    aside = Halfspaces(CUBE.normals, CUBE.offsets + CUBE.normals @ [1.0, 0.0, 0.0])
    places = np.array([[0.5, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    turns = np.tile(0.05 * np.eye(3), (4, 1, 1))
    apart = Body(CORNERS).certainly_apart(turns, places, Regions.of([CUBE, aside]))
    np.testing.assert_array_equal(apart, [True, False, False, True])


def test_it_is_what_the_matrix_product_says() -> None:
    """All vertices beyond some face of each of three regions; random hulls in random places."""
    rng = generator(6, 0)
    hulls = [ConvexHull(rng.normal(size=(30, 3)) * 0.05 + rng.uniform(-0.1, 0.1, 3)).equations for _ in range(3)]
    regions = [Halfspaces(np.ascontiguousarray(hull[:, :3]), -hull[:, 3]) for hull in hulls]
    vertices, scale = rng.normal(size=(40, 3)), rng.uniform(0.02, 0.05, (500, 1, 1))
    linear, shift = scale * Rotation.random(500, rng=7).as_matrix(), rng.uniform(-0.3, 0.3, (500, 3))
    moved = vertices @ linear.transpose(0, 2, 1) + shift[:, None]
    beyond = [((moved @ r.normals.T).min(axis=1) > r.offsets).any(axis=1) for r in regions]
    apart = Body(vertices).certainly_apart(linear, shift, Regions.of(regions))
    np.testing.assert_array_equal(apart, np.all(beyond, axis=0))
    assert 50 < apart.sum() < 450
