from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from sim_action.commands import OpenLoop
from sim_action.commands.twist import TwistCommands
from sim_action.core.geometry import Twist
from sim_action.core.workspace import Workspace
from tests.traces import scene

THERE = scene()


def spec(*segments: dict[str, Any], **others: Any) -> TwistCommands:
    return TwistCommands.model_validate({"twist": segments, **others})


def at(commands: TwistCommands, time: float) -> object:
    controller = commands.open(THERE)
    assert isinstance(controller, OpenLoop)
    return controller.command(time)


@pytest.mark.parametrize(
    ("time", "twist"),
    [
        (0.0, Twist.planar(1.0)),
        (1.9, Twist.planar(1.0)),
        (2.0, Twist.planar(0.2, 1.0)),
        (2.9, Twist.planar(0.2, 1.0)),
        (3.0, Twist()),
        (99.0, Twist()),
    ],
)
def test_segments_follow_one_another_and_then_it_stops(time: float, twist: Twist) -> None:
    commands = spec({"linear": 1.0, "for": "2 s"}, {"linear": 0.2, "angular": "1 rad/s", "for": 1})
    assert at(commands, time) == twist


def test_segments_go_sideways_and_last_until_the_next() -> None:
    assert at(spec({"linear": 1.0, "lateral": "-20 cm/s"}), 0.0) == Twist.planar(1.0, lateral=-0.2)
    assert at(spec({"linear": 1.0, "for": 1}, {"linear": 0.5}), 1e6) == Twist.planar(0.5)
    # A tick on the end of a segment belongs to the next, whatever the rounding.
    commands = spec(*[{"linear": float(n), "for": 0.1} for n in range(10)])
    assert [at(commands, n / 10) for n in range(10)] == [Twist.planar(float(n)) for n in range(10)]


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"twist": ()}, "at least 1 item"),
        ({"twist": ({"for": 0},)}, "greater than 0"),
        ({"twist": ({"for": "-1 s"},)}, "greater than 0"),
        ({"twist": ({"duration": 1},)}, "Extra inputs"),
        ({"twist": ({"linear": "1 rad/s"},)}, "'rad/s' is not a unit of speed"),
        ({"twist": ({"angular": "1 m/s"},)}, "'m/s' is not a unit of angular speed"),
        ({"twist": ({},), "rate": 0}, "greater than 0"),
    ],
)
def test_what_cannot_be_driven_is_refused(data: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        TwistCommands.model_validate(data)


@pytest.mark.parametrize(
    ("lengths", "rate", "told"),
    [
        ([1.91, 0.05, 1], 10, [(1, "1.91 s", "1.96 s", "0.1 s", "20 Hz")]),
        ([0.05, 0.04, 1], 10, [(1, "0.05 s", "0.09 s", "0.1 s", "25 Hz")]),
        ([0.05, 0.05, 1], 10, [(1, "0.05 s", "0.1 s", "0.1 s", "20 Hz")]),
        ([0.95, 0.1, 0.1], 10, []),
        ([0.05], 10, []),
        ([0.99, 0.02], 10, []),
        ([0.1] * 30, 10, []),
        ([1, None], 10, []),
        ([0.3, 0.001, 0.3, 0.001], 20, [(3, "0.601 s", "0.602 s", "0.05 s", "1000 Hz")]),
    ],
)
def test_a_segment_that_no_tick_falls_into_is_told_with_what_helps(
    lengths: list[float | None], rate: float, told: list[tuple[int, str, str, str, str]], tmp_path: Path
) -> None:
    commands = spec(*[{} if length is None else {"for": length} for length in lengths], rate=rate)
    found = list(commands.problems(Workspace(tmp_path, tmp_path)))
    assert [path for path, _ in found] == [("twist", index, "for") for index, *_ in told]
    for (_, message), (_, start, end, period, remedy) in zip(found, told, strict=True):
        assert message.startswith(f"no tick falls between {start} and {end}, so it has no effect; ")
        assert message.endswith(
            f"{period} apart (rate: {rate:g} Hz): make it at least that long, or set rate: {remedy}"
        )


def test_a_segment_that_never_ends_is_the_last(tmp_path: Path) -> None:
    found = spec({"linear": 1, "for": 1}, {"linear": 1}, {"linear": 2}).problems(Workspace(tmp_path, tmp_path))
    assert list(found) == [(("twist", 1), "only the last segment may omit 'for'")]


@given(st.lists(st.floats(0.001, 0.5), min_size=1, max_size=8))
def test_every_segment_is_driven_or_told(lengths: list[float]) -> None:
    commands = spec(*[{"linear": float(number), "for": length} for number, length in enumerate(lengths)])
    controller = commands.open(THERE)
    assert isinstance(controller, OpenLoop)
    driven = [controller.command(tick / 10) for tick in range(60)]
    dropped = {path[1] for path, _ in commands.problems(Workspace(Path(), Path()))}
    assert dropped == {number for number in range(len(lengths)) if Twist.planar(float(number)) not in driven}


def test_it_needs_a_drive_and_ticks_at_10_hertz() -> None:
    assert TwistCommands.needs_drive
    assert not TwistCommands.runs_user_code
    assert spec({}).rate == 10.0
    assert spec({}, rate="20 Hz").rate == 20.0
