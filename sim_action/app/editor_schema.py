"""JSON Schemas in the form that editors and validators need, made from the schemas of pydantic.

The result is draft-07, which all editors know, and passes the strict mode of ajv. `if`/`then` or a key selects an
alternative before it is checked, so that an editor reports one short problem at the right line, and not all
alternatives.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any, Final

from sim_action.core.field_types import END_OF_TEXT, pattern_at_least

Schema = dict[str, Any]
DIALECT: Final = "http://json-schema.org/draft-07/schema#"
_PARTIAL: Final = "Partial"
_NULL: Final[Schema] = {"type": "null"}
_BOUNDS: Final = {"gt": "exclusiveMinimum", "ge": "minimum", "lt": "exclusiveMaximum", "le": "maximum"}
_OF_NUMBERS: Final = tuple(sorted(_BOUNDS.values()))


class EditorSchemas:
    """The conversion of schemas that share definitions."""

    def __init__(self, definitions: Mapping[str, Schema]) -> None:
        """Take the definitions in the form of pydantic; definitions of partial maps are added when they are needed."""
        self._definitions = dict(definitions)

    def document(self, head: Schema, root: Schema) -> Schema:
        """Return a whole schema: a root in the form of pydantic, converted, with the definitions that it needs."""
        converted = self._converted(root)
        used = reachable(converted, lambda name: self._converted(self._definitions[name]))
        return {"$schema": DIALECT, **head, **converted, "definitions": used}

    def define(self, name: str, schema: Schema) -> Schema:
        """Add a definition; return the reference to it. Raise ValueError if the name has another meaning."""
        if self._definitions.setdefault(name, schema) != schema:
            raise ValueError(f"two definitions have the name {name}")
        return {"$ref": f"#/$defs/{name}"}

    def partial(self, schema: Schema) -> Schema:
        """Return the schema of a map that is merged with others: no key is required, and null removes a key."""
        if "$ref" in schema:
            name = _name(schema["$ref"])
            partial = _PARTIAL + name
            if partial not in self._definitions:
                self._definitions[partial] = {}
                self._definitions[partial] = self.partial(self._definitions[name])
            return {**schema, "$ref": f"#/$defs/{partial}"}
        if "anyOf" in schema:
            return {**schema, "anyOf": [self.partial(branch) for branch in schema["anyOf"]]}
        changed = {key: value for key, value in schema.items() if key not in ("required", "oneOf")}
        if "properties" in schema:
            changed["properties"] = {key: self._removable(value) for key, value in schema["properties"].items()}
        if isinstance(schema.get("additionalProperties"), dict):
            changed["additionalProperties"] = self._removable(schema["additionalProperties"])
        return changed

    def _removable(self, schema: Schema) -> Schema:
        partial = self.partial(schema)
        if not partial.keys() - {"description", "default"} or "null" in self._types(partial):
            return partial
        note = {key: partial.pop(key) for key in ("description",) if key in partial}
        return {**note, "anyOf": [partial, _NULL]}

    def _types(self, schema: Schema) -> frozenset[str]:
        """Return the JSON types that a schema accepts; empty if it accepts all."""
        if "$ref" in schema:
            return self._types(self._definitions[_name(schema["$ref"])])
        if "anyOf" in schema:
            return frozenset[str]().union(*(self._types(branch) for branch in schema["anyOf"]))
        if "type" in schema:
            return frozenset(schema["type"] if isinstance(schema["type"], list) else [schema["type"]])
        if "enum" in schema:
            return frozenset({"string"} if all(isinstance(value, str) for value in schema["enum"]) else ())
        return frozenset()

    def _converted(self, schema: Any) -> Any:
        if not isinstance(schema, dict):
            return schema
        if isinstance(kinds := schema.get("type"), list):
            schema = {**_notes(schema), "anyOf": [{"type": kind} for kind in kinds]}
        schema = self._with_text(_with_bounds_inside(schema))
        if "$ref" in schema:
            return {**_notes(schema), "$ref": f"#/definitions/{_name(schema['$ref'])}"}
        if "anyOf" in schema and "properties" not in schema:
            return {**_notes(schema), **self._alternatives(schema["anyOf"])}
        converted = _notes(schema)
        for key, value in schema.items():
            converted |= self._keyword(key, value)
        if "enum" in converted and "type" not in converted and (types := self._types(converted)):
            converted["type"] = next(iter(types))
        if named := [branch["required"][0] for branch in schema.get("oneOf", ())]:
            converted |= _one_kind(named, [key for key in schema["properties"] if key not in named])
        return converted

    def _keyword(self, key: str, value: Any) -> Schema:
        if key in ("title", "default", "oneOf"):
            return {}
        if key == "pattern":
            return {key: (value if value.endswith(END_OF_TEXT) else re.sub(r"[$]$", r"(?!\\n)$", value))}
        if key == "properties":
            return {key: {name: self._converted(subschema) for name, subschema in value.items()}}
        if key == "prefixItems":
            return {"items": [self._converted(subschema) for subschema in value], "additionalItems": False}
        is_schema = key in ("if", "then", "else", "items", "additionalProperties")
        return {key: self._converted(value) if is_schema else value}

    def _alternatives(self, branches: Iterable[Schema]) -> Schema:
        """Return a choice by the type of the value, which is the last branch for other types."""
        flat = list(_flattened(branches))
        others = [branch for branch in flat if branch != _NULL]
        types = [self._types(branch) for branch in others]
        if types == [frozenset({"number"}), frozenset({"string"})] and "description" in others[1]:
            return self._quantity(*others, is_optional=len(others) < len(flat))
        if any(len(kinds) != 1 for kinds in types) or len(frozenset().union(*types)) < len(types):
            return {"anyOf": [self._converted(branch) for branch in flat]}
        *first, last = sorted(others, key=lambda branch: _ORDER.index(next(iter(self._types(branch)))))
        chosen = self._converted(last)
        for branch in reversed(first):
            kind = next(iter(self._types(branch)))
            chosen = {"if": {"type": kind}, "then": self._converted(branch), "else": chosen}
        return {"anyOf": [chosen, _NULL]} if len(others) < len(flat) else chosen

    def _with_text(self, schema: Schema) -> Schema:
        if "properties" not in schema:
            return schema
        return {**schema, "properties": {key: self._described(value) for key, value in schema["properties"].items()}}

    def _described(self, schema: Schema) -> Schema:
        branches = schema.get("anyOf", ())
        of_branches = (
            self._definitions[_name(branch["$ref"])].get("description") for branch in branches if "$ref" in branch
        )
        parts = [schema.get("description") or next(of_branches, None), next(_quantities(schema), None)]
        if isinstance(default := schema.get("default"), str | int | float):
            parts.append(f"default: {str(default).lower() if isinstance(default, bool) else default}")
        text = "\n\n".join(part for part in parts if part)
        return {**schema, "description": text} if text else schema

    def _quantity(self, number: Schema, text: Schema, *, is_optional: bool) -> Schema:
        units = text["description"].partition("units: ")[2]
        bounds = [f"{key} {number[key]:g}" for key in _OF_NUMBERS if key in number]
        name = re.sub(r"[^\w.+-]+", "_", "_".join(("Quantity", units, *bounds)))
        pattern = {"type": "string", "pattern": text["pattern"]}
        converted: Schema = self._converted(
            self.define(name, {"if": {"type": "string"}, "then": pattern, "else": number})
        )
        return {"if": {"not": _NULL}, "then": converted} if is_optional else converted


_ORDER: Final = ("string", "boolean", "array", "integer", "number", "object")


def reachable(root: Schema, definition: Callable[[str], Schema]) -> dict[str, Schema]:
    """Return the definitions that a schema refers to, directly or by others, by name and sorted."""
    used: dict[str, Schema] = {}
    waiting = [root]
    while waiting:
        for name in set(_references(waiting.pop())) - used.keys():
            used[name] = definition(name)
            waiting.append(used[name])
    return dict(sorted(used.items()))


def chosen_by_key(kinds: Mapping[str, Schema], shared: Mapping[str, Schema]) -> Schema:
    """Return a choice of maps by the key that only one of them has, in the form of pydantic.

    Without such a key, one is missing, and `shared` has all the keys that can be meant.
    """
    chosen: Schema = {
        "type": "object",
        "properties": {key: {"description": key_schema.get("description", "")} for key, key_schema in shared.items()},
        "additionalProperties": False,
        **_with_a_kind([*kinds], [key for key in shared if key not in kinds]),
    }
    for kind, schema in reversed([*kinds.items()]):
        chosen = {"if": {"required": [kind], "properties": {kind: {}}}, "then": schema, "else": chosen}
    return {"type": "object", **chosen}


def _one_kind(kinds: Sequence[str], options: Collection[str]) -> Schema:
    """Return the keywords that demand exactly one of some keys, and report a second one at its place."""
    alone = {
        kind: {"properties": {key: {} for key in (kind, *options)}, "additionalProperties": False} for kind in kinds
    }
    return {**_with_a_kind(kinds, options), "dependencies": alone}


def _with_a_kind(kinds: Sequence[str], options: Collection[str]) -> Schema:
    """Return the keywords that demand a kind where there are only options. A misspelt kind has a message of its own."""
    first = kinds[0]
    if not options:
        return {"minProperties": 1}
    return {"if": {"propertyNames": {"enum": [*options]}}, "then": {"required": [first], "properties": {first: {}}}}


def _with_bounds_inside(schema: Schema) -> Schema:
    """Return a choice whose numbers have the bounds that stand outside of it; its texts have no refused sign."""
    schema = {_BOUNDS.get(key, key): value for key, value in schema.items()}
    if "anyOf" not in schema:
        return schema
    outside = {key: schema.pop(key) for key in _OF_NUMBERS if key in schema}
    branches = [_with_bounds_inside({**branch, **_for_branch(branch, outside)}) for branch in schema["anyOf"]]
    number = next((branch for branch in branches if branch.get("type") == "number"), {})
    for key in ("minimum", "exclusiveMinimum"):
        if key in number:
            exclusive = key == "exclusiveMinimum"
            branches = [_without_signs(branch, number[key], exclusive=exclusive) for branch in branches]
    return {**schema, "anyOf": branches}


def _for_branch(branch: Schema, bounds: Schema) -> Schema:
    return bounds if branch.get("type") == "number" or "anyOf" in branch else {}


def _without_signs(branch: Schema, bound: float, *, exclusive: bool) -> Schema:
    if not isinstance(pattern := branch.get("pattern"), str):
        return branch
    return {**branch, "pattern": pattern_at_least(pattern, bound, exclusive=exclusive)}


def _quantities(schema: Any) -> Iterator[str]:
    """Yield the descriptions of the quantities in a schema, but not in the schemas that it refers to."""
    if isinstance(schema, list):
        for subschema in schema:
            yield from _quantities(subschema)
    elif isinstance(schema, dict):
        if "pattern" in schema and "description" in schema:
            yield schema["description"]
        for key in ("anyOf", "items", "prefixItems", "additionalProperties"):
            yield from _quantities(schema.get(key))


def _notes(schema: Schema) -> Schema:
    return {"description": schema["description"]} if schema.get("description") else {}


def _flattened(branches: Iterable[Schema]) -> Iterator[Schema]:
    for branch in branches:
        if branch.keys() == {"anyOf"}:
            yield from _flattened(branch["anyOf"])
        else:
            yield branch


def _name(reference: str) -> str:
    return reference.rpartition("/")[2]


def _references(schema: Any) -> Iterator[str]:
    if isinstance(schema, dict):
        for key, value in schema.items():
            if key == "$ref":
                yield _name(value)
            else:
                yield from _references(value)
    elif isinstance(schema, list):
        for value in schema:
            yield from _references(value)
