"""All bad models and meshes in one suite, beside good ones; and each that the audit lets through on every engine."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import pytest

from sim_action.engines import installed
from sim_action.results.outcome import Outcome
from sim_action.results.results_json import Results
from sim_action.robot.model.findings import ALLOWABLE, RULES
from sim_action.robot.model.robot_spec import Robot
from sim_action.state.command import JointTargets
from sim_action.world.scene import Scene
from tests.integration.conftest import sim_action
from tests.integration.engines import scene_of, travelled
from tests.meshes.test_bad_meshes import BAD as BAD_MESHES
from tests.robot.bad_models import BAD_MODELS, GOOD, BadModel

SPHERE: Final = '<sphere radius="0.5"/>'
GOOD_ONES: Final = 8
_WEIGHTLESS: Final = ("massless-base", "massless-model")


@dataclass(frozen=True, slots=True)
class Case:
    """A scenario whose model has something wrong: the rule and line that say so, if it is refused."""

    name: str
    rule: str
    line: int | None
    text: str
    files: tuple[tuple[str, bytes], ...] = ()

    @property
    def is_refused(self) -> bool:
        return RULES[self.rule].level != "warning"


# PyBullet alone refuses a model with many joints.
_MODELS: Final = [bad for bad in BAD_MODELS if bad.rule != "many-joints"]
CASES: Final = [
    *(Case(f"model {number}", bad.rule, bad.line, bad.text) for number, bad in enumerate(_MODELS)),
    *(
        Case(f"mesh {number}", rule, 10, GOOD.replace(SPHERE, f'<mesh filename="{file}"/>'), ((file, data),))
        for number, (file, data, rule, _) in enumerate(BAD_MESHES.values())
    ),
]


def write(folder: Path, name: str, text: str, files: tuple[tuple[str, bytes], ...] = ()) -> None:
    """A scenario in a folder of its own."""
    folder = folder / name.replace(" ", "_")
    folder.mkdir(parents=True)
    (folder / "robot.urdf").write_text(text, encoding="utf-8")
    for file, data in files:
        (folder / file).write_bytes(data)
    # These need a base that cannot move.
    bolted = {"base": "fixed"} if any(text == bad.text for bad in BAD_MODELS if bad.rule in _WEIGHTLESS) else {}
    scenario = {
        "name": name,
        "robot": {"model": "robot.urdf", **bolted},
        "allow": ["fixed-base"] if bolted else [],
        "physics": {"settle": 0},
        "expect": ["upright"],
        "time_limit": "0.1 s",
    }
    (folder / "it.sim.yml").write_text(json.dumps(scenario, indent=1))


@pytest.fixture(scope="module")
def suite(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Outcome]:
    """The outcomes of all cases, which have run two at a time, by the folders of their scenarios."""
    folder = tmp_path_factory.mktemp("suite")
    for case in CASES:
        write(folder, case.name, case.text, case.files)
    for number in range(GOOD_ONES):
        write(folder, f"good {number}", GOOD)
    ran = sim_action(folder, "run", ".", "--jobs", "2", "--backend", installed()[0])
    assert ran.returncode == 2, ran.stdout + ran.stderr
    assert "Traceback" not in ran.stdout + ran.stderr
    results = Results.read(folder / "sim-results/results.json")
    return {Path(outcome.file).parent.name.replace("_", " "): outcome for outcome in results.outcomes}


def test_every_bad_model_is_an_error_of_its_rule_on_its_line(suite: dict[str, Outcome]) -> None:
    for case in CASES:
        outcome = suite[case.name]
        if not case.is_refused:
            assert outcome.status == "passed", case
            assert any(note.endswith(f"[{case.rule}]") for note in (*outcome.notes, *outcome.model_notes)), case
            continue
        failure = outcome.failures[0]
        assert (outcome.status, failure.kind) == ("error", "invalid"), case
        assert failure.message.endswith(f"[{case.rule}]"), case
        assert failure.location is not None, case
        place = (failure.location.file, failure.location.line)
        assert place == (f"{case.name.replace(' ', '_')}/robot.urdf", case.line), case


def test_every_good_model_passes_beside_them(suite: dict[str, Outcome]) -> None:
    assert len(suite) == len(CASES) + GOOD_ONES
    assert {suite[f"good {number}"].status for number in range(GOOD_ONES)} == {"passed"}


LIMIT = '    <limit lower="-1" upper="2" effort="10" velocity="3"/>\n'
SECOND = 240


def scene(folder: Path, text: str, base: str = "fixed") -> Scene:
    robot = Robot.model_validate({"model": "robot.urdf", "base": base, "allow": ALLOWABLE})
    return scene_of(folder, text, robot, allow=ALLOWABLE)


TAKEN = [bad for bad in _MODELS if bad.rule in ALLOWABLE or RULES[bad.rule].level == "warning"]


@pytest.mark.parametrize("engine", installed())
@pytest.mark.parametrize("base", ["fixed", "free"])
@pytest.mark.parametrize("bad", TAKEN, ids=lambda bad: bad.name)
def test_what_was_let_go_can_be_simulated(bad: BadModel, base: str, engine: str, tmp_path: Path) -> None:
    placed = scene(tmp_path, bad.text, base)
    spun = {joint.name: 1.0 for joint in placed.model.motor_joints if joint.mimic is None}
    trace = travelled(engine, placed, SECOND, JointTargets(velocity=spun if base == "free" else {}), contacts=True)
    joints = (trace.joint_position[-1], trace.joint_velocity[-1])
    assert np.isfinite(np.concatenate((trace.base_position_xyz[-1], trace.base_angular_xyz[-1], *joints))).all()


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
@pytest.mark.parametrize(
    "limit", ["", "<limit/>", '<limit lower="2" upper="-1"/>', '<limit effort="90" velocity="9"/>']
)
def test_a_joint_without_limits_moves_without(kind: str, limit: str, tmp_path: Path) -> None:
    text = GOOD.replace(LIMIT, limit).replace('"revolute"', f'"{kind}"')
    assert text.count("limit") == limit.count("limit")
    turns = JointTargets(velocity={"shoulder": 6.0})
    assert travelled(installed()[0], scene(tmp_path, text), SECOND, turns).joint_position[-1, 0] > 4.0
