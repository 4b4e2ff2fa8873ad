"""Runs say when their physics is not accurate, and only then."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from sim_action import robot as models
from sim_action.scenario.loading import build_scene, load_scenario
from sim_action.simulation.loop import simulate
from tests.integration.engines import at, on_every_engine, scene_of, travelled

pytestmark = on_every_engine
CUBE = "box: [0.2, 0.2, 0.2]"
G = 9.80665
INERTIA = '<inertia ixx="{0}" iyy="{0}" izz="{0}" ixy="0" ixz="0" iyz="0"/>'
BALL = (
    f'<robot name="ball"><link name="base"><inertial><mass value="2"/>{INERTIA.format(0.01)}</inertial></link></robot>'
)
MOMENT = 0.01  # kg m^2, of a rod about its middle


def rod(name: str, parent: str, origin: str) -> str:
    inertial = f'<inertial><origin xyz="0 0 -0.5"/><mass value="1"/>{INERTIA.format(MOMENT)}</inertial>'
    ends = f'<parent link="{parent}"/><child link="{name}"/><origin xyz="{origin}"/><axis xyz="0 1 0"/>'
    return f'<link name="{name}">{inertial}</link><joint name="{name}_joint" type="continuous">{ends}</joint>'


PENDULUM = (
    f'<robot name="it"><link name="base"/>{rod("upper", "base", "0 0 0")}{rod("lower", "upper", "0 0 -1")}</robot>'
)


def notes(
    engine: str,
    folder: Path,
    more: str,
    *,
    robot: str = "{model: turtlebot3_burger}",
    seconds: int = 3,
    claim: str = "stl: 'always (speed < 60 m/s)'",
) -> list[str]:
    """The notes of a run that are about accuracy."""
    (folder / "pendulum.urdf").write_text(PENDULUM)
    (folder / "ball.urdf").write_text(BALL)
    path = folder / "it.sim.yml"
    expect = f"expect: [{{{claim}}}]"
    head = f"name: it\nrobot: {robot}\nbackend: {engine}\n{more}"
    path.write_text(f"{head}\ntime_limit: {seconds} s\nduration: {seconds} s\n{expect}\n")
    loaded = load_scenario(path)
    pytest.importorskip(engine)
    run = simulate(loaded.scenario, build_scene(loaded), lambda _: None)
    return [note for note in run.notes if "raise physics.rate" in note or "twice the physics.rate" in note]


def test_a_double_pendulum_is_told_of_its_energy(engine: str, tmp_path: Path) -> None:
    hangs = "{model: pendulum.urdf, base: fixed, pose: {z: 5}, joints: {upper_joint: 90 deg, lower_joint: 90 deg}}"
    turns = "joint_within: {velocity: {upper_joint: [-100, 100]}}"
    (note,) = notes(engine, tmp_path, "physics: {settle: 0 s}", robot=hangs, seconds=20, claim=turns)
    assert "its mechanical energy changed by -" in note
    little = hangs.replace("90 deg", "10 deg")
    assert notes(engine, tmp_path, "physics: {settle: 0 s}", robot=little, seconds=20, claim=turns) == []


def test_a_fall_is_accurate_enough(engine: str, tmp_path: Path) -> None:
    falls = "{model: ball.urdf, pose: {z: 60}}"
    assert notes(engine, tmp_path, "physics: {settle: 0 s}", robot=falls) == []


def test_a_heavy_body_on_a_light_one_is_told_of(engine: str, tmp_path: Path) -> None:
    found = notes(
        engine,
        tmp_path,
        f"world: {{objects: [{{name: low, {CUBE}, mass: 1 kg, pose: {{x: 2}}}}, "
        f"{{name: high, {CUBE}, mass: 300 kg, pose: {{x: 2, z: 0.3}}}}]}}",
    )
    masses, depth = found
    assert "300 times the mass" in masses
    assert "body 'low' and the ground overlapped by" in depth


def test_usual_runs_have_no_such_notes(engine: str, tmp_path: Path) -> None:
    assert notes(engine, tmp_path, "commands: {rate: 10 Hz, twist: [{linear: 0.2}]}") == []
    box = f"{{name: box, {CUBE}, mass: 1 kg, pose: {{x: 0.4}}}}"
    pushed = f"world: {{objects: [{box}]}}\ncommands: {{rate: 10 Hz, twist: [{{linear: 0.2}}]}}"
    assert notes(engine, tmp_path, pushed) == []
    assert notes(engine, tmp_path, "") == []


def test_wheels_with_little_friction_are_told_of_with_their_slip(engine: str, tmp_path: Path) -> None:
    text = Path(models.__file__).with_name("built_in").joinpath("turtlebot3_burger.urdf").read_text(encoding="utf-8")
    tags = "".join(f'<gazebo reference="wheel_{side}_link"><mu1>0.1</mu1></gazebo>' for side in ("left", "right"))
    (tmp_path / "slippery.urdf").write_text(text.replace("</robot>", f"{tags}</robot>"), encoding="utf-8")
    path = tmp_path / "slip.sim.yml"
    path.write_text(
        f"name: slip\nrobot: {{model: slippery.urdf}}\nbackend: {engine}\n"
        "commands: {rate: 10 Hz, twist: [{linear: 1.0}]}\nduration: 3 s\ntime_limit: 3 s\nexpect: [upright]\n"
    )
    pytest.importorskip(engine)
    loaded = load_scenario(path)
    run = simulate(loaded.scenario, build_scene(loaded), lambda _: None)
    (note,) = (note for note in run.notes if note.startswith("wheels slipped: "))
    rolled, moved, slid = (float(way) for way in re.findall(r"([\d.]+) m\b", note))
    # A second to reach 1 m/s, and two more.
    assert rolled == pytest.approx(2.5, rel=0.02)
    assert run.travelled <= moved * 1.02
    assert moved < 0.9 * rolled
    assert slid > rolled - moved - 0.02


@pytest.mark.parametrize(("rate", "short_mm"), [(240.0, 24.5), (960.0, 6.1)])
def test_a_fall_is_short_by_half_a_step_of_its_speed(engine: str, rate: float, short_mm: float, tmp_path: Path) -> None:
    seconds = 1.2
    trace = travelled(engine, scene_of(tmp_path, BALL, at(50.0), rate=rate), round(seconds * rate))
    fallen = 50.0 - float(trace.base_position_xyz[-1, 2])
    assert fallen - G * seconds**2 / 2 == pytest.approx(G * seconds / rate / 2, rel=1e-3)
    assert 1e3 * (fallen - G * seconds**2 / 2) == pytest.approx(short_mm, abs=0.05)
    assert trace.base_linear_xyz[-1, 2] == pytest.approx(-G * seconds, rel=1e-6)
