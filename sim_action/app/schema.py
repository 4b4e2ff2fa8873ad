"""JSON Schemas: of scenario files, for editors, and of `results.json`, for programs that read it."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any, Final

from pydantic import BaseModel, ValidationError
from pydantic.json_schema import GenerateJsonSchema, models_json_schema

from sim_action.assertions import ASSERTIONS, Assertion
from sim_action.assertions.combined import Combined
from sim_action.commands import COMMANDS
from sim_action.core.registry import Table
from sim_action.drives import DRIVES
from sim_action.results.results_json import Results
from sim_action.scenario.model import ExpectationOptions, Scenario
from sim_action.sensors import SENSORS, Mounting

Schema = dict[str, Any]


class _Untitled(GenerateJsonSchema):
    """Titles made from names say nothing that the names do not."""

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False


def schema_text(schema: Schema) -> str:
    """Return the text that `sim-action schema` prints."""
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"


def results_schema() -> Schema:
    """The schema of `results.json`, as it is written."""
    schema = Results.model_json_schema(mode="serialization", schema_generator=_Untitled)
    definitions = {name: _described(definition) for name, definition in schema.pop("$defs").items()}
    head = {"$schema": GenerateJsonSchema.schema_dialect, "title": "sim-action results"}
    return {**head, **_described(schema), "$defs": definitions}


def scenario_schema() -> Schema:
    """The schema of one scenario file."""
    families = [table.load(name) for table in (ASSERTIONS, COMMANDS, DRIVES, SENSORS) for name in table]
    models: list[type[BaseModel]] = [Scenario, ExpectationOptions, Mounting, *families]
    _, schema = models_json_schema(
        [(model, "validation") for model in models], ref_template="#/$defs/{model}", schema_generator=_Untitled
    )
    definitions = schema["$defs"]
    for definition in definitions.values():
        definition.pop("title", None)
    scenario = definitions.pop(Scenario.__name__)
    scenario["properties"]["expect"]["items"] = {"$ref": "#/$defs/Expectation"}
    scenario["properties"]["sensors"]["items"] = {"$ref": "#/$defs/Sensor"}
    scenario["properties"]["commands"] = _commands(scenario["properties"]["commands"]["description"])
    definitions["Expectation"] = _one_of(ASSERTIONS, definitions.pop(ExpectationOptions.__name__)["properties"])
    definitions |= _combined_assertions(definitions)
    definitions["Sensor"] = _one_of(SENSORS, definitions.pop(Mounting.__name__)["properties"])
    robot = definitions["DrivenRobot"]["properties"]
    robot["drive"] = {"description": robot["drive"]["description"], **_choice(_drive_keys())}
    _loosen(scenario, definitions)
    head = {"$schema": GenerateJsonSchema.schema_dialect, "title": "sim-action scenario"}
    return {**head, **scenario, "$defs": _reachable(definitions, scenario)}


def _combined_assertions(definitions: Schema) -> Schema:
    """Assertions that consist of others, which have no options of their own."""
    part = {"$ref": f"#/$defs/{Assertion.__name__}"}
    kinds = [kind for name in ASSERTIONS if issubclass(kind := ASSERTIONS.load(name), Combined)]
    combined = {
        kind.__name__: {"description": definitions[kind.__name__]["description"], **kind.value_schema(part)}
        for kind in kinds
    }
    return {Assertion.__name__: _one_of(ASSERTIONS, {}), **combined}


def _loosen(scenario: Schema, definitions: Schema) -> None:
    """Drop required keys where other files or shared keys may supply them."""
    parts = scenario["properties"]
    strict = {"commands": parts["commands"], "robot": {"required": definitions["DrivenRobot"].pop("required")}}
    alone = {"required": scenario.pop("required"), "properties": strict}
    parts["commands"] = {"description": strict["commands"]["description"]}
    entry = {key: value for key, value in parts.items() if key not in _OF_A_FILE}
    items = {"type": "object", "properties": entry, "additionalProperties": False}
    parts["scenarios"] = _list(parts["scenarios"]["description"], items)
    scenario["if"] = {"anyOf": [{"required": [key]} for key in _OF_A_FILE]}
    scenario["then"] = True
    scenario["else"] = alone


def _list(description: str, items: Schema) -> Schema:
    return {"description": description, "type": "array", "minItems": 1, "items": items}


_OF_A_FILE: Final = ("extends", "scenarios")


def _described(definition: Schema) -> Schema:
    """With what its docstring says of attributes beside them. All are written; a later version may add to them."""
    if "properties" not in definition:
        return definition
    described = {name: value for name, value in definition.items() if name not in {"title", "additionalProperties"}}
    described["description"], _, attributes = definition["description"].partition("\n\nAttributes:\n")
    properties = {name: dict(schema) for name, schema in definition["properties"].items()}
    for name, text in re.findall(r"^ *(\w+): (.+)$", attributes, re.MULTILINE):
        properties[name]["description"] = text
    return {**described, "properties": properties, "required": list(properties)}


def _commands(description: str) -> Schema:
    source = {"anyOf": [_ref(COMMANDS.load(name)) for name in COMMANDS]}
    return {"description": description, "anyOf": [source, {"type": "array", "items": source}]}


def _drive_keys() -> Schema:
    return {name: _ref(DRIVES.load(name)) for name in DRIVES}


def _one_of(table: Table[Any], options: Schema) -> Schema:
    """A name alone, where it needs nothing more; else a map of the name and what may stand beside it."""
    alone = [name for name in table if _needs_nothing(table.load(name))]
    specs: Schema = {name: _value(table.load(name)) for name in table}
    for name in alone:
        specs[name] = {"anyOf": [specs[name], {"type": "null"}]}
    return {"anyOf": [{"enum": alone}, _choice(specs, options)]}


def _value(model: type[BaseModel]) -> Schema:
    """A map of keys, or the value of the one that may stand alone."""
    is_bare = getattr(model, "bare_value", None) is not None
    return {"anyOf": [_ref(model), {"type": "string"}]} if is_bare else _ref(model)


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
