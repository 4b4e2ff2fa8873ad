"""What starts a workflow, and the inputs that it then has."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from tests.integration.github.documents import mapping, one_or_more, sequence
from tests.integration.github.errors import UnsupportedFeature
from tests.integration.github.expressions import evaluate
from tests.integration.github.values import Known, Value, to_text

# What an event may be said to need: who calls this says that there was one, and thereby that it is on the branch.
_KEYS: Final = {
    "push": {"branches"},
    "pull_request": set[str](),
    "workflow_call": {"inputs", "outputs"},
    "workflow_dispatch": set[str](),
    "schedule": set[str](),
}
_INPUT_KEYS: Final = ("description", "default", "type")


def trigger(on: Value, event_name: str) -> Mapping[str, Value]:
    """What a workflow's `on` says of an event. Raises UnsupportedFeature if that does not start it."""
    events = mapping(on, "on", _KEYS) if isinstance(on, Mapping) else dict.fromkeys(one_or_more(on))
    if event_name not in events:
        raise UnsupportedFeature(f"the event {event_name} does not start this workflow, but {', '.join(events)}")
    if event_name == "schedule" and isinstance(on, Mapping):
        for time in sequence(events["schedule"], "schedule"):
            mapping(time, "schedule", {"cron", "timezone"})
        return {}
    return mapping(events[event_name], event_name, _KEYS.get(event_name, ()))


def resolved_inputs(declared: Value, given: Mapping[str, Value], github: Known) -> Known:
    """The inputs of a workflow that is called. Raises UnsupportedFeature."""
    specs = {name: mapping(spec, name, _INPUT_KEYS) for name, spec in mapping(declared, "inputs").items()}
    if unknown := given.keys() - specs.keys():
        raise UnsupportedFeature(f"unexpected inputs: {', '.join(sorted(unknown))}")
    return Known({name: _value(name, spec, given, github) for name, spec in specs.items()})


def _value(name: str, spec: Mapping[str, Value], given: Mapping[str, Value], github: Known) -> Value:
    if spec.get("type") != "string":
        raise UnsupportedFeature(f"the input {name} is of the type {spec.get('type')}")
    value = given.get(name, evaluate(to_text(spec.get("default")), {"github": github}))
    if not isinstance(value, str):
        raise UnsupportedFeature(f"the input {name} is text, and not {value!r}")
    return value
