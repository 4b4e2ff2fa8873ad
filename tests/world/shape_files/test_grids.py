"""Grids: occupancy maps as rectangles, and the grey images that are read or refused before they are unpacked."""

from __future__ import annotations

import struct
import tracemalloc
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from sim_action.world.shape_files.grids import ImageError, read_image, rectangles
from tests.soak import examples
from tests.worlds import pgm, png


@given(arrays.arrays(np.bool_, st.tuples(st.integers(1, 12), st.integers(1, 12))))
def test_each_cell_is_in_one_rectangle_and_no_other_is(cells: np.ndarray) -> None:
    covered = np.zeros(cells.shape, int)
    for left, right, low, high in rectangles(cells, 1000) or ():
        covered[low:high, left:right] += 1
    assert (covered == cells).all()


def test_a_frame_is_four_and_a_block_one() -> None:
    block = np.ones((1000, 1000), np.bool_)
    assert rectangles(block, 10) == [(0, 1000, 0, 1000)]
    frame = block.copy()
    frame[1:-1, 1:-1] = False
    assert len(rectangles(frame, 10) or ()) == 4


def test_what_comes_to_too_many_is_told() -> None:
    assert rectangles(np.indices((50, 50)).sum(axis=0) % 2 == 0, 100) is None


PIXELS = np.random.default_rng(7).integers(0, 256, (5, 7))
DEEP = PIXELS * 257


@pytest.mark.parametrize("white", [100, 255, 1000, 65535])
def test_a_pgm_is_read_as_it_was_written(white: int) -> None:
    image = read_image(pgm(PIXELS % (white + 1), white))
    assert image.white == white
    assert (image.pixels == PIXELS % (white + 1)).all()


def test_a_pgm_may_be_text() -> None:
    image = read_image(b"P2 # size\n2 2\n15\n0 15 # row\n7 3\n")
    assert image.pixels.tolist() == [[0, 15], [7, 3]]


def test_a_pgm_of_much_text_takes_no_more_room_than_its_pixels() -> None:
    """Python's own words would take 20 times that: 40 MB here, and gigabytes at the most that is read."""
    text = b"P2 2 1 255\n" + 100_000 * b"# 0\n" + b"3 4 " + 500_000 * b"5 "
    tracemalloc.start()
    try:
        image = read_image(text)
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert image.pixels.tolist() == [[3, 4]]
    assert most < 6 * len(text)


@pytest.mark.parametrize("kinds", [(0,), (1,), (2,), (3,), (4,), (0, 1, 2, 3, 4)])
@pytest.mark.parametrize("bits", [8, 16])
def test_a_png_is_read_whatever_its_rows_are_told_by(bits: int, kinds: tuple[int, ...]) -> None:
    whole = PIXELS if bits == 8 else DEEP
    for pixels in (whole, whole.T, whole[:1], whole[:, :1]):
        image = read_image(png(pixels, bits, kinds))
        assert image.white == 2**bits - 1
        assert (image.pixels == pixels).all()


def header(width: int, height: int, bits: int = 8, colour: int = 0, interlaced: int = 0) -> bytes:
    body = struct.pack(">IIBBBBB", width, height, bits, colour, 0, 0, interlaced)
    return struct.pack(">I", len(body)) + b"IHDR" + body + struct.pack(">I", zlib.crc32(b"IHDR" + body))


SIGNATURE = b"\x89PNG\r\n\x1a\n"


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"P5 100000 100000 255\n", "100000 x 100000 pixels in its header; at most 16,000,000"),
        (b"P5 0 4 255\n", "0 x 4 pixels"),
        (b"P5 2 2 70000\n....", "white of 70000"),
        (b"P5 2 2 255\n..", "cut off"),
        (b"P2 2 2 255\n1 2 3", "cut off"),
        (b"P2 2 2 255\n1 2 3 x", "not a whole number"),
        (b"P2 2 2 255\n1 2 3 -4", "below 0"),
        (b"P5 two 2 255\n", "not a valid PGM"),
        (b"P6 2 2 255\n", "neither a PGM"),
        (b"", "neither a PGM"),
        (b"version https://git-lfs.github.com/spec/v1", "Git LFS"),
        (SIGNATURE, "cut off"),
        (SIGNATURE + header(100_000, 100_000), "100000 x 100000 pixels"),
        (SIGNATURE + header(4, 4, colour=2), "unsupported kind"),
        (SIGNATURE + header(4, 4, bits=4), "unsupported kind"),
        (SIGNATURE + header(4, 4, interlaced=1), "interlaced"),
        (png(PIXELS)[:-5], "cut off"),
        (png(PIXELS).replace(b"IDAT", b"IDAX"), "damaged"),
        (png(PIXELS, kinds=(0,))[:33], "cut off"),
    ],
)
def test_what_is_no_image_is_refused(data: bytes, message: str) -> None:
    with pytest.raises(ImageError, match=message):
        read_image(data)


def test_a_png_that_would_unpack_to_more_is_not_unpacked() -> None:
    bomb = zlib.compress(bytes(50_000_000))
    idat = struct.pack(">I", len(bomb)) + b"IDAT" + bomb + struct.pack(">I", zlib.crc32(b"IDAT" + bomb))
    end = struct.pack(">I", 0) + b"IEND" + struct.pack(">I", zlib.crc32(b"IEND"))
    assert read_image(SIGNATURE + header(2, 2) + idat + end).pixels.tolist() == [[0, 0], [0, 0]]


@examples(50)
@given(st.binary(max_size=60), st.integers(0, 80))
def test_damage_is_an_error_or_an_image(more: bytes, at: int) -> None:
    for whole in (png(PIXELS), pgm(PIXELS)):
        try:
            read_image(whole[:at] + more + whole[at:])
        except ImageError:
            continue
