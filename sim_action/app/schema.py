"""JSON Schemas: of scenario and base files, for editors, and of results and proofs, for programs that read them."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Final

from pydantic import BaseModel, PydanticUserError
from pydantic.json_schema import GenerateJsonSchema, models_json_schema

from sim_action.app.catalogue import package_parts
from sim_action.app.editor_schema import EditorSchemas, Schema, chosen_by_key
from sim_action.assertions import ASSERTIONS, Assertion
from sim_action.assertions.combined import Combined
from sim_action.commands import COMMANDS, CommandSource
from sim_action.core.registry import PackageProblem, Table
from sim_action.drives import DRIVES
from sim_action.results.proof import Proof
from sim_action.results.results_json import Results
from sim_action.scenario.events import Action, ConditionOptions, EventKeys
from sim_action.scenario.model import DrivenActor, ExpectationOptions, Scenario
from sim_action.sensors import SENSORS, Mounting

SITE: Final = "https://sim-action.github.io/sim-action"  # the address of the documents, where the schemas are published


Kinds = Mapping[str, type[BaseModel]]  # names that a scenario can use, and their classes
Added = Mapping[str, Kinds]  # the kind of a table -> the classes of installed packages


class _Untitled(GenerateJsonSchema):
    """Titles made from names say nothing that the names do not."""

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False


def schema_text(schema: Schema) -> str:
    """Return the text that `sim-action schema` prints."""
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"


def results_schema() -> Schema:
    """The schema of `results.json`, as it is written."""
    return _of_output(Results, "sim-action results")


def proof_schema() -> Schema:
    """The schema of the JSON of `sim-action prove`, as it is written."""
    return _of_output(Proof, "sim-action proof")


def _of_output(kind: type[BaseModel], title: str) -> Schema:
    schema = kind.model_json_schema(mode="serialization", schema_generator=_Untitled)
    definitions = {name: _described(definition) for name, definition in schema.pop("$defs").items()}
    head = {"$schema": GenerateJsonSchema.schema_dialect, "title": title}
    return {**head, **_described(schema), "$defs": definitions}


def schema_here(kind: str) -> Schema:
    """The schema of a kind in `SCHEMAS`, with the parts of the packages that are installed here."""
    if kind in ("results", "proof"):
        return SCHEMAS[kind]()
    added = {table.kind: _added(table) for table in (ASSERTIONS, COMMANDS, SENSORS)}
    return scenario_schema(added) if kind == "scenario" else base_schema(added)


def _added(table: Table[Any]) -> Kinds:
    kinds = {part.name: kind for part, kind in package_parts(table) if not isinstance(kind, PackageProblem)}
    return {name: kind for name, kind in kinds.items() if _definitions_of(kind)}


def scenario_schema(added: Added = MappingProxyType({})) -> Schema:
    """The schema of a scenario file for editors, with classes of packages: one, several, or one to complete."""
    scenario, schemas = _for_editors(added)
    root = {
        "type": "object",
        "if": {"anyOf": [{"required": [key], "properties": {key: {}}} for key in _COMPLETING]},
        "then": _merged(scenario, schemas, _OF_A_FILE),
        "else": scenario,
    }
    return schemas.document(_head("scenario", "simulation scenario", scenario["description"]), root)


def base_schema(added: Added = MappingProxyType({})) -> Schema:
    """The schema of a base file for editors, with classes of packages: keys that scenarios share, none required."""
    scenario, schemas = _for_editors(added)
    head = _head(
        "base", "base of simulation scenarios", "Keys that scenarios share: they name this file with `extends`."
    )
    return schemas.document(head, _merged(scenario, schemas, ("extends",)))


def _head(kind: str, title: str, description: str) -> Schema:
    return {"$id": f"{SITE}/{kind}.schema.json", "title": f"sim-action {title}", "description": description}


def _for_editors(added: Added) -> tuple[Schema, EditorSchemas]:
    scenario, definitions = _models(added)
    description = scenario["properties"]["commands"]["description"]
    kinds = _kinds(COMMANDS, added)
    for name, kind in kinds.items():
        definition = definitions[_name(kind)]
        definition["properties"][name].setdefault("description", definition["description"])
    shared = {key: value for kind in kinds.values() for key, value in _properties(definitions, kind).items()}
    source = chosen_by_key({name: _ref(kind) for name, kind in kinds.items()}, shared)
    part = {"type": "object", "properties": shared, "additionalProperties": False}
    definitions |= {"CommandSource": source, "SharedCommands": part}
    several = {"type": "array", "items": {"$ref": "#/$defs/CommandSource"}}
    commands = {"description": description, "anyOf": [several, {"$ref": "#/$defs/CommandSource"}]}
    scenario["properties"]["commands"] = commands
    definitions[DrivenActor.__name__]["properties"]["commands"] = commands
    return scenario, EditorSchemas(definitions)


def _properties(definitions: Schema, model: type[BaseModel]) -> Schema:
    properties: Schema = definitions[_name(model)]["properties"]
    return properties


def _merged(scenario: Schema, schemas: EditorSchemas, of_a_file: tuple[str, ...]) -> Schema:
    """Return the schema of a file whose keys are merged with others."""
    described = scenario["properties"]
    commands = described["commands"]
    several, _ = commands["anyOf"]
    shared = {**commands, "anyOf": [several, {"$ref": "#/$defs/SharedCommands"}]}
    keys = {key: value for key, value in described.items() if key not in _OF_A_FILE} | {"commands": shared}
    entry = schemas.partial({"type": "object", "properties": keys, "additionalProperties": False})
    properties = entry["properties"] | {key: described[key] for key in of_a_file}
    if "scenarios" in of_a_file:
        properties["scenarios"] = _list(described["scenarios"]["description"], schemas.define("ScenarioEntry", entry))
    return {**entry, "properties": {key: properties[key] for key in described if key in properties}}


def _models(added: Added = MappingProxyType({})) -> tuple[Schema, Schema]:
    """Return the schema of one scenario and the definitions that it refers to."""
    assertions, sensors = (_kinds(table, added) for table in (ASSERTIONS, SENSORS))
    families = [table.load(name) for table in (ASSERTIONS, COMMANDS, DRIVES, SENSORS) for name in table]
    models: list[type[BaseModel]] = [Scenario, EventKeys, ConditionOptions, ExpectationOptions, Mounting, *families]
    _, schema = models_json_schema(
        [(model, "validation") for model in models], ref_template="#/$defs/{model}", schema_generator=_Untitled
    )
    definitions = schema["$defs"]
    for kind in (kind for kinds in added.values() for kind in kinds.values()):
        definitions |= _definitions_of(kind)
    for definition in definitions.values():
        definition.pop("title", None)
    scenario = definitions.pop(Scenario.__name__)
    scenario["properties"]["expect"]["items"] = {"$ref": "#/$defs/Expectation"}
    scenario["properties"]["sensors"]["items"] = {"$ref": "#/$defs/Sensor"}
    scenario["properties"]["commands"] = _commands(scenario["properties"]["commands"]["description"], added)
    definitions["Expectation"] = _one_of(assertions, definitions.pop(ExpectationOptions.__name__)["properties"])
    _describe_events(scenario, definitions, assertions)
    definitions |= _combined_assertions(definitions, assertions)
    definitions["Sensor"] = _one_of(sensors, definitions.pop(Mounting.__name__)["properties"])
    for name in COMMANDS:
        _let_map_hold_keys(name, COMMANDS.load(name), definitions)
    _let_world_name_robot(scenario, definitions["DrivenRobot"])
    robot = definitions["DrivenRobot"]["properties"]
    robot["drive"] = {"description": robot["drive"]["description"], **_choice(_drive_keys())}
    actor = definitions[DrivenActor.__name__]["properties"]
    several = _list(actor["sensors"]["description"], {"$ref": "#/$defs/Sensor"})
    described = several.pop("description")
    actor |= {
        "drive": robot["drive"],
        "commands": scenario["properties"]["commands"],
        "sensors": {"description": described, "anyOf": [several, {"enum": ["standard"]}]},
    }
    return scenario, definitions


def _describe_events(scenario: Schema, definitions: Schema, assertions: Kinds) -> None:
    """Let events have conditions, which are assertions, times or other events, and actions, one of which is a word."""
    scenario["properties"]["events"]["items"] = _ref(EventKeys)
    options = definitions.pop(ConditionOptions.__name__)["properties"]
    condition = _one_of(assertions, {key: options.pop(key) for key in ("for", "since")})
    choice = condition["anyOf"][-1]
    choice["properties"] |= options
    choice["oneOf"] += [{"required": [key]} for key in options]
    when = definitions[EventKeys.__name__]["properties"]["when"]
    definitions["Condition"] = {"description": when["description"], **condition}
    definitions[EventKeys.__name__]["properties"]["when"] = {"$ref": "#/$defs/Condition"}
    action = definitions[Action.__name__]
    words = {"description": action["description"], "anyOf": [{"enum": ["end"]}, _choice(action["properties"])]}
    definitions[Action.__name__] = words


def _kinds(table: Table[Any], added: Added) -> Kinds:
    return {**{name: table.load(name) for name in table}, **added.get(table.kind, {})}


def _definitions_of(kind: type[BaseModel]) -> Schema:
    """Return the definitions of a class of an installed package; their names differ from all others. Empty: none."""
    prefix = _prefix(kind)
    try:
        schema = kind.model_json_schema(ref_template=f"#/$defs/{prefix}{{model}}", schema_generator=_Untitled)
    except (PydanticUserError, ValueError, TypeError):  # a field of a type that JSON does not have
        return {}
    inner = {f"{prefix}{name}": definition for name, definition in schema.pop("$defs", {}).items()}
    return {**inner, _name(kind): {"description": "", **schema}}


def _prefix(kind: type[BaseModel]) -> str:
    return "" if kind.__module__.startswith("sim_action.") else f"{getattr(kind, 'key', '')}."


def _name(kind: type[BaseModel]) -> str:
    return f"{_prefix(kind)}{kind.__name__}"


_KEYWORDS: Final[Mapping[str, frozenset[str]]] = {
    "string": frozenset({"minLength", "maxLength", "pattern"}),
    "array": frozenset({"items", "minItems", "maxItems"}),
}
"""The keywords of JSON Schema for each type that the value of a command source may have."""


def _let_map_hold_keys(name: str, kind: type[CommandSource], definitions: Schema) -> None:
    """Let the keys of a command source be written in a map below its own key."""
    if kind.map_key is None:
        return
    properties = _properties(definitions, kind)
    own = properties[name]
    types = own["type"] if isinstance(own.get("type"), list) else [own.get("type")]
    others = {key: part for key, part in properties.items() if key != name}
    definition = definitions[kind.__name__]
    if needed := [key for key in definition["required"] if key != name]:
        definition["required"] = [name]
        definition["if"] = {"properties": {name: {"type": "object"}}}
        definition["else"] = {"required": needed, "properties": {key: {} for key in needed}}
    whole = {
        "type": "object",
        "properties": {kind.map_key: own, **others},
        "required": [kind.map_key, *needed],
        "additionalProperties": False,
    }
    values = {key: part for key, part in own.items() if key not in ("type", "description")}
    alone = [{"type": kind, **{key: values[key] for key in values if key in _KEYWORDS[kind]}} for kind in types]
    properties[name] = {"description": own["description"], "anyOf": [*alone, whole]}


def _let_world_name_robot(scenario: Schema, robot: Schema) -> None:
    """Require `robot.model` only if `world.robot` names no model of a world file."""
    scenario["required"].remove("robot")
    robot["required"].remove("model")
    if not robot["required"]:
        del robot["required"]
    in_world: Schema = {"type": "object", "required": ["file", "robot"], "properties": {"file": {}, "robot": {}}}
    # Editors offer the words of this branch, so it repeats the schema of the key.
    of_robot: Schema = {"type": "object", "required": ["model"], "properties": {"model": robot["properties"]["model"]}}
    scenario["if"] = {"required": ["world"], "properties": {"world": in_world}}
    scenario["else"] = {"required": ["robot"], "properties": {"robot": of_robot}}


def _combined_assertions(definitions: Schema, assertions: Kinds) -> Schema:
    """Assertions that consist of others, which have no options of their own."""
    part = {"$ref": f"#/$defs/{Assertion.__name__}"}
    kinds = [kind for kind in assertions.values() if issubclass(kind, Combined)]
    combined = {
        kind.__name__: {"description": definitions[kind.__name__]["description"], **kind.value_schema(part)}
        for kind in kinds
    }
    return {Assertion.__name__: _one_of(assertions, {}), **combined}


def _list(description: str, items: Schema) -> Schema:
    return {"description": description, "type": "array", "minItems": 1, "items": items}


_OF_A_FILE: Final = ("extends", "scenarios")
_COMPLETING: Final = (*_OF_A_FILE, "variations")  # the keys that may supply what a file itself does not have


def _described(definition: Schema) -> Schema:
    """Return a definition with properties described by its docstring. All are written; later versions may add some."""
    if "properties" not in definition:
        return definition
    described = {name: value for name, value in definition.items() if name not in {"title", "additionalProperties"}}
    described["description"], _, attributes = definition["description"].partition("\n\nAttributes:\n")
    properties = {name: dict(schema) for name, schema in definition["properties"].items()}
    for name, text in re.findall(r"^ *(\w+): (.+)$", attributes, re.MULTILINE):
        properties[name]["description"] = text
    return {**described, "properties": properties, "required": list(properties)}


def _commands(description: str, added: Added) -> Schema:
    source = {"anyOf": [_ref(kind) for kind in _kinds(COMMANDS, added).values()]}
    return {"description": description, "anyOf": [source, {"type": "array", "items": source}]}


def _drive_keys() -> Schema:
    return {name: _ref(DRIVES.load(name)) for name in DRIVES}


def _one_of(kinds: Kinds, options: Schema) -> Schema:
    """Return the schema of a name alone, if it needs nothing more, or of a map with the name and options."""
    alone = [name for name, kind in kinds.items() if _needs_nothing(kind)]
    specs: Schema = {name: _value(kind) for name, kind in kinds.items()}
    for name in alone:
        specs[name] = {"anyOf": [specs[name], {"type": "null"}]}
    return {"anyOf": [{"enum": alone}, _choice(specs, options)]}


def _value(model: type[BaseModel]) -> Schema:
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
    except ValueError:
        return False
    return True


def _ref(model: type[BaseModel]) -> Schema:
    return {"$ref": f"#/$defs/{_name(model)}"}


SCHEMAS: Final[Mapping[str, Callable[[], Schema]]] = {
    "scenario": scenario_schema,
    "base": base_schema,
    "results": results_schema,
    "proof": proof_schema,
}
"""Each schema by the name that `sim-action schema` and the published files have for it."""
