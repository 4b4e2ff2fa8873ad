"""Bodies on paths that move through bolted links: every engine sees the contact, although it computes no force."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.errors import BadStart, InvalidScenario, MissedContact
from sim_action.core.field_types import Placement
from sim_action.engines.observers import MIN_OVERLAP_M
from sim_action.robot.model.robot_spec import Robot
from sim_action.state.observation import Contact
from sim_action.state.trace import Trace
from sim_action.state.verdict import Verdict
from sim_action.world import World
from sim_action.world.scene import Scene
from tests.integration.engines import advance, on_every_engine, running, scene_of, travelled
from tests.simulated import simulated
from tests.soak import examples
from tests.worlds import with_files

RATE = 240
BASE = '<cylinder radius="0.15" length="0.1"/>'
ARM = """
<robot name="arm">
  <link name="base">{inertial}<collision><geometry>{base}</geometry></collision></link>
  <link name="column">{inertial}<collision><geometry><box size="0.1 0.1 0.4"/></geometry></collision></link>
  <joint name="weld" type="fixed"><parent link="base"/><child link="column"/><origin xyz="0 0 0.25"/></joint>
  <link name="upper">{inertial}<collision><geometry><box size="0.08 0.08 0.3"/></geometry></collision></link>
  <joint name="shoulder" type="revolute"><parent link="column"/><child link="upper"/><origin xyz="0 0 0.4"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="50" velocity="2"/></joint>
</robot>
"""
INERTIAL = '<inertial><mass value="5"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'


def arm(folder: Path, *objects: dict[str, Any], base: str = BASE, **pose: float) -> Scene:
    robot = Robot(model="robot.urdf", base="fixed", pose=Placement(**pose))
    return scene_of(folder, ARM.format(inertial=INERTIAL, base=base), robot, World.model_validate({"objects": objects}))


def moved(engine: str, scene: Scene, seconds: float) -> Trace:
    return travelled(engine, scene, round(seconds * RATE), contacts=True)


def steps_of(contacts: Sequence[Contact], link: str) -> list[int]:
    return [round(contact.time * RATE) for contact in contacts if contact.link == link]


def along_x(z: float, size_z: float = 0.06, **keys: Any) -> dict[str, Any]:
    """A box of 0.6 m that moves through the origin at 1 m/s."""
    path = ({"at": 0, "x": 1}, {"at": 2, "x": -1})
    return {"name": "agv", "box": (0.6, 0.6, size_z), "pose": {"x": 1, "z": z}, "path": path, **keys}


@on_every_engine
@pytest.mark.parametrize(("link", "z", "half"), [("base", 0.05, 0.15), ("column", 0.3, 0.05)])
def test_a_bolted_link_is_touched_at_each_step_of_the_overlap(
    engine: str, link: str, z: float, half: float, tmp_path: Path
) -> None:
    trace = moved(engine, arm(tmp_path, along_x(z)), 2)
    within = [step for step in range(1, 481) if abs(1 - step / RATE) < 0.3 + half - MIN_OVERLAP_M]
    assert steps_of(trace.contacts, link) == within
    assert {contact.link for contact in trace.contacts} == {link}
    assert not any(contact.has_force or contact.force for contact in trace.contacts)
    x, y, at = trace.contacts[0].position_xyz
    assert (x, at) == pytest.approx((half, z), abs=0.05)
    assert abs(y) <= 0.3


@on_every_engine
def test_a_link_beyond_a_joint_is_left_to_the_engine(engine: str, tmp_path: Path) -> None:
    trace = moved(engine, arm(tmp_path, along_x(0.7)), 2)
    assert {contact.link for contact in trace.contacts} == {"upper"}
    assert all(contact.has_force for contact in trace.contacts)
    assert max(contact.force for contact in trace.contacts) > 0


@on_every_engine
def test_controllers_see_the_contact_and_a_start_inside_counts(engine: str, tmp_path: Path) -> None:
    path = ({"at": 0, "x": 0}, {"at": 1, "x": 1})
    with running(engine, arm(tmp_path, along_x(0.05, path=path)), contacts=True) as backend:
        advance(backend, -24, 24)
        (start,) = [contact for contact in backend.observe(0, contacts=True).contacts if contact.body == "agv"]
        assert (start.time, start.link, start.has_force) == (0.0, "base", False)
        trace = advance(backend, 0, 240)
        assert steps_of(trace.contacts, "base")[-1] == math.floor((0.45 - MIN_OVERLAP_M) * RATE)
        assert not any(contact.body == "agv" for contact in backend.observe(240, contacts=True).contacts)


@on_every_engine
def test_a_body_of_several_pieces_touches_with_each(engine: str, tmp_path: Path) -> None:
    stairs = {"name": "stairs", "stairs": {"steps": 3, "rise": 0.1, "run": 0.3, "width": 1.0}}
    path = ({"at": 0, "x": 2}, {"at": 4, "x": -2})
    trace = moved(engine, arm(tmp_path, {**stairs, "pose": {"x": 2}, "path": path}), 4)
    # The lowest step meets the base first, the highest one the column.
    assert steps_of(trace.contacts, "base")[0] < steps_of(trace.contacts, "column")[0]
    assert steps_of(trace.contacts, "base")[0] == pytest.approx((2 - 0.45 - 0.15) * RATE, abs=2)


@on_every_engine
def test_terrain_on_a_path_touches_too(engine: str, tmp_path: Path) -> None:
    # Its surface is at a height of 0.2 m: in the column, and above the base.
    flat = {"heightfield": {"heights": ((0.1, 0.1, 0.1),) * 3, "size": (1.0, 1.0)}}
    path = ({"at": 0, "x": 2, "z": 0.1}, {"at": 2, "x": 0, "z": 0.1})
    scene = arm(tmp_path, {"name": "hill", **flat, "pose": {"x": 2, "z": 0.1}, "path": path})
    first = steps_of(moved(engine, with_files(scene), 2).contacts, "column")
    assert first[0] == pytest.approx((2 - 0.5 - 0.05) * RATE, abs=2)
    assert first == list(range(first[0], 481))


@on_every_engine
def test_a_body_beside_a_link_or_on_it_does_not_touch(engine: str, tmp_path: Path) -> None:
    beside = along_x(0.05, name="beside", pose={"x": 1, "y": 0.452, "z": 0.05})
    above = {"name": "lid", "box": (0.05, 0.05, 0.1), "pose": {"x": 0.12, "z": 0.15}}
    lid = {**above, "path": ({"at": 0, "y": -1}, {"at": 2, "y": 1})}
    assert moved(engine, arm(tmp_path, beside, lid), 2).contacts == ()


SHAPES = st.one_of(
    st.fixed_dictionaries({"box": st.tuples(*[st.floats(0.02, 0.5)] * 3)}),
    st.fixed_dictionaries({"sphere": st.fixed_dictionaries({"radius": st.floats(0.01, 0.3)})}),
    st.fixed_dictionaries(
        {"cylinder": st.fixed_dictionaries({"radius": st.floats(0.01, 0.3), "height": st.floats(0.02, 0.5)})}
    ),
)
BASES = st.sampled_from(['<box size="0.3 0.2 0.1"/>', BASE, '<sphere radius="0.1"/>'])
POINTS = st.lists(st.tuples(*[st.floats(-0.6, 0.6)] * 3), min_size=2, max_size=4)


def separation(base: str, shape: dict[str, Any], there: np.ndarray) -> float:
    """The distance in m of two shapes with parallel axes, negative inside: an oracle that needs no engine.

    Each shape is a round or rectangular outline in the plane and an extent in height; a ball is a point with a radius.
    """
    own: dict[str, dict[str, Any]] = {
        '<box size="0.3 0.2 0.1"/>': {"box": (0.3, 0.2, 0.1)},
        BASE: {"cylinder": {"radius": 0.15, "height": 0.1}},
        '<sphere radius="0.1"/>': {"sphere": {"radius": 0.1}},
    }
    (core, radius), (other, more) = _core(own[base]), _core(shape)
    apart = np.abs(there) - core[:3] - other[:3]
    round_xy = core[3] + other[3]
    plane = float(np.hypot(*np.maximum(apart[:2], 0.0))) if (apart[:2] > 0).any() else float(apart[:2].max())
    plane -= round_xy
    ways = np.array([plane, apart[2]])
    outside = float(np.hypot(*np.maximum(ways, 0.0))) if (ways > 0).any() else float(ways.max())
    return outside - radius - more


def _core(shape: dict[str, Any]) -> tuple[np.ndarray, float]:
    """Half extents in x, y and z, the radius in the plane, and the radius in space."""
    if "box" in shape:
        return np.array([*(size / 2 for size in shape["box"]), 0.0]), 0.0
    if "sphere" in shape:
        return np.zeros(4), shape["sphere"]["radius"]
    return np.array([0.0, 0.0, shape["cylinder"]["height"] / 2, shape["cylinder"]["radius"]]), 0.0


@on_every_engine
@examples(25)
@given(shape=SHAPES, base=BASES, points=POINTS, gap=st.floats(0.1, 1.0))
def test_contacts_agree_with_distances_that_need_no_engine(
    engine: str, shape: dict[str, Any], base: str, points: list[tuple[float, float, float]], gap: float
) -> None:
    path = tuple({"at": gap * number, "x": x, "y": y, "z": z + 5} for number, (x, y, z) in enumerate(points))
    x, y, z = points[0]
    mover = {"name": "agv", **shape, "pose": {"x": x, "y": y, "z": z + 5}, "path": path}
    seconds = gap * len(points)
    with tempfile.TemporaryDirectory() as folder:
        trace = moved(engine, arm(Path(folder), mover, base=base, z=5.0), seconds)
    touched = set(steps_of(trace.contacts, "base"))
    columns = np.array(points)
    for step in range(1, len(trace) + 1):
        at = [np.interp(step / RATE, [point["at"] for point in path], column) for column in columns.T]
        distance = separation(base, shape, np.array(at))
        # PyBullet rounds the edges of boxes by 1 mm.
        if abs(distance) > 1e-3:
            assert (step in touched) == (distance < 0), (step, distance)


def judged(folder: Path, engine: str, expected: Any, *objects: dict[str, Any], **keys: Any) -> Verdict:
    (folder / "robot.urdf").write_text(ARM.format(inertial=INERTIAL, base=BASE))
    scenario = {"name": "s", "backend": engine, "robot": {"model": "robot.urdf", "base": "fixed"}, "expect": [expected]}
    timed = {**scenario, "world": {"objects": objects}, "duration": 2, "time_limit": 2, **keys}
    (verdict,) = simulated(folder, timed).verdicts
    return verdict


@on_every_engine
def test_a_body_on_a_path_through_a_base_is_a_collision(engine: str, tmp_path: Path) -> None:
    verdict = judged(tmp_path, engine, "no_collision", along_x(0.05))
    assert verdict.status == "failed"
    assert verdict.time == pytest.approx(0.55, abs=0.01)
    assert verdict.message.startswith("base touched agv at 0.55 s, at (")
    assert " m, with no computed force (neither gives way); body 'agv' began its path at " in verdict.message


@on_every_engine
@pytest.mark.parametrize("limit", [{"at_most": 50}, {"impulse": {"at_most": 1}}])
def test_a_limit_of_the_force_does_not_pass(engine: str, limit: dict[str, Any], tmp_path: Path) -> None:
    verdict = judged(tmp_path, engine, {"contact": {"with": "agv", **limit}}, along_x(0.05))
    assert (verdict.status, verdict.measured) == ("failed", None)
    assert "with no computed force (neither gives way), so no limit can hold" in verdict.message
    with pytest.raises(InvalidScenario, match="there is no force between 'agv' and 'base': 'agv' follows its path"):
        judged(tmp_path, engine, {"contact": {"with": "agv", "link": "base", **limit}}, along_x(0.05))


@on_every_engine
def test_names_in_allow_still_count(engine: str, tmp_path: Path) -> None:
    assert judged(tmp_path, engine, {"no_collision": {"allow": ["base"]}}, along_x(0.05)).passed


@on_every_engine
def test_a_thin_body_that_jumps_past_a_thin_link_is_an_error(engine: str, tmp_path: Path) -> None:
    plate = {"name": "plate", "box": (0.01, 0.5, 0.5), "pose": {"x": 1, "z": 0.35}}
    # The column is 0.1 m wide; the plate moves 0.4 m per step.
    fast = {**plate, "path": ({"at": 0, "x": 1.01}, {"at": 0.02, "x": -0.91})}
    with pytest.raises(MissedContact, match=r"link '(column|base)' passed through body 'plate' without a contact"):
        judged(tmp_path, engine, "no_collision", fast, physics={"rate": 240, "max_speed": 1000})


@on_every_engine
@pytest.mark.parametrize("is_other", [False, True])
def test_only_links_that_can_move_may_not_start_in_what_is_fixed(engine: str, is_other: bool, tmp_path: Path) -> None:
    """The robot under test and another one alike: where neither side gives way, nothing is thrown out."""
    (tmp_path / "robot.urdf").write_text(ARM.format(inertial=INERTIAL, base=BASE))
    arm = {"model": "robot.urdf", "base": "fixed", "pose": {"x": 2}}
    robots = {"model": "turtlebot3_burger"} if is_other else arm, [{"name": "arm", **arm}] if is_other else []

    def notes(box: tuple[float, ...], z: float) -> Sequence[str]:
        world = {"objects": [{"name": "it", "box": box, "pose": {"x": 2, "z": z}}], "actors": robots[1]}
        keys = {"name": "s", "backend": engine, "robot": robots[0], "world": world, "allow": ["fixed-base"]}
        return simulated(tmp_path, {**keys, "expect": ["upright"], "duration": 0.1, "time_limit": 1}).notes

    assert [note for note in notes((1, 1, 0.3), 0.15) if "overlapped" in note] == []
    with pytest.raises(BadStart, match=r"(link 'upper' starts|'arm' begins) 0.\d+ m (inside|deep in) 'it'"):
        notes((0.1, 0.1, 0.1), 0.75)
