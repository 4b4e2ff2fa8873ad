"""The JSON Schema of scenario files, for editors."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic.json_schema import GenerateJsonSchema, models_json_schema

from sim_action.assertions import ASSERTIONS
from sim_action.commands import COMMANDS
from sim_action.drives import DRIVES
from sim_action.scenario import ExpectationOptions, Scenario

Schema = dict[str, Any]


class _Untitled(GenerateJsonSchema):
    """Titles made from names say nothing that the names do not."""

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False


def schema_text() -> str:
    """What `sim-action schema` prints."""
    return json.dumps(scenario_schema(), indent=2, ensure_ascii=False) + "\n"


def scenario_schema() -> Schema:
    """The schema of one scenario file."""
    families = [table.load(name) for table in (ASSERTIONS, COMMANDS, DRIVES) for name in table]
    models: list[type[BaseModel]] = [Scenario, ExpectationOptions, *families]
    _, schema = models_json_schema(
        [(model, "validation") for model in models], ref_template="#/$defs/{model}", schema_generator=_Untitled
    )
    definitions = schema["$defs"]
    for definition in definitions.values():
        definition.pop("title", None)
    scenario = definitions.pop(Scenario.__name__)
    options = definitions.pop(ExpectationOptions.__name__)["properties"]
    scenario["properties"]["expect"]["items"] = {"$ref": "#/$defs/Expectation"}
    scenario["properties"]["commands"] = _commands(scenario["properties"]["commands"]["description"])
    definitions["Expectation"] = _expectation(options)
    robot = definitions["DrivenRobot"]["properties"]
    robot["drive"] = {"description": robot["drive"]["description"], **_choice(_drive_keys())}
    head = {"$schema": GenerateJsonSchema.schema_dialect, "title": "sim-action scenario"}
    return {**head, **scenario, "$defs": _reachable(definitions, scenario)}


def _commands(description: str) -> Schema:
    source = {"anyOf": [_ref(COMMANDS.load(name)) for name in COMMANDS]}
    return {"description": description, "anyOf": [source, {"type": "array", "items": source}]}


def _drive_keys() -> Schema:
    return {name: _ref(DRIVES.load(name)) for name in DRIVES}


def _expectation(options: Schema) -> Schema:
    """A name alone, where an assertion needs nothing more; else a map of its name and what may stand beside it."""
    alone = [name for name in ASSERTIONS if _needs_nothing(ASSERTIONS.load(name))]
    specs: Schema = {name: _ref(ASSERTIONS.load(name)) for name in ASSERTIONS}
    for name in alone:
        specs[name] = {"anyOf": [specs[name], {"type": "null"}]}
    return {"anyOf": [{"enum": alone}, _choice(specs, options)]}


def _choice(keys: Schema, beside: Schema | None = None) -> Schema:
    """A map with exactly one of the keys."""
    return {
        "type": "object",
        "properties": {**keys, **(beside or {})},
        "oneOf": [{"required": [name]} for name in keys],
        "additionalProperties": False,
    }


def _needs_nothing(model: type[BaseModel]) -> bool:
    try:
        model()
    except ValidationError:
        return False
    return True


def _ref(model: type[BaseModel]) -> Schema:
    return {"$ref": f"#/$defs/{model.__name__}"}


def _reachable(definitions: Schema, root: Schema) -> Schema:
    """The definitions that are referred to; the common bases of families are not."""
    used: set[str] = set()
    waiting = [root]
    while waiting:
        for name in set(_referred(waiting.pop())) - used:
            used.add(name)
            waiting.append(definitions[name])
    return {name: definitions[name] for name in sorted(used)}


def _referred(part: Any) -> Iterator[str]:
    if isinstance(part, dict):
        if "$ref" in part:
            yield part["$ref"].rpartition("/")[2]
        for value in part.values():
            yield from _referred(value)
    elif isinstance(part, list):
        for value in part:
            yield from _referred(value)
