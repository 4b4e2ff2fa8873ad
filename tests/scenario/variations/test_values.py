"""The values of one key: how many samples, rows of CSV files, and their names."""

from __future__ import annotations

import hashlib
import re
import struct
from collections import Counter
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.errors import InvalidScenario, Location
from sim_action.core.permissions import Permissions
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_document import read_document
from sim_action.scenario.files import read_file
from sim_action.scenario.loading import load_all
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.source import MAX_KEYS, Refused, Source
from sim_action.scenario.variations.expansion import expanded
from sim_action.scenario.variations.values import (
    BITS,
    MAX_CSV_BYTES,
    CsvFiles,
    ValueList,
    ValuesError,
    points,
    scrambled_points,
    value_list,
)
from tests.scenarios import LEAST

UNIFORM = "robot.pose.x: {uniform: [0, 1]}"


def sources(folder: Path, variations: str, runs: int | None = None) -> tuple[Source, ...]:
    gate = f"gate: {{passes: {{at_least: 50 %, confidence: 50 %}}, runs: {runs}}}\n" if runs else ""
    document = read_document("s.sim.yml", f"{LEAST}variations:\n  {variations.replace('; ', chr(10) + '  ')}\n{gate}")
    return expanded(Source(folder / "s.sim.yml", Workspace(folder, folder), document, "push"), None)


def rows(folder: Path, variations: str, runs: int | None = None) -> list[tuple[object, ...]]:
    return [tuple(each.value for each in source.variation) for source in sources(folder, variations, runs)]


def problems(folder: Path, variations: str, runs: int | None = None) -> list[str]:
    with pytest.raises(InvalidScenario) as refused:
        sources(folder, variations, runs)
    return [str(problem) for problem in refused.value.problems]


def names(folder: Path, variations: str) -> list[str]:
    return [source.name.removeprefix("push") for source in sources(folder, variations)]


def write(folder: Path, text: str | bytes, name: str = "rows.csv") -> None:
    (folder / name).write_bytes(text.encode() if isinstance(text, str) else text)


def test_a_gate_decides_the_number_of_samples(tmp_path: Path) -> None:
    stated = rows(tmp_path, UNIFORM.replace("]}", "], samples: 5}"))
    assert rows(tmp_path, UNIFORM, 5) == stated == rows(tmp_path, UNIFORM.replace("]}", "], samples: 5}"), 5)


@pytest.mark.parametrize("draw", ["uniform: [0, 1]", "integers: [0, 9]", "choice: [0, 1]", "sobol: [0, 1]"])
def test_a_draw_without_samples_needs_a_gate(tmp_path: Path, draw: str) -> None:
    (found,) = problems(tmp_path, f"robot.pose.x: {{{draw}}}")
    assert found == (
        "s.sim.yml:12:3: variations.robot.pose.x: the key 'samples' is missing; add it, or state the number of runs in "
        "'gate.runs'"
    )


def test_samples_must_agree_with_a_gate(tmp_path: Path) -> None:
    write(tmp_path, "x\n1\n2\n")
    text = (
        "robot.pose.x: {uniform: [0, 1], samples: 4}; robot.pose.y: {csv: rows.csv, column: x, samples: 1}; "
        "robot.pose.z: {csv: rows.csv, column: x}; robot.pose.yaw: {sobol: [0, 1]}; seed: {integers: [0, 2]}"
    )
    unequal = "but the gate has 5 runs; remove 'samples', or make both equal"
    even = "'sobol' covers a space evenly with a power of 2 as the number of runs of the gate, such as 4 or 8; found 5"
    seeds = "5 different seeds do not fit between 0 and 2; choose wider bounds, such as [0, 1000000]"
    assert problems(tmp_path, text, 5) == [
        f"s.sim.yml:12:35: variations.robot.pose.x.samples: 4 samples, {unequal}",
        f"s.sim.yml:13:44: variations.robot.pose.y.samples: 1 sample, {unequal}",
        "s.sim.yml:14:18: variations.robot.pose.z.csv: rows.csv has 2 rows after the header, but the gate needs 5",
        f"s.sim.yml:15:3: variations.robot.pose.yaw: {even}",
        f"s.sim.yml:16:10: variations.seed.integers: {seeds}",
    ]


@pytest.mark.parametrize(("samples", "near"), [(3, "2 or 4"), (100, "64 or 128"), (9000, "8,192, the greatest one")])
def test_even_samples_are_a_power_of_2(tmp_path: Path, samples: int, near: str) -> None:
    (found,) = problems(tmp_path, f"robot.pose.x: {{sobol: [0, 1], samples: {samples}}}")
    assert f"such as {near}; found {samples:,}" in found


@pytest.mark.parametrize("samples", [1, 2, 64])
def test_all_keys_with_even_samples_form_one(tmp_path: Path, samples: int) -> None:
    keys = [f"robot.pose.{axis}: {{sobol: [0, 1], samples: {samples}}}" for axis in "xy"]
    drawn = rows(tmp_path, "; ".join(keys))
    for wide in (1, 2, 4, 8):
        if samples == 64:
            high = samples // wide
            assert len({(int(x * wide), int(y * high)) for x, y in drawn}) == samples  # type: ignore[operator]  # all are numbers
    # Other keys between them change nothing, a key before them takes their dimension.
    with_others = rows(tmp_path, f"{keys[0]}; robot.pose.z: {{uniform: [0, 1], samples: {samples}}}; {keys[1]}")
    assert [(x, y) for x, _, y in with_others] == drawn
    (alone, *_), *_ = rows(tmp_path, keys[0])
    assert alone == drawn[0][0]
    if samples == 64:
        assert [y for y, _ in rows(tmp_path, "; ".join(reversed(keys)))] != [y for _, y in drawn]
        assert rows(tmp_path, "; ".join(keys).replace("64", "128"))[:64] == drawn


def test_seeds_are_drawn_from_whole_numbers(tmp_path: Path) -> None:
    found = names(tmp_path, "seed: {integers: [0, 9], samples: 10}")
    assert sorted(found) == [f"[seed={seed}]" for seed in range(10)]
    assert found == names(tmp_path, "seed: {uniform: [0, 9], samples: 10}")


@pytest.mark.parametrize("draw", ["choice: [1, 2]", "log_uniform: [1, 2]", "sobol: [0, 3]", "csv: rows.csv"])
def test_other_draws_give_no_seeds(tmp_path: Path, draw: str) -> None:
    write(tmp_path, "seed\n1\n")
    (found,) = problems(tmp_path, f"seed: {{{draw}, samples: 1}}")
    assert "seeds are different whole numbers: draw them with 'integers' or 'uniform', such as {integers" in found


def test_samples_of_equal_values_have_numbers(tmp_path: Path) -> None:
    text = "robot.base: {choice: [free, fixed], samples: 4}"
    values = [value for (value,) in rows(tmp_path, text)]
    called = [f"[base={value}#{n}]" for n, value in enumerate(values, 1)]
    assert len(set(values)) < len(values)
    assert names(tmp_path, text) == [
        name if values.count(value) > 1 else f"[base={value}]" for name, value in zip(called, values, strict=True)
    ]
    # Another drawn key makes them different.
    assert "#" not in "".join(names(tmp_path, f"{text}; robot.pose.x: {{uniform: [0, 1], samples: 4}}"))


def test_structured_choices_are_called_by_their_numbers_in_the_list(tmp_path: Path) -> None:
    text = "robot.pose: {choice: [{x: 1}, {x: 2}, {x: 3}], weights: [0, 0, 1], samples: 1}"
    assert names(tmp_path, text) == ["[pose=#3]"]
    assert rows(tmp_path, text) == [({"x": 3},)]


@given(
    st.lists(st.one_of(st.text("ab#1", min_size=1, max_size=3), st.integers(0, 3)), min_size=2, max_size=5, unique=True)
)
def test_no_two_samples_are_called_alike(values: list[str | int]) -> None:
    written = ", ".join(f"'{value}'" if isinstance(value, str) else str(value) for value in values)
    found = names(Path.cwd(), f"robot.base: {{choice: [{written}], samples: 12}}")
    assert len(set(found)) == 12


def test_whole_numbers_are_whole_in_names(tmp_path: Path) -> None:
    found = names(tmp_path, "robot.pose.x: {integers: [100000, 900000], samples: 5}")
    assert all(re.fullmatch(r"\[x=[1-9][0-9]{5}\]", name) for name in found)
    assert all(type(value) is int for (value,) in rows(tmp_path, "robot.pose.x: {integers: [-5, 5], samples: 9}"))


def test_values_of_a_column_are_those_that_yaml_would_read(tmp_path: Path) -> None:
    write(tmp_path, "x,pose\n1, 10 deg\n0.5,text\ntrue,0x10\n~,1e3\n.5,-7\n")
    assert rows(tmp_path, "robot.x: {csv: rows.csv}; robot.y: {csv: rows.csv, column: pose}") == [
        (1, "10 deg"),
        (0.5, "text"),
        (True, 16),
        (None, 1000.0),
        (0.5, -7),
    ]
    assert rows(tmp_path, "robot.x: {csv: rows.csv, samples: 2}; robot.z: {uniform: [0, 1], samples: 2}")[1][0] == 0.5


@pytest.mark.parametrize(
    "data",
    [
        b"x,y\n1,2\n3,4",
        b"x,y\n1,2\n3,4\n\n\n",
        b"\xef\xbb\xbfx,y\r\n1,2\r\n3,4\r\n",
        b'\xef\xbb\xbf"x","y"\r\n"1","2"\r\n"3","4"\r\n,\r\n,\r\n',
        b"\n\n x , y \n 1 , 2 \n 3 , 4 \n",
        b"x,y\r1,2\r3,4\r",
    ],
)
def test_files_of_spreadsheets_are_read(tmp_path: Path, data: bytes) -> None:
    write(tmp_path, data)
    assert rows(tmp_path, "robot.pose.x: {csv: rows.csv}; robot.pose.y: {csv: rows.csv}") == [(1, 2), (3, 4)]


@pytest.mark.parametrize(
    ("data", "draw", "problem"),
    [
        ("x,y\n1,2\n", "csv: row.csv", "12:18: variations.robot.pose.x.csv: 'row.csv' does not exist (looked for "),
        (
            "x,y\n1,2\n",
            "csv: ../rows.csv",
            "12:18: variations.robot.pose.x.csv: '../rows.csv' is outside the workspace",
        ),
        ("x,y\n1,2\n", "csv: .", "'.' is a folder, not a file"),
        ("x,y\n1,2\n", 'csv: "a\\0/b"', "is not a valid path: embedded null byte"),
        ("x,y\n1,2\n", f"csv: {'a/' * 3000}", "csv: 'a/a/a/"),
        ("x,y\n1,2\n", "csv: 3", "12:18: variations.robot.pose.x.csv: expected text, found 3; put it in quotes"),
        ("a,xx\n1,2\n", "csv: rows.csv", "rows.csv has no column 'x'"),
        ("a,b\n1,2\n", "csv: rows.csv", "(allowed: a, b); name one with 'column'"),
        (
            "a,bb\n1,2\n",
            "csv: rows.csv, column: bbb",
            "rows.csv has no column 'bbb'; did you mean 'bb'? (allowed: a, bb)",
        ),
        ("x;y\n1;2\n", "csv: rows.csv", "no column 'x'; separate columns by commas, its first line is 'x;y'"),
        ("x,x\n1,2\n", "csv: rows.csv", "rows.csv has 2 columns 'x'; give each column a name of its own"),
        ("x,y\n", "csv: rows.csv", "rows.csv has 0 rows after the header, but it needs at least 1"),
        ("x,y\n1,2\n", "csv: rows.csv, samples: 2", "rows.csv has 1 row after the header, but 'samples' is 2"),
        (
            "x\n" + "1\n" * 10_001,
            "csv: rows.csv",
            "rows.csv has more than 10,000 rows; choose the first ones with 'samp",
        ),
    ],
)
def test_a_column_that_cannot_be_read_is_a_problem_of_its_key(
    tmp_path: Path, data: str, draw: str, problem: str
) -> None:
    write(tmp_path, data)
    (found,) = problems(tmp_path, f"robot.pose.x: {{{draw}}}")
    assert found.startswith("s.sim.yml:12:")
    assert problem in found


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        (b"", "rows.csv:1: variations.robot.pose.x: the file is empty; its first line must name the columns"),
        (b"x,y\n1,2\n,4\n", "rows.csv:3: variations.robot.pose.x: the cell of column 'x' is empty; fill it, or remove"),
        (b"x,y\n1,2\n\n3,4\n", "rows.csv:3: variations.robot.pose.x: the cell of column 'x' is empty"),
        (b"x\n1\n\n3\n", "rows.csv:3: variations.robot.pose.x: the cell of column 'x' is empty"),
        (b"x,y\n1,2\n3\n", "rows.csv:3: variations.robot.pose.x: found 1 cell, but the header has 2 columns"),
        (b"x,y\n1,2,3\n", "rows.csv:2: variations.robot.pose.x: found 3 cells, but the header has 2 columns"),
        (b'x,y\n"1,2\n', "rows.csv:2: variations.robot.pose.x: not valid CSV: unexpected end of data"),
        (b"x,y\n\xff,2\n", "rows.csv:2: variations.robot.pose.x: the byte 0xff is not UTF-8 text; save the file as"),
        (b'x,y\n"a\nb",2\n', "rows.csv:3: variations.robot.pose.x: expected one line of text in column 'x', found"),
        (b"x\na\x00b\n", "rows.csv:2: variations.robot.pose.x: "),
        (b"x\n" + b"9" * 500 + b"\n", "column 'x': a number of 500 digits; the maximum is 400"),
        (b"x\n" + b"9" * 200_000 + b"\n", "rows.csv:2: variations.robot.pose.x: not valid CSV: field larger than"),
    ],
)
def test_a_damaged_table_is_a_problem_of_its_line(tmp_path: Path, data: bytes, problem: str) -> None:
    write(tmp_path, data)
    (found,) = problems(tmp_path, "robot.pose.x: {csv: rows.csv}")
    assert problem in found
    assert found.startswith("rows.csv:")


def test_a_large_table_is_refused_unread(tmp_path: Path) -> None:
    with (tmp_path / "rows.csv").open("wb") as file:
        file.truncate(MAX_CSV_BYTES + 1)
    (found,) = problems(tmp_path, "robot.pose.x: {csv: rows.csv}")
    assert "rows.csv has more than 25 MB; keep the rows to run only" in found


def test_rows_beyond_the_samples_do_not_matter(tmp_path: Path) -> None:
    write(tmp_path, "x\n1\n2\n\n,,,\ncomment, of somebody\n")
    assert rows(tmp_path, "robot.pose.x: {csv: rows.csv, samples: 2}") == [(1,), (2,)]


def test_rows_are_joint_with_all_drawn_keys(tmp_path: Path) -> None:
    write(tmp_path, "x\n1\n2\n3\n")
    (found,) = problems(tmp_path, "robot.pose.x: {csv: rows.csv}; robot.pose.y: {uniform: [0, 1], samples: 2}")
    assert found.endswith("samples are drawn together: 'robot.pose.x' has 3, this one 2")


def test_a_file_outside_is_read_if_the_caller_allows_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write(tmp_path, "x\n1\n2\n")
    inner = tmp_path / "inner"
    inner.mkdir()
    files = CsvFiles(Workspace(inner, inner, allow_outside=True), "inner/s.sim.yml")
    found = value_list("robot.pose.x", {"csv": "../rows.csv"}, 0, files=files)
    assert found == ValueList((1, 2), True, places=(Location("rows.csv", 2), Location("rows.csv", 3)))


def test_a_value_list_without_files_reads_none() -> None:
    with pytest.raises(ValuesError, match="a CSV file can only be read for the scenario of a file"):
        value_list("robot.pose.x", {"csv": "rows.csv"}, 0)


def loaded(folder: Path, variations: str) -> list[LoadedScenario | Refused]:
    (folder / "s.sim.yml").write_text(f"{LEAST}variations:\n  {variations}\n")
    return load_all(read_file(folder / "s.sim.yml", Permissions()), Permissions())


def test_wrong_values_are_reported_where_they_are_written_and_stop_all_variations(tmp_path: Path) -> None:
    write(tmp_path, "friction,x\n0.5,1\n-1,2\n0.7,3\nfast,4\n")
    (refused,) = loaded(tmp_path, "world.ground.friction: {csv: rows.csv}")
    assert isinstance(refused, Refused)
    assert [str(problem).rpartition("/")[2] for problem in refused.problems] == [
        "rows.csv:3: world.ground.friction: must be at least 0, found -1",
        "rows.csv:5: world.ground.friction: expected ratio such as 0.5, found 'fast'",
    ]
    (refused,) = loaded(tmp_path, "world.ground.friction: {choice: [0.5, -1], samples: 16}")
    assert isinstance(refused, Refused)
    assert [str(problem).rpartition("/")[2] for problem in refused.problems] == [
        "s.sim.yml:12:41: world.ground.friction: must be at least 0, found -1"
    ]


def test_rows_of_a_base_in_another_folder_are_beside_that_base(tmp_path: Path) -> None:
    (tmp_path / ".git").mkdir()
    (tmp_path / "lib").mkdir()
    write(tmp_path, "x\n1\n2\n", "lib/rows.csv")
    (tmp_path / "lib/b.base.yml").write_text(f"{LEAST}variations: {{robot.pose.x: {{csv: rows.csv}}}}\n")
    (tmp_path / "s.sim.yml").write_text("extends: lib/b.base.yml\n")
    found = read_file(tmp_path / "s.sim.yml", Permissions())
    assert [each.variation[0].value for each in found] == [1, 2]


PAGE = Path(__file__).parents[3] / "docs/scenario/variations.md"


def test_all_draws_of_the_document_can_be_drawn(tmp_path: Path) -> None:
    write(tmp_path, "payload\n1 kg\n2 kg\n", "loads.csv")
    found = re.findall(r"^\| `\w+` \|.*\| `(\{.*\})` \|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert len(found) == 7
    for draw in found:
        assert len(rows(tmp_path, f"robot.payload: {draw}")) in (2, 20, 64)


DIMENSIONS = range(MAX_KEYS)

# Of the primitive polynomials, that of the first dimension taken as 0.
DEGREES = (0, 1, 2, 3, 3, 4, 4, 5, 5, 5, 5, 5, 5, 6, 6, 6, 6, 6, 6, 7)

SCRAMBLES = st.integers(0, 2**BITS - 1)


def test_all_points_are_those_of_another_program() -> None:
    """Those of scipy 1.17.1: `qmc.Sobol(20, scramble=False, bits=32).random(256) * 2**32` as "<u4"."""
    rows = zip(*(points(dimension, 256) for dimension in DIMENSIONS), strict=True)
    written = b"".join(struct.pack("<20I", *row) for row in rows)
    assert hashlib.sha256(written).hexdigest() == "4b7cbfe2a112d4cb925243dfd974b9db5a449d4f072d0adcd34725c213b2c705"


@given(st.sampled_from(DIMENSIONS), st.integers(0, 9), SCRAMBLES)
def test_each_interval_of_a_dimension_has_one_point_at_every_power_of_2(
    dimension: int, power: int, scramble: int
) -> None:
    count = 2**power
    covered = [int(point * count) for point in scrambled_points(dimension, count, scramble)]
    assert sorted(covered) == list(range(count))


@given(st.integers(0, 8), st.integers(0, 8), SCRAMBLES, SCRAMBLES)
def test_the_first_two_dimensions_have_one_point_in_each_rectangle(wide: int, high: int, one: int, other: int) -> None:
    count = 2 ** (wide + high)
    pairs = zip(scrambled_points(0, count, one), scrambled_points(1, count, other), strict=True)
    assert len({(int(x * 2**wide), int(y * 2**high)) for x, y in pairs}) == count


@pytest.mark.parametrize(("first", "second"), list(pairwise(DIMENSIONS)))
def test_two_dimensions_cover_rectangles_as_their_polynomials_promise(first: int, second: int) -> None:
    """A (t, m, 2)-net: each rectangle of the area 2**(t - m) holds 2**t points."""
    t = sum(max(DEGREES[each] - 1, 0) for each in (first, second))
    m = max(t, 8)
    xs, ys = (list(scrambled_points(each, 2**m, 7919 * each + 1)) for each in (first, second))
    for wide in range(m - t + 1):
        high = m - t - wide
        cells = Counter((int(x * 2**wide), int(y * 2**high)) for x, y in zip(xs, ys, strict=True))
        assert set(cells.values()) == {2**t}
        assert len(cells) == 2 ** (m - t)


@given(st.sampled_from(DIMENSIONS), SCRAMBLES)
def test_more_points_leave_the_first_as_they_are(dimension: int, scramble: int) -> None:
    few = list(scrambled_points(dimension, 8, scramble))
    assert list(scrambled_points(dimension, 32, scramble))[:8] == few
    assert all(0 < point < 1 for point in few)


def test_each_point_is_uniform_over_scrambles() -> None:
    """The first point of many scrambles: each of 16 intervals has its share, within 5 standard deviations."""
    seeds = [int.from_bytes(hashlib.sha256(bytes([n % 256, n // 256])).digest()[:4], "big") for n in range(4096)]
    for index in (0, 1, 5):
        found = Counter(int(list(scrambled_points(3, index + 1, seed))[-1] * 16) for seed in seeds)
        assert len(found) == 16
        assert all(abs(count - 256) < 5 * 256**0.5 for count in found.values())
