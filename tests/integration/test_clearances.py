"""How near robots come to bodies, on real engines: against what is right, and against asking at every step."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_action.core.field_types import Placement
from sim_action.engines import ENGINES
from sim_action.engines.clearances import ClearanceRecorder
from sim_action.robot.model.robot_spec import Robot
from sim_action.state.command import JointTargets
from sim_action.state.trace import Trace
from sim_action.state.trace_records import Channels, ClearanceRecord, ClearanceWatch, Nearness
from sim_action.world import Body, Cylinder, PathPoint, Sphere, World
from sim_action.world.scene import Scene
from sim_action.world.shapes import Ramp
from tests import traces
from tests.integration.engines import advance, at, on_every_engine, one_link, running, scene_of, travelled
from tests.mesh_files import stl
from tests.physics.robots import collision, inertial, joint, link, robot

LEAST = ClearanceWatch()
ALWAYS = ClearanceWatch(always=True)

BOX, MESH, BALL, ROLL = (  # the mesh is of the size of the box
    one_link(shape, moment=0.01)
    for shape in (
        '<box size="0.2 0.4 0.6"/>',
        '<mesh filename="box.stl"/>',
        '<sphere radius="0.2"/>',
        '<cylinder radius="0.2" length="0.4"/>',
    )
)
WALL = Body(name="wall", box=(0.1, 2.0, 2.0), pose=Placement(x=1.05, z=1.0))  # its face is at x = 1
POST = Body(name="post", cylinder=Cylinder(radius=0.1, height=2.0), pose=Placement(x=1.1, z=1.0))
GLOBE = Body(name="globe", sphere=Sphere(radius=0.1), pose=Placement(x=1.1, z=1.0))


def told(trace: Trace, watch: ClearanceWatch = LEAST) -> list[Nearness]:
    record: ClearanceRecord = trace.clearances[watch]
    return [record.at(index) for index in range(len(record))]


def placed(folder: Path, urdf: str, pose: Placement, body: Body) -> Scene:
    (folder / "box.stl").write_bytes(stl())
    return scene_of(folder, urdf, Robot(model="robot.urdf", base="fixed", pose=pose), World(objects=(body,)))


def distance(engine: str, scene: Scene) -> float:
    (near,) = told(travelled(engine, scene, 1, clearances=[LEAST]))
    return near.distance


@on_every_engine
@pytest.mark.parametrize("body", [WALL, POST, GLOBE], ids=lambda body: str(body.name))
@pytest.mark.parametrize(
    "case",
    [
        (BOX, Placement(z=1.0), 0.1),
        (BOX, Placement(z=1.0, yaw=math.pi / 2), 0.2),
        (MESH, Placement(z=1.0), 0.1),
        (MESH, Placement(z=1.0, yaw=math.pi / 2), 0.2),
        (BALL, Placement(z=1.0), 0.2),
        (ROLL, Placement(z=1.0), 0.2),
        (ROLL, Placement(z=1.0, pitch=math.pi / 2), 0.2),
        (ROLL, Placement(z=1.0, roll=math.pi / 2), 0.2),
    ],
    ids=["box", "box, long side", "mesh", "mesh, long side", "ball", "roll", "roll, cap", "roll, lying"],
)
def test_distances_are_right(engine: str, case: tuple[str, Placement, float], body: Body, tmp_path: Path) -> None:
    urdf, pose, reach = case
    assert distance(engine, placed(tmp_path, urdf, pose, body)) == pytest.approx(1.0 - reach, abs=1e-8)


@on_every_engine
def test_edges_are_right_but_for_the_millimetre_by_which_one_engine_rounds_them(engine: str, tmp_path: Path) -> None:
    scene = placed(tmp_path, BOX, Placement(z=1.0, yaw=math.pi / 4), WALL)
    rounded = 0.001 * (math.sqrt(2) - 1) if engine == "pybullet" else 0.0
    assert distance(engine, scene) == pytest.approx(1.0 - 0.15 * math.sqrt(2) + rounded, abs=1e-8)


@on_every_engine
@pytest.mark.parametrize("urdf", [BOX, MESH, BALL, ROLL], ids=["box", "mesh", "ball", "roll"])
def test_inside_of_a_body_it_is_negative(engine: str, urdf: str, tmp_path: Path) -> None:
    scene = placed(tmp_path, urdf, Placement(x=0.9, z=1.0), WALL)
    reach = 0.1 if urdf in (BOX, MESH) else 0.2
    assert distance(engine, scene) == pytest.approx(0.1 - reach, abs=1e-6 if urdf != MESH else 1e-3)


@on_every_engine
def test_far_away_is_measured_too(engine: str, tmp_path: Path) -> None:
    far = WALL.model_copy(update={"pose": Placement(x=5000.05, z=1.0)})
    assert distance(engine, placed(tmp_path, BALL, Placement(z=1.0), far)) == pytest.approx(4999.8, abs=1e-6)


@on_every_engine
def test_a_falling_ball_is_where_it_is_after_the_step_not_before(engine: str, tmp_path: Path) -> None:
    floor = Body(name="floor", box=(1.0, 1.0, 0.1), pose=Placement(z=0.05))
    trace = travelled(engine, scene_of(tmp_path, BALL, at(z=2.0), World(objects=(floor,))), 100, clearances=[ALWAYS])
    heights = [near.distance + 0.1 + 0.2 for near in told(trace, ALWAYS)]
    assert heights == pytest.approx(trace.base_position_xyz[:, 2].tolist(), abs=1e-9)
    assert [near.time for near in told(trace, ALWAYS)] == trace.time.tolist()


ROOM = World(
    objects=(
        Body(name="wall", box=(0.1, 3.0, 0.5), pose=Placement(x=1.5)),
        Body(name="post", cylinder=Cylinder(radius=0.1, height=1.0), pose=Placement(x=0.6, y=0.5)),
        Body(name="ball", sphere=Sphere(radius=0.1), pose=Placement(x=1.0, y=-0.3), mass=0.2),
        Body(name="far", box=(1.0, 1.0, 1.0), pose=Placement(x=-20.0)),
    )
)
WHEELS = ("wheel_left_joint", "wheel_right_joint")


def waggling_arm(folder: Path) -> Scene:
    """Three links that turn about different axes, one that slides, on a base that is bolted."""
    inside = inertial(0.2, (1e-3, 1e-3, 1e-3))
    shape = collision('<box size="0.3 0.05 0.05"/>', (0.15, 0.0, 0.0))
    parts = [link("l0", inside)]
    for n, (kind, axis, most) in enumerate(
        (
            ("revolute", (0.0, 0.0, 1.0), 3.0),
            ("revolute", (0.0, 1.0, 0.0), 1.5),
            ("prismatic", (1.0, 0.0, 0.0), 0.2),
            ("continuous", (1.0, 0.0, 1.0), 0.0),
        ),
        start=1,
    ):
        limit = f'lower="-{most}" upper="{most}" effort="50" velocity="10"' * bool(most)
        parts.append(link(f"l{n}", inside + shape))
        ahead = (0.3 * (n > 1), 0.0, 0.0)
        parts.append(joint(f"j{n}", kind, f"l{n - 1}", f"l{n}", ahead, axis=axis, limit=limit))
    world = World(objects=(POST.model_copy(update={"pose": Placement(x=0.7, y=0.7, z=1.0)}), GLOBE, WALL))
    return scene_of(folder, robot(*parts), Robot(model="robot.urdf", base="fixed", pose=Placement(z=1.0)), world)


def driven(engine: str, watches: list[ClearanceWatch], openings: tuple[float, ...] = ()) -> Trace:
    """A curve past the post, through the ball and into the wall."""
    scene = replace(traces.scene(), world=ROOM)
    channels = Channels(clearances=frozenset(watches), openings=frozenset(openings))
    pytest.importorskip(engine)
    backend = ENGINES[engine].load()(scene, channels)
    pieces = []
    for number, speeds in enumerate([(8.0, 8.0), (16.0, 12.0), (12.0, 16.0), (16.0, 16.0), (-9.0, -6.0), (0.0, 0.0)]):
        turn = JointTargets(velocity=dict(zip(WHEELS, speeds, strict=True)))
        pieces.append(advance(backend, 240 * number, 240, turn))
    backend.close()
    return Trace.concatenate(pieces)


def swung(engine: str, folder: Path, watches: list[ClearanceWatch]) -> Trace:
    rng = np.random.default_rng(3)
    with running(engine, waggling_arm(folder), clearances=watches) as backend:
        pieces = []
        for number in range(20):
            goal = rng.uniform(-1, 1, 4) * (3.0, 1.5, 0.2, 3.0)
            targets = JointTargets(position={f"j{n + 1}": float(value) for n, value in enumerate(goal)})
            pieces.append(advance(backend, 60 * number, 60, targets))
    return Trace.concatenate(pieces)


def lows(found: list[Nearness], since: float = 0.0) -> list[Nearness]:
    """Those that came nearer than all before."""
    kept: list[Nearness] = []
    for near in found:
        if near.time >= since - 1e-9 and (not kept or near.distance < kept[-1].distance):
            kept.append(near)
    return kept


@on_every_engine
@pytest.mark.parametrize("bodies", [None, ("wall",), ("ball", "far"), ("post", "wall")])
def test_what_is_not_asked_at_every_step_misses_nothing(engine: str, bodies: tuple[str, ...] | None) -> None:
    least, always = ClearanceWatch(bodies=bodies), ClearanceWatch(bodies=bodies, always=True)
    trace = driven(engine, [least, always])
    every = told(trace, always)
    assert len(every) == len(trace)
    assert told(trace, least) == lows(every)


@on_every_engine
def test_nor_does_an_arm(engine: str, tmp_path: Path) -> None:
    hand = (ClearanceWatch(links=("l4", "l2")), ClearanceWatch(links=("l4", "l2"), always=True))
    trace = swung(engine, tmp_path, [LEAST, ALWAYS, *hand])
    assert told(trace) == lows(told(trace, ALWAYS))
    assert told(trace, hand[0]) == lows(told(trace, hand[1]))
    assert {near.link for near in told(trace, hand[1])} <= {"l4", "l2"}
    assert min(told(trace, hand[1])) >= min(told(trace, ALWAYS))


def beside_movers(engine: str, folder: Path, *bodies: Body) -> tuple[Trace, list[Nearness]]:
    """The trace of a still ball, and its distances at each step; what is asked seldom has missed nothing."""
    still = Robot(model="robot.urdf", base="fixed", pose=Placement(z=0.5))
    trace = travelled(engine, scene_of(folder, BALL, still, World(objects=bodies)), 600, clearances=[LEAST, ALWAYS])
    every = told(trace, ALWAYS)
    assert len(every) == len(trace)
    assert told(trace) == lows(every)
    return trace, every


@on_every_engine
def test_nor_does_what_moves_by_itself(engine: str, tmp_path: Path) -> None:
    there_and_back = (PathPoint(at=0.0, x=1.0), PathPoint(at=1.0, x=0.5), PathPoint(at=2.0, x=0.75, yaw=1.0))
    door = Body(name="door", box=(0.1, 0.5, 0.5), pose=Placement(z=0.5), path=there_and_back, loop=False)
    late = Body(name="late", box=(0.1, 0.1, 0.1), pose=Placement(x=-0.4, z=0.5), appears=1.5)
    trace, _ = beside_movers(engine, tmp_path, door, late)
    assert min(near.distance for near in told(trace)) == pytest.approx(0.4 - 0.05 - 0.2, abs=1e-6)
    assert [near.body for near in told(trace) if near.time >= 1.5] == ["late"]


@on_every_engine
def test_nor_does_what_turns_and_has_no_known_size(engine: str, tmp_path: Path) -> None:
    there_and_back = (PathPoint(at=0.0, x=1.5), PathPoint(at=1.0, x=0.7, yaw=1.5), PathPoint(at=2.0, x=1.5, yaw=3.0))
    slope = Ramp(length=0.5, width=0.5, height=0.2)
    door = Body(name="door", ramp=slope, pose=Placement(z=0.5), path=there_and_back)
    assert min(near.distance for near in beside_movers(engine, tmp_path, door)[1]) < 0.3


@pytest.mark.parametrize("openings", [(), (1.0, 2.503)])
def test_to_look_back_at_many_steps_is_to_look_at_each(
    openings: tuple[float, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    still = ("wall", "post", "far")
    watches = [
        ClearanceWatch(bodies=still),
        ClearanceWatch(bodies=still, always=True),
        ClearanceWatch(bodies=still, within=0.3, always=True),
        ClearanceWatch(bodies=("wall",), links=("base_footprint",)),
    ]
    back = driven("mujoco", watches, openings)
    monkeypatch.setattr(ClearanceRecorder, "bodies_are_static", False)
    each = driven("mujoco", watches, openings)
    for watch in watches:
        assert told(back, watch)
        assert told(back, watch) == told(each, watch)


@on_every_engine
def test_each_window_has_its_own_least_within_the_asked_distance_and_watching_changes_nothing(engine: str) -> None:
    openings, near = (0.0, 2.5, 5.0), ClearanceWatch(within=0.3, always=True)
    trace = driven(engine, [LEAST, ALWAYS, near], openings)
    for since in openings:
        assert lows(told(trace), since) == lows(told(trace, ALWAYS), since)
    assert told(trace, near) == [one for one in told(trace, ALWAYS) if one.distance <= 0.3] != []
    assert np.array_equal(trace.state, driven(engine, []).state)


@on_every_engine
def test_the_ground_is_watched_where_it_is_named(engine: str, tmp_path: Path) -> None:
    watch = ClearanceWatch(bodies=("ground",), always=True)
    trace = travelled(engine, scene_of(tmp_path, BALL, at(z=2.0)), 50, clearances=[watch])
    assert [near.distance + 0.2 for near in told(trace, watch)] == pytest.approx(trace.base_position_xyz[:, 2].tolist())


@on_every_engine
def test_the_engine_is_asked_seldom(engine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []
    original: Any = ClearanceRecorder.__init__

    def counting(self: Any, *asks_for: Any, near: Any, **others: Any) -> None:
        def ask(body: str, links: Any, within: float) -> Any:
            asked.append(body)
            return near(body, links, within)

        original(self, *asks_for, near=ask, **others)

    monkeypatch.setattr(ClearanceRecorder, "__init__", counting)
    steps = len(driven(engine, [LEAST]))
    assert asked.count("far") == 1
    assert asked.count("post") < steps / 3
    assert asked.count("wall") < steps
