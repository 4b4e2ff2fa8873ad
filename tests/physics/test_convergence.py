"""Verdicts at 240 Hz are those at 1920 Hz, unless the quantity is too near to its limit.

A verdict is the comparison of a case's quantity with `Case.verdict_limit`. The converged difference of a case on an
engine is |q(960 Hz) - q(1920 Hz)|. Where the margin at 1920 Hz, |q(1920 Hz) - limit|, is more than three times that
difference, q(240 Hz) must be on the same side of the limit. Cases for which this is not so are in `known.MISSED`.

`run --confidence` knows q(240 Hz) and q(480 Hz) alone: it must leave few verdicts open, and decide none otherwise.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import pytest

from tests.physics.case import BETWEEN, FINE_RATE, RATE, Case
from tests.physics.known import MISSED, entries
from tests.physics.zoo import ZOO
from tests.runner.test_numerical_confidence import judged, run, scenario

SURE_MARGIN: Final = 3.0  # converged differences that a margin needs for the verdict to be judged
QUICK: Final = ("box shoved at 1 m/s on friction 0.2: distance", "box slides down 35 deg at friction 0.5")


CASES: Final = [case for case in ZOO if not case.between and all(setup.rate == RATE for setup in case.setups)]
"""Cases whose runs are all at the usual rate, on one engine each."""


@pytest.mark.parametrize(("engine", "case"), entries(CASES, MISSED, QUICK))
def test_a_clear_verdict_does_not_depend_on_the_step(tmp_path: Path, engine: str, case: Case) -> None:
    assert engine != BETWEEN
    pytest.importorskip(engine, reason=f"{engine} is not installed")
    coarse, fine, finest = (case.measured(engine, rate) for rate in (RATE, FINE_RATE / 2, FINE_RATE))
    limit = case.verdict_limit
    is_decided = _status(tmp_path, case, engine) != "inconclusive"
    if is_decided or abs(finest - limit) > SURE_MARGIN * abs(fine - finest):
        assert (coarse > limit) == (finest > limit), (
            f"{coarse:.6g} at 240 Hz, {finest:.6g} at 1920 Hz, limit {limit:.6g}"
        )


def test_missed_verdicts_are_of_cases() -> None:
    assert set(MISSED) <= {(engine, case.name) for case in ZOO for engine in case.engines}


def _status(folder: Path, case: Case, engine: str) -> str:
    """Return the status of the verdict with a repetition with half the step."""
    ours, half = (run(case.measured(engine, rate) - case.verdict_limit) for rate in (RATE, 2 * RATE))
    return judged(scenario(folder), ours, half=half).status


@pytest.mark.soak
def test_few_verdicts_are_inconclusive(tmp_path: Path) -> None:
    statuses = [_status(tmp_path, case, engine) for case in CASES[::10] for engine in case.engines]
    assert statuses.count("inconclusive") <= 0.1 * len(statuses)
