"""Actions of others are not run: something that does as they do stands in for each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from tests.integration.github.errors import StepFailed, UnsupportedFeature
from tests.integration.github.machine import Machine
from tests.integration.github.scripts import Finished
from tests.integration.github.values import KnownOutputs

NO_OUTPUTS: Final[Mapping[str, str]] = {}
_PATTERN: Final = frozenset("*?[]{}()!,\n")
_TRUE: Final = frozenset({"true", "True", "TRUE"})
_FALSE: Final = frozenset({"false", "False", "FALSE"})


@dataclass(frozen=True, slots=True)
class StandIn:
    """What stands in for an action."""

    # what the action does with all its inputs; what it returns are the outputs that are known here
    does: Callable[[Machine, Mapping[str, str]], Mapping[str, str]]
    required: tuple[str, ...] = ()  # inputs that the action does not start without
    defaults: Mapping[str, str] = field(default_factory=dict)  # of all other inputs that are known here

    def use(self, machine: Machine, given: Mapping[str, str]) -> Finished:
        """Raises StepFailed and UnsupportedFeature."""
        if unknown := given.keys() - {*self.required, *self.defaults}:
            raise UnsupportedFeature(f"inputs of an action that is not run here: {', '.join(sorted(unknown))}")
        inputs = {**self.defaults, **{name: value.strip() for name, value in given.items()}}
        if missing := [name for name in self.required if not inputs.get(name)]:
            raise StepFailed(f"Input required and not supplied: {missing[0]}")
        return Finished(0, KnownOutputs(self.does(machine, inputs)))


def boolean(text: str) -> bool:
    """An input that is true or false. Raises StepFailed."""
    if text not in _TRUE | _FALSE:
        raise StepFailed(f"Input does not meet YAML 1.2 Core Schema specification: {text}")
    return text in _TRUE


def one_path(machine: Machine, text: str) -> Path:
    """The path that an input names. Raises UnsupportedFeature for patterns and lists of them."""
    if not text or _PATTERN.intersection(text):
        raise UnsupportedFeature(f"the path {text!r}")
    return machine.home / text.removeprefix("~/") if text.startswith("~/") else machine.workspace / text
