"""Feet and the support polygon on every engine, against formulas and MuJoCo's own centre of mass."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import mujoco
import pytest

from sim_action.robot.model.kinematics import centre_of_mass
from sim_action.simulation.loop import SimulationRun
from sim_action.state.command import JointTargets
from sim_action.world import World
from tests.integration.engines import advance, at, on_every_engine, running, scene_of
from tests.integration.test_link_contacts import GRAVITY, table
from tests.physics.robots import collision, inertial, joint, link, robot
from tests.simulated import simulated

CRANE = Path(__file__).parents[2] / "examples/assertions/crane.urdf"
# The table: a plate of 5 kg on four balls of 200 g, and 0.3 m between its middle and theirs.
HEIGHT = (5.0 * 0.33 + 0.8 * 0.03) / 5.8


def run(tmp_path: Path, engine: str, *expect: dict[str, Any], urdf: str = "", **keys: Any) -> SimulationRun:
    (tmp_path / "table.urdf").write_text(urdf or table())
    scenario = {
        "name": "a table stands",
        "robot": {"model": "table.urdf"},
        "expect": [{**one, "severity": "warning"} for one in expect],
        "allow": ["warnings-only"],
        "time_limit": 0.3,
        "backend": engine,
        **keys,
    }
    return simulated(tmp_path, scenario)


def barely(tmp_path: Path, engine: str, margin: float, **keys: Any) -> tuple[bool, ...]:
    """The verdicts on a limit that is a little lower, and on one that is a little higher."""
    limits = (margin - 1e-3, margin + 1e-3)
    margins = ({"support_margin": {"links": ["foot_*"], "at_least": limit}} for limit in limits)
    return tuple(verdict.passed for verdict in run(tmp_path, engine, *margins, **keys).verdicts)


@on_every_engine
@pytest.mark.parametrize("aside", [0.0, 0.15])
def test_the_margin_is_the_distance_to_the_nearest_edge(engine: str, aside: float, tmp_path: Path) -> None:
    margin = min(0.15, 0.2 - 5.0 * aside / 5.8)
    assert barely(tmp_path, engine, margin, urdf=table(aside)) == (True, False)


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
    verdicts = run(tmp_path, engine, *asked, world={"objects": [slab]}, physics={"settle": 2}).verdicts
    assert [verdict.passed for verdict in verdicts] == [True, False, True, True, False, False, False, False]
    assert [verdict.measured for verdict in verdicts] == [4.0, 4.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0]


@on_every_engine
def test_a_table_that_falls_lands_when_the_formula_says(engine: str, tmp_path: Path) -> None:
    lands = math.sqrt(2 * 0.2 / GRAVITY)
    keys: dict[str, Any] = {"robot": {"model": "table.urdf", "pose": {"z": 0.53}}, "physics": {"settle": 0}}
    in_air = {"feet_on_ground": {"links": ["foot_*"], "at_most": 0}}
    on_feet = {"feet_on_ground": {"links": ["foot_*"]}}
    asked = [{**in_air, "before": lands - 0.01}, {**in_air, "before": lands + 0.01}, {**on_feet, "after": lands - 0.01}]
    verdicts = run(tmp_path, engine, *asked, **keys).verdicts
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
    verdicts = run(tmp_path, engine, *asked, world=post).verdicts
    assert [verdict.passed for verdict in verdicts] == [True, True, True, False, True]
    # Nothing asks for them: they are not recorded.
    assert not run(tmp_path, engine, {"contact": "post"}, world=post).trace.contacts


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
    ended = run(tmp_path, engine, {**standing, "after": 0.5}, standing, urdf=boom, time_limit=1, physics={"settle": 0})
    assert [verdict.passed for verdict in ended.verdicts] == [True, False]
