"""What starts a workflow, and the inputs that it then has."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from tests.integration.github.documents import mapping, one_or_more
from tests.integration.github.errors import UnsupportedFeature
from tests.integration.github.expressions import evaluate_value
from tests.integration.github.values import Known, Value, is_array

# The caller says which event there is, and thereby that these let it through.
_FILTERS: Final = (
    *("branches", "branches-ignore", "tags", "tags-ignore", "paths", "paths-ignore", "types"),
    *("workflows", "inputs", "outputs"),
)
_INPUT_KEYS: Final = ("description", "required", "default", "type", "options")
_KINDS: Final[Mapping[str, type]] = {"string": str, "boolean": bool, "number": float, "choice": str}
_EMPTY: Final[Mapping[str, Value]] = {"string": "", "boolean": False, "number": 0, "choice": ""}


def trigger(on: Value, event_name: str) -> Mapping[str, Value]:
    """What a workflow's `on` says of an event. Raises UnsupportedFeature if that does not start it."""
    events = mapping(on, "on") if isinstance(on, Mapping) else dict.fromkeys(one_or_more(on))
    if event_name not in events:
        raise UnsupportedFeature(f"the event {event_name} does not start this workflow, but {', '.join(events)}")
    details = events[event_name]
    return {} if is_array(details) and event_name == "schedule" else mapping(details, event_name, _FILTERS)


def resolved_inputs(declared: Value, given: Mapping[str, Value], github: Known) -> Known:
    """The inputs of a workflow that is called or dispatched. Raises UnsupportedFeature."""
    specs = {name: mapping(spec, name, _INPUT_KEYS) for name, spec in mapping(declared, "inputs").items()}
    if unknown := given.keys() - specs.keys():
        raise UnsupportedFeature(f"unexpected inputs: {', '.join(sorted(unknown))}")
    return Known({name: _checked(name, spec, given, github) for name, spec in specs.items()})


def _checked(name: str, spec: Mapping[str, Value], given: Mapping[str, Value], github: Known) -> Value:
    kind = str(spec.get("type", "string"))
    if kind not in _KINDS:
        raise UnsupportedFeature(f"the input {name} is of the type {kind}")
    if name not in given:
        return _default(name, spec, kind, github)
    value = given[name]
    fits = isinstance(value, _KINDS[kind]) or (kind == "number" and type(value) is int)
    if not fits or (kind == "choice" and value not in one_or_more(spec.get("options"))):
        raise UnsupportedFeature(f"the input {name} is a {kind}, and not {value!r}")
    return value


def _default(name: str, spec: Mapping[str, Value], kind: str, github: Known) -> Value:
    if spec.get("required") is True:
        raise UnsupportedFeature(f"the input {name} is required")
    default = spec.get("default", _EMPTY[kind])
    return evaluate_value(default, {"github": github}) if isinstance(default, str) else default
