"""The values of one key: how many samples, their distributions, rows of CSV files, and their names."""

from __future__ import annotations

import hashlib
import math
import re
import struct
from collections import Counter
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from random import Random
from statistics import NormalDist, fmean, variance
from typing import Any

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from pydantic import ValidationError

from sim_action.core.errors import Location
from sim_action.core.permissions import Permissions
from sim_action.core.workspace import Workspace
from sim_action.scenario import variations as draws
from sim_action.scenario.files import read_file
from sim_action.scenario.source import MAX_KEYS
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
from tests.scenarios import LEAST, load_refused, refused_runs, runs

UNIFORM = "robot.pose.x: {uniform: [0, 1]}"


def varied(variations: str, gate_runs: int | None = None) -> str:
    gate = f"gate: {{passes: {{at_least: 50 %, confidence: 50 %}}, runs: {gate_runs}}}\n" if gate_runs else ""
    return f"variations:\n  {variations.replace('; ', chr(10) + '  ')}\n{gate}"


def rows(folder: Path, variations: str, gate_runs: int | None = None) -> list[tuple[object, ...]]:
    return [tuple(value.value for value in run.variation) for run in runs(varied(variations, gate_runs), folder)]


def problems(folder: Path, variations: str, gate_runs: int | None = None) -> list[str]:
    return refused_runs(varied(variations, gate_runs), folder)


def names(variations: str) -> list[str]:
    return [run.name.removeprefix("push") for run in runs(varied(variations))]


def write(folder: Path, text: str | bytes, name: str = "rows.csv") -> None:
    (folder / name).write_bytes(text.encode() if isinstance(text, str) else text)


def test_a_gate_decides_the_number_of_samples(tmp_path: Path) -> None:
    stated = rows(tmp_path, UNIFORM.replace("]}", "], samples: 5}"))
    assert rows(tmp_path, UNIFORM, 5) == stated == rows(tmp_path, UNIFORM.replace("]}", "], samples: 5}"), 5)


@pytest.mark.parametrize("draw", ["uniform: [0, 1]", "integers: [0, 9]", "choice: [0, 1]", "sobol: [0, 1]"])
def test_a_draw_without_samples_needs_a_gate(tmp_path: Path, draw: str) -> None:
    (found,) = problems(tmp_path, f"robot.pose.x: {{{draw}}}")
    assert found == (
        "12:3: variations.robot.pose.x: the key 'samples' is missing; add it, or state the number of runs in "
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
        f"12:35: variations.robot.pose.x.samples: 4 samples, {unequal}",
        f"13:44: variations.robot.pose.y.samples: 1 sample, {unequal}",
        "14:18: variations.robot.pose.z.csv: rows.csv has 2 rows after the header, but the gate needs 5",
        f"15:3: variations.robot.pose.yaw: {even}",
        f"16:10: variations.seed.integers: {seeds}",
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


def test_seeds_are_drawn_from_whole_numbers() -> None:
    found = names("seed: {integers: [0, 9], samples: 10}")
    assert sorted(found) == [f"[seed={seed}]" for seed in range(10)]
    assert found == names("seed: {uniform: [0, 9], samples: 10}")


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
    assert names(text) == [
        name if values.count(value) > 1 else f"[base={value}]" for name, value in zip(called, values, strict=True)
    ]
    # Another drawn key makes them different.
    assert "#" not in "".join(names(f"{text}; robot.pose.x: {{uniform: [0, 1], samples: 4}}"))


def test_structured_choices_are_called_by_their_numbers_in_the_list(tmp_path: Path) -> None:
    text = "robot.pose: {choice: [{x: 1}, {x: 2}, {x: 3}], weights: [0, 0, 1], samples: 1}"
    assert names(text) == ["[pose=#3]"]
    assert rows(tmp_path, text) == [({"x": 3},)]


@given(
    st.lists(st.one_of(st.text("ab#1", min_size=1, max_size=3), st.integers(0, 3)), min_size=2, max_size=5, unique=True)
)
def test_no_two_samples_are_called_alike(values: list[str | int]) -> None:
    written = ", ".join(f"'{value}'" if isinstance(value, str) else str(value) for value in values)
    found = names(f"robot.base: {{choice: [{written}], samples: 12}}")
    assert len(set(found)) == 12


def test_whole_numbers_are_whole_in_names(tmp_path: Path) -> None:
    found = names("robot.pose.x: {integers: [100000, 900000], samples: 5}")
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
        ("x,y\n1,2\n", "csv: ../rows.csv", "12:18: variations.robot.pose.x.csv: '../rows.csv' is outside the"),
        ("x,y\n1,2\n", "csv: .", "'.' is a folder, not a file"),
        ("x,y\n1,2\n", 'csv: "a\\0/b"', "is not a valid path: embedded null byte"),
        ("x,y\n1,2\n", f"csv: {'a/' * 3000}", "csv: 'a/a/a/"),
        ("x,y\n1,2\n", "csv: 3", "12:18: variations.robot.pose.x.csv: expected text, found 3; put it in quotes"),
        ("a,xx\n1,2\n", "csv: rows.csv", "rows.csv has no column 'x'"),
        ("a,b\n1,2\n", "csv: rows.csv", "(allowed: a, b); name one with 'column'"),
        ("a,bb\n1,2\n", "csv: rows.csv, column: bbb", "has no column 'bbb'; did you mean 'bb'? (allowed: a, bb)"),
        ("x;y\n1;2\n", "csv: rows.csv", "no column 'x'; separate columns by commas, its first line is 'x;y'"),
        ("x,x\n1,2\n", "csv: rows.csv", "rows.csv has 2 columns 'x'; give each column a name of its own"),
        ("x,y\n", "csv: rows.csv", "rows.csv has 0 rows after the header, but it needs at least 1"),
        ("x,y\n1,2\n", "csv: rows.csv, samples: 2", "rows.csv has 1 row after the header, but 'samples' is 2"),
        ("x\n" + "1\n" * 10_001, "csv: rows.csv", "has more than 10,000 rows; choose the first ones with 'samples'"),
    ],
)
def test_a_column_that_cannot_be_read_is_a_problem_of_its_key(
    tmp_path: Path, data: str, draw: str, problem: str
) -> None:
    write(tmp_path, data)
    (found,) = problems(tmp_path, f"robot.pose.x: {{{draw}}}")
    assert found.startswith("12:")
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


def test_a_large_table_is_refused_unread_and_rows_beyond_the_samples_do_not_matter(tmp_path: Path) -> None:
    with (tmp_path / "rows.csv").open("wb") as file:
        file.truncate(MAX_CSV_BYTES + 1)
    (found,) = problems(tmp_path, "robot.pose.x: {csv: rows.csv}")
    assert "rows.csv has more than 25 MB; keep the rows to run only" in found
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


def test_wrong_values_are_reported_where_they_are_written_and_stop_all_variations(tmp_path: Path) -> None:
    write(tmp_path, "friction,x\n0.5,1\n-1,2\n0.7,3\nfast,4\n")
    refused = load_refused(tmp_path, LEAST + varied("world.ground.friction: {csv: rows.csv}"))
    assert [str(problem).rpartition("/")[2] for problem in refused.problems] == [
        "rows.csv:3: world.ground.friction: must be at least 0, found -1",
        "rows.csv:5: world.ground.friction: expected ratio such as 0.5, found 'fast'",
    ]
    refused = load_refused(tmp_path, LEAST + varied("world.ground.friction: {choice: [0.5, -1], samples: 16}"))
    (problem,) = refused.problems
    assert str(problem).endswith("s.sim.yml:12:41: world.ground.friction: must be at least 0, found -1")


def test_rows_of_a_base_in_another_folder_are_beside_that_base(tmp_path: Path) -> None:
    (tmp_path / ".git").mkdir()
    (tmp_path / "lib").mkdir()
    write(tmp_path, "x\n1\n2\n", "lib/rows.csv")
    (tmp_path / "lib/b.base.yml").write_text(f"{LEAST}variations: {{robot.pose.x: {{csv: rows.csv}}}}\n")
    (tmp_path / "s.sim.yml").write_text("extends: lib/b.base.yml\n")
    found = read_file(tmp_path / "s.sim.yml", Permissions())
    assert [each.variation[0].value for each in found] == [1, 2]


COUNT = 4000
SHARES = st.floats(0, 1, exclude_max=True)
FIGURES = st.floats(-1e6, 1e6)


def drawn(draw: draws.Distribution, seed: int = 1) -> list[Any]:
    generator = Random(seed)
    return list(draw.drawn(generator.random() for _ in range(COUNT)))


def largest_gap(samples: Sequence[float], share_below: Callable[[float], float]) -> float:
    """The statistic of Kolmogorov and Smirnov: the largest difference of both distribution functions."""
    ordered = sorted(samples)
    return max(
        max((index + 1) / len(ordered) - share_below(value), share_below(value) - index / len(ordered))
        for index, value in enumerate(ordered)
    )


SIGNIFICANT = 1.95 / COUNT**0.5  # larger differences have a probability of 1e-3; the seed is fixed


def simpson(function: Callable[[float], float], low: float, high: float, steps: int = 2000) -> float:
    width = (high - low) / steps
    inner = sum((4 if step % 2 else 2) * function(low + step * width) for step in range(1, steps))
    return (function(low) + inner + function(high)) * width / 3


@pytest.mark.parametrize(
    ("draw", "share_below"),
    [
        (draws.Uniform(uniform=(-2, 6)), lambda x: (x + 2) / 8),
        (draws.Sobol(sobol=(-2, 6)), lambda x: (x + 2) / 8),
        (draws.LogUniform(log_uniform=(0.01, 100)), lambda x: (math.log10(x) + 2) / 4),
        (draws.Normal(normal=(3, 2)), NormalDist(3, 2).cdf),
    ],
)
def test_samples_have_the_distribution_that_they_are_drawn_from(
    draw: draws.Distribution, share_below: Callable[[float], float]
) -> None:
    assert largest_gap(drawn(draw), share_below) < SIGNIFICANT
    assert largest_gap(drawn(draw), lambda x: share_below(x) ** 1.2) > SIGNIFICANT


@pytest.mark.parametrize(
    "between", [(-1, 1), (0, 0.1), (-5, -1), (2, 3), (4, 9), (-30, 30), (-0.5, 40), (-40, 0.5), (5, 5.5), (-5.9, -5.8)]
)
def test_a_truncated_normal_distribution_is_the_density_integrated_over_its_range(between: tuple[float, float]) -> None:
    """By Simpson's rule, which shares no code with the error function."""
    mean, deviation = 2.0, 3.0
    low, high = (mean + deviation * bound for bound in between)
    samples = drawn(draws.Normal(normal=(mean, deviation), between=(low, high)))

    def density(x: float) -> float:
        return math.exp(-(((x - mean) / deviation) ** 2) / 2)

    near = max(low, mean - 12 * deviation), min(high, mean + 12 * deviation)
    whole = simpson(density, *near)
    assert all(low <= sample <= high for sample in samples)
    for share in (0.02, 0.1, 0.5, 0.9, 0.98):
        value = sorted(samples)[int(share * COUNT)]
        assert abs(simpson(density, near[0], value) / whole - share) < SIGNIFICANT
    expected = simpson(lambda x: x * density(x), *near) / whole
    assert abs(fmean(samples) - expected) < 4 * (variance(samples) / COUNT) ** 0.5


def test_quantiles_of_a_truncated_normal_distribution_are_exact_far_from_its_mean() -> None:
    """The median halves the tail, with all digits of the error function."""
    for side in (1, -1):
        between = (5.5, 30.0) if side > 0 else (-30.0, -5.5)
        (median,) = draws.Normal(normal=(0, 1), between=between).drawn([0.5])
        assert isinstance(median, float)
        tail = math.erfc(abs(median) / math.sqrt(2)) / math.erfc(5.5 / math.sqrt(2))
        assert tail == pytest.approx(0.5, rel=1e-9)


@given(FIGURES, st.floats(1e-3, 1e6), st.floats(-6, 6), st.floats(-6, 6), SHARES)
def test_truncated_samples_are_in_their_range(mean: float, deviation: float, a: float, b: float, share: float) -> None:
    low, high = sorted((mean + deviation * a, mean + deviation * b))
    assume((high - low) / deviation > 0.1)
    (sample,) = draws.Normal(normal=(mean, deviation), between=(low, high)).drawn([share])
    assert isinstance(sample, float)
    assert low <= sample <= high


@pytest.mark.parametrize(
    ("way", "bounds"), [("uniform", FIGURES), ("sobol", FIGURES), ("log_uniform", st.floats(1e-300, 1e300))]
)
@given(data=st.data(), share=SHARES)
def test_samples_of_a_range_are_in_it(
    way: str, bounds: st.SearchStrategy[float], data: st.DataObject, share: float
) -> None:
    low, high = sorted((data.draw(bounds), data.draw(bounds)))
    assume(low < high)
    draw = draws.DRAWS[way].model_validate({way: (low, high)})
    assert isinstance(draw, draws.Distribution)
    (sample,) = draw.drawn([share])
    assert isinstance(sample, float)
    assert low <= sample <= high


@given(st.integers(-(2**52), 2**52), st.integers(-(2**52), 2**52), SHARES)
def test_whole_numbers_are_in_their_range(one: int, other: int, share: float) -> None:
    low, high = sorted((one, other))
    assume(low < high)
    draw = draws.Integers(integers=(low, high))
    first, sample, last = draw.drawn([0.0, share, 1 - 2**-53])
    assert isinstance(sample, int)
    assert first == low <= sample <= high == last


def test_whole_numbers_are_equally_likely() -> None:
    count = Counter(drawn(draws.Integers(integers=(-2, 5))))
    assert sorted(count) == list(range(-2, 6))
    squares = sum((number - COUNT / 8) ** 2 / (COUNT / 8) for number in count.values())
    # A chi-squared of 7 degrees of freedom is larger with a probability of 1e-3.
    assert squares < 24.3


def test_values_are_chosen_as_often_as_their_weights_say() -> None:
    generator = Random(2)
    choice = draws.Choice(choice=("a", "b", "c", "d"), weights=(0, 3, 1, 0))
    count = Counter(choice.indices(generator.random() for _ in range(COUNT)))
    assert set(count) == {1, 2}
    assert abs(count[1] / COUNT - 0.75) < 4 * (0.75 * 0.25 / COUNT) ** 0.5
    even = Counter(draws.Choice(choice=("a", "b", "c")).indices(generator.random() for _ in range(COUNT)))
    assert all(abs(even[index] / COUNT - 1 / 3) < 4 * (2 / 9 / COUNT) ** 0.5 for index in range(3))


@given(st.lists(st.floats(0, 1e300), min_size=2, max_size=8), SHARES)
@example([0.0, math.ulp(0.0), 0.0], 0.5)  # the product with the last number is rounded up to the whole sum
def test_a_value_without_weight_is_never_chosen(weights: list[float], share: float) -> None:
    assume(0 < sum(weights) < math.inf)
    choice = draws.Choice(choice=tuple(range(len(weights))), weights=tuple(weights))
    for index in choice.indices([0.0, share, 1 - 2**-53]):
        assert weights[index] > 0


@pytest.mark.parametrize(
    ("way", "stated", "message"),
    [
        ("normal", {"normal": (0, 1), "between": (1, 1)}, "both bounds are 1; choose two different ones"),
        ("normal", {"normal": (0, 1), "between": ("2", 1)}, "found [2, 1]; write [1, 2]"),
        ("normal", {"normal": (0, 1), "between": (7, 9)}, "'between' holds 1e-12 of the normal distribution, less"),
        ("normal", {"normal": (0, 1), "between": (-9, -7)}, "widen it, move the mean, or use 'uniform'"),
        ("normal", {"normal": (0, 1), "between": (1e300, 1e301)}, "'between' holds 0 of the normal distribution"),
        ("normal", {"normal": (0, 1), "between": (0, 1e-12)}, "'between' holds 4e-13 of the normal distribution"),
        ("normal", {"normal": (0, 1), "between": (0, math.nan)}, "expected a finite number or quantity, found nan"),
        ("normal", {"normal": ("0 m", "1 m"), "between": ("0 s", "1 m")}, "of the same dimension as m; found '0 s'"),
        ("normal", {"normal": ("0 m", "1 m"), "between": (-1, 1)}, "units of the same dimension as m; found -1"),
        ("normal", {"normal": (0, 1), "between": ("0 m", 1)}, "must have no unit, like the mean; found '0 m'"),
        ("normal", {"normal": (0, 1e308)}, "samples would be larger than any number; choose a smaller standard"),
        ("normal", {"normal": (-1.79e308, 1e306)}, "samples would be larger than any number"),
        ("uniform", {"uniform": (math.nan, 1)}, "expected a finite number or quantity, found nan"),
        ("log_uniform", {"log_uniform": (0, 1)}, "must be above 0; found [0, 1]; use 'uniform' for a range with 0"),
        ("log_uniform", {"log_uniform": ("-1 m", "1 m")}, "both bounds must be above 0"),
        ("log_uniform", {"log_uniform": (2, 1)}, "must be below the second; found [2, 1]; write [1, 2]"),
        ("sobol", {"sobol": ("1 m", "5 s")}, "both figures must have units of one dimension, or none"),
        ("integers", {"integers": (3, 3)}, "both bounds are 3; choose two different ones, or list the value: [3]"),
        ("integers", {"integers": (3, 1)}, "must be below the second; found [3, 1]; write [1, 3]"),
        ("integers", {"integers": (0, 2.5)}, "Input should be a valid integer"),
        ("integers", {"integers": (0, 2**60)}, "less than or equal to 4503599627370496"),
        ("choice", {"choice": ("a",)}, "'choice' needs at least two values, found 1; a list can have a single one"),
        ("choice", {"choice": ("a", "b"), "weights": (1,)}, "one number for each of the 2 values, found 1"),
        ("choice", {"choice": ("a", "b"), "weights": (1, -1)}, "'weights' must be finite and not negative, found -1"),
        ("choice", {"choice": ("a", "b"), "weights": (1, math.nan)}, "must be finite and not negative, found nan"),
        ("choice", {"choice": ("a", "b"), "weights": (1, math.inf)}, "must be finite and not negative, found inf"),
        ("choice", {"choice": ("a", "b"), "weights": (0, 0)}, "the sum of 'weights' must be finite and above 0"),
        ("choice", {"choice": ("a", "b"), "weights": (1e308, 1e308)}, "the sum of 'weights' must be finite"),
    ],
)
def test_draws_that_cannot_be(way: str, stated: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError) as refused:
        draws.DRAWS[way].model_validate(stated)
    assert message in refused.value.errors()[0]["msg"]


def test_bounds_of_a_normal_distribution_have_the_unit_of_its_mean_or_none_for_0() -> None:
    plain, other = (
        list(draws.Normal(normal=("0 m", "5 cm"), between=between).drawn([0.1, 0.9]))
        for between in (("-1 cm", "10 cm"), ("-10 mm", "0.1 m"))
    )
    assert plain == other
    assert list(draws.Normal(normal=("3 cm", "5 cm"), between=(0, "1 m")).drawn([0.0])) == ["0.0 cm"]


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
