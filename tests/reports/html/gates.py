"""Runs of gates, as calls of the command leave them behind."""

from __future__ import annotations

from typing import Any

from sim_action.core.errors import Location
from sim_action.results.outcome import ExpectationOutcome, Failure, Outcome
from sim_action.results.results_json import Results
from sim_action.scenario.source import Varied
from sim_action.state.verdict import Verdict
from tests.outcomes import gate_results, like, planned_gate

FILE = "push.sim.yml"
PASSES = {"passes": {"at_least": 0.9, "confidence": 0.95}}
STOPS = {"stop_early": {"reject": 0.5, "accept": 0.9, "confidence": 0.9}}


def run(number: int, margin: float | None, **changes: Any) -> Outcome:
    """A run with a margin to its limit; None: it crashed."""
    friction, yaw = 0.1 + number / 100, f"{number - 10} deg"
    verdict = Verdict((margin or 0) >= 0, 1.5 + (margin or 0), 1.5, margin, "m", 3.0, "travelled")
    place = Location(FILE, 8, 5)
    expected = ExpectationOutcome(
        name="travel at least 1.5 m", assertion="travel", severity="error", location=place, verdict=verdict
    )
    varied = Varied("world.ground.friction", friction), Varied("robot.pose.yaw", yaw), Varied("floor", "wet")
    crash = Failure(kind="crash", title="SIGSEGV", message="the process ended")
    return like(
        Outcome(
            name=f"push[friction={friction:.3g},yaw={number - 10}deg]",
            file=FILE,
            group="push",
            gate="push",
            variation=varied,
            status="error" if margin is None else "passed" if margin >= 0 else "failed",
            expectations=() if margin is None else (expected,),
            failures=(crash,) if margin is None else (),
            digest=None if margin is None else f"{number:064x}",
            engine="pybullet 3.2.7",
        ),
        **changes,
    )


def grid_of_runs() -> list[Outcome]:
    """The variations of a scenario over five speeds and three frictions, each of which counts; two of them fail."""
    made = []
    for speed in (0.1, 0.15, 0.2, 0.3, 0.4):
        for friction in (0.3, 0.5, 0.9):
            name = f"stop[speed={speed:g},friction={friction:g}]"
            varied = (Varied("commands.twist.0.speed", speed), Varied("world.ground.friction", friction))
            margin = -0.1 if speed == 0.4 and friction < 0.9 else 0.5 - speed
            made.append(run(0, margin, name=name, file="stop.sim.yml", group="stop", gate=None, variation=varied))
    return made


def gated(gate: dict[str, Any], *runs: Outcome) -> Results:
    """The results of a gate over runs."""
    return gate_results(like(planned_gate(len(runs), "push", **gate), file=FILE, location=Location(FILE, 5, 1)), *runs)


def passed_gate() -> Results:
    """60 runs pass and one fails."""
    return gated(PASSES, *(run(number, 0.1 + number / 100) for number in range(60)), run(60, -0.3))


def failed_gate() -> Results:
    """Half of the runs fail."""
    return gated(PASSES, *(run(number, number / 100 - 0.15) for number in range(30)))


def inconclusive_gate() -> Results:
    """Three of 30 runs fail."""
    return gated(PASSES, *(run(number, 0.1 if number > 2 else -0.2 - number / 10) for number in range(30)))


def crashed_gate() -> Results:
    """One of 30 runs crashes."""
    return gated(PASSES, *(run(number, None if number == 4 else 0.2) for number in range(30)))


def decided_gate() -> Results:
    """A test that stops early accepts, and leaves runs out."""
    found = [run(number, 0.2) for number in range(8)]
    return gated(STOPS, *found, *(run(number, None, status="skipped", failures=()) for number in range(8, 20)))


def empty_gate() -> Results:
    """No run was made."""
    return gated(PASSES, *(run(number, None, status="skipped", failures=()) for number in range(30)))


GATES = {
    "passed": passed_gate,
    "failed": failed_gate,
    "inconclusive": inconclusive_gate,
    "crashed": crashed_gate,
    "decided": decided_gate,
    "skipped": empty_gate,
}
