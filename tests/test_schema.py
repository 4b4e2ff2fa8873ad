from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml

from sim_action.schema import scenario_schema, schema_text

ROOT = Path(__file__).parents[1]
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
    assert json.loads(schema_text())["$schema"] == "https://json-schema.org/draft/2020-12/schema"


@pytest.mark.parametrize("path", sorted(ROOT.glob("examples/**/*.sim.yml")), ids=lambda path: path.stem)
def test_the_examples_are_valid(path: Path, validator: jsonschema.Draft202012Validator) -> None:
    validator.validate(yaml.safe_load(path.read_text()))


@pytest.mark.parametrize(
    "change",
    [
        {"expect": [{"travel": {"at_least": "1.5 m"}, "before": 3, "severity": "warning"}]},
        {"expect": [{"no_collision": None}, {"upright": {"max_tilt": "20 deg"}}]},
        {"commands": {"twist": [{"linear": 1.0, "for": "2 s"}], "rate": "10 Hz"}},
        {"commands": [{"twist": [{"linear": 1.0}]}, {"script": "controller.py"}]},
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
        {"commands": {"rate": 10}},
        {"time_limit": -1},
        {"unknown": 1},
        {"version": 2},
    ],
)
def test_what_the_loader_refuses_is_invalid(change: dict[str, Any], validator: jsonschema.Draft202012Validator) -> None:
    assert not validator.is_valid(LEAST | change)


def test_every_reference_leads_somewhere() -> None:
    schema = scenario_schema()
    text = json.dumps(schema)
    for name in schema["$defs"]:
        assert f'"#/$defs/{name}"' in text
