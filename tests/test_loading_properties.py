"""Whatever is done to a scenario's text: it is loaded, or refused with a place inside the file. Nothing else."""

from __future__ import annotations

import random
import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.errors import InvalidScenario, Location, Problem
from sim_action.scenario.loading import load_scenario
from sim_action.scenario.model import LoadedScenario
from tests.scenarios import FULL, LEAST
from tests.soak import examples

ODD_VALUES = [
    *("", "~", "true", "-1", "0", ".nan", ".inf", "1e999", "1e-323", "0x" + "f" * 5000, "9" * 350, "1 furlong", "5 kg"),
    *("[]", "{}", "[[]]", "{a: {b: c}}", "[1, 2, 3]", "*x", "&x y", "!!str x", "'", '"', "|", ">", "%", "@", "\t"),
    *('"\\0"', '"\\ud800"', '"\\UFFFFFFFF"', '"a\\nb"', "../../x.urdf", "/dev/null", "x.xacro", "turtlebot3_burgr"),
    *("90 deg", "240", "7 Hz", "wheel_left_joint", "ground", "no_collision", "script", "twist", "\U0001f916", "\x07"),
]
ODD_ENTRIES = [
    *("upright", "no_collision: {allow: [wal]}", "joint: {name: x, near: 1}", "reach: {x: 1}", "reach: {x: 1, y: 1 s}"),
    *("stay_within: {x: [1]}", "max_speed: {}", "travel: {at_least: 2, at_most: 1}", "{travel: {}, reach: {}}"),
]

texts = st.sampled_from([LEAST, FULL])
seeds = st.integers(0, 2**32 - 1)


def check(text: str, folder: Path) -> None:
    path = folder / "any.sim.yml"
    data = text.encode("utf-8", "surrogatepass")
    path.write_bytes(data)
    lines = re.split("\r\n|[\r\n\x85\u2028\u2029]", data.decode("utf-8", "replace"))
    for problem in refused(path):
        where = problem.location
        assert where.file == str(path)
        assert where.line is not None
        assert where.column is not None
        assert 1 <= where.line <= len(lines)
        assert 1 <= where.column <= len(lines[where.line - 1]) + 1
        assert problem.message.isprintable()
        assert len(problem.message) < 2100


def refused(path: Path) -> tuple[Problem, ...]:
    """The problems of a file, none if it is valid; any other exception is the bug that is looked for."""
    try:
        loaded = load_scenario(path)
    except InvalidScenario as error:
        return error.problems or (Problem(Location("no problem is told"), ""),)
    assert isinstance(loaded, LoadedScenario)
    return ()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("scenarios")


def mutated(text: str, rng: random.Random, odd: str) -> str:
    """The text with one change."""
    lines = text.split("\n")
    at = rng.randrange(len(lines))
    match rng.randrange(9):
        case 0:
            del lines[at]
        case 1:
            lines.insert(rng.randrange(len(lines)), lines[at])
        case 2:
            lines[at] = lines[rng.randrange(len(lines))]
        case 3:
            column = rng.randrange(len(lines[at]) + 1)
            lines[at] = lines[at][:column] + odd + lines[at][column:]
        case 4:
            lines[at] = " " * rng.randrange(8) + lines[at].lstrip()
        case 5:
            lines[at] = re.sub(r": .*", lambda _: f": {rng.choice(ODD_VALUES)}", lines[at])
        case 6:
            lines[at] = re.sub(r": [^,}]*(?=[,}])", lambda _: f": {rng.choice(ODD_VALUES)}", lines[at], count=1)
        case 7:
            lines.insert(at, f"  - {rng.choice(ODD_ENTRIES)}")
        case _:
            first, second = rng.sample(re.findall(r"[\w.]+", text), 2)
            return text.replace(first, second, 1)
    return "\n".join(lines)


@examples(100)
@given(texts, seeds, st.integers(1, 3), st.text(max_size=5))
def test_a_damaged_scenario_is_loaded_or_refused(folder: Path, text: str, seed: int, changes: int, odd: str) -> None:
    rng = random.Random(seed)
    for _ in range(changes):
        text = mutated(text, rng, odd)
    check(text, folder)


plain = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=10)
    | st.sampled_from(["1 s", "5 m", "10 Hz", "turtlebot3_burger", "twist", "travel", "no_collision", "diff"])
)
keys = st.text(max_size=5) | st.sampled_from(["twist", "travel", "rate", "name", "linear", "for", "x", "box", "drive"])
structures = st.recursive(
    plain, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(keys, inner, max_size=3), max_leaves=8
)


def places(data: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Every path in plain data."""
    inner = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    return [path, *(found for key, value in inner for found in places(value, (*path, key)))]


def replaced(data: Any, path: tuple[Any, ...], value: Any) -> Any:
    if not path:
        return value
    copy = dict(data) if isinstance(data, dict) else list(data)
    copy[path[0]] = replaced(data[path[0]], path[1:], value)
    return copy


@examples(80)
@given(texts, seeds, structures)
def test_any_structure_at_any_key_is_loaded_or_refused(folder: Path, text: str, seed: int, value: object) -> None:
    data = yaml.safe_load(text)
    path = random.Random(seed).choice(places(data))
    check(yaml.dump(replaced(data, path, value), allow_unicode=True), folder)


@examples(80)
@given(st.text(max_size=100))
def test_any_text_is_loaded_or_refused(folder: Path, text: str) -> None:
    check(text, folder)
