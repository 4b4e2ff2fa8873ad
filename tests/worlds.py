"""Worlds whose shapes are in files, for tests: they write the files, and read them as a scenario would."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sim_action.world.scene import Scene
from sim_action.world.shape_files import read_surroundings


def pgm(pixels: ArrayLike, white: int = 255) -> bytes:
    """Pixels (H, W), as bytes."""
    image = np.asarray(pixels)
    height, width = image.shape
    header = f"P5\n# a comment\n{width} {height}\n{white}\n"
    return header.encode() + image.astype(">u2" if white > 255 else "u1").tobytes()


def png(pixels: ArrayLike, bits: int = 8, kinds: Sequence[int] = (0,)) -> bytes:
    """Pixels (H, W), with these kinds of filters by turns."""
    image = np.asarray(pixels)
    height, width = image.shape
    step = bits // 8
    rows = image.astype(">u2" if bits == 16 else "u1").tobytes()
    stride = width * step
    lines, above = [], bytes(stride)
    for number in range(height):
        row = rows[number * stride : (number + 1) * stride]
        kind = kinds[number % len(kinds)]
        lines.append(bytes([kind]) + bytes(_difference(kind, row, above, step)))
        above = row
    header = struct.pack(">IIBBBBB", width, height, bits, 0, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(b"".join(lines))), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(map(_chunk, *zip(*chunks, strict=True)))


def _chunk(kind: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def _difference(kind: int, row: bytes, above: bytes, step: int) -> list[int]:
    found = []
    for at, value in enumerate(row):
        left, corner = (row[at - step], above[at - step]) if at >= step else (0, 0)
        up = above[at]
        guess = left + up - corner
        paeth = min((abs(guess - near), order, near) for order, near in enumerate((left, up, corner)))[2]
        found.append((value - (0, left, up, (left + up) // 2, paeth)[kind]) % 256)
    return found


def write_map(folder: Path, pixels: ArrayLike, name: str = "map", **keys: Any) -> str:
    """A map_server's map; returns the name of its YAML file."""
    (folder / f"{name}.pgm").write_bytes(pgm(pixels))
    said = {"image": f"{name}.pgm", "resolution": 0.05, "origin": [0.0, 0.0, 0.0], "negate": 0} | keys
    lines = (f"{key}: {value}" for key, value in said.items() if value is not None)
    (folder / f"{name}.yaml").write_text("\n".join(lines) + "\n")
    return f"{name}.yaml"


def with_files(scene: Scene) -> Scene:
    """The scene with what is read from files."""
    found = read_surroundings(scene.world, scene.workspace)
    assert found.problems == ()
    return replace(scene, parts=found.parts)
