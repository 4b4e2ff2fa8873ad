"""Few rectangles that cover the same cells as many small ones."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Rectangle(NamedTuple):
    """Cells from a column up to another, and from a row up to another, which are not in it."""

    left: int
    right: int
    low: int
    high: int


def rectangles(cells: NDArray[np.bool_], most: int) -> list[Rectangle] | None:
    """The rectangles of the cells (rows, columns) that are set, each cell in one; None if they are more than `most`.

    A row's cells that stand in line are one; rows of the same are one. Both ways are tried, for walls along either.
    """
    along = _merged(cells, most)
    across = _merged(cells.T, most)
    if across is not None and (along is None or len(across) < len(along)):
        return [Rectangle(low, high, left, right) for left, right, low, high in across]
    return along


def _merged(cells: NDArray[np.bool_], most: int) -> list[Rectangle] | None:
    found: list[Rectangle] = []
    begun: dict[tuple[int, int], int] = {}
    last = -1
    for row, runs in _runs(cells):
        if row != last + 1:
            found += _closed(begun, {}, last + 1)
        found += _closed(begun, runs, row)
        for run in runs:
            begun.setdefault(run, row)
        last = row
        if len(found) + len(begun) > most:
            return None
    return [*found, *_closed(begun, {}, last + 1)]


def _closed(begun: dict[tuple[int, int], int], runs: dict[tuple[int, int], None], row: int) -> Iterator[Rectangle]:
    """Those that do not go on in a row; they are taken out."""
    ended = [run for run in begun if run not in runs]
    return iter([Rectangle(*run, begun.pop(run), row) for run in ended])


def _runs(cells: NDArray[np.bool_]) -> Iterator[tuple[int, dict[tuple[int, int], None]]]:
    """Each row that has cells, with where its runs begin and end."""
    for row in np.flatnonzero(cells.any(axis=1)).tolist():
        padded = np.concatenate(([False], cells[row], [False]))
        edges = np.flatnonzero(padded[1:] != padded[:-1]).tolist()
        yield row, dict.fromkeys(zip(edges[::2], edges[1::2], strict=True))
