"""Contacts of named links, feet, the support polygon and grips on every engine, against formulas."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import mujoco
import numpy as np
import pytest

from sim_action.assertions.upright import Upright
from sim_action.robot.model.kinematics import centre_of_mass
from sim_action.scenario.loading import build_scene
from sim_action.scenario.model import LoadedScenario
from sim_action.simulation.loop import SimulationRun, simulate
from sim_action.state.command import JointTargets
from sim_action.state.trace_records import Channels
from sim_action.state.trace_storage import load_trace, save_trace
from sim_action.state.verdict import Verdict
from sim_action.world import GRAVITY, World
from tests.integration.conftest import ACTION
from tests.integration.engines import advance, at, on_every_engine, running, scene_of
from tests.mesh_files import fans, stl, wheel
from tests.physics.robots import collision, inertial, joint, link, robot
from tests.scenarios import LEAST, load
from tests.simulated import simulated
from tests.traces import expectation

FEET = ("foot_1", "foot_2", "foot_3", "foot_4")
CORNERS = ((0.2, 0.15), (0.2, -0.15), (-0.2, 0.15), (-0.2, -0.15))


def table(aside: float = 0.0) -> str:
    """A plate of 5 kg, whose centre of mass is `aside`, that stands on four balls of 200 g each."""
    plate = inertial(5.0, (0.1, 0.1, 0.1), (aside, 0.0, 0.0)) + collision('<box size="0.4 0.3 0.1"/>')
    ball = inertial(0.2, (1e-3, 1e-3, 1e-3)) + collision('<sphere radius="0.03"/>')
    parts = [link("plate", plate)]
    for name, (x, y) in zip(FEET, CORNERS, strict=True):
        parts += [link(name, ball), joint(f"to_{name}", "fixed", "plate", name, (x, y, -0.3))]
    return robot(*parts)


class Watching(Upright):
    """Reads the contacts of three feet."""

    key: ClassVar[str] = "upright"

    @property
    def channels(self) -> Channels:
        return Channels(link_contacts=frozenset(FEET[:3]))


def loaded_table(folder: Path, engine: str, rate: str = "240 Hz", objects: str = "[]") -> LoadedScenario:
    (folder / "table.urdf").write_text(table())
    text = LEAST.partition("commands:")[0].replace("turtlebot3_burger", "table.urdf")
    world = f"world: {{objects: {objects}}}\ntrace: {{rate: {rate}}}\nbackend: {engine}\n"
    return load(folder, f"{text}expect: [upright]\ntime_limit: 0.25 s\n{world}")


def watched(folder: Path, engine: str, *, watching: bool = True, **keys: str) -> SimulationRun:
    loaded = loaded_table(folder, engine, **keys)
    looks = loaded.scenario.model_copy(update={"expect": (expectation(Watching()),)})
    return simulate(looks if watching else loaded.scenario, build_scene(loaded), lambda _: None)


@on_every_engine
def test_each_named_link_has_its_contacts_at_every_moment_from_the_start(engine: str, tmp_path: Path) -> None:
    trace = watched(tmp_path, engine).trace
    assert list(trace.link_contacts) == list(FEET[:3])
    for (x, y), record in zip(CORNERS, trace.link_contacts.values(), strict=False):
        assert record.moment(trace.time).tolist() == list(range(61))
        assert record.bodies == ("ground",)
        assert record.position_xyz == pytest.approx(np.tile([x, y, 0.0], (61, 1)), abs=1e-3)
        assert record.normal_xyz == pytest.approx(np.tile([0.0, 0.0, 1.0], (61, 1)))
        assert record.force == pytest.approx(np.full(61, 5.8 * GRAVITY / 4), rel=0.05)


@on_every_engine
def test_the_normal_points_to_the_link_from_whatever_it_touches(engine: str, tmp_path: Path) -> None:
    # A platform below the first foot, as high as the ground, and a wall at the second.
    objects = "[{name: slab, box: [0.1, 0.1, 0.1], pose: {x: 0.2, y: 0.15, z: -0.05}}]"
    trace = watched(tmp_path, engine, objects=objects).trace
    assert set(trace.link_contacts["foot_1"].bodies) == {"slab", "ground"}
    assert trace.link_contacts["foot_1"].normal_xyz[:, 2].min() > 0.999


@on_every_engine
def test_contacts_of_a_thinned_trace_are_those_of_its_moments(engine: str, tmp_path: Path) -> None:
    full, thinned = watched(tmp_path, engine).trace, watched(tmp_path, engine, rate="24 Hz").trace
    for name, record in thinned.link_contacts.items():
        assert record.moment(thinned.time).tolist() == list(range(len(thinned)))
        assert record.force.tolist() == full.link_contacts[name].force[::10].tolist()


@on_every_engine
def test_a_run_with_contacts_of_links_is_the_same_run_and_stored_whole(engine: str, tmp_path: Path) -> None:
    watching, plain = watched(tmp_path, engine), watched(tmp_path, engine, watching=False)
    assert watching.digest == plain.digest
    assert plain.trace.link_contacts == {}
    save_trace(watching.trace, tmp_path / "trace.npz")
    stored = load_trace(tmp_path / "trace.npz").link_contacts
    assert list(stored) == list(watching.trace.link_contacts)
    for name, record in watching.trace.link_contacts.items():
        assert stored[name].bodies == record.bodies
        for column in ("time", "body", "position_xyz", "normal_xyz", "force"):
            np.testing.assert_array_equal(getattr(stored[name], column), getattr(record, column))
    cut = replace(watching.trace, contacts=()).between(0.1, 0.2)
    assert cut.link_contacts["foot_1"].moment(cut.time).tolist() == list(range(25))


@on_every_engine
def test_normals_point_from_the_body_to_the_link(engine: str, tmp_path: Path) -> None:
    with running(engine, build_scene(loaded_table(tmp_path, engine))) as backend:
        backend.advance(0, [JointTargets()] * 24)
        contacts = backend.observe(24, contacts=True).contacts
        assert {contact.link for contact in contacts} == set(FEET)
        for contact in contacts:
            np.testing.assert_allclose(contact.normal_xyz, (0.0, 0.0, 1.0), atol=1e-3)


CRANE = ACTION / "examples/assertions/crane.urdf"
# The table: a plate of 5 kg on four balls of 200 g, and 0.3 m between its middle and theirs.
HEIGHT = (5.0 * 0.33 + 0.8 * 0.03) / 5.8


def warned(folder: Path, engine: str, *expect: dict[str, Any], **keys: Any) -> SimulationRun:
    """A run whose expectations may fail."""
    expected = [{**one, "severity": "warning"} for one in expect]
    scenario = {"name": "it", "expect": expected, "allow": ["warnings-only"], "backend": engine, **keys}
    return simulated(folder, scenario, outside=True)


def stood(folder: Path, engine: str, *expect: dict[str, Any], urdf: str = "", **keys: Any) -> SimulationRun:
    (folder / "table.urdf").write_text(urdf or table())
    return warned(folder, engine, *expect, **{"robot": {"model": "table.urdf"}, "time_limit": 0.3, **keys})


def barely(tmp_path: Path, engine: str, margin: float, **keys: Any) -> tuple[bool, ...]:
    """The verdicts on a limit that is a little lower, and on one that is a little higher."""
    limits = (margin - 1e-3, margin + 1e-3)
    margins = ({"support_margin": {"links": ["foot_*"], "at_least": limit}} for limit in limits)
    return tuple(verdict.passed for verdict in stood(tmp_path, engine, *margins, **keys).verdicts)


@on_every_engine
@pytest.mark.parametrize("aside", [0.0, 0.15])
def test_the_margin_is_the_distance_to_the_nearest_edge(engine: str, aside: float, tmp_path: Path) -> None:
    margin = min(0.15, 0.2 - 5.0 * aside / 5.8)
    assert barely(tmp_path, engine, margin, urdf=table(aside)) == (True, False)


@on_every_engine
@pytest.mark.parametrize("shape", ['<box size="0.2 0.2 0.1"/>', '<mesh filename="disc.stl"/>'])
def test_the_margin_of_a_flat_foot_is_that_of_its_sole(engine: str, shape: str, tmp_path: Path) -> None:
    corners, faces = wheel(0.1 / math.cos(math.pi / 16), 0.1)
    (tmp_path / "disc.stl").write_bytes(stl(corners, fans(faces)))
    urdf = robot(link("foot_1", inertial(2.0, (0.02, 0.02, 0.02)) + collision(shape)))
    # PyBullet keeps a box on two corners. Of the 64 corners of the disc, 16 count.
    (verdict,) = stood(tmp_path, engine, {"support_margin": {"links": ["foot_1"]}}, urdf=urdf).verdicts
    assert verdict.measured == pytest.approx(0.1, abs=1e-3)


@on_every_engine
def test_the_margin_is_seen_along_gravity(engine: str, tmp_path: Path) -> None:
    tilt = math.radians(20)
    gravity = [GRAVITY * math.sin(tilt), 0.0, -GRAVITY * math.cos(tilt)]
    margin = 0.2 * math.cos(tilt) - HEIGHT * math.sin(tilt)
    assert barely(tmp_path, engine, margin, world={"gravity": gravity}) == (True, False)


@on_every_engine
def test_feet_stand_on_what_on_names(engine: str, tmp_path: Path) -> None:
    # Two feet stand on a slab, 1 cm above the ground.
    slab = {"name": "slab", "box": [0.1, 0.5, 0.1], "pose": {"x": 0.2, "z": -0.04}}
    feet: list[dict[str, Any]] = [{"at_least": 4}, {"at_most": 3}]
    feet += [{"at_least": 2, "at_most": 2, "on": [name]} for name in ("ground", "slab")]
    feet += [limit | {"on": [name]} for name in ("ground", "slab") for limit in ({"at_least": 3}, {"at_most": 1})]
    asked = ({"feet_on_ground": {"links": ["foot_*"], **one}} for one in feet)
    verdicts = stood(tmp_path, engine, *asked, world={"objects": [slab]}, physics={"settle": 2}).verdicts
    assert [verdict.passed for verdict in verdicts] == [True, False, True, True, False, False, False, False]
    assert [verdict.measured for verdict in verdicts] == [4.0, 4.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0]


@on_every_engine
def test_a_table_that_falls_lands_when_the_formula_says(engine: str, tmp_path: Path) -> None:
    lands = math.sqrt(2 * 0.2 / GRAVITY)
    keys: dict[str, Any] = {"robot": {"model": "table.urdf", "pose": {"z": 0.53}}, "physics": {"settle": 0}}
    in_air = {"feet_on_ground": {"links": ["foot_*"], "at_most": 0}}
    on_feet = {"feet_on_ground": {"links": ["foot_*"]}}
    asked = [{**in_air, "before": lands - 0.01}, {**in_air, "before": lands + 0.01}, {**on_feet, "after": lands - 0.01}]
    verdicts = stood(tmp_path, engine, *asked, **keys).verdicts
    assert [verdict.passed for verdict in verdicts] == [True, False, False]
    assert verdicts[1].time == pytest.approx(lands, abs=0.009)


def test_the_centre_of_mass_is_that_of_mujoco(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, CRANE.read_text(), at(z=0.3, roll=0.3, pitch=-0.2, yaw=1.0), World(gravity=0.0))
    with running("mujoco", scene) as backend:
        for step in range(5):
            trace = advance(backend, 10 * step, 10, JointTargets(position={"luff": 0.3 * step}))
            engine: Any = backend
            data, model = engine._data, engine._model
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            centre = centre_of_mass(scene.model, trace)[-1]
            assert centre == pytest.approx(data.subtree_com[model.body("robot/platform").id], abs=1e-9)


@on_every_engine
def test_the_force_on_the_ground_is_the_weight_and_that_of_a_foot_its_share(engine: str, tmp_path: Path) -> None:
    weight = 5.8 * GRAVITY
    post = {"objects": [{"name": "post", "box": [0.1, 0.1, 0.1], "pose": {"x": 3}}]}
    asked: tuple[dict[str, Any], ...] = (
        {"stl": f"always (abs(force(ground) - {weight}) < {0.01 * weight})", "after": 0.1},
        {"stl": f"always (force(foot_2, ground) < {0.3 * weight})", "after": 0.1},
        {"contact": {"with": "ground", "at_least": 0.98 * weight, "at_most": 1.02 * weight, "for": 0.1}, "after": 0.1},
        {"contact": {"with": "ground", "link": "foot_1", "at_least": 0.3 * weight}},
        {"no_collision": {"allow": []}},
    )
    verdicts = stood(tmp_path, engine, *asked, world=post).verdicts
    assert [verdict.passed for verdict in verdicts] == [True, True, True, False, True]
    # Nothing asks for them: they are not recorded.
    assert not stood(tmp_path, engine, {"contact": "post"}, world=post).trace.contacts


@on_every_engine
def test_a_leg_on_a_boom_stands_and_falls(engine: str, tmp_path: Path) -> None:
    """The root is the world. A hinge lets the other end of an arm of 1 m fall onto its foot."""
    mass = inertial(1.0, (0.01, 0.01, 0.01))
    boom = robot(
        link("world", ""),
        link("arm", mass),
        link("foot", mass + collision('<sphere radius="0.05"/>')),
        joint("hinge", "continuous", "world", "arm", (0.0, 0.0, 0.1)),
        joint("end", "fixed", "arm", "foot", (1.0, 0.0, 0.0)),
    )
    standing = {"feet_on_ground": {"links": ["foot"]}}
    ended = stood(
        tmp_path, engine, {**standing, "after": 0.5}, standing, urdf=boom, time_limit=1, physics={"settle": 0}
    )
    assert [verdict.passed for verdict in ended.verdicts] == [True, False]


GRIPPER = ACTION / "examples/assertions/gripper.urdf"
CUBE = {"name": "cube", "box": [0.05, 0.05, 0.05], "mass": 0.2, "pose": {"z": 0.025}}


def gripped(
    folder: Path, engine: str, efforts: dict[str, float], *asked: dict[str, Any], **cube: Any
) -> tuple[Verdict, ...]:
    commands = [{"joints": [{"at": 0.0, "effort": efforts}], "interpolation": "hold"}]
    keys = {"duration": 0.6, "time_limit": 0.6, "world": {"objects": [{**CUBE, **cube}]}}
    keys |= {"robot": {"model": str(GRIPPER), "base": "fixed", "pose": {"z": 0}, "self_collision": False}}
    expected = ({"grasped": {"object": "cube", "by": ["*_finger"], **one}} for one in asked)
    return warned(folder, engine, *expected, **keys, **({"commands": commands} if efforts else {})).verdicts


@on_every_engine
def test_two_fingers_hold_a_cube_with_their_effort(engine: str, tmp_path: Path) -> None:
    efforts = {"left_finger_joint": 5.0, "right_finger_joint": 5.0}
    # At first the fingers strike with more; half a second of 5 N is the grip.
    held, weak = gripped(tmp_path, engine, efforts, {"at_least": 4.95, "for": 0.3}, {"at_least": 5.05, "for": 0.3})
    assert (held.passed, weak.passed) == (True, False)
    assert held.unit == "s"


@on_every_engine
def test_one_finger_pushes_and_does_not_hold(engine: str, tmp_path: Path) -> None:
    # The cube is too heavy to be pushed against the other finger.
    (pushed,) = gripped(tmp_path, engine, {"left_finger_joint": 5.0}, {"for": 0.1}, mass=2)
    assert not pushed.passed
    assert "only left_finger touched it" in pushed.message


@on_every_engine
@pytest.mark.parametrize("by", [["palm", "left_finger"], ["palm", "*_finger"]])
def test_what_lies_on_a_link_is_not_held(engine: str, by: list[str], tmp_path: Path) -> None:
    (carried,) = gripped(tmp_path, engine, {}, {"by": by, "for": 0.1}, pose={"x": 0.0, "z": 0.156})
    assert not carried.passed
    assert "only palm touched it" in carried.message
