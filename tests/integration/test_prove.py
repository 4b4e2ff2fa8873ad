"""`sim-action prove` on planted scenarios: which expectations check nothing, the suggestions, the same table always."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

import jsonschema
import pytest
import yaml

from sim_action.app.schema import proof_schema
from sim_action.cli.main import call
from sim_action.core.errors import ExitCode
from sim_action.robot.built_in import BUILT_IN
from tests.soak import soaked

HEAD: Final = "robot: {model: turtlebot3_burger}\ntime_limit: 8 s\n"
FLAT: Final = HEAD.replace("turtlebot3_burger", "f1tenth")
STRAIGHT: Final = "commands: {rate: 10 Hz, twist: [{linear: 0.2, for: 5 s}]}\n"
SLOWLY: Final = STRAIGHT.replace("0.2", "0.1")
CURVE: Final = "commands: {rate: 10 Hz, twist: [{linear: 0.2, angular: 0.4, for: 6 s}]}\nduration: 6 s\n"
CRATE: Final = "world: {objects: [{name: crate, box: [0.3, 0.3, 0.3], pose: {x: 0.5, y: YY}}]}\n"

USELESS: Final = {
    "speed": STRAIGHT + "expect: [{reach: {x: 0.8, y: 0, tolerance: 0.1}, before: 4.5}, {max_speed: {linear: 40}}]",
    "tilt": STRAIGHT + "expect: [{upright: {max_tilt: 80 deg}}, {final_pose: {x: 0.97, y: 0, tolerance: 0.3}}]",
    "area": STRAIGHT + "expect: [{travel: {at_least: 0.9}}, {stay_within: {x: [-1 km, 1 km], y: [-1 km, 1 km]}}]",
    "crate": STRAIGHT
    + CRATE.replace("YY", "8")
    + "expect: [{travel: {at_least: 0.8}}, {clearance: {at_least: 0.1, to: [crate]}}]",
    "wheel": STRAIGHT
    + "expect: [{joint: {name: wheel_left_joint, reading: velocity, at_most: 900}}, {travel: {at_least: 0.8}}]",
}
"""Scenarios with one useless expectation each; "tilt" is of a flat car, which never tips over."""

NAMED: Final = {"speed": "max_speed", "tilt": "upright", "area": "stay_within", "crate": "clearance", "wheel": "joint"}
"""The useless expectation of each."""

USEFUL: Final = {
    "speed": SLOWLY + "expect: [{reach: {x: 0.4, y: 0, tolerance: 0.05}, before: 4.5}, {max_speed: {linear: 0.15}}]",
    "place": CURVE + "expect: [{final_pose: {x: 0.34, y: 0.88, tolerance: 0.1}}]",
    "corridor": STRAIGHT + "expect: [{travel: {at_least: 0.9}}, {stay_within: {y: [-0.1, 0.1]}}]",
    "crate": STRAIGHT
    + CRATE.replace("YY", "0.4")
    + "expect: [{travel: {at_least: 0.8}}, {clearance: {at_least: 0.1, to: [crate]}}]",
    "wheel": SLOWLY
    + "expect: [{joint: {name: wheel_left_joint, reading: velocity, at_most: 4}}, {travel: {at_least: 0.4}}]",
}
"""Scenarios without a useless expectation."""


def written(folder: Path, name: str, text: str) -> Path:
    path = folder / f"{name}.sim.yml"
    head = FLAT if text == USELESS["tilt"] else HEAD
    path.write_text(f"name: {name}\n{head}{text}\n")
    return path


def proof(*arguments: str | Path, code: int = ExitCode.PASSED) -> dict[str, Any]:
    assert call(["prove", "--quiet", "--json", "proof.json", *map(str, arguments)]) == code
    found: dict[str, Any] = json.loads(Path("proof.json").read_text())
    return found


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / ".git").mkdir()
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(("useless", "useful"), soaked(zip(USELESS, USEFUL, strict=True), short=[("area", "corridor")]))
def test_planted_scenarios_are_judged_right_and_suggestions_notice_what_they_are_for(
    useless: str, useful: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path, "useless", USELESS[useless])
    written(tmp_path, "useful", USEFUL[useful])
    found = proof("--jobs", "2", "--strict", code=ExitCode.FAILED)
    assert capsys.readouterr().out.count("checks nothing here") == 1
    jsonschema.validate(found, proof_schema())
    blind = {
        scenario["name"]: [claim["assertion"] for claim in scenario["expectations"] if claim["finding"] != "notices"]
        for scenario in found["scenarios"]
    }
    assert blind == {"useless": [NAMED[useless]], "useful": []}
    if useless not in ("area", "tilt"):
        return
    mutants = next(scenario["mutants"] for scenario in found["scenarios"] if scenario["name"] == "useless")
    survivors = [each for each in mutants if each["suggestion"]]
    assert survivors
    for survivor in survivors:
        assert survivor["status"] == "survived"
        data = yaml.safe_load(path.read_text())
        data["expect"] += yaml.safe_load(survivor["suggestion"])
        improved = tmp_path / "improved.sim.yml"
        improved.write_text(yaml.safe_dump(data))
        # A scenario that does not pass has no mutants.
        (mutant,) = proof(improved, "--only", survivor["name"])["scenarios"][0]["mutants"]
        assert (mutant["status"], mutant["noticed_by"]) == ("noticed", [len(data["expect"]) - 1])


@pytest.mark.soak
@pytest.mark.parametrize("robot", BUILT_IN)
def test_every_expectation_that_init_writes_notices_something(robot: str) -> None:
    assert call(["init", "--robot", robot]) == ExitCode.PASSED
    found = proof("--strict", "simulation")
    assert all(each["finding"] == "notices" for each in found["scenarios"][0]["expectations"])


def test_the_table_is_the_same_with_one_job_and_with_two(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    written(tmp_path, "crate", USEFUL["crate"])
    only = ("--only", "silenced,moved")
    (one, told), (other, again) = ((proof("--jobs", jobs, *only), capsys.readouterr().out) for jobs in "12")
    assert told == again
    assert one["scenarios"] == other["scenarios"]
    assert one["runs"] == other["runs"]


@pytest.mark.parametrize("engine", ["pybullet", "mujoco"])
def test_a_shove_tips_a_tall_robot_and_not_a_flat_one(engine: str, tmp_path: Path) -> None:
    upright = f"duration: 5 s\nbackend: {engine}\nexpect: [{{upright: {{max_tilt: LIMIT}}}}]\n"
    for model, limit in (("turtlebot3_burger", "20 deg"), ("f1tenth", "80 deg")):
        text = HEAD.replace("turtlebot3_burger", model) + STRAIGHT + upright.replace("LIMIT", limit)
        (tmp_path / f"{model}.sim.yml").write_text(f"name: {model}\n{text}")
    results = {each["name"]: each["mutants"] for each in proof("--only", "shoved")["scenarios"]}
    assert {name: shoved["status"] for name, (shoved,) in results.items()} == {
        "turtlebot3_burger": "noticed",
        "f1tenth": "survived",
    }


def test_a_failure_does_not_hide_what_other_expectations_notice(tmp_path: Path) -> None:
    """The run goes on: the limit of the speed is broken at once, and the area later."""
    text = STRAIGHT + "expect: [{max_speed: {linear: 0.3}}, {stay_within: {x: [-0.1, 1.5]}}]\nduration: 6 s"
    (scenario,) = proof(written(tmp_path, "both", text), "--only", "scaled:x2")["scenarios"]
    assert scenario["mutants"][0]["noticed_by"] == [0, 1]


def test_an_expectation_that_is_blind_to_directions_misses_an_inverted_axis(tmp_path: Path) -> None:
    """Each expectation notices something, and together they miss that the robot drives the other way."""
    claims = "{travel: {at_least: 95 cm, at_most: 105 cm}}, {max_speed: {linear: 0.22}}"
    text = f"{STRAIGHT}duration: 6 s\nexpect: [{claims}]"
    only = "silenced,reversed,turned,scaled,slippery,delayed"
    (scenario,) = proof(written(tmp_path, "blind", text), "--only", only)["scenarios"]
    results = {mutant["name"]: mutant["status"] for mutant in scenario["mutants"]}
    assert {each["finding"] for each in scenario["expectations"]} == {"notices"}
    assert {results["reversed:linear"], results["turned"]} == {"survived"}
    assert results["slippery"] == "survived"
    assert "slippery:ice" in results
    assert [name for name in results if name.startswith("delayed")] == ["delayed:0.5s"]


def test_scenarios_that_do_not_pass_are_listed_and_not_mutated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    written(tmp_path, "failing", STRAIGHT + "expect: [{max_speed: {linear: 0.1}}]")
    written(tmp_path, "good", USEFUL["corridor"])
    found = proof("--only", "silenced")
    failing, good = found["scenarios"]
    assert failing["reason"].startswith("failed (")
    assert failing["mutants"] == []
    assert [each["status"] for each in good["mutants"]] == ["noticed"]
    assert "1 scenario not mutated" in capsys.readouterr().out
    proof("--only", "silenced", "--strict", code=ExitCode.FAILED)
    written(tmp_path, "invalid", "expect: [{nonsense: 1}]")
    assert call(["prove", "--quiet", "--only", "silenced", "."]) == ExitCode.INVALID


def test_mutants_of_sensors_and_objects_are_noticed_by_what_they_change(tmp_path: Path) -> None:
    (tmp_path / "control.py").write_text(
        "from sim_action import Twist\n\n\ndef control(seen):\n"
        "    return Twist.planar(0.2 if seen.sensors['lidar'].nearest(-0.2, 0.2) > 0.5 else 0.0)\n"
    )
    text = (
        "world: {objects: [{name: wall, box: [0.1, 1, 0.5], pose: {x: 1.2}}]}\n"
        "sensors: [{lidar: {rays: 36}}]\n"
        "commands: {rate: 10 Hz, script: control.py}\n"
        "expect: [no_collision, {stay_within: {x: [-0.1, 0.8]}}]\nduration: 6 s"
    )
    found = proof(written(tmp_path, "stops", text), "--only", "frozen,removed")["scenarios"][0]
    results = {each["name"]: each["noticed_by"] for each in found["mutants"]}
    assert results == {"removed:wall": [1], "frozen:lidar": [0, 1]}


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--only", "silence"], "did you mean 'silenced'"),
        (["--only", "motor-off:wheel_lft_joint"], "did you mean 'motor-off:wheel_left_joint'"),
        (["--only", ","], "expected names of mutants, not ','"),
        (["--budget", "soon"], "--budget"),
        (["--budget", "0 s"], "greater than 0"),
        (["--json", "mine.json"], "mine.json exists and is no proof"),
        (["--json", "no/such/folder.json"], "cannot be written"),
    ],
)
def test_bad_options_are_refused(
    arguments: list[str], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine.json").write_text('{"mine": 1}')
    written(tmp_path, "corridor", USEFUL["corridor"])
    assert call(["prove", "--quiet", *arguments]) == ExitCode.INVALID
    printed = capsys.readouterr()
    assert told in printed.err
    assert "Traceback" not in printed.err
    assert (tmp_path / "mine.json").read_text() == '{"mine": 1}'
