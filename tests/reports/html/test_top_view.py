"""."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from sim_action.core.geometry import quaternion_from_rpy
from sim_action.recording.replay import scene_data
from sim_action.reports.html.top_view import SceneOutlines, drawing, outline, pose_of
from tests.outcomes import like, outcome
from tests.replays import GREY, HERE, MESH, drive, passed_by


def drawn(*, holds: bool = False, distance: float = 1.0) -> ET.Element:
    return ET.fromstring(drawing(drive(distance=distance), outcome("a.sim.yml", holds=holds)))


def points(svg: ET.Element, kind: str) -> list[list[tuple[float, ...]]]:
    found = [shape for shape in svg if shape.get("class") == kind]
    return [[tuple(map(float, pair.split(","))) for pair in shape.attrib["points"].split()] for shape in found]


def test_the_parts_of_a_drawing() -> None:
    # The way is drawn from its beginning to its end.
    [way] = points(drawn(), "way")
    assert (way[0], way[-1]) == ((0.0, 0.0), (1.0, 0.0))
    assert len(way) <= 120
    # All of the way and of what it was about is in view.
    x, y, width, height = map(float, drawn(distance=5.0).attrib["viewBox"].split())
    assert x < -0.2
    assert x + width > 5.2
    assert y < -0.8
    assert y + height > 0.1
    assert width <= 3.001 * height
    # What the robot met is there and what it touched.
    svg = drawn()
    assert len(points(svg, "body")) == 2
    assert [float(shape.attrib["cx"]) for shape in svg if shape.get("class") == "touch"] == [1.0]


@pytest.mark.parametrize(("holds", "kind"), [(True, "goal"), (False, "goal missed")])
def test_a_goal_that_was_missed_is_told_apart(holds: bool, kind: str) -> None:
    [goal] = [shape for shape in drawn(holds=holds) if shape.tag == "circle" and "goal" in shape.attrib["class"]]
    assert goal.attrib["class"] == kind


def test_tolerances_of_a_path_and_of_a_heading_are_areas() -> None:
    way = ((0.0, 1.0, 0.0), (1.0, 1.0, 0.0))
    path = scene_data.PolylineMark(kind="polyline", points=way, tolerance=0.2, expectation=0)
    arrow = scene_data.ArrowMark(kind="arrow", x=0.0, y=2.0, yaw=0.0, tolerance=0.5, expectation=0)
    replay = like(drive(distance=3.0), marks=(path, arrow))
    svg = ET.fromstring(drawing(replay, outcome("a.sim.yml", holds=False)))
    [band] = [shape for shape in svg if shape.get("class") == "band missed"]
    assert (band.attrib["points"], band.attrib["stroke-width"]) == ("0,-1 1,-1", "0.4")
    [wedge] = points(svg, "goal missed")
    assert wedge[0] == (0.0, -2.0)
    assert {round(math.dist(wedge[0], rim), 2) for rim in wedge[1:]} == {0.3}


def test_a_line_around_a_far_body_does_not_widen_the_view() -> None:
    far = scene_data.PolylineMark(kind="polyline", points=((0.0, 90.0, 0.0), (1.0, 90.0, 0.0)), is_aside=True)
    plain, added = (like(drive(), marks=marks) for marks in ((), (far,)))
    views = [ET.fromstring(drawing(replay, outcome("a.sim.yml"))).attrib["viewBox"] for replay in (plain, added)]
    assert views[0] == views[1]


def test_marks_that_move_with_a_link_are_drawn_where_they_are_at_the_end() -> None:
    # The robot ends at (3, 0), with its heading.
    moved = drive(distance=3.0)
    circle = scene_data.CircleMark(kind="circle", x=0.5, y=0.25, radius=0.1, link=0, expectation=1)
    line = scene_data.PolylineMark(kind="polyline", points=((0.0, 1.0, 0.0), (1.0, 1.0, 0.0)), link=0, expectation=1)
    square = scene_data.PolygonMark(kind="polygon", points=((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)), link=0, expectation=1)
    arrow = scene_data.ArrowMark(kind="arrow", x=0.0, y=2.0, yaw=0.0, link=0, expectation=1)
    replay = like(moved, marks=(circle, line, square, arrow))
    svg = ET.fromstring(drawing(replay, outcome("a.sim.yml")))
    [goal] = [shape for shape in svg if shape.tag == "circle" and "goal" in shape.attrib["class"]]
    assert (float(goal.attrib["cx"]), float(goal.attrib["cy"])) == (3.5, -0.25)
    assert points(svg, "goal path") == [[(3.0, -1.0), (4.0, -1.0)], [(3.0, -2.0), (3.3, -2.0)]]
    [region] = [shape for shape in svg if shape.tag == "polygon" and shape.get("class") == "goal"]
    assert region.attrib["points"] == "3,0 4,0 4,-1"


@pytest.mark.parametrize(
    ("y", "appears", "highest"),
    [(3.0, None, 3.0), (3.0, 1.0, 1.5), (3.0, 100.0, 0.8), (0.04, None, 0.8), (40.0, None, 3.0)],
)
def test_bodies_that_move_are_in_view_where_they_are_near(y: float, appears: float | None, highest: float) -> None:
    """From 1 s on, the first one is half way; far away, not there yet, or hardly moving, it does not widen the view."""
    svg = ET.fromstring(drawing(passed_by(y, appears=appears), outcome("a.sim.yml")))
    margin = 0.35
    assert -float(svg.attrib["viewBox"].split()[1]) == pytest.approx(highest + margin, abs=0.35)


ORIGIN = pose_of(HERE)
LYING = (0.0, 0.0, 0.0, 0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5))


def extent(corners: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> list[float]:
    return [*corners.min(axis=0).tolist(), *corners.max(axis=0).tolist()]


@pytest.mark.parametrize(
    ("shape", "half"),
    [
        (scene_data.BoxShape(kind="box", pose=HERE, color=GREY, size=(0.4, 0.2, 0.1)), (0.2, 0.1)),
        (scene_data.CylinderShape(kind="cylinder", pose=HERE, color=GREY, radius=0.3, length=1.0), (0.3, 0.3)),
        (scene_data.EllipsoidShape(kind="ellipsoid", pose=HERE, color=GREY, half=(0.3, 0.1, 0.2)), (0.3, 0.1)),
        (scene_data.CapsuleShape(kind="capsule", pose=LYING, color=GREY, radius=0.1, length=0.4), (0.3, 0.1)),
    ],
    ids=lambda value: getattr(value, "kind", ""),
)
def test_a_solid_covers_the_ground_below_it(shape: scene_data.BoxShape, half: tuple[float, float]) -> None:
    x, y = half
    assert extent(outline(shape, ORIGIN, {})) == pytest.approx([-x, -y, x, y], abs=1e-3)


def test_outlines_of_shapes_and_links() -> None:
    # A turned box is as wide as its diagonal.
    turned = (1.0, 0.0, 0.0, *quaternion_from_rpy(0.0, 0.0, math.pi / 4))
    corners = outline(scene_data.BoxShape(kind="box", pose=HERE, color=GREY, size=(2.0, 2.0, 1.0)), pose_of(turned), {})
    assert len(corners) == 4
    assert extent(corners) == pytest.approx([1 - math.sqrt(2), -math.sqrt(2), 1 + math.sqrt(2), math.sqrt(2)], abs=1e-3)
    # A mesh is its points.
    meshes = drive().scene.meshes
    corners = outline(scene_data.MeshShape(kind="mesh", pose=HERE, color=GREY, mesh=MESH), ORIGIN, meshes)
    assert extent(corners) == pytest.approx([0.0, 0.0, 0.3, 0.3])
    # Links go where the base goes.
    replay = drive(distance=2.0)
    svg = ET.fromstring(drawing(replay, outcome("a.sim.yml")))
    # The y axis of a drawing points down.
    base, wheel = (extent(np.array(corners)) for corners in points(svg, "start"))
    assert base == pytest.approx([-0.2, -0.1, 0.2, 0.1])
    assert wheel == pytest.approx([0.0, -0.17, 0.2, -0.13], abs=1e-3)
    assert extent(np.array(points(svg, "robot")[0])) == pytest.approx([1.8, -0.1, 2.2, 0.1])
    # Drawings that share outlines are those made alone.
    shared = SceneOutlines()
    first = drive(distance=1.0)
    again = like(drive(distance=2.0), scene=first.scene)
    other = drive(distance=2.0, body="crate")
    for replay in (first, again, other, first):
        expected = outcome("a.sim.yml")
        assert drawing(replay, expected, shared) == drawing(replay, expected)


@pytest.mark.parametrize("middle", [0.00005, 0.12345, -0.00025, 1.00015, 123.45675])
def test_outlines_are_rounded_as_python_rounds(middle: float) -> None:
    half = 2 * middle
    box = scene_data.BoxShape(kind="box", pose=HERE, color=GREY, size=(abs(half), abs(half), 1.0))
    corners = outline(box, pose_of(HERE), {})
    assert {abs(value) for value in corners.ravel().tolist()} == {round(abs(half) / 2, 4)}


def test_each_point_of_a_shape_is_rounded_as_python_rounds() -> None:
    # The products of some coordinates with 1e4 are near the middle of two whole numbers, those of others are not.
    x, y = 1.00015, 0.77777
    box = scene_data.BoxShape(kind="box", pose=HERE, color=GREY, size=(2 * x, 2 * y, 1.0))
    corners = {(abs(x), abs(y)) for x, y in outline(box, pose_of(HERE), {}).tolist()}
    assert corners == {(round(2 * x / 2, 4), round(2 * y / 2, 4))}
