from __future__ import annotations

import xml.etree.ElementTree as ET

import pytest

from sim_action.reports.page.drawing import drawing
from tests.outcomes import outcome
from tests.replays import drive


def drawn(*, holds: bool = False, distance: float = 1.0) -> ET.Element:
    return ET.fromstring(drawing(drive(distance=distance), outcome("a.sim.yml", holds=holds)))


def points(svg: ET.Element, kind: str) -> list[list[tuple[float, ...]]]:
    found = [shape for shape in svg if shape.get("class") == kind]
    return [[tuple(map(float, pair.split(","))) for pair in shape.attrib["points"].split()] for shape in found]


def test_the_way_is_drawn_from_its_beginning_to_its_end() -> None:
    [way] = points(drawn(), "way")
    assert (way[0], way[-1]) == ((0.0, 0.0), (1.0, 0.0))
    assert len(way) <= 120


def test_all_of_the_way_and_of_what_it_was_about_is_in_view() -> None:
    x, y, width, height = map(float, drawn(distance=5.0).attrib["viewBox"].split())
    assert x < -0.2
    assert x + width > 5.2
    assert y < -0.8
    assert y + height > 0.1
    assert width <= 3.001 * height


def test_what_the_robot_met_is_there_and_what_it_touched() -> None:
    svg = drawn()
    assert len(points(svg, "body")) == 2
    assert [float(shape.attrib["cx"]) for shape in svg if shape.get("class") == "touch"] == [1.0]


@pytest.mark.parametrize(("holds", "kind"), [(True, "goal"), (False, "goal missed")])
def test_a_goal_that_was_missed_is_told_apart(holds: bool, kind: str) -> None:
    [goal] = [shape for shape in drawn(holds=holds) if shape.tag == "circle" and "goal" in shape.attrib["class"]]
    assert goal.attrib["class"] == kind
