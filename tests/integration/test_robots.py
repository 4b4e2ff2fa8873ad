"""Real robots that come with the engine: each weighs what its file says, and rests for five seconds."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

import pybullet_data
import pytest

from sim_action.errors import ModelError
from sim_action.models import load_model
from sim_action.workspace import Workspace
from sim_action.world import Robot

DATA: Final = Path(pybullet_data.getDataPath())
LEGS: Final = ("FR", "FL", "RR", "RL")
STANCE: Final = {f"{leg}_upper_joint": 0.8 for leg in LEGS} | {f"{leg}_lower_joint": -1.6 for leg in LEGS}
ROBOTS: Final[dict[str, dict[str, object]]] = {
    "husky/husky.urdf": {"allow": ["unexpanded-expression"]},
    "racecar/racecar.urdf": {},
    "r2d2.urdf": {},
    "a1/a1.urdf": {"joints": STANCE},
    "laikago/laikago_toes.urdf": {"allow": ["impossible-inertia"]},
    "quadruped/minitaur.urdf": {"allow": ["missing-limits"]},
    "kuka_iiwa/model.urdf": {"allow": ["zero-mass"], "base": "fixed"},
    "franka_panda/panda.urdf": {
        "allow": ["zero-mass"],
        "base": "fixed",
        "packages": {"meshes": str(DATA / "franka_panda/meshes")},
    },
}
# Wheels that nobody holds roll, and a robot of 46 kg is never quite level.
BRAKED: Final = {
    "husky/husky.urdf": {
        "diff": {
            "left": ["front_left_wheel", "rear_left_wheel"],
            "right": ["front_right_wheel", "rear_right_wheel"],
        }
    }
}
NEGLIGIBLE: Final = 0.002  # of the whole, for all links that state no mass

every_robot = pytest.mark.parametrize("model", ROBOTS)


def robot(model: str) -> Robot:
    return Robot.model_validate_json(json.dumps({"model": str(DATA / model), **ROBOTS[model]}))


@every_robot
def test_it_weighs_what_its_file_says(model: str, tmp_path: Path) -> None:
    loaded = load_model(robot(model), Workspace(tmp_path, tmp_path, allow_outside=True))
    stated = sum(float(mass.attrib["value"]) for mass in ET.parse(DATA / model).iterfind("link/inertial/mass"))
    engines = sum(float(mass.attrib["value"]) for mass in ET.fromstring(loaded.urdf).iterfind("link/inertial/mass"))
    assert loaded.mass == pytest.approx(stated)
    assert stated <= engines * (1 + 1e-9)
    assert engines <= stated * (1 + NEGLIGIBLE)
    assert {finding.rule for finding in loaded.findings if finding.level == "error"} == set(robot(model).allow), (
        "what it needs, and nothing else"
    )


@every_robot
def test_it_rests(model: str, tmp_path: Path) -> None:
    scenario: dict[str, object] = {
        "name": "rests",
        "robot": {"model": str(DATA / model), **ROBOTS[model]},
        "expect": [{"upright": {"max_tilt": "5 deg"}}, {"travel": {"at_most": "2 cm"}}],
        "duration": "5 s",
        "time_limit": "5 s",
    }
    if model in BRAKED:
        scenario["robot"] = {"model": str(DATA / model), **ROBOTS[model], "drive": BRAKED[model]}
        scenario["commands"] = {"twist": [{"linear": 0}]}
    (tmp_path / "rests.sim.yml").write_text(json.dumps(scenario))
    command = [sys.executable, "-m", "sim_action", "run", "--allow-outside"]
    ran = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout


def test_a_trailing_nul_is_refused_on_its_line(tmp_path: Path) -> None:
    path = DATA / "humanoid/humanoid.urdf"
    last = path.read_bytes().count(b"\n") + 1
    with pytest.raises(ModelError, match=rf"humanoid\.urdf:{last}: not well-formed XML"):
        load_model(Robot(model=str(path)), Workspace(tmp_path, tmp_path, allow_outside=True))
