"""The JSON Schemas of scenario files, of base files and of `results.json`.

How editors word mistakes is in tests/integration/test_editors.py.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml

from sim_action.app.schema import SCHEMAS, base_schema, results_schema, scenario_schema, schema_text
from sim_action.cli.init import files
from sim_action.core.errors import InvalidScenario, Location
from sim_action.core.workspace import SUFFIXES
from sim_action.results.outcome import ExpectationOutcome, Failure, Outcome
from sim_action.results.results_json import Results
from sim_action.scenario.loading import load_scenario
from sim_action.state.verdict import Verdict
from tests.app.typos import SCENARIO, TYPOS, Typo
from tests.examples import EXAMPLES
from tests.scenarios import FULL

ROOT = Path(__file__).parents[2]
LEAST: dict[str, Any] = {
    "name": "n",
    "robot": {"model": "turtlebot3_burger"},
    "expect": ["no_collision"],
    "time_limit": "30 s",
}


def validator_of(schema: dict[str, Any]) -> jsonschema.Draft7Validator:
    jsonschema.Draft7Validator.check_schema(schema)
    return jsonschema.Draft7Validator(schema)


@pytest.fixture(scope="module")
def validator() -> jsonschema.Draft7Validator:
    return validator_of(scenario_schema())


@pytest.fixture(scope="module")
def of_bases() -> jsonschema.Draft7Validator:
    return validator_of(base_schema())


def test_they_name_their_dialect_and_address_and_are_json() -> None:
    for name in ("scenario", "base"):
        schema = json.loads(schema_text(SCHEMAS[name]()))
        assert schema["$schema"] == "http://json-schema.org/draft-07/schema#"
        assert schema["$id"] == f"https://sim-action.github.io/sim-action/{name}.schema.json"


@pytest.mark.parametrize("name", SCHEMAS)
def test_the_site_publishes_each_schema(name: str) -> None:
    assert f'"{name}.schema.json"' in (ROOT / "docs/conf.py").read_text(encoding="utf-8")


def test_the_site_and_schemastore_have_the_published_schemas() -> None:
    entry = json.loads((ROOT / ".github/schemastore.json").read_text(encoding="utf-8"))
    assert entry.keys() == {"name", "description", "fileMatch", "url"}
    assert entry["url"] == scenario_schema()["$id"]
    assert sorted(entry["fileMatch"]) == sorted(f"*{suffix}" for suffix in SUFFIXES)
    page = (ROOT / "docs/scenario/editors.md").read_text(encoding="utf-8")
    (settings,) = re.findall(r"```json\n(.*?)```", page, re.DOTALL)
    addresses = json.loads(settings)["yaml.schemas"]
    assert list(addresses) == [scenario_schema()["$id"], base_schema()["$id"]]
    for address in addresses:
        assert page.count(address) >= 2


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_the_examples_are_valid(path: Path, validator: jsonschema.Draft7Validator) -> None:
    validator.validate(yaml.safe_load(path.read_text()))


def test_base_files_need_nothing_and_have_no_list_of_scenarios(of_bases: jsonschema.Draft7Validator) -> None:
    for path in ROOT.glob("examples/**/*.base.yml"):
        of_bases.validate(yaml.safe_load(path.read_text()))
    for part in ({}, {"extends": "other.base.yml"}, {"name": "n", "variations": {"seed": [1, 2]}}):
        of_bases.validate(part)
    for mistake in ({"scenarios": [{"name": "a"}]}, {"time_limt": 1}, {"expect": ["travel"]}, {"seed": "x"}):
        assert not of_bases.is_valid(mistake)


def test_the_scenario_of_init_is_valid(validator: jsonschema.Draft7Validator) -> None:
    validator.validate(yaml.safe_load(files("")["simulation/drive_straight.sim.yml"]))


def scenario_texts() -> Iterator[str]:
    """Yield the whole scenarios in the documents, except that of the page whose assertion is not in the product."""
    pages = (page for page in sorted((ROOT / "docs").rglob("*.md")) if page.name != "new-assertion.md")
    for page in (ROOT / "README.md", *pages):
        for text in re.findall(r"```yaml\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
            if re.search(r"^extends:|^name:(.|\n)*^time_limit:", text, re.MULTILINE):
                yield text


@pytest.mark.parametrize("text", [FULL, SCENARIO, *scenario_texts()], ids=lambda text: str(text.count("\n")))
def test_scenarios_of_tests_and_documents_are_valid(text: str, validator: jsonschema.Draft7Validator) -> None:
    validator.validate(yaml.safe_load(text))


@pytest.mark.parametrize("typo", TYPOS, ids=lambda typo: typo.wrong.strip() or f"no {typo.right.strip()}")
def test_a_typo_is_found_here_or_by_loading(typo: Typo, validator: jsonschema.Draft7Validator, tmp_path: Path) -> None:
    assert validator.is_valid(yaml.safe_load(typo.text)) is not bool(typo.message)
    path = tmp_path / "a.sim.yml"
    path.write_text(typo.text, encoding="utf-8")
    with pytest.raises(InvalidScenario):
        load_scenario(path)


def test_at_least_forty_of_fifty_typos_are_found() -> None:
    assert len(TYPOS) >= 50
    assert sum(bool(typo.message) for typo in TYPOS) >= 0.8 * len(TYPOS)


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
def test_what_the_loader_takes_is_valid(change: dict[str, Any], validator: jsonschema.Draft7Validator) -> None:
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
def test_what_the_loader_refuses_is_invalid(change: dict[str, Any], validator: jsonschema.Draft7Validator) -> None:
    assert not validator.is_valid(LEAST | change)


@pytest.mark.parametrize(
    "file",
    [
        {"extends": "burger.base.yml", "commands": {"rate": 20}, "robot": {"pose": {"x": 1}}},
        {"robot": {"model": "turtlebot3_burger"}, "scenarios": [{"name": "a", "time_limit": 1}, {"name": "b"}]},
        {"extends": "a.base.yml", "commands": {"twist": None, "script": "drive.py"}, "seed": None},
        {"extends": "a.base.yml", "robot": {"drive": {"diff": {"left": None, "acceleration": 1}}}, "world": None},
        {"name": "n", "variations": {"time_limit": [5, "6 s"], "robot.model": ["a.urdf", "b.urdf"]}},
    ],
)
def test_a_file_for_others_need_not_be_whole(file: dict[str, Any], validator: jsonschema.Draft7Validator) -> None:
    validator.validate(file)
    assert not validator.is_valid(file | {"robot": {"modl": 1}})
    assert not validator.is_valid(
        {key: value for key, value in file.items() if key not in ("extends", "scenarios", "variations")}
    )


def test_every_definition_is_referred_to() -> None:
    for schema in (scenario_schema(), base_schema()):
        text = json.dumps(schema)
        for name in schema["definitions"]:
            assert f'"#/definitions/{name}"' in text


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


@pytest.mark.parametrize(
    ("commands", "is_valid"),
    [
        ({"script": {"file": "a.py", "class": "A", "with": {"kp": 1.2}, "rate": "20 Hz"}}, True),
        ({"script": {"file": "a.py"}, "rate": "20 Hz"}, True),
        ([{"script": "a.py", "class": "A", "with": {"kp": [1, "2"]}}], True),
        ({"script": {"class": "A"}}, False),
        ({"script": {"fil": "a.py"}}, False),
        ({"script": {"file": 3}}, False),
        ({"script": 3}, False),
        ({"process": {"command": ["a"], "with": {"kp": 1}}}, True),
        ({"process": {"command": "a b", "start_within": "2 s"}}, True),
        ({"process": "a b"}, True),
        ({"process": {"with": {}}}, False),
        ({"policy": {"file": "a.onnx", "action": {"joints": "effort"}, "rate": 50, "observation": ["time"]}}, True),
        ({"policy": "a.onnx", "action": {"joints": "effort"}, "rate": 50, "commands": [0.5, 0, "1 rad/s"]}, True),
        ({"policy": {"file": "a.onnx", "action": {"joints": "effort"}, "rate": 50, "inputs": {"x": ["time"]}}}, True),
        ({"policy": "a.onnx", "action": {"joints": "effort", "scale": {"*": 2}, "offset": "home"}, "rate": 50}, True),
        ({"policy": "a.onnx", "action": {"joints": "effort"}}, False),
        ({"policy": {"file": "a.onnx", "rate": 50}}, True),  # the network may state the action
        ({"policy": {"file": "a.onnx", "rate": 50, "constants": {"is_training": False, "n": [1, 2]}}}, True),
        ({"policy": {"file": "a.onnx", "rate": 50, "pictures": {"x": {"camera": "front", "mean": [0, 0, 0]}}}}, True),
        ({"policy": {"file": "a.onnx", "rate": 50, "pictures": {"x": {"mean": [0, 0, 0]}}}}, False),
        ({"policy": "a.onnx", "action": {"joints": "effort"}, "rate": 50, "observation": [{"scale": 2}]}, False),
        ({"policy": "a.onnx", "action": {"joints": "effort", "offset": "hom"}, "rate": 50}, False),
    ],
)
def test_keys_of_a_source_may_be_a_map(commands: Any, is_valid: bool, validator: jsonschema.Draft7Validator) -> None:
    assert validator.is_valid({**LEAST, "commands": commands}) == is_valid
