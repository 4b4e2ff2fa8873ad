"""Temporal logic and classes of the user's, on real engines."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from sim_action.engines import installed
from sim_action.simulation.loop import SimulationRun
from tests.simulated import simulated

SCENARIO = """\
name: burger
robot: {{model: turtlebot3_burger}}
commands: {{twist: [{{linear: 0.2}}]}}
expect:
  - {expectation}
time_limit: 4 s
"""


def run(folder: Path, expectation: str, engine: str = installed()[0]) -> SimulationRun:
    return simulated(folder, SCENARIO.format(expectation=expectation) + f"backend: {engine}\n")


@pytest.mark.parametrize("engine", installed())
@pytest.mark.parametrize(
    ("formula", "expected", "time"),
    [
        # With 1 m/s^2 to 0.2 m/s: 0.02 m of way are lost, so 0.3 m are travelled at 1.6 s.
        ("eventually (travel >= 30 cm)", ("passed", "goals met"), 1.6),
        ("always (travel < 30 cm)", ("failed", "expectation failed"), 1.6),
        ("not (eventually (travel >= 30 cm))", ("failed", "expectation failed"), 1.6),
        ("always (travel > 10 cm implies eventually[0 s, 1 s] travel > 45 cm)", ("failed", "expectation failed"), 1.6),
        ("always (travel > 10 cm implies eventually[0 s, 2 s] travel > 45 cm)", ("passed", "time limit"), 4.0),
        ("travel < 20 cm until[0 s, 2 s] x > 19 cm", ("passed", "goals met"), 1.05),
        ("always (eventually (speed > 0.1 m/s))", ("passed", "time limit"), 4.0),
    ],
)
def test_a_run_ends_when_its_formula_is_decided(
    formula: str, expected: tuple[str, str], time: float, engine: str, tmp_path: Path
) -> None:
    found = run(tmp_path, f"stl: {formula}", engine)
    assert (found.verdicts[0].status, found.end) == expected
    assert found.sim_time == pytest.approx(time, abs=0.03)


GOOD = """\
from sim_action import Verdict
print("was here")

class Far:
    kind = "goal"

    def __init__(self, metres):
        self.metres = metres

    def judge(self, trace):
        x = trace.base_position_xyz[:, 0]
        return Verdict(x.max() >= self.metres, x.max(), self.metres, x.max() - self.metres, "m", trace.time[x.argmax()])
"""


def test_a_class_of_the_users_is_a_goal(tmp_path: Path) -> None:
    (tmp_path / "far.py").write_text(GOOD)
    found = run(tmp_path, "assertion: {class: far.py:Far, with: {metres: 0.3}}")
    assert (found.verdicts[0].status, found.end) == ("passed", "goals met")
    assert found.sim_time == pytest.approx(1.6, abs=0.03)
    inside = run(tmp_path, "not: {assertion: {class: far.py:Far, with: {metres: 0.3}}}")
    assert (inside.verdicts[0].status, inside.end) == ("failed", "expectation failed")
    assert inside.sim_time == found.sim_time


ARM = """\
<robot name="arm">
  <link name="base">{mass}</link>
  <link name="upper">{mass}</link>
  <link name="tip-1">{mass}<collision><geometry><sphere radius="0.05"/></geometry></collision></link>
  <joint name="lift" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <origin xyz="0 0 1"/><limit lower="-2" upper="2" effort="500" velocity="10"/></joint>
  <joint name="weld" type="fixed"><parent link="upper"/><child link="tip-1"/><origin xyz="0.5 0 0"/></joint>
</robot>
""".format(mass='<inertial><mass value="1"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>')
LIFTING = """\
name: arm above a ball that falls
robot: {{model: arm.urdf, base: fixed, pose: {{z: 0}}}}
physics: {{settle: 0}}
world: {{objects: [{{name: ball, sphere: {{radius: 10 cm}}, mass: 1 kg, pose: {{x: 0.3, z: 5}}}}]}}
commands: {{joints: [{{at: 0.2 s, position: {{lift: -0.5}}}}]}}
expect:
  - stl: {formula}
duration: 0.3 s
time_limit: 0.3 s
trace: {{rate: 240 Hz}}
backend: {engine}
"""


def formula_run(folder: Path, formula: str, engine: str) -> SimulationRun:
    (folder / "arm.urdf").write_text(ARM)
    return simulated(folder, LIFTING.format(formula=json.dumps(formula), engine=engine))


@pytest.mark.parametrize("engine", installed())
def test_bounds_on_links_and_objects_are_barely_kept_or_broken(engine: str, tmp_path: Path) -> None:
    free = formula_run(tmp_path, "always ('tip-1'.z < 1.4 m and distance('tip-1', ball) < 99 m)", engine)
    lifted, turning = free.trace.joint_position[:, 0], free.trace.joint_velocity[:, 0]
    ball = free.trace.objects["ball"].position_xyz
    tip = np.column_stack((0.5 * np.cos(lifted), np.zeros(len(lifted)), 1 - 0.5 * np.sin(lifted)))
    apart = np.sqrt(np.square(tip - ball).sum(axis=1))
    assert tip[-1, 2] > 1.1
    kept = []
    for signal, values, unit in (
        ("'tip-1'.z", tip[:, 2], "m"),
        ("distance('tip-1', ball)", apart, "m"),
        ("'tip-1'.speed", 0.5 * np.abs(turning), "m/s"),
        ("clearance('tip-1', ball)", apart[1:] - 0.15, "m"),
    ):
        for name, extreme, relation in (("max", values.max(), "<"), ("min", values.min(), ">")):
            if relation == ">" and signal.endswith(".speed"):
                continue  # it begins at 0, and a formula that asks for more than less than 0 is refused
            # PyBullet gives distances in single precision.
            slack = (1e-6 if "clearance" in signal else 1e-9) * (1 if name == "max" else -1)
            kept.append(f"{signal} {relation} {float(extreme) + slack!r} {unit}")
            broken = formula_run(tmp_path, f"always ({signal} {relation} {float(extreme) - slack!r} {unit})", engine)
            assert not broken.verdicts[0].passed, (signal, name)
    assert formula_run(tmp_path, f"always ({' and '.join(kept)})", engine).verdicts[0].passed
