"""The counts of the runs of a gate, and the bounds that they show."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from sim_action.core.field_types import FrozenModel

Count = Annotated[int, Field(ge=0)]
Share = Annotated[float, Field(ge=0, le=1)]


class GateStatistics(FrozenModel):
    """The counts of a gate.

    Attributes:
        planned: the number of runs of the gate.
        runs: the number of runs that were counted; less than planned if a sequential test decided before.
        passed, failed: the runs with these verdicts.
        errors: the runs without a verdict, flaky ones included.
        not_exercised: the runs in which an expectation was never judged.
        rate: the share of passed runs.
        lower, upper: the bounds of the true rate, each one-sided at `confidence`; None after a sequential test, whose
            runs have no such bounds.
        decision: the result of a sequential test; None for a fixed number of runs, or if it did not decide.
    """

    planned: Count
    runs: Count
    passed: Count
    failed: Count
    errors: Count
    not_exercised: Count
    rate: Share
    confidence: Share
    lower: Share | None = None
    upper: Share | None = None
    decision: Literal["accepted", "rejected"] | None = None

    @property
    def without_verdict(self) -> int:
        """The number of counted runs that neither passed nor failed."""
        return self.errors + self.not_exercised
