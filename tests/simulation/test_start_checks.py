"""Which starts are refused, and what is said of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from sim_action.core.errors import BadStart, Location, RunError
from sim_action.core.field_types import Placement
from sim_action.core.geometry import Pose, quaternion_from_rpy
from sim_action.engines.engine import Engine
from sim_action.robot.model.robot_model import Joint, JointType, Link, RobotModel
from sim_action.robot.model.robot_spec import Robot
from sim_action.scenario.stage import DEPTH
from sim_action.simulation import start_checks
from sim_action.state.observation import Clash, Overlap
from sim_action.world import GROUND, Body, Heightfield, Physics, World
from sim_action.world.parts import GridPart
from sim_action.world.scene import Scene, WorldPlaces
from tests.scenarios import load
from tests.traces import HERE

CRATE = Body(name="crate", box=(1, 1, 1), mass=2)
WALL = Body(name="wall", box=(1, 1, 1))
DEEP = 2 * DEPTH


def joint(kind: JointType, parent: str, child: str) -> Joint:
    return Joint(f"{parent}_{child}", kind, parent, child, Pose(), (0.0, 0.0, 1.0))


ARM = RobotModel(
    name="arm",
    source="/arm.urdf",
    links=tuple(Link(name, 1.0) for name in ("base", "foot", "upper", "hand")),
    joints=(joint("fixed", "base", "foot"), joint("revolute", "base", "upper"), joint("fixed", "upper", "hand")),
    urdf="<robot/>",
)


def scene(z: float | None = 0.1, base: str = "free", **keys: Any) -> Scene:
    """The arm, with a crate and a wall in its world."""
    robot = Robot.model_validate({"model": "arm.urdf", "base": base, "pose": {"x": 1, "y": 2, "z": z}})
    return Scene(robot, ARM, World(objects=(CRATE, WALL)), Physics(), HERE, **keys)


def settled(down: float, pitch: float, z: float | None = None, base: str = "free") -> str | None:
    after = Pose((0.0, 0.0, 0.5 - down), quaternion_from_rpy(0.0, pitch, 1.0))
    return start_checks.moved_while_settling(scene(z, base), Pose((0.0, 0.0, 0.5)), after)


@pytest.mark.parametrize(
    ("down", "pitch", "z", "said"),
    [
        (0.0, 0.0, None, None),
        (0.01, 0.03, None, None),
        (0.25, 0.0, None, "came 0.25 m down"),
        (0.25, -0.1, None, "tilted by 5.73 deg and came 0.25 m down"),
        (0.0, 0.1, None, "tilted by 5.73 deg"),
        (0.25, 0.0, 0.5, None),
        (0.25, 0.1, 0.5, "tilted by 5.73 deg and came 0.25 m down"),
    ],
)
def test_a_base_that_moved_while_settling_is_told(down: float, pitch: float, z: float | None, said: str | None) -> None:
    expected = said and f"while the robot settled, before t = 0, its base link 'base' {said}"
    assert settled(down, pitch, z) == expected
    assert settled(down, pitch, z, base="fixed") is None


@pytest.mark.parametrize(("down", "z", "notes"), [(0.25, 0.5, 1), (0.09, 0.5, 0), (-0.25, 0.5, 0), (0.25, None, 0)])
def test_a_robot_that_falls_is_told_how_to_start_in_the_air(down: float, z: float | None, notes: int) -> None:
    before, after = Pose((0.0, 0.0, 0.5)), Pose((0.0, 0.0, 0.5 - down))
    for base, expected in (("free", notes), ("fixed", 0)):
        found = start_checks.fell_while_settling(scene(z, base), before, after)
        assert (found is not None) == bool(expected)
        assert found is None or ("fell 0.25 m before t = 0" in found and "physics: {settle: 0}" in found)


def told(*overlaps: Overlap, base: str = "free", z: float | None = 0.1, clashes: Sequence[Clash] = ()) -> list[str]:
    try:
        start_checks.refuse_bad_start(scene(z, base), Pose(), overlaps, clashes)
    except BadStart as error:
        return [".".join(map(str, path)) + f": {message}" for path, message in error.by_keys]
    return []


def test_a_start_inside_a_body_is_told_with_what_to_move() -> None:
    assert told() == []
    assert told(Overlap("base", "wall", DEPTH), Overlap("hand", GROUND, DEPTH)) == []
    assert told(Overlap("hand", "wall", 0.12)) == [
        "robot.pose: the robot's link 'hand' starts 0.12 m inside 'wall'; move it, or world.objects[1].pose"
    ]
    (message,) = told(Overlap("base", GROUND, 0.3))
    assert "0.3 m inside the ground" in message
    assert "leave z out" in message
    # What is bolted at the height of the world has no z to leave out.
    (message,) = told(Overlap("hand", GROUND, 0.3), base="fixed", z=None)
    assert message.endswith("inside the ground; raise its z")
    # Each body is told once, with the link that is deepest in it.
    found = told(
        Overlap("hand", "wall", 0.1),
        Overlap("upper", "wall", 0.2),
        Overlap("foot", "wall", DEEP),
        Overlap("hand", "crate", 0.3),
    )
    assert [message.split(";")[0] for message in found] == [
        "robot.pose: the robot's link 'hand' starts 0.3 m inside 'crate'",
        "robot.pose: the robot's link 'upper' starts 0.2 m inside 'wall'",
    ]
    # A body deep in another is told once, and one that lies on it is not.
    clashes = (Clash("crate", "wall", 0.1), Clash("crate", GROUND, 0.3), Clash("crate", "wall", DEPTH))
    (message,) = told(clashes=clashes)
    assert message.startswith("world.objects.0.pose: 'crate' begins 0.3 m deep in the ground, which would throw it out")
    assert told(clashes=clashes[2:]) == []


@pytest.mark.parametrize(
    ("link", "body", "is_told"),
    [
        ("base", "wall", False),
        ("foot", GROUND, False),
        ("foot", "crate", True),
        ("upper", "wall", True),
        ("hand", GROUND, True),
    ],
)
def test_what_is_bolted_to_the_world_may_be_in_what_is_fixed(link: str, body: str, is_told: bool) -> None:
    assert bool(told(Overlap(link, body, DEEP), base="fixed")) is is_told
    assert told(Overlap(link, body, DEEP), base="free")


@pytest.mark.parametrize(("x", "z", "is_buried"), [(0.0, 0.4, True), (0.0, 0.6, False), (3.0, 0.1, False)])
def test_a_robot_below_a_heightfield_is_told_though_it_touches_nothing(x: float, z: float, is_buried: bool) -> None:
    field = Heightfield(heights=((0.5, 0.5), (0.5, 0.5)), size=(2, 2))
    body = Body(name="hill", heightfield=field, pose=Placement(z=0))
    parts = {"hill": (GridPart((2, 2), np.full((2, 2), 0.5)),)}
    hilly = Scene(Robot(model="arm.urdf"), ARM, World(objects=(body,)), Physics(), HERE, parts=parts)
    if not is_buried:
        start_checks.refuse_bad_start(hilly, Pose((x, 0, z)), (), ())
        return
    with pytest.raises(BadStart, match=r"starts 0.1 m below the surface of 'hill'"):
        start_checks.refuse_bad_start(hilly, Pose((x, 0, z)), (), ())


@dataclass
class Floor:
    """An engine with a floor under the robot; without a stated z, the robot begins at z = 0."""

    scene: Scene
    top: float
    is_closed: bool = False

    @property
    def z(self) -> float:
        return self.scene.robot.pose.z or 0.0

    def observe(self, step: int, *, contacts: bool) -> object:
        return SimpleNamespace(pose=Pose((1.0, 2.0, self.z)))

    def overlaps(self) -> tuple[Overlap, ...]:
        # A way out through a side is never longer than that upwards.
        depth = self.top - self.z
        return (Overlap("base", "wall", min(depth, 0.04)),) if depth > 0 else ()

    def close(self) -> None:
        assert not self.is_closed
        self.is_closed = True


HERE_IN_WORLD = Location("office.world", 7)


def lifted(top: float, z: float | None, place: Location | None = None, base: str = "free") -> tuple[float, list[str]]:
    places = WorldPlaces({"wall": Location("office.world", 3)}, place)
    opened: list[Floor] = []

    def start(scene: Scene) -> Engine:
        opened.append(Floor(scene, top))
        return cast(Engine, opened[-1])

    backend, notes = start_checks.opened_on_top(scene(z, base, places=places), start)
    assert [each.is_closed for each in opened] == [True] * (len(opened) - 1) + [False]
    assert cast(object, backend) is opened[-1]
    return opened[-1].z, list(notes)


def test_a_robot_starts_on_top_of_a_fixed_body() -> None:
    z, (note,) = lifted(0.05, None)
    assert z == pytest.approx(0.05)
    assert note.startswith("the robot starts on 'wall', 0.05 m above the ground")
    assert lifted(0.09, None)[0] == pytest.approx(0.09)
    # That of a world file has a note on its line.
    z, (note,) = lifted(0.03, 0.01, HERE_IN_WORLD)
    assert z == pytest.approx(0.03)
    assert note.startswith("the pose of the robot in the world file puts it 0.02 m into 'wall'")
    assert note.endswith("(office.world:7)")


@pytest.mark.parametrize(
    ("top", "z", "place", "base"),
    [
        (0.05, 0.0, None, "free"),
        (0.05, None, None, "fixed"),
        (DEPTH, None, None, "free"),
        (start_checks.MAX_LIFT_M + 0.01, None, None, "free"),
        (start_checks.MAX_LIFT_M + 0.01, 0.0, HERE_IN_WORLD, "free"),
    ],
    ids=["stated z", "bolted", "a contact", "too deep", "too deep in a world file"],
)
def test_other_robots_stay_where_they_are(top: float, z: float | None, place: Location | None, base: str) -> None:
    assert lifted(top, z, place, base) == (z or 0.0, [])


def of_file(overlaps: Sequence[Overlap] = (), clashes: Sequence[Clash] = (), **places: Location) -> list[str]:
    at = WorldPlaces({name: place for name, place in places.items() if name != "robot"}, places.get("robot"))
    with pytest.raises(BadStart) as told:
        start_checks.refuse_bad_start(scene(places=at), Pose(), overlaps, clashes)
    own = [".".join(map(str, path)) + f": {message}" for path, message in told.value.by_keys]
    return [*own, *map(str, told.value.elsewhere)]


def test_a_start_in_a_body_of_the_world_file_names_its_line() -> None:
    place = Location("office.world", 3)
    deep = Overlap("hand", "wall", 0.12)
    inside = "the robot's link 'hand' starts 0.12 m inside 'wall'; move it, or the model at office.world:3"
    assert of_file([deep], wall=place) == [f"robot.pose: {inside}"]
    assert of_file([deep], wall=place, robot=HERE_IN_WORLD) == [f"office.world:7: {inside}"]
    (message,) = of_file([Overlap("hand", GROUND, 0.12)], robot=HERE_IN_WORLD)
    assert message.startswith("office.world:7: the robot's link 'hand' starts 0.12 m inside the ground; ")
    assert message.endswith("; raise its <pose>, or state robot.pose in the scenario")
    # Bodies of the world file may begin a little in each other.
    places = {"crate": Location("office.world", 3), "wall": Location("office.world", 5)}
    touching = [Clash("crate", "wall", 0.02)]
    (note,) = start_checks.refuse_bad_start(scene(places=WorldPlaces(places)), Pose(), (), touching)
    assert note == (
        "1 body of the world file begins a little inside others, and the engine moves them apart: "
        "'crate' begins 0.02 m deep in 'wall' (office.world:3)"
    )
    (message,) = of_file((), [Clash("crate", "wall", 0.021)], **places)
    assert message.startswith("office.world:3: 'crate' begins 0.021 m deep in 'wall', which would throw it out; ")
    assert "; at most 0.02 m is allowed; move it, or run with it: allow: [overlapping-bodies]" in message


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
def arrivals(tmp_path: Path) -> start_checks.Spawns:
    return start_checks.Spawns.of(load(tmp_path, TEXT).scenario)


def test_arrivals_are_at_the_first_step_of_their_time_and_end_a_period(arrivals: start_checks.Spawns) -> None:
    assert arrivals.names == {120: ("first",), 121: ("second", "third")}
    ends = {0: 24, 95: 119, 96: 120, 97: 120, 119: 120, 120: 121, 121: 145}
    assert {step: arrivals.next(step, step + 24) for step in ends} == ends


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


def refuse(arrivals: start_checks.Spawns, step: int, engine: Inside) -> None:
    arrivals.refuse_blocked(step, 240.0, cast(Engine, engine))


def test_engines_are_asked_when_something_appears_and_the_deepest_is_told(arrivals: start_checks.Spawns) -> None:
    engine = Inside()
    for step in range(100, 130):
        refuse(arrivals, step, engine)
    assert engine.asked == 2
    # What was there before is not told.
    links = (Overlap("base", "first", 0.1), Overlap("base", "ever", 0.1), Overlap("base", "third", 0.004))
    refuse(arrivals, 121, Inside(links, (Clash("first", "ever", 0.1),)))
    links = (Overlap("base", "second", 0.01), Overlap("wheel", "second", 0.02), Overlap("arm", "ever", 1.0))
    with pytest.raises(RunError, match=r"'second' appears at 0.5042 s, 0.02 m inside the robot's link 'wheel'") as told:
        refuse(arrivals, 121, Inside(links))
    assert told.value.keys == ("world", "objects", 1, "appears")


@pytest.mark.parametrize("clash", [Clash("ever", "third", 0.03), Clash("third", "ever", 0.03)])
def test_bodies_are_inside_each_other_either_way(arrivals: start_checks.Spawns, clash: Clash) -> None:
    with pytest.raises(RunError, match=r"'third' appears at 0.5042 s, 0.03 m inside 'ever', and the engine would"):
        refuse(arrivals, 121, Inside(bodies=(clash,)))
