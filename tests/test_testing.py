"""`check_assertion` and `check_sensor` find each mistake that they look for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import pytest
from pydantic import ConfigDict

from sim_action import Scenario, Trace, Verdict
from sim_action import testing as module
from sim_action.assertions import ASSERTIONS
from sim_action.core.errors import Location
from sim_action.core.registry import Table
from sim_action.extending import Assertion, Bounds, Monitor, Scene, Signal, SignalMonitor, State, Truth
from sim_action.scenario.model import Expectation
from sim_action.testing import BrokenRules, check_assertion
from tests.traces import START, scene, trace

STEPS = trace([0.1 * step for step in range(200)], x=[0.05 * step for step in range(200)])


class Honest(Assertion):
    """The x coordinate stays below a limit."""

    key: ClassVar[str] = "honest"

    limit: float = 5.0

    @property
    def title(self) -> str:
        return "honest"

    def monitor(self, scene: Scene, start: Any) -> Monitor:
        return SignalMonitor("x", lambda trace: trace.base_position_xyz[:, 0], Bounds("was at", "m", None, self.limit))


@dataclass(frozen=True)
class Last:
    """Judges the last step seen."""

    state: State = State.HOLDS
    passed: Any = True
    measured: Any = 1.0
    margin: Any = None
    message: str = "fine"

    def observe(self, trace: Trace) -> Self:
        return self

    def verdict(self) -> Verdict:
        return Verdict(self.passed, self.measured, None, self.margin, "m", None, self.message)


@dataclass(frozen=True)
class Changing(Last):
    """Changes in observe()."""

    def observe(self, trace: Trace) -> Self:
        object.__setattr__(self, "measured", self.measured + 1.0)
        return self


@dataclass(frozen=True)
class Counting(Last):
    """Counts the calls."""

    def observe(self, trace: Trace) -> Self:
        return replace(self, measured=self.measured + 1.0)


@dataclass(frozen=True)
class Recovering(Last):
    """Is broken for some steps only."""

    def observe(self, trace: Trace) -> Self:
        return replace(self, state=State.BROKEN if 3 < trace.time[-1] < 10 else State.HOLDS)


@dataclass(frozen=True)
class Curved(Last):
    """Gives a curve and a truth of the wrong length."""

    is_momentary: ClassVar[bool] = True

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        return (Signal("x", "m", trace.time, trace.time[1:]),)

    def truth(self, trace: Trace) -> Truth:
        return Truth(trace.time[1:], trace.time[1:] > 0)


@dataclass(frozen=True)
class Doubtful(Last):
    """Gives numbers as truth."""

    def truth(self, trace: Trace) -> Truth:
        return Truth(trace.time, np.zeros(len(trace)))  # type: ignore[arg-type] # that is the mistake


@dataclass(frozen=True)
class Raising(Last):
    """Raises before the first step."""

    def verdict(self) -> Verdict:
        raise ZeroDivisionError("no steps")


def found(kind: type[Assertion], monitor: Monitor | None = None, steps: Trace = STEPS) -> list[str]:
    """Return the problems that a monitor has with a trace."""
    if monitor is not None:
        kind = type("Planted", (kind,), {"monitor": lambda *_: monitor, "__module__": __name__})
    problems = module._Problems()
    expected = Expectation(kind(), Location("a.sim.yml"), "planted")
    with problems.of("the monitor"):
        module._check_monitor(module._Watched(expected, scene(), START, steps), problems)
    return problems.found


class Goal(Honest):
    """States that it is a goal."""

    @property
    def is_goal(self) -> bool:
        return True


class Condition(Honest):
    """States that it has a truth."""

    @property
    def has_truth(self) -> bool:
        return True


def test_an_honest_monitor_has_no_problem() -> None:
    assert found(Honest) == found(Condition) == []
    assert found(Honest, steps=trace([0.0])) == []


@pytest.mark.parametrize(
    ("kind", "monitor", "told"),
    [
        (Goal, None, "its monitor begins as HOLDS; with is_goal True, it begins as PENDING"),
        (Honest, Last(State.PENDING), "its monitor begins as PENDING; with is_goal False, it begins as HOLDS"),
        (Honest, Last(passed=np.True_), "its verdict has passed = "),
        (Honest, Last(measured=float("inf")), "its verdict has measured = inf; it must be a finite number"),
        (Honest, Last(measured="1"), "its verdict has measured = '1'; it must be a finite number"),
        (Honest, Last(margin=-1.0), "its verdict passed with the margin -1; a margin below 0 means that it failed"),
        (Honest, Last(message="two\nlines"), "the message of its verdict has several lines"),
        (Honest, Last(message=""), "the message of its verdict is ''; it must be a text"),
        (Honest, Raising(), "verdict() before the first step raised ZeroDivisionError: no steps"),
        (Honest, Changing(), "observe() changes the monitor that it is called on; return a new one"),
        (Honest, Counting(), "its verdict depends on the blocks in which steps are observed: in small blocks passed"),
        (Honest, Recovering(), "it was decided as BROKEN, and later steps change that"),
        (Honest, Curved(), "its signal 'x' has time (200,) and values (199,); both must have the same length"),
        (Condition, Last(), "has_truth is True, and its monitor has no truth()"),
        (Condition, Curved(), "truth() has 199 moments for 200 steps"),
        (Condition, Doubtful(), "truth() must give a bool for each time, found float64 of shape (200,)"),
    ],
)
def test_a_mistake_of_a_monitor_is_told(kind: type[Assertion], monitor: Monitor | None, told: str) -> None:
    assert told in "\n".join(found(kind, monitor))


class Thawed(Honest):
    """Is not frozen."""

    model_config = ConfigDict(frozen=False)


class Titled(Honest):
    """Has a title of two lines."""

    @property
    def title(self) -> str:
        return "two\nlines"


class Forgetful(Honest):
    """Is another one after pickling."""

    def __reduce__(self) -> tuple[Callable[..., object], tuple[object, ...]]:
        return (Forgetful, ())


class Converted(Honest):
    """Has a value that YAML does not have."""

    made: complex = 0j


class Halved(Honest):
    """Has another value when it is read again."""

    def model_post_init(self, _: object) -> None:
        object.__setattr__(self, "limit", self.limit / 2)


class Unwritten(Honest):
    """Has a field without a JSON schema."""

    call: Callable[[], None] = print


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The class that is checked counts as installed."""
    monkeypatch.setattr(
        module, "_RULES", {key: rule for key, rule in module._RULES.items() if key != "its entry point"}
    )


@pytest.mark.usefixtures("installed")
@pytest.mark.parametrize(
    ("spec", "told"),
    [
        (Thawed(), "is not frozen"),
        (Titled(), "title has several lines"),
        (Forgetful(limit=2), "after pickling"),
        (Converted(made=1j), "YAML raised InvalidScenario: "),
        (Halved(limit=2), "when it is read from YAML"),
        (Unwritten(), "has no JSON schema, so editors cannot complete its keys"),
    ],
)
def test_a_mistake_of_a_class_is_told_before_anything_runs(spec: Assertion, told: str) -> None:
    with pytest.raises(BrokenRules) as raised:
        check_assertion(spec, passes="nowhere.sim.yml", fails="nowhere.sim.yml")
    (problem,) = raised.value.problems
    assert told in problem


def test_classes_that_are_not_installed_under_their_names_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(BrokenRules) as raised:
        check_assertion(Honest(), passes="nowhere.sim.yml", fails="nowhere.sim.yml")
    assert "honest: no installed package has it; name the class below" in str(raised.value)
    renamed = type("Renamed", (Honest,), {"key": "travel", "__module__": __name__})()
    assert (
        module._why_not_installed(renamed, ASSERTIONS) == "sim-action has assertion 'travel' itself; choose another key"
    )
    monkeypatch.setattr(Table, "installed", lambda _: {"honest": "'honest' of a 1.0"})
    monkeypatch.setattr(Table, "load", lambda *_: Goal)
    told = module._why_not_installed(Honest(), ASSERTIONS)
    assert told == f"'honest' of a 1.0 is another class: {__name__}"


@pytest.mark.process
@pytest.mark.usefixtures("installed")
def test_a_scenario_that_cannot_be_read_is_told(tmp_path: Path) -> None:
    broken = Scenario(folder=tmp_path, name="broken", robot={"model": "nowhere"}, expect=[Honest()], time_limit=1)
    with pytest.raises(BrokenRules) as raised:
        check_assertion(Honest(), passes=broken, fails=broken)
    (passing, failing) = raised.value.problems
    assert passing.startswith("the scenario in which it should have passed raised InvalidScenario: ")
    assert failing.startswith("the scenario in which it should have failed raised InvalidScenario: ")
