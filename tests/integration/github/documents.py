"""Reads actions and workflows: YAML 1.2 as GitHub reads it, and every key that is not expected is refused."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import yaml

from tests.integration.github.errors import UnsupportedFeature
from tests.integration.github.values import Value, is_array, to_text


class _Loader(yaml.SafeLoader):
    """YAML 1.2: `on` and `yes` are text, 1:30 and 010 are no surprise; no key is there twice."""

    yaml_implicit_resolvers: dict[str, list[tuple[str, re.Pattern[str]]]] = {}  # noqa: RUF012 - PyYAML's own type


def _mapping(loader: _Loader, node: yaml.MappingNode) -> dict[str, Value]:
    keys = [str(loader.construct_object(key, deep=True)) for key, _ in node.value]
    if len(set(keys)) < len(keys):
        raise UnsupportedFeature(f"a key is there twice among {', '.join(keys)}")
    return dict(zip(keys, (loader.construct_object(value, deep=True) for _, value in node.value), strict=True))


def _integer(loader: _Loader, node: yaml.ScalarNode) -> int:
    return int(node.value, 0) if node.value[:2] in {"0x", "0o"} else int(node.value)


_Loader.add_constructor("tag:yaml.org,2002:map", _mapping)
_Loader.add_constructor("tag:yaml.org,2002:int", _integer)
for tag, pattern in {
    "null": r"~|null|Null|NULL|",
    "bool": r"true|True|TRUE|false|False|FALSE",
    "int": r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+",
    "float": r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?",
}.items():
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{tag}", re.compile(f"(?:{pattern})$"), None)


def load(file: Path) -> Mapping[str, Value]:
    """A document, which is a mapping. Raises UnsupportedFeature."""
    return mapping(yaml.load(file.read_text(encoding="utf-8"), _Loader), str(file))


def mapping(value: Value, where: str, allowed: Collection[str] | None = None) -> Mapping[str, Value]:
    """What must be a mapping, of allowed keys only; nothing counts as an empty one. Raises UnsupportedFeature."""
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise UnsupportedFeature(f"{where}: {value!r} is no mapping")
    if allowed is not None and (unknown := value.keys() - set(allowed)):
        raise UnsupportedFeature(f"{where}: the key {', '.join(sorted(unknown))} is not known")
    return value


def sequence(value: Value, where: str) -> Sequence[Value]:
    """What must be a list. Raises UnsupportedFeature."""
    if not is_array(value):
        raise UnsupportedFeature(f"{where}: {value!r} is no list")
    return value


def one_or_more(value: Value) -> list[str]:
    """What may be one text or a list of them."""
    if value is None:
        return []
    return [to_text(item) for item in value] if is_array(value) else [to_text(value)]
