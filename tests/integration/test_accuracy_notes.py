"""Runs say when their physics is not accurate, and only then."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from sim_action import robot as models
from tests.integration.engines import on_every_engine
from tests.physics import robots
from tests.simulated import simulated

pytestmark = on_every_engine
CUBE = "box: [0.2, 0.2, 0.2]"
MOMENTS = (0.01, 0.01, 0.01)  # kg m^2
BALL = robots.robot(robots.link("base", robots.inertial(2.0, MOMENTS)))
ROD = robots.inertial(1.0, MOMENTS, (0.0, 0.0, -0.5))
PENDULUM = robots.robot(
    robots.link("base", ""),
    robots.link("upper", ROD),
    robots.link("lower", ROD),
    robots.joint("upper_joint", "continuous", "base", "upper"),
    robots.joint("lower_joint", "continuous", "upper", "lower", (0.0, 0.0, -1.0)),
)
DRIVES = "commands: {rate: 10 Hz, twist: [{linear: 0.2}]}"
DROPPED = "physics: {settle: 0 s}"
HANGS = "{model: pendulum.urdf, base: fixed, pose: {z: 5}, joints: {upper_joint: 90 deg, lower_joint: 90 deg}}"
SWINGS: dict[str, Any] = {"seconds": 20, "claim": "joint_within: {velocity: {upper_joint: [-100, 100]}}"}


def notes(
    engine: str,
    folder: Path,
    more: str = "",
    *,
    robot: str = "{model: turtlebot3_burger}",
    seconds: int = 3,
    claim: str = "stl: 'always (speed < 60 m/s)'",
) -> list[str]:
    """The notes of a run that are about accuracy."""
    pytest.importorskip(engine)
    (folder / "pendulum.urdf").write_text(PENDULUM)
    (folder / "ball.urdf").write_text(BALL)
    times = f"time_limit: {seconds} s\nduration: {seconds} s"
    run = simulated(folder, f"name: it\nrobot: {robot}\nbackend: {engine}\n{more}\n{times}\nexpect: [{{{claim}}}]\n")
    return [note for note in run.notes if "raise physics.rate" in note or "twice the physics.rate" in note]


def test_a_double_pendulum_has_a_note_on_its_energy(engine: str, tmp_path: Path) -> None:
    (note,) = notes(engine, tmp_path, DROPPED, robot=HANGS, **SWINGS)
    assert "its mechanical energy changed by -" in note


def test_a_heavy_body_on_a_light_one_has_notes(engine: str, tmp_path: Path) -> None:
    low = f"{{name: low, {CUBE}, mass: 1 kg, pose: {{x: 2}}}}"
    high = f"{{name: high, {CUBE}, mass: 300 kg, pose: {{x: 2, z: 0.3}}}}"
    masses, depth = notes(engine, tmp_path, f"world: {{objects: [{low}, {high}]}}")
    assert "300 times the mass" in masses
    assert "body 'low' and the ground overlapped by" in depth


@pytest.mark.parametrize(
    ("more", "keys"),
    [
        ("", {}),
        (DRIVES, {}),
        (f"world: {{objects: [{{name: box, {CUBE}, mass: 1 kg, pose: {{x: 0.4}}}}]}}\n{DRIVES}", {}),
        (DROPPED, {"robot": "{model: ball.urdf, pose: {z: 60}}"}),
        (DROPPED, {"robot": HANGS.replace("90 deg", "10 deg"), **SWINGS}),
    ],
    ids=["stands", "drives", "pushes", "falls", "swings a little"],
)
def test_usual_runs_have_no_such_notes(engine: str, more: str, keys: dict[str, Any], tmp_path: Path) -> None:
    assert notes(engine, tmp_path, more, **keys) == []


def test_a_note_says_how_far_wheels_with_little_friction_slipped(engine: str, tmp_path: Path) -> None:
    text = Path(models.__file__).with_name("built_in").joinpath("turtlebot3_burger.urdf").read_text(encoding="utf-8")
    tags = "".join(f'<gazebo reference="wheel_{side}_link"><mu1>0.1</mu1></gazebo>' for side in ("left", "right"))
    (tmp_path / "slippery.urdf").write_text(text.replace("</robot>", f"{tags}</robot>"), encoding="utf-8")
    commands = {"rate": 10, "twist": [{"linear": 1.0}]}
    scenario = {"name": "slip", "robot": {"model": "slippery.urdf"}, "backend": engine, "commands": commands}
    run = simulated(tmp_path, {**scenario, "duration": 3, "time_limit": 3, "expect": ["upright"]})
    (note,) = (note for note in run.notes if note.startswith("wheels slipped: "))
    rolled, moved, slid = (float(way) for way in re.findall(r"([\d.]+) m\b", note))
    # A second to reach 1 m/s, and two more.
    assert rolled == pytest.approx(2.5, rel=0.02)
    assert run.travelled <= moved * 1.02
    assert moved < 0.9 * rolled
    assert slid > rolled - moved - 0.02
