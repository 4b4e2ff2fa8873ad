"""When bodies appear, and whether their place is free."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import cast

import pytest

from sim_action.core.errors import RunError
from sim_action.engines import Backend
from sim_action.simulation.spawn_checks import Arrivals
from sim_action.state.observation import Clash, Overlap
from tests.scenarios import load

TEXT = """\
name: s
robot: {model: turtlebot3_burger}
world:
  objects:
    - {name: first, box: [1, 1, 1], pose: {x: 5}, appears: 0.5 s}
    - {name: second, box: [1, 1, 1], pose: {x: 5}, appears: 0.501 s}
    - {name: third, box: [1, 1, 1], pose: {x: 5}, appears: 0.504 s}
    - {name: ever, box: [1, 1, 1], pose: {x: 5}}
expect: [upright]
time_limit: 10 s
"""


@pytest.fixture
def arrivals(tmp_path: Path) -> Arrivals:
    return Arrivals.of(load(tmp_path, TEXT).scenario)


def test_steps_are_the_first_at_or_after_a_time(arrivals: Arrivals) -> None:
    assert arrivals.names == {120: ("first",), 121: ("second", "third")}


def test_the_next_arrival_ends_a_period_that_it_falls_in(arrivals: Arrivals) -> None:
    assert [arrivals.next(step, step + 24) for step in (0, 95, 96, 97, 119, 120, 121)] == [
        24,
        119,
        120,
        120,
        120,
        121,
        145,
    ]


@dataclass
class Inside:
    """An engine in which things are inside each other; nothing else is asked of it."""

    links: tuple[Overlap, ...] = ()
    bodies: tuple[Clash, ...] = ()
    asked: int = 0

    def overlaps(self) -> tuple[Overlap, ...]:
        self.asked += 1
        return self.links

    def clashes(self) -> tuple[Clash, ...]:
        return self.bodies


def refuse(arrivals: Arrivals, step: int, engine: Inside) -> None:
    arrivals.refuse_blocked(step, 240.0, cast(Backend, engine))


def test_engines_are_asked_only_when_something_appears(arrivals: Arrivals) -> None:
    engine = Inside()
    for step in range(100, 130):
        refuse(arrivals, step, engine)
    assert engine.asked == 2


def test_what_was_there_before_is_not_told(arrivals: Arrivals) -> None:
    links = (Overlap("base", "first", 0.1), Overlap("base", "ever", 0.1), Overlap("base", "third", 0.004))
    refuse(arrivals, 121, Inside(links, (Clash("first", "ever", 0.1),)))


def test_the_deepest_is_told(arrivals: Arrivals) -> None:
    links = (Overlap("base", "second", 0.01), Overlap("wheel", "second", 0.02), Overlap("arm", "ever", 1.0))
    with pytest.raises(
        RunError, match=r"'second' appears at 0.5042 s, 0.02 m deep in the robot's link 'wheel'"
    ) as told:
        refuse(arrivals, 121, Inside(links))
    assert told.value.keys == ("world", "objects", 1, "appears")


@pytest.mark.parametrize("clash", [Clash("ever", "third", 0.03), Clash("third", "ever", 0.03)])
def test_bodies_are_inside_each_other_either_way(arrivals: Arrivals, clash: Clash) -> None:
    with pytest.raises(RunError, match=r"'third' appears at 0.5042 s, 0.03 m deep in 'ever', and one would"):
        refuse(arrivals, 121, Inside(bodies=(clash,)))
