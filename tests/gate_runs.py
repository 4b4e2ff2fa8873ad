"""Simulated runs of a gate, and its outcome."""

from __future__ import annotations

import random
from collections.abc import Sequence
from functools import cache
from typing import Any

from sim_action.core.errors import Location
from sim_action.results.gates import judged_gate
from sim_action.results.outcome import ExpectationOutcome, Outcome, Status
from sim_action.scenario.source import Varied
from sim_action.scenario.variations.gate import Gate, Passes, PlannedGate
from sim_action.state.verdict import Verdict

FILE = "push.sim.yml"
PLACE = Location(FILE, 8, 5)


@cache
def run(
    sample: int, status: Status = "passed", *, margin: float = 0.4, gate: str = "push", file: str = FILE, seed: int = 0
) -> Outcome:
    """Return a run with a drawn friction; `seed`: that of the scenario."""
    friction = random.Random(f"{seed} {sample}").uniform(0.1, 0.8)
    verdict = Verdict(status == "passed", 1.0 + margin, 1.0, margin, "m", 2.0, f"margin {margin} m")
    expected = ExpectationOutcome(
        name="clearance", assertion="clearance", severity="error", location=PLACE, verdict=verdict
    )
    return Outcome(
        name=f"{gate}[sample={sample}]",
        file=file,
        group=gate,
        variation=(Varied("world.ground.friction", friction),),
        gate=gate,
        status=status,
        expectations=(expected,) if status in ("passed", "failed") else (),
        seed=1000 * seed + sample,
        number=sample + 1,
    )


def planned(
    runs: int, gate: str = "push", file: str = FILE, at_least: float = 0.5, confidence: float = 0.95
) -> PlannedGate:
    """Return a gate over so many runs."""
    claim = Gate(passes=Passes(at_least=at_least, confidence=confidence))
    return PlannedGate(name=gate, file=file, location=Location(file, 4), group=gate, gate=claim, runs=runs)


def judged(
    runs: Sequence[Outcome], gate: str = "push", *, at_least: float = 0.5, confidence: float = 0.95
) -> list[Outcome]:
    """Return the outcome of the gate, followed by its runs."""
    return [judged_gate(planned(len(runs), gate, runs[0].file, at_least, confidence), runs), *runs]


def stated(runs: int = 100, **gate: Any) -> PlannedGate:
    """Return a gate with these keys."""
    claims = Gate.model_validate(gate)
    return PlannedGate(name="push", file=FILE, location=Location(FILE, 4), group="push", gate=claims, runs=runs)


def verdicts(passed: Sequence[bool], gate: str = "push", *, seed: int = 0) -> list[Outcome]:
    """Return the runs with these verdicts."""
    return [
        run(sample, "passed", gate=gate, seed=seed)
        if each
        else run(sample, "failed", margin=-0.1, gate=gate, seed=seed)
        for sample, each in enumerate(passed)
    ]


def simulated(seed: int, rate: float, runs: int = 100, *, noise: float = 0.0, version: str = "") -> list[bool]:
    """Return verdicts of a robot: the same draws for each rate and version, and noise of the version's own."""
    draws, own = random.Random(seed), random.Random(f"{seed} {version}")
    return [(draws.random() < rate) != (own.random() < noise) for _ in range(runs)]
