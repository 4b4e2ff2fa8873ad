"""What is drawn into the world."""

from __future__ import annotations

from sim_action.state.marks import Arrow, Circle, goal, line, rectangle


def test_a_place_to_come_to_is_a_circle_and_a_heading_there_an_arrow() -> None:
    assert list(goal(1.0, 2.0, None, 0.25, None)) == [Circle(1.0, 2.0, 0.25)]
    assert list(goal(1.0, 2.0, 3.0, 0.25, 0.5)) == [Circle(1.0, 2.0, 0.25, 3.0), Arrow(1.0, 2.0, 0.5)]


def test_an_area_goes_round_its_corners() -> None:
    assert rectangle((0.0, 1.0), (2.0, 3.0)).points == ((0.0, 2.0), (1.0, 2.0), (1.0, 3.0), (0.0, 3.0))


def test_a_bound_of_one_axis_is_a_line_across_it() -> None:
    assert {x for x, _, _ in line("x", 2.0, (0.0, 1.0)).points} == {2.0}
    assert {y for _, y, _ in line("y", 2.0, (0.0, 1.0)).points} == {2.0}
