"""Real robots that come with the engine: each weighs what its file says, and rests for five seconds."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

import pytest

from sim_action.core.errors import ModelError
from sim_action.robot.reading.loading import load_model
from tests.integration.conftest import sim_action
from tools.bench.robots import REFUSED, ROBOTS, WORKSPACE, KnownRobot

pytestmark = pytest.mark.pybullet
NEGLIGIBLE: Final = 0.002  # of the whole, for all links that state no mass
every_robot = pytest.mark.parametrize("known", ROBOTS, ids=lambda known: known.name)


@every_robot
def test_it_weighs_what_its_file_says(known: KnownRobot) -> None:
    loaded = load_model(known.robot, WORKSPACE)
    stated = sum(float(mass.attrib["value"]) for mass in ET.parse(known.path).iterfind("link/inertial/mass"))
    engines = sum(float(mass.attrib["value"]) for mass in ET.fromstring(loaded.urdf).iterfind("link/inertial/mass"))
    assert loaded.mass == pytest.approx(stated)
    assert stated <= engines * (1 + 1e-9)
    assert engines <= stated * (1 + NEGLIGIBLE)
    assert {finding.rule for finding in loaded.findings if finding.level == "error"} == set(known.robot.allow), (
        "what it needs, and nothing else"
    )


def test_legs_that_cannot_be_straight_begin_bent(tmp_path: Path) -> None:
    """Begun beyond its limits, the robot would be thrown on its back."""
    (known,) = (known for known in ROBOTS if known.name == "a1")
    bent = {"joint": {"name": "FR_lower_joint", "at_least": "-104 deg", "at_most": "-103 deg"}}
    scenario = {
        "name": "stands",
        "robot": {"model": str(known.path)},
        "expect": [{"upright": {"max_tilt": "1 deg"}}, bent],
        "time_limit": "2 s",
    }
    (tmp_path / "stands.sim.yml").write_text(json.dumps(scenario))
    ran = sim_action(tmp_path, "run", "--allow-outside")
    assert ran.returncode == 0, ran.stdout


def test_a_trailing_nul_is_refused_on_its_line() -> None:
    last = Path(REFUSED.path).read_bytes().count(b"\n") + 1
    with pytest.raises(ModelError, match=rf"humanoid\.urdf:{last}: not well-formed XML"):
        load_model(REFUSED.robot, WORKSPACE)
