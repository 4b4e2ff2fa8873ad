"""Values that fit a JSON Schema, as the models of scenarios write it, drawn by chance."""

from __future__ import annotations

import re
from typing import Any, Final

from tests.fuzz.urdf_texts import Chance

_DEEPEST: Final = 6
_MOST: Final = 3
_WORDS: Final[dict[str, tuple[str, ...]]] = {
    "model": ("turtlebot3_burger",), "link": ("base_link", "base_footprint", "wheel_left_link"),
    "joint": ("wheel_left_joint", "wheel_right_joint"), "body": ("wall", "ground"), "name": ("wall", "a", "b"),
    "sensor": ("lidar",), "parent": ("base_link",),
}  # fmt: skip
"""Key -> texts that are likely to mean something there."""
_TEXTS: Final = ("wall", "base_link", "lidar", "1 s", "1 m", "10 Hz", "5 deg", "0.5", "x", "a.csv", "world")


def value(schema: Any, root: dict[str, Any], chance: Chance, key: str = "", depth: int = 0) -> Any:
    """Return a value for a schema; `root` has its definitions, `key` is the key in front of it."""
    schema = _resolved(schema, root, chance)
    if "const" in schema:
        return schema["const"]
    if "enum" in schema:
        return chance.choice(schema["enum"])
    kind = schema.get("type")
    kind = chance.choice(kind) if isinstance(kind, list) else kind
    if kind == "object" or "properties" in schema:
        return _object(schema, root, chance, depth)
    return _array(schema, root, chance, key, depth) if kind == "array" else _plain(schema, kind, chance, key)


def _resolved(schema: Any, root: dict[str, Any], chance: Chance) -> dict[str, Any]:
    """The schema behind references, with one of its alternatives."""
    while isinstance(schema, dict):
        if "$ref" in schema:
            schema = root["$defs"][schema["$ref"].rpartition("/")[2]]
            continue
        several = next((name for name in ("anyOf", "oneOf", "allOf") if name in schema), None)
        if several is None or "properties" in schema:
            return schema
        plain = [each for each in schema[several] if each.get("type") != "null"]
        schema = chance.choice(plain if plain and chance.random() < 0.9 else schema[several])
    return {}


def _object(schema: dict[str, Any], root: dict[str, Any], chance: Chance, depth: int) -> dict[str, Any]:
    known = dict(schema.get("properties", {}))
    needed = list(schema.get("required", ()))
    for branches in (schema[several] for several in ("oneOf", "anyOf") if schema.get(several)):
        branch = chance.choice(branches)
        for other in (name for each in branches if each is not branch for name in each.get("required", ())):
            known.pop(other, None)
        known |= branch.get("properties", {})
        needed += branch.get("required", ())

    others = [name for name in known if name not in needed]
    few = 0 if depth > _DEEPEST else min(len(others), chance.randrange(_MOST + 1))
    chosen = [*needed, *chance.sample(others, few)]
    found = {name: value(known.get(name, {}), root, chance, name, depth + 1) for name in dict.fromkeys(chosen)}
    more = schema.get("additionalProperties")
    if isinstance(more, dict) and more and (not found or chance.random() < 0.5):
        name = chance.choice(("wheel_left_joint", "a", "base_link"))
        found[name] = value(more, root, chance, name, depth + 1)
    return found


def _array(schema: dict[str, Any], root: dict[str, Any], chance: Chance, key: str, depth: int) -> list[Any]:
    if prefix := schema.get("prefixItems"):
        return [value(each, root, chance, key, depth + 1) for each in prefix]
    least = schema.get("minItems", 0)
    most = min(schema.get("maxItems", least + 2), least + 2)
    count = least if depth > _DEEPEST else chance.randint(least, max(least, most))
    return [value(schema.get("items", {}), root, chance, key, depth + 1) for _ in range(count)]


def _plain(schema: dict[str, Any], kind: str | None, chance: Chance, key: str) -> Any:
    if kind in ("number", "integer"):
        low = schema.get("minimum", schema.get("exclusiveMinimum", 0))
        high = schema.get("maximum", schema.get("exclusiveMaximum", low + 10))
        found = chance.choice((low, high, low + 1, 1, 0.5, 2))
        return int(found) if kind == "integer" else found
    if kind == "boolean":
        return chance.random() < 0.5
    if kind == "null":
        return None
    if kind == "string" or kind is None:
        near = next((texts for word, texts in _WORDS.items() if word in key), _TEXTS)
        texts = [
            text for text in (*schema.get("examples", ()), *near, *_TEXTS) if re.search(schema.get("pattern", ""), text)
        ]
        return chance.choice(texts or near)
    return None
