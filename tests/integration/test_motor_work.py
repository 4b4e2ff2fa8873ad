"""What motors exert and what work they do, in every engine, against the laws of mechanics."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.assertions.effort import Braking, Effort, Energy
from sim_action.assertions.monitors import Monitor
from sim_action.robot.model.robot_spec import Robot
from sim_action.state.command import JointTargets
from sim_action.state.trace import Trace
from sim_action.world import Physics, World
from sim_action.world.scene import Scene
from tests.integration.engines import advance, inertia, on_every_engine, running, scene_of
from tests.traces import HERE, START, WHEELS, burger

pytestmark = on_every_engine
RATE = 240
GRAVITY = 9.80665
LOAD = 2.0
WHEEL_INERTIA = 1.55e-5  # kg m^2, as the burger's model has it
HOIST = f"""
<robot name="hoist">
  <link name="base"><inertial><mass value="1"/>{inertia(1)}</inertial></link>
  <joint name="lift" type="prismatic">
    <parent link="base"/><child link="load"/><axis xyz="0 0 1"/><limit lower="-9" upper="9" effort="500" velocity="5"/>
  </joint>
  <link name="load"><inertial><mass value="{LOAD}"/>{inertia(1)}</inertial></link>
</robot>
"""


def hoisted(engine: str, folder: Path, *speeds: float) -> tuple[Scene, Trace]:
    """The hoist at these speeds, each for a second."""
    scene = scene_of(folder, HOIST, Robot(model="robot.urdf", base="fixed"), rate=RATE)
    targets = [JointTargets(velocity={"lift": speed}) for speed in speeds for _ in range(RATE)]
    with running(engine, scene) as backend:
        return scene, advance(backend, 0, len(targets), *targets)


def judged(spec: Energy | Effort, scene: Scene, seen: Trace) -> Monitor:
    return spec.monitor(scene, START).observe(seen)


def test_to_lift_a_load_takes_its_weight_times_the_height_and_what_brings_it_to_speed(
    engine: str, tmp_path: Path
) -> None:
    scene, seen = hoisted(engine, tmp_path, 0.5, 0.0)
    height = float(seen.joint_position[-1, 0])
    assert height == pytest.approx(0.5, rel=0.01)
    used = judged(Energy(at_most=1e3), scene, seen).verdict().measured
    assert used == pytest.approx(LOAD * GRAVITY * height + LOAD * 0.5**2 / 2, rel=0.01)


@pytest.mark.parametrize(("braking", "lifts"), [("regained", 1.0), ("free", 1.0), ("costs", 2.0)])
def test_to_let_it_down_again_is_free_or_costs_as_much(
    engine: str, braking: Braking, lifts: float, tmp_path: Path
) -> None:
    scene, seen = hoisted(engine, tmp_path, 0.5, 0.0, -0.5)
    used = judged(Energy(at_most=1e3, braking=braking), scene, seen).verdict().measured
    assert used == pytest.approx(lifts * LOAD * GRAVITY * 0.5, rel=0.06)


def test_to_hold_a_load_takes_its_weight_and_no_work(engine: str, tmp_path: Path) -> None:
    scene, seen = hoisted(engine, tmp_path, 0.0, 0.0)
    held = seen.between(1.0, 2.0)
    for spec in (Effort(at_most=1e3), Effort(rms_at_most=1e3)):
        assert judged(spec, scene, held).verdict().measured == pytest.approx(LOAD * GRAVITY, rel=1e-3)
    assert judged(Energy(at_most=1e3, braking="costs"), scene, held).verdict().measured == pytest.approx(0.0, abs=1e-3)


def driven(engine: str, acceleration: float) -> tuple[Scene, Trace]:
    """The burger, after it stood for a second, up to 0.5 m/s within another."""
    scene = Scene(Robot(model="turtlebot3_burger"), burger(), World(), Physics(rate=RATE), HERE)
    ramp = [min(0.5, acceleration * step / RATE) for step in range(1, RATE + 1)]
    with running(engine, scene) as backend:
        advance(backend, -RATE, RATE, JointTargets(velocity=dict.fromkeys(WHEELS, 0.0)))
        turning = [JointTargets(velocity=dict.fromkeys(WHEELS, speed / 0.033)) for speed in ramp]
        return scene, advance(backend, 0, RATE, *turning)


@pytest.mark.parametrize(
    ("acceleration", "of_robot", "of_wheels", "off"), [(1.0, 1, 1, 0.01), (1e3, 2, 0, 0.1)], ids=["rolls", "slips"]
)
def test_to_bring_a_robot_to_speed_takes_its_kinetic_energy_and_as_much_again_if_wheels_slip(
    engine: str, acceleration: float, of_robot: int, of_wheels: int, off: float
) -> None:
    scene, seen = driven(engine, acceleration)
    speed = float(seen.speed[-1])
    energy = of_robot * scene.model.mass * speed**2 / 2 + of_wheels * 2 * WHEEL_INERTIA * (speed / 0.033) ** 2 / 2
    assert judged(Energy(at_most=1.0), scene, seen).verdict().measured == pytest.approx(energy, rel=off)
