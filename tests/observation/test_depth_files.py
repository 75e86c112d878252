"""Depth files: every accepted form reads the same, everything else gets an error that says why."""

import os
import struct
import zipfile
import zlib

import numpy as np
import pytest
from PIL import Image

from bayesgrasp.errors import DepthImageError
from bayesgrasp.observation.depth_files import checked_depth, read_depth, write_depth_png
from bayesgrasp.seeding import generator


@pytest.fixture
def depth():
    image = generator(0).uniform(0.5, 1.2, (48, 64)).astype(np.float32)
    image[:5] = 0
    return image


def test_every_form_reads_the_same(tmp_path, depth):
    millimetres = np.rint(depth * 1000).astype(np.uint16)
    write_depth_png(tmp_path / "a.png", depth)
    np.save(tmp_path / "a.npy", depth)
    np.save(tmp_path / "mm.npy", millimetres)
    np.save(tmp_path / "float_mm.npy", depth.astype(np.float64) * 1000)
    np.save(tmp_path / "channel.npy", depth[..., None])
    np.save(tmp_path / "first.npy", depth[None])
    np.savez(tmp_path / "one.npz", depth)
    np.savez(tmp_path / "named.npz", depth=depth, mask=depth > 0)
    for path in sorted(tmp_path.iterdir()):
        image = read_depth(path)
        assert image.dtype == np.float32
        np.testing.assert_allclose(image, depth, atol=5.1e-4)
    np.testing.assert_array_equal(read_depth(tmp_path / "a.npy", unit="m"), depth)
    assert np.array_equal(np.array(Image.open(tmp_path / "a.png")), millimetres)


def test_nan_is_a_hole_only_if_asked(depth):
    depth[10:20] = np.nan
    depth[20:22] = np.inf
    with pytest.raises(DepthImageError, match="768 of 3072 pixels are NaN or infinite"):
        checked_depth(depth)
    assert (checked_depth(depth, nan_is_hole=True)[10:22] == 0).all()


def test_a_signalling_nan_is_one_too(depth):
    depth.view(np.uint32)[10, 10] = 0x7F800001
    with pytest.raises(DepthImageError, match="1 of 3072 pixels are NaN"):
        checked_depth(depth)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d * 0, "all pixels are 0"),
        (lambda d: np.full_like(d, np.nan), "NaN"),
        (lambda d: d - 0.1, "negative"),
        (lambda d: d[0], "shape"),
        (lambda d: np.stack([d, d, d], axis=-1), "shape"),
        (lambda d: d[:8], "at least 16"),
        (lambda d: d.astype(complex), "integers or floating-point"),
        (lambda d: d > 0, "integers or floating-point"),
        (lambda d: (d * 100).astype(np.uint8), "8-bit"),
        (lambda d: d * 30, "cannot be told"),
        (lambda d: d * 1e6, "cannot be told"),
        (lambda d: np.where(d > 1.19, 1e30, d), r"\d+ of 3072 pixels are further than 1000 m"),
        (lambda d: np.where(d > 1.19, 1e300, d.astype(np.float64)), "further than 1000 m"),
    ],
)
def test_what_is_no_depth_image_is_refused(depth, change, message):
    with pytest.raises(DepthImageError, match=message):
        checked_depth(change(depth))


def test_a_wrong_unit_is_refused(depth):
    with pytest.raises(DepthImageError, match="m would be plausible"):
        checked_depth(depth, unit="mm")
    with pytest.raises(DepthImageError, match="mm would be plausible"):
        checked_depth(depth * 1000, unit="m")
    with pytest.raises(DepthImageError, match="unknown unit"):
        checked_depth.__wrapped__(depth, unit="cm")


def test_files_that_cannot_be_read_are_named(tmp_path, depth):
    (tmp_path / "broken.png").write_bytes(b"no picture")
    (tmp_path / "broken.npy").write_bytes(b"no array")
    (tmp_path / "empty.npz").write_bytes(b"")
    (tmp_path / "depth.txt").write_text("0.7")
    Image.fromarray((depth * 100).astype(np.uint8)).save(tmp_path / "picture.png")
    np.savez(tmp_path / "two.npz", a=depth, b=depth)
    np.save(tmp_path / "objects.npy", np.array([{}]), allow_pickle=True)
    write_depth_png(tmp_path / "cut.png", depth)
    (tmp_path / "cut.png").write_bytes((tmp_path / "cut.png").read_bytes()[:1000])
    for path in [*sorted(tmp_path.iterdir()), tmp_path / "absent.png"]:
        with pytest.raises(DepthImageError, match=path.name):
            read_depth(path)


def png(*chunks: tuple[bytes, bytes]) -> bytes:
    """A PNG file of these parts, with right checksums."""
    parts = (struct.pack(">I", len(d)) + n + d + struct.pack(">I", zlib.crc32(n + d)) for n, d in chunks)
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


def size(width: int, height: int, bits: int = 16, colour: int = 0) -> tuple[bytes, bytes]:
    return b"IHDR", struct.pack(">IIBBBBB", width, height, bits, colour, 0, 0, 0)


def pixels(width: int, height: int) -> tuple[bytes, bytes]:
    return b"IDAT", zlib.compress(b"".join(b"\0" + b"\x02\xbc" * width for _ in range(height)))


END = b"IEND", b""
IMAGE = png(size(32, 20), pixels(32, 20), END)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (IMAGE.replace(b"\x10\0\0\0\0", b"\x10\0\0\0\1"), "checksum of its part b'IHDR' is wrong"),
        (IMAGE[:-4], "ends too early"),
        (IMAGE[:18], "ends too early"),
        (IMAGE.replace(b"IDAT", b"\x1b[2J"), "checksum of its part"),
        (png(END), "does not begin with its size"),
        (png(size(32, 20, 8), pixels(32, 20), END), "this one has 8 bits and colour 0"),
        (png(size(32, 20, 16, 2), pixels(96, 20), END), "this one has 16 bits and colour 2"),
        (png(size(32, 20), END), "damaged PNG"),
        (png(size(32, 20), pixels(32, 10), END), "not have as many pixels"),
        (png(size(32, 20), pixels(32, 21), END), "not have as many pixels"),
        (png(size(32, 20), (b"IDAT", pixels(32, 20)[1][:-4]), END), "not have as many pixels"),
        (png(size(32, 20), (b"IDAT", zlib.compress(b"\7" * 1300)), END), "damaged PNG"),
        (png(size(32, 20), (b"IDAT", b"no pixels"), END), "damaged PNG"),
        (png(size(60_000, 60_000), pixels(10, 10), END), "at most 50,000,000 pixels"),
        (png(size(2**31 - 1, 2**31 - 1), END), "at most 50,000,000 pixels"),
        (png(size(0, 0), pixels(1, 1), END), "damaged PNG"),
    ],
)
def test_a_png_is_checked_before_it_is_decoded(tmp_path, content, message):
    assert_refused(tmp_path / "image.png", content, message)


def test_parts_of_a_png_that_are_no_pixels_are_not_looked_at(tmp_path):
    bomb = b"zTXt", b"key\0\0" + zlib.compress(b"\0" * 10**8)
    (tmp_path / "text.png").write_bytes(png(size(32, 20), bomb, pixels(32, 20), END))
    (tmp_path / "plain.png").write_bytes(IMAGE)
    np.testing.assert_array_equal(read_depth(tmp_path / "text.png"), read_depth(tmp_path / "plain.png"))


@pytest.mark.parametrize(("width", "height"), [(33, 21), (17, 16), (64, 48)])
def test_an_interlaced_png_is_read(tmp_path, width, height):
    """Written by hand, pass by pass, since Pillow does not write it."""
    millimetres = generator(0).integers(500, 1200, (height, width)).astype(">u2")
    passes = ((0, 0, 8, 8), (0, 4, 8, 8), (4, 0, 8, 4), (0, 2, 4, 4), (2, 0, 4, 2), (0, 1, 2, 2), (1, 0, 2, 1))
    rows = (row for r, c, down, right in passes for row in millimetres[r::down, c::right])
    packed = zlib.compress(b"".join(b"\0" + row.tobytes() for row in rows if len(row)))
    header = struct.pack(">IIBBBBB", width, height, 16, 0, 0, 0, 1)
    (tmp_path / "laced.png").write_bytes(png((b"IHDR", header), (b"IDAT", packed), END))
    np.testing.assert_allclose(read_depth(tmp_path / "laced.png"), millimetres / 1000, atol=1e-6)


def npy(header: str, numbers: bytes = b"", version: bytes = b"\1\0") -> bytes:
    text = header.encode("latin-1")
    length = len(text).to_bytes(2 if version[0] == 1 else 4, "little")
    return b"\x93NUMPY" + version + length + text + numbers


def header(shape: str, kind: str = "<f4") -> str:
    return f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}\n"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (npy(header("(1000000, 1000000)")), "at most 50,000,000 pixels"),
        (npy(header("(99999999999999999999, 99999999999999999999)")), "at most 50,000,000 pixels"),
        (npy(header("(20, 32)"), bytes(100)), "makes a file of"),
        (npy(header("(20, 32)"), bytes(20 * 32 * 4 + 1)), "makes a file of"),
        (npy(header("(-20, 32)")), "integers or floating-point"),
        (npy(header("(20.0, 32)")), "integers or floating-point"),
        (npy(header("(True, 32)")), "integers or floating-point"),
        (npy(header("(20, 32)", "|O")), "integers or floating-point"),
        (npy(header("(20, 32)", "<U99")), "integers or floating-point"),
        (npy(header("(20, 32)", "<c8")), "integers or floating-point"),
        (npy(header("(20, 32)", "nonsense")), "header cannot be read"),
        (npy("{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': (20, 32)}"), "integers or floating-point"),
        (npy("{'descr': '<f4', 'fortran_order': 1, 'shape': (20, 32)}"), "integers or floating-point"),
        (npy("{'descr': '<f4', 'shape': (20, 32)}"), "header cannot be read"),
        (npy("{'descr': '<f4', 'fortran_order': False, 'shape': (20, 32"), "header cannot be read"),
        (npy("(" * 900), "header cannot be read"),
        (npy("-" * 900), "header cannot be read"),
        (npy("[" * 5000), "header is too long"),
        (npy("1", version=b"\2\0")[:10], "not an array of NumPy"),
        (b"\x93NUMPY\2\0\xff\xff\xff\xff" + bytes(100), "header is too long"),
    ],
)
def test_an_array_is_checked_before_it_takes_memory(tmp_path, content, message):
    assert_refused(tmp_path / "array.npy", content, message)
    with zipfile.ZipFile(tmp_path / "archive.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("depth.npy", content)
    assert_refused(tmp_path / "archive.npz", (tmp_path / "archive.npz").read_bytes())


def test_archives_that_are_bombs_or_damaged_are_refused(tmp_path):
    array = npy(header("(20, 32)"), np.full(640, 0.7, np.float32).tobytes())
    for name, kind in (("plain", zipfile.ZIP_STORED), ("small", zipfile.ZIP_DEFLATED), ("lzma", zipfile.ZIP_LZMA)):
        with zipfile.ZipFile(tmp_path / f"{name}.npz", "w", kind) as archive:
            archive.writestr("depth.npy", array)
    assert read_depth(tmp_path / "plain.npz").shape == read_depth(tmp_path / "small.npz").shape == (20, 32)
    plain = (tmp_path / "plain.npz").read_bytes()
    assert_refused(tmp_path / "lzma.npz", (tmp_path / "lzma.npz").read_bytes(), "compressed in another way")
    assert_refused(tmp_path / "flipped.npz", plain[:1500] + b"?" + plain[1501:], "CRC")
    assert_refused(tmp_path / "many.npz", plain + b"PK\x01\x02" * 2000, "more than 1000 members")
    with zipfile.ZipFile(tmp_path / "larger.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("depth.npy", array + bytes(10**8))
    assert_refused(tmp_path / "larger.npz", (tmp_path / "larger.npz").read_bytes(), "bytes instead of")
    encrypted = bytearray(plain)
    for place in (6, plain.index(b"PK\x01\x02") + 8):
        encrypted[place] |= 1
    assert_refused(tmp_path / "encrypted.npz", bytes(encrypted), "encrypted")


def test_files_that_are_endless_or_huge_are_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe.png")
    with pytest.raises(DepthImageError, match="a pipe, not a regular file"):
        read_depth(tmp_path / "pipe.png")
    (tmp_path / "huge.npy").touch()
    os.truncate(tmp_path / "huge.npy", 2**40)
    with pytest.raises(DepthImageError, match="at most 512 MiB"):
        read_depth(tmp_path / "huge.npy")


@pytest.mark.parametrize("seed", range(60))
def test_no_flipped_bit_of_a_png_passes(tmp_path, seed):
    place, bit = divmod(int(generator(seed).integers(8 * len(IMAGE))), 8)
    damaged = bytearray(IMAGE)
    damaged[place] ^= 1 << bit
    assert_refused(tmp_path / "image.png", bytes(damaged))


def assert_refused(path, content, message=None):
    path.write_bytes(content)
    with pytest.raises(DepthImageError, match=message) as refused:
        read_depth(path)
    assert path.name in str(refused.value)
    assert len(str(refused.value).replace(str(path.parent), "")) < 300
    assert str(refused.value).isprintable()


def test_depths_beyond_16_bits_are_not_written(tmp_path):
    with pytest.raises(DepthImageError, match=r"65\.535"):
        write_depth_png(tmp_path / "far.png", np.full((20, 20), 70.0, np.float32))
    assert not (tmp_path / "far.png").exists()
