"""Runs a list of steps, those of a job or those of a composite action: they differ only in what they may use."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Final

from tests.integration.github.documents import mapping
from tests.integration.github.errors import StepFailed, UnsupportedFeature
from tests.integration.github.expressions import Status, evaluate, holds
from tests.integration.github.machine import Machine
from tests.integration.github.results import StepResult
from tests.integration.github.scripts import Finished, Script, run_script
from tests.integration.github.values import Known, Value, to_text

_KEYS: Final = frozenset({"name", "id", "if", "env", "continue-on-error"})
_RUN_KEYS: Final = _KEYS | {"run", "shell"}
_USES_KEYS: Final = _KEYS | {"uses", "with"}


@dataclass(frozen=True, slots=True)
class Use:
    """What a step uses, and what it hands over."""

    machine: Machine
    uses: str
    inputs: Mapping[str, str]
    environment: Mapping[str, str]
    contexts: Mapping[str, Value]


@dataclass(slots=True)
class Steps:
    """A list of steps, and how far it has come."""

    machine: Machine
    steps: Sequence[Value]
    contexts: Mapping[str, Value]  # beside those of the machine and of the steps themselves
    use: Callable[[Use], Finished]  # runs what a step uses. Raises StepFailed.
    environment: Mapping[str, str] = field(default_factory=dict)  # for these steps, beside the machine's
    is_job: bool = False  # they are a job's own steps, which need not name a shell
    results: list[StepResult] = field(default_factory=list)

    def run(self) -> None:
        """Runs the steps, each if its `if` says so. Raises UnsupportedFeature."""
        for number, step in enumerate(self.steps, 1):
            self.results.append(self._result(self._checked(step, number)))

    @property
    def status(self) -> str:
        """success, failure or cancelled: of these steps alone."""
        conclusions = {result.conclusion for result in self.results}
        return next((status for status in ("cancelled", "failure") if status in conclusions), "success")

    @property
    def exit_code(self) -> int:
        """Of the first step that failed and was not forgiven."""
        return next((result.exit_code for result in self.results if result.conclusion in {"failure", "cancelled"}), 0)

    def all_contexts(self, given: Mapping[str, str] | None = None) -> dict[str, Value]:
        """What an expression may ask for, in a step that was given an environment of its own or after the last one."""
        ids = (to_text(step.get("id")) for step in self.steps if isinstance(step, Mapping))
        names: dict[str, Value] = {name: None for name in ids if name}
        done: dict[str, Value] = {result.id: _as_context(result) for result in self.results if result.id}
        environment = {**self.machine.environment, **self.environment, **(given or {})}
        return {**self.machine.contexts, **self.contexts, "env": environment, "steps": Known({**names, **done})}

    def _checked(self, step: Value, number: int) -> Mapping[str, Value]:
        where = f"step {number}"
        checked = mapping(step, where, _USES_KEYS if "uses" in mapping(step, where) else _RUN_KEYS)
        if "uses" not in checked and "run" not in checked:
            raise UnsupportedFeature(f"{where}: neither run nor uses")
        if "run" in checked and not self.is_job and "shell" not in checked:
            raise UnsupportedFeature(f"{where}: a composite action must name the shell")
        return checked

    def _result(self, step: Mapping[str, Value]) -> StepResult:
        identity = to_text(step.get("id"))
        environment = _texts(step.get("env"), self.all_contexts())
        contexts = self.all_contexts(environment)
        if not holds(step.get("if"), contexts, self._asked()):
            return StepResult(_name(step), identity, "skipped", "skipped")
        finished = self._finished(step, contexts, environment)
        outcome = self._outcome(finished)
        forgiven = _flag(step.get("continue-on-error", False)) and outcome == "failure"
        return StepResult(
            name=_name(step, partial(evaluate, contexts=contexts)),
            id=identity,
            outcome=outcome,
            conclusion="success" if forgiven else outcome,
            outputs=finished.outputs,
            exit_code=finished.exit_code,
        )

    def _asked(self) -> Status:
        return Status(self.status == "success", self.status == "failure", self.status == "cancelled")

    def _outcome(self, finished: Finished) -> str:
        if finished.exit_code == 0:
            return "success"
        return "cancelled" if self.machine.out_of_time else "failure"

    def _finished(
        self, step: Mapping[str, Value], contexts: Mapping[str, Value], environment: Mapping[str, str]
    ) -> Finished:
        try:
            if "uses" in step:
                inputs = _texts(step.get("with"), contexts)
                given = {**self.environment, **environment}
                return self.use(Use(self.machine, to_text(step["uses"]), inputs, given, contexts))
            return run_script(self.machine, self._script(step, contexts, environment))
        except StepFailed as failure:
            self.machine.record.complain(str(failure))
            return Finished(1, {})

    def _script(
        self, step: Mapping[str, Value], contexts: Mapping[str, Value], environment: Mapping[str, str]
    ) -> Script:
        return Script(
            text=evaluate(to_text(step["run"]), contexts),
            shell=to_text(step.get("shell")),
            variables={**self.environment, **environment},
            github=mapping(contexts["github"], "github"),
        )


def _name(step: Mapping[str, Value], text: Callable[[str], str] = str) -> str:
    if "name" in step:
        return text(to_text(step["name"]))
    does = text(to_text(step.get("uses", step.get("run")))).strip()
    return " ".join(["Run", *does.splitlines()[:1]])


def _texts(values: Value, contexts: Mapping[str, Value]) -> dict[str, str]:
    return {name: evaluate(to_text(value), contexts) for name, value in mapping(values, "env or with").items()}


def _flag(value: Value) -> bool:
    if not isinstance(value, bool):
        raise UnsupportedFeature(f"{value!r} where true or false is due")
    return value


def _as_context(result: StepResult) -> Known:
    return Known(outputs=result.outputs, outcome=result.outcome, conclusion=result.conclusion)
