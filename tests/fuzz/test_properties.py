"""What holds for every value: what is written is read back, and what is quoted stays short."""

import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from bayesgrasp import files
from bayesgrasp.data.images import pack, unpack
from bayesgrasp.data.manifest import Entry
from bayesgrasp.errors import BayesgraspError, clipped, shown
from bayesgrasp.geometry.camera import IMAGE_SHAPE, Camera, canonical_camera
from bayesgrasp.observation.depth_files import checked_depth, read_depth, write_depth_png
from bayesgrasp.observation.stored_arrays import npy_array
from bayesgrasp.sealed import sealed, unsealed

SCALARS = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text()
JSON = st.recursive(SCALARS, lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner), max_leaves=20)
OBJECTS = st.dictionaries(st.text(), JSON)
COUNTS = st.integers(0, 2**40)
OUTCOMES = st.dictionaries(st.integers(0, 99).map(str), st.lists(COUNTS, min_size=6, max_size=6))
# The same examples every time, and no time limit, as for all tests.
repeatable = settings(derandomize=True, deadline=None, database=None, max_examples=60)


@repeatable
@given(JSON)
def test_json_is_read_as_it_was_written(value: Any) -> None:
    with tempfile.TemporaryDirectory() as folder:
        files.write_json(Path(folder) / "value.json", value)
        assert files.read_json(Path(folder) / "value.json", files.MIB) == value


@repeatable
@given(OBJECTS, st.text(), JSON)
def test_a_seal_fits_its_object_and_no_other(content: dict[str, Any], name: str, value: Any) -> None:
    closed = json.loads(json.dumps(sealed(content)))
    content.pop("checksum", None)
    assert unsealed(closed) == content
    if name != "checksum" and (name not in closed or json.dumps(closed[name]) != json.dumps(value)):
        try:
            unsealed({**closed, name: value})
        except ValueError:
            return
        raise AssertionError("an alteration was not found")


@repeatable
@given(COUNTS, COUNTS, COUNTS, OUTCOMES)
def test_a_line_of_the_journal_is_read_back(
    chunk: int, attempts: int, scenes: int, outcomes: dict[str, list[int]]
) -> None:
    entry = Entry(chunk, attempts, scenes, outcomes, ["a" * 64, "b" * 64])
    assert Entry.from_line(entry.to_line().rstrip().encode()) == entry


@repeatable
@given(st.one_of(st.text(), JSON, st.binary(), st.integers().map(lambda n: n**99)), st.integers(4, 200))
def test_what_is_quoted_is_one_short_printable_line(value: Any, most: int) -> None:
    assert len(shown(value, most)) <= most
    assert shown(value, most).isprintable()
    assert len(clipped(shown(value), most)) <= most
    assert clipped(shown(value), most).isprintable()


@repeatable
@given(st.text(), st.integers(4, 200))
def test_any_text_is_clipped_to_one_printable_line(text: str, most: int) -> None:
    assert len(clipped(text, most)) <= most
    assert clipped(text, most).isprintable()


@repeatable
@given(arrays(np.uint16, st.tuples(st.integers(16, 40), st.integers(16, 40)), elements=st.integers(400, 65535)))
def test_a_depth_png_is_read_back_to_the_millimetre(millimetres: np.ndarray) -> None:
    depth = (millimetres / 1000).astype(np.float32)
    with tempfile.TemporaryDirectory() as folder:
        write_depth_png(Path(folder) / "depth.png", depth)
        try:
            image = read_depth(Path(folder) / "depth.png")
        except BayesgraspError:
            assert np.median(depth) > 20  # metres, beyond which a unit cannot be told
            return
    np.testing.assert_allclose(image, depth, atol=1e-5)


@repeatable
@given(st.sampled_from(["<f4", ">f8", "<u2", ">i4", "<f2"]), array_shapes(max_dims=3, max_side=6), st.booleans())
def test_an_array_is_read_as_numpy_reads_it(kind: str, shape: tuple[int, ...], fortran: bool) -> None:
    array = np.arange(np.prod(shape)).reshape(shape).astype(kind)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "array.npy"
        np.save(path, np.asfortranarray(array) if fortran else array)
        np.testing.assert_array_equal(npy_array(path.read_bytes()), np.load(path))


@repeatable
@given(arrays(np.float32, (16, 17), elements=st.floats(width=32)))
def test_an_array_of_any_numbers_is_a_depth_image_or_refused(stored: np.ndarray) -> None:
    try:
        image = checked_depth(stored)
    except BayesgraspError as error:
        message = str(error)
    else:
        message = ""
        assert np.isfinite(image).all()
        assert image.min() >= 0
    assert len(message) < 300


@repeatable
@given(st.integers(0, 2**32 - 1), st.integers(1, 65536))
def test_an_image_is_unpacked_to_the_bit(seed: int, colours: int) -> None:
    image = np.random.default_rng(seed).integers(0, colours, IMAGE_SHAPE).astype(np.uint16)
    np.testing.assert_array_equal(unpack(pack(image)), image)


@repeatable
@given(st.dictionaries(st.sampled_from(["width", "height", "fx", "fy", "cx", "cy"]), SCALARS | st.floats()))
def test_any_intrinsics_make_a_camera_or_one_clear_error(changes: dict[str, Any]) -> None:
    content = canonical_camera().to_dict()
    content["intrinsics"] |= changes
    try:
        camera = Camera.from_dict(content)
    except BayesgraspError as error:
        message = str(error)
    else:
        message = ""
        assert Camera.from_dict(json.loads(json.dumps(camera.to_dict()))).to_dict() == camera.to_dict()
    assert len(message) < 300
