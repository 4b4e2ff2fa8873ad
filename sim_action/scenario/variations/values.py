"""The values of a key in its variations: a list, samples drawn at random, or a column of a CSV file."""

from __future__ import annotations

import io
from collections.abc import Iterator
from functools import cache
from random import Random
from typing import Any, Final

from pydantic import ValidationError

from sim_action.core.errors import Location
from sim_action.core.field_types import spec_errors
from sim_action.core.files import read_at_most
from sim_action.core.records import dataclass
from sim_action.core.wording import counted, did_you_mean, shown
from sim_action.core.workspace import PathError, Workspace, name_beside, similar_name
from sim_action.core.yaml_document import KeyPath, plain_value
from sim_action.scenario.source import DRAWN_SEED_BITS, SEED
from sim_action.scenario.variations import (
    DRAWS,
    OPTIONS,
    Choice,
    CsvColumn,
    Distribution,
    Draw,
    DrawError,
    Integers,
    Sobol,
    Uniform,
)

MAX_CSV_BYTES: Final = 25_000_000
MAX_ROWS: Final = 10_000  # the largest number of rows that are samples: as many as a file may have runs


@dataclass(frozen=True, slots=True)
class ValueList:
    """The values of one key."""

    values: tuple[Any, ...]
    drawn: bool = False  # True if they are samples, which all drawn keys share
    advice: str = ""  # for a sample that the key does not allow; empty if the problem is reported at its own place
    rounded: bool = False  # True if names have their numbers rounded
    choices: tuple[Any, ...] = ()  # the different values that samples are chosen from, if they are listed
    # of each value: keys below the varied key, or a place in another file; empty if they have none
    places: tuple[KeyPath | Location, ...] = ()


class ValuesError(Exception):
    """Invalid values; `path` leads to the problem below the key, or `place` is in another file."""

    def __init__(self, message: str, path: KeyPath = (), place: Location | None = None) -> None:
        self.path, self.place = path, place
        super().__init__(message)


class CsvFiles:
    """The CSV files that variations of one scenario name; each is read once."""

    def __init__(self, workspace: Workspace, file: str) -> None:
        """Start; `file`: the name of the scenario's file in messages."""
        self._workspace, self._file = workspace, file
        self._tables: dict[str, _Table] = {}

    def table(self, reference: str) -> _Table:
        """Return the rows of a file. Raises ValuesError."""
        if reference not in self._tables:
            try:
                path = self._workspace.file(reference)
            except PathError as error:
                raise ValuesError(f"{error}{similar_name(self._workspace.directory / reference)}", ("csv",)) from None
            name = name_beside(self._file, reference, path)
            try:
                data = read_at_most(path, MAX_CSV_BYTES)
            except OSError as error:
                raise ValuesError(f"{name} cannot be read: {error.strerror}", ("csv",)) from None
            if data is None:
                raise ValuesError(
                    f"{name} has more than {MAX_CSV_BYTES // 1_000_000} MB; keep the rows to run only", ("csv",)
                )
            self._tables[reference] = _Table.of(name, data)
        return self._tables[reference]


@dataclass(frozen=True, slots=True)
class _Table:
    """The columns of a CSV file, and its first rows with the numbers of their lines; no empty rows at the end."""

    name: str
    columns: tuple[str, ...]
    rows: tuple[tuple[int, list[str]], ...]
    is_whole: bool  # True if there are no further rows

    @classmethod
    def of(cls, name: str, data: bytes) -> _Table:
        """Return the table of a file. Raises ValuesError."""
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            line = data[: error.start].count(b"\n") + 1
            message = f"the byte 0x{data[error.start]:02x} is not UTF-8 text; save the file as CSV in UTF-8"
            raise ValuesError(message, place=Location(name, line)) from None
        lines = _lines(name, text)
        _, columns = next((header for header in lines if any(header[1])), (0, []))
        if not columns:
            raise ValuesError("the file is empty; its first line must name the columns", place=Location(name, 1))
        rows: list[tuple[int, list[str]]] = []
        empty: tuple[int, list[str]] | None = None
        for row in lines:
            if not any(row[1]):
                empty = empty or row
                continue
            rows += [row] if empty is None else [empty, row]
            empty = None
            if len(rows) > MAX_ROWS:
                break
        return cls(name, tuple(columns), tuple(rows), len(rows) <= MAX_ROWS)

    def values(self, column: str, rows: int) -> Iterator[tuple[object, Location]]:
        """Yield the values of a column in the first rows, with their places. Raises ValuesError."""
        index = self.columns.index(column)
        for line, cells in self.rows[:rows]:
            place = Location(self.name, line)
            if any(cells) and len(cells) != len(self.columns):
                message = (
                    f"found {counted(len(cells), 'cell')}, but the header has {counted(len(self.columns), 'column')}"
                )
                raise ValuesError(message, place=place)
            cell = cells[index] if cells else ""
            if not cell:
                raise ValuesError(f"the cell of column '{column}' is empty; fill it, or remove the row", place=place)
            if not cell.isprintable():
                raise ValuesError(f"expected one line of text in column '{column}', found {shown(cell)}", place=place)
            try:
                yield plain_value(cell), place
            except ValueError as error:
                raise ValuesError(f"column '{column}': {error}", place=place) from None


def _lines(name: str, text: str) -> Iterator[tuple[int, list[str]]]:
    """Yield the number of each line and its cells. Raises ValuesError."""
    # Few scenarios need it.
    import csv

    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        for cells in reader:
            yield reader.line_num, [cell.strip() for cell in cells]
    except csv.Error as error:
        raise ValuesError(f"not valid CSV: {error}", place=Location(name, reader.line_num)) from None


_EXPECTED: Final = "expected a list of values, or a draw such as {uniform: [0, 1], samples: 10}"


def value_list(
    key: str, stated: object, seed: int, *, runs: int | None = None, dimension: int = 0, files: CsvFiles | None = None
) -> ValueList:
    """Return the values of a key.

    Args:
        key: as it is written; `key` and `seed` decide random draws.
        stated: the value of the key in `variations`.
        seed: of the scenario.
        runs: the number of samples that a gate asks for; None without a gate.
        dimension: the place of the key among the keys with `sobol`, from 0.
        files: the files that it may read.

    Raises ValuesError.
    """
    if isinstance(stated, tuple) and stated:
        _refuse_twins(stated)
        return ValueList(stated, places=tuple((index,) for index in range(len(stated))))
    draw = _draw(stated)
    if isinstance(draw, CsvColumn):
        return _of_csv(key, draw, runs, files)
    generator = Random(f"variations {key} {seed}")
    count = _count(draw, runs)
    if key == SEED:
        return _seeds(draw, count, generator)
    if isinstance(draw, Choice):
        _refuse_twins(draw.choice, ("choice",), "; use 'weights' instead")
        indices = tuple(draw.indices(generator.random() for _ in range(count)))
        places = tuple(("choice", index) for index in indices)
        return ValueList(tuple(draw.choice[index] for index in indices), True, choices=draw.choice, places=places)
    assert isinstance(draw, Distribution)
    if isinstance(draw, Sobol):
        _refuse_uneven(draw, count)
        numbers = scrambled_points(dimension, count, generator.getrandbits(BITS))
    else:
        numbers = (generator.random() for _ in range(count))
    return ValueList(tuple(draw.drawn(numbers)), True, draw.advice, rounded=not isinstance(draw, Integers))


def _draw(stated: object) -> Draw:
    """Return the draw that a key states. Raises ValuesError."""
    if not isinstance(stated, dict):
        raise ValuesError(f"{_EXPECTED}, found {shown(stated)}")
    ways = [way for way in DRAWS if way in stated]
    if len(ways) > 1:
        raise ValuesError(f"'{ways[0]}' and '{ways[1]}' cannot be combined; keep one of them")
    if not ways:
        others = [name for name in stated if name not in OPTIONS]
        hint = did_you_mean(others[0] if others else "", DRAWS)
        raise ValuesError(f"{_EXPECTED}{hint}")
    model = DRAWS[ways[0]]
    try:
        return model.model_validate(stated)
    except ValidationError as error:
        path, message = next(spec_errors(model, stated, error))
        cause = error.errors(include_url=False)[0].get("ctx", {}).get("error")
        raise ValuesError(message, (cause.key,) if isinstance(cause, DrawError) else path) from None


def _count(draw: Draw, runs: int | None) -> int:
    """Return the number of samples. Raises ValuesError."""
    _refuse_other_runs(draw, runs)
    count = draw.samples or runs
    if count is None:
        raise ValuesError("the key 'samples' is missing; add it, or state the number of runs in 'gate.runs'")
    return count


def _refuse_other_runs(draw: Draw, runs: int | None) -> None:
    if runs is not None and draw.samples not in (None, runs):
        message = f"{counted(draw.samples or 0, 'sample')}, but the gate has {counted(runs, 'run')}"
        raise ValuesError(f"{message}; remove 'samples', or make both equal", ("samples",))


def _refuse_uneven(draw: Sobol, count: int) -> None:
    if count & (count - 1):
        above = 1 << count.bit_length()
        near = f"{above // 2:,} or {above:,}" if above <= MAX_ROWS else f"{above // 2:,}, the greatest one"
        where = "samples" if draw.samples else "runs of the gate"
        message = f"'sobol' covers a space evenly with a power of 2 as the number of {where}"
        raise ValuesError(f"{message}, such as {near}; found {count:,}", ("samples",) if draw.samples else ())


def _of_csv(key: str, draw: CsvColumn, runs: int | None, files: CsvFiles | None) -> ValueList:
    """Return the values of a column. Raises ValuesError."""
    if key == SEED:
        raise ValuesError(_NO_SEEDS, (draw.key,))
    if files is None:
        raise ValuesError("a CSV file can only be read for the scenario of a file", (draw.key,))
    _refuse_other_runs(draw, runs)
    table = files.table(draw.csv)
    column = draw.column or key.rpartition(".")[2]
    if (times := table.columns.count(column)) != 1:
        problem = f"{table.name} has {'no column' if not times else f'{times} columns'} {shown(column)}"
        hint = did_you_mean(column, table.columns) if not times else "; give each column a name of its own"
        if len(table.columns) == 1 and not times:
            hint = f"; separate columns by commas, its first line is {shown(table.columns[0])}"
        remedy = "" if draw.column or times or len(table.columns) == 1 else "; name one with 'column'"
        raise ValuesError(f"{problem}{hint}{remedy}", ("column",) if draw.column else ("csv",))
    samples = draw.samples or runs
    if (samples or 1) > len(table.rows):
        asked = "'samples' is" if draw.samples else "the gate needs" if runs else "it needs at least"
        message = f"{table.name} has {counted(len(table.rows), 'row')} after the header, but {asked} {samples or 1}"
        raise ValuesError(message, ("samples",) if draw.samples else ("csv",))
    if samples is None and not table.is_whole:
        raise ValuesError(
            f"{table.name} has more than {MAX_ROWS:,} rows; choose the first ones with 'samples'", ("csv",)
        )
    cells = tuple(table.values(column, samples or len(table.rows)))
    return ValueList(tuple(value for value, _ in cells), True, places=tuple(place for _, place in cells))


_NO_SEEDS: Final = (
    "seeds are different whole numbers: draw them with 'integers' or 'uniform', such as "
    "{integers: [0, 1000000], samples: 20}"
)


def _seeds(draw: Draw, count: int, generator: Random) -> ValueList:
    """Return different whole numbers; more samples keep the first ones. Raises ValuesError."""
    if not isinstance(draw, Integers | Uniform):
        raise ValuesError(_NO_SEEDS, (draw.key,))
    low, high, unit = (*draw.integers, "") if isinstance(draw, Integers) else draw.numbers
    if unit or low < 0 or high > 2**DRAWN_SEED_BITS or low % 1 or high % 1:
        raise ValuesError(f"the bounds of seeds must be whole numbers from 0 to {2**DRAWN_SEED_BITS}", (draw.key,))
    size = int(high - low) + 1
    if count > size:
        message = f"{count} different seeds do not fit between {low:g} and {high:g}"
        path = ("samples",) if draw.samples else (draw.key,)
        raise ValuesError(f"{message}; choose wider bounds, such as [0, 1000000]", path)
    seeds: dict[int, None] = {}
    while len(seeds) < count:
        seeds[int(low) + int(size * generator.random())] = None
    return ValueList(tuple(seeds), True, draw.advice)


def _refuse_twins(values: tuple[object, ...], path: KeyPath = (), remedy: str = "") -> None:
    seen: set[str] = set()
    for index, value in enumerate(values):
        if (written := repr(value)) in seen:
            raise ValuesError(f"{shown(value)} occurs twice{remedy}", (*path, index))
        seen.add(written)


# Sobol's sequence: points that fill a cube evenly, scrambled so that each point is uniform by itself.
#
# The direction numbers are by Joe and Kuo (2008), new-joe-kuo-6. The scramble of Laine and Karras (2011) is
# Owen's nested scramble with a hash: each binary digit depends on the digits above it alone, so that the points keep
# covering all elementary intervals.

BITS: Final = 32
_MASK: Final = 2**BITS - 1

# For each dimension after the first: the primitive polynomial over GF(2), without its first and last coefficient, and
# the initial direction numbers, as many as its degree.
_JOE_KUO: Final = (
    (0, (1,)),
    (1, (1, 3)),
    (1, (1, 3, 1)),
    (2, (1, 1, 1)),
    (1, (1, 1, 3, 3)),
    (4, (1, 3, 5, 13)),
    (2, (1, 1, 5, 5, 17)),
    (4, (1, 1, 5, 5, 5)),
    (7, (1, 1, 7, 11, 19)),
    (11, (1, 1, 5, 1, 1)),
    (13, (1, 1, 1, 3, 11)),
    (14, (1, 3, 5, 5, 31)),
    (1, (1, 3, 3, 9, 7, 49)),
    (13, (1, 1, 1, 15, 21, 21)),
    (16, (1, 3, 1, 13, 27, 49)),
    (19, (1, 1, 1, 15, 7, 5)),
    (22, (1, 3, 1, 15, 13, 25)),
    (25, (1, 1, 5, 5, 19, 61)),
    (1, (1, 3, 7, 11, 23, 15, 103)),
)

# The multipliers are even, so that a digit depends on the digits below it alone (here the digits are reversed).
_MULTIPLIERS: Final = (0x6C50B47C, 0xB82F1E52, 0xC7AFE638, 0x8D22F6E6)


def scrambled_points(dimension: int, count: int, scramble: int) -> Iterator[float]:
    """Yield the first points of a dimension between 0 and 1, exclusive; `scramble`: a random number of 32 bits."""
    for point in points(dimension, count):
        # A permutation of all numbers of 32 bits, in which each bit depends on the bits below it alone.
        number = _reversed(point)
        number = number + scramble & _MASK
        for multiplier in _MULTIPLIERS:
            number ^= number * multiplier & _MASK
        yield (_reversed(number) + 0.5) / 2**BITS


def points(dimension: int, count: int) -> Iterator[int]:
    """Yield the first points of a dimension in units of 2**-32, in the order of the Gray code, without a scramble."""
    directions = _directions(dimension)
    point = 0
    for index in range(1, count + 1):
        yield point
        # The Gray codes of neighbours differ in the lowest bit that is set in the index of the second.
        point ^= directions[(index & -index).bit_length() - 1]


@cache
def _directions(dimension: int) -> tuple[int, ...]:
    """Return the direction numbers of a dimension, in units of 2**-32."""
    if dimension == 0:
        return tuple(1 << (BITS - 1 - place) for place in range(BITS))
    polynomial, initial = _JOE_KUO[dimension - 1]
    degree = len(initial)
    directions = [number << (BITS - 1 - place) for place, number in enumerate(initial)]
    for place in range(degree, BITS):
        direction = directions[place - degree] ^ (directions[place - degree] >> degree)
        for step in range(1, degree):
            if polynomial >> (degree - 1 - step) & 1:
                direction ^= directions[place - step]
        directions.append(direction)
    return tuple(directions)


def _reversed(number: int) -> int:
    return int(f"{number:0{BITS}b}"[::-1], 2)
