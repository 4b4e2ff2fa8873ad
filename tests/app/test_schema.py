from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml

from sim_action.app.schema import results_schema, scenario_schema, schema_text
from sim_action.core.errors import Location
from sim_action.results.outcome import ExpectationOutcome, Failure, Outcome
from sim_action.results.results_json import Results
from sim_action.state.verdict import Verdict

ROOT = Path(__file__).parents[2]
LEAST: dict[str, Any] = {
    "name": "n",
    "robot": {"model": "turtlebot3_burger"},
    "expect": ["no_collision"],
    "time_limit": "30 s",
}


@pytest.fixture(scope="module")
def validator() -> jsonschema.Draft202012Validator:
    schema = scenario_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


def test_it_names_its_dialect_and_is_json() -> None:
    assert json.loads(schema_text(scenario_schema()))["$schema"] == "https://json-schema.org/draft/2020-12/schema"


@pytest.mark.parametrize("path", sorted(ROOT.glob("examples/**/*.sim.yml")), ids=lambda path: path.stem)
def test_the_examples_are_valid(path: Path, validator: jsonschema.Draft202012Validator) -> None:
    validator.validate(yaml.safe_load(path.read_text()))


@pytest.mark.parametrize(
    "change",
    [
        {"expect": [{"travel": {"at_least": "1.5 m"}, "before": 3, "severity": "warning"}]},
        {"expect": [{"no_collision": None}, {"upright": {"max_tilt": "20 deg"}}]},
        {"expect": [{"stl": "always (speed < 1)", "after": 1}, {"stl": {"formula": "x < 1"}}]},
        {"expect": [{"any_of": ["no_collision", {"not": {"all_of": [{"travel": {"at_least": 1}}]}}], "name": "n"}]},
        {
            "expect": [
                {"not": "no_collision"},
                {"assertion": "a.py:B"},
                {"assertion": {"class": "a.py:B", "with": {"c": 1}}},
            ]
        },
        {"commands": {"twist": [{"linear": 1.0, "for": "2 s"}], "rate": "10 Hz"}},
        {"commands": [{"twist": [{"linear": 1.0}]}, {"script": "controller.py"}]},
        {"commands": {"joints": [{"at": "2 s", "position": {"a": "90 deg", "b": "1 cm"}, "effort": {"c": "1 N"}}]}},
        {"commands": {"joints": [{"at": 0, "velocity": {"a": 1}}], "interpolation": "hold", "rate": "60 Hz"}},
        {"robot": {"model": "x.urdf", "drive": {"diff": {"left": ["a"], "right": ["b"]}}}},
        {"world": {"objects": [{"name": "wall", "box": [0.1, "2 m", 0.5], "pose": {"yaw": "90 deg"}}]}},
    ],
)
def test_what_the_loader_takes_is_valid(change: dict[str, Any], validator: jsonschema.Draft202012Validator) -> None:
    validator.validate(LEAST | change)


@pytest.mark.parametrize(
    "change",
    [
        {"expect": []},
        {"expect": ["travel"]},
        {"expect": [{"travell": {"at_least": 1}}]},
        {"expect": [{"travel": {"at_least": 1}, "upright": {}}]},
        {"expect": [{"travel": {"at_least": "1.5 kg"}}]},
        {"expect": [{"stl": 5}]},
        {"expect": [{"any_of": []}]},
        {"expect": [{"any_of": {"travel": {"at_least": 1}}}]},
        {"expect": [{"all_of": [{"no_collision": None, "after": 1}]}]},
        {"expect": [{"not": {"travel": {"at_lest": 1}}}]},
        {"expect": [{"assertion": {"with": {}}}]},
        {"commands": {"rate": 10}},
        {"commands": {"joints": [{"position": {"a": 1}}]}},
        {"commands": {"joints": [{"at": 1, "position": {"a": "1 rad/s"}}]}},
        {"time_limit": -1},
        {"unknown": 1},
        {"version": 2},
    ],
)
def test_what_the_loader_refuses_is_invalid(change: dict[str, Any], validator: jsonschema.Draft202012Validator) -> None:
    assert not validator.is_valid(LEAST | change)


@pytest.mark.parametrize(
    "file",
    [
        {"extends": "burger.base.yml", "commands": {"rate": 20}, "robot": {"pose": {"x": 1}}},
        {"robot": {"model": "turtlebot3_burger"}, "scenarios": [{"name": "a", "time_limit": 1}, {"name": "b"}]},
    ],
)
def test_a_file_that_others_complete_need_not_be_whole(
    file: dict[str, Any], validator: jsonschema.Draft202012Validator
) -> None:
    validator.validate(file)
    assert not validator.is_valid(file | {"robot": {"modl": 1}})
    assert not validator.is_valid({key: value for key, value in file.items() if key not in ("extends", "scenarios")})


def test_every_reference_leads_somewhere() -> None:
    schema = scenario_schema()
    text = json.dumps(schema)
    for name in schema["$defs"]:
        assert f'"#/$defs/{name}"' in text


def test_results_are_as_their_schema_says() -> None:
    schema = results_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    verdict = Verdict(True, 1.5, 1.5, 0.0, "m", 2.0, "travelled 1.5 m in 2.00 s")
    expectation = ExpectationOutcome(
        name="travel", assertion="travel", severity="error", location=Location("a.sim.yml", 8, 5), verdict=verdict
    )
    failure = Failure(kind="crash", title="SIGSEGV", message="the process ended")
    results = Results(
        sim_action="1.0.0",
        python="3.11.7",
        platform="Linux",
        wall_time=1.0,
        outcomes=(
            Outcome(name="a", file="a.sim.yml", status="passed", expectations=(expectation,), sim_time=2.0),
            Outcome(name="b", file="b.sim.yml", status="error", failures=(failure,)),
        ),
    )
    written = json.loads(results.model_dump_json())
    jsonschema.validate(written, schema)
    assert set(written) == set(schema["required"])
    assert schema["$defs"]["Outcome"]["properties"]["travelled"]["description"].startswith("the distance in m between")
    del written["outcomes"][0]["digest"]
    with pytest.raises(jsonschema.ValidationError, match="digest"):
        jsonschema.validate(written, schema)
