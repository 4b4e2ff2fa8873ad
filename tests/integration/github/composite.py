"""Composite actions: action.yml + inputs -> steps -> outputs."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from tests.integration.github.documents import load, mapping, sequence
from tests.integration.github.errors import UnsupportedFeature
from tests.integration.github.expressions import evaluate
from tests.integration.github.machine import Machine
from tests.integration.github.scripts import Finished
from tests.integration.github.steps import Steps, Use
from tests.integration.github.values import Known, Value, to_text

_KEYS: Final = frozenset({"name", "author", "description", "branding", "inputs", "outputs", "runs"})
_INPUT_KEYS: Final = frozenset({"description", "required", "default", "deprecationMessage"})
_OUTPUT_KEYS: Final = frozenset({"description", "value"})
_SHARED: Final = ("matrix",)  # of what a step can ask for, an action sees no more than this


@dataclass(frozen=True, slots=True)
class Action:
    """An action in a folder; without repository and version it is one of the workflow's own."""

    folder: Path
    repository: str = ""
    version: str = ""


def run_composite(
    action: Action, machine: Machine, use: Callable[[Use], Finished], asked: Use
) -> tuple[Steps, dict[str, str]]:
    """Runs the steps of an action, and says what its outputs are. Raises UnsupportedFeature."""
    document = mapping(load(action.folder / "action.yml"), "action.yml", _KEYS)
    runs = mapping(document["runs"], "runs", {"using", "steps"})
    if runs["using"] != "composite":
        raise UnsupportedFeature(f"runs.using: {runs['using']}")
    contexts: dict[str, Value] = {name: asked.contexts[name] for name in _SHARED if name in asked.contexts}
    contexts["github"] = _github(machine, action)
    declared = mapping(document.get("inputs"), "inputs").items()
    specs = {name: mapping(spec, name, _INPUT_KEYS) for name, spec in declared}
    _warn_of_unexpected(machine, specs, asked.inputs)
    contexts["inputs"] = _inputs(specs, asked.inputs, {**machine.contexts, **contexts})
    steps = Steps(machine, sequence(runs["steps"], "steps"), contexts, use, asked.environment)
    steps.run()
    return steps, _outputs(document.get("outputs"), steps)


def _github(machine: Machine, action: Action) -> Known:
    own = {"action_path": str(action.folder), "action_repository": action.repository, "action_ref": action.version}
    return Known({**machine.github, **own})


def _inputs(specs: Mapping[str, Mapping[str, Value]], given: Mapping[str, str], contexts: Mapping[str, Value]) -> Known:
    """GitHub does not enforce `required`: an input that is not given and has no default is empty."""
    defaults = {name: evaluate(to_text(spec.get("default")), contexts) for name, spec in specs.items()}
    declared = {name.lower(): name for name in specs}
    return Known({**defaults, **{declared.get(name.lower(), name): value for name, value in given.items()}})


def _warn_of_unexpected(machine: Machine, specs: Collection[str], given: Collection[str]) -> None:
    """The runner's own words; names of inputs have no case."""
    declared = {name.lower() for name in specs}
    if unexpected := [name for name in given if name.lower() not in declared]:
        names, valid = "', '".join(unexpected), "', '".join(specs)
        machine.record.complain(f"Unexpected input(s) '{names}', valid inputs are ['{valid}']", "warning")


def _outputs(declared: Value, steps: Steps) -> dict[str, str]:
    """They are handed on although a step failed; what a step did not say is empty."""
    specs = {name: mapping(spec, name, _OUTPUT_KEYS) for name, spec in mapping(declared, "outputs").items()}
    contexts = steps.all_contexts()
    return {name: evaluate(to_text(spec["value"]), contexts) for name, spec in specs.items()}
