"""A run that passed, and its mutants: the same scenario with one fault of the system each."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Final, Self

import numpy as np

from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.records import dataclass, replace
from sim_action.results.outcome import Outcome
from sim_action.robot.model.kinematics import link_motion
from sim_action.runner.outcome_assembly import stored_trace
from sim_action.scenario.model import LoadedScenario, Scenario
from sim_action.scenario.mutation import Mutation
from sim_action.scenario.source import Refused
from sim_action.state.trace import Trace

if TYPE_CHECKING:
    from sim_action.world.parts import Part

_NO_FAULT: Final = Mutation()
_DIGITS: Final = 3


def lengths(way: FloatArray) -> FloatArray:
    """Return the length of a way so far, (T,) m; `way`: (T, 2) or (T, 3) m."""
    steps = np.linalg.norm(np.diff(way, axis=0), axis=1)
    return np.concatenate(([0.0], np.cumsum(steps)))


@dataclass(frozen=True, eq=False)
class Original:
    """A run that passed, without any mutation."""

    loaded: LoadedScenario
    outcome: Outcome
    trace: Trace

    @classmethod
    def of(cls, loaded: LoadedScenario | Refused, outcome: Outcome, folder: Path) -> Self | None:
        """Return the run of a scenario whose files are in `folder`; None if it did not pass, or has no trace."""
        trace = stored_trace(outcome, folder) if outcome.status == "passed" else None
        return None if trace is None or isinstance(loaded, Refused) else cls(loaded, outcome, trace)

    @property
    def scenario(self) -> Scenario:
        """The scenario that ran."""
        return self.loaded.scenario

    @cached_property
    def way_xy(self) -> FloatArray:
        """The places of the base on the ground plane, (T, 2) m."""
        return self.trace.base_position_xyz[:, :2]

    @property
    def is_fixed(self) -> bool:
        """True if the base of the robot cannot move."""
        return self.loaded.is_fixed

    @cached_property
    def moving_link(self) -> tuple[str, FloatArray] | None:
        """The link with the longest way, and its places, (T, 3) m; None if the base can move."""
        model = self.loaded.model
        if model is None or not self.is_fixed:
            return None
        ways = {link.name: link_motion(model, self.trace, link.name).position_xyz for link in model.links}
        # Rounding must not decide between fingers.
        name = max(ways, key=lambda link_name: round(float(lengths(ways[link_name])[-1]), _DIGITS))
        return name, ways[name]

    @property
    def moving_xy(self) -> FloatArray:
        """The places on the ground plane of the base, or of the link that moved furthest, (T, 2) m."""
        return self.way_xy if self.moving_link is None else self.moving_link[1][:, :2]

    @cached_property
    def driven(self) -> FloatArray:
        """The length of the way on the ground plane so far, (T,) m."""
        return lengths(self.way_xy)

    def mutant(self, kind: str, subject: str, words: str, mutation: Mutation) -> Mutant:
        """Return the mutant with a fault at the seams of the run."""
        return self._named(kind, subject, words, replace(self.loaded, mutation=mutation))

    def changed(
        self,
        kind: str,
        subject: str,
        words: str,
        scenario: Scenario,
        parts: Mapping[str, tuple[Part, ...]] | None = None,
    ) -> Mutant:
        """Return the mutant with another scenario."""
        parts = self.loaded.parts if parts is None else parts
        changed = replace(self.loaded, scenario=scenario, parts=parts, mutation=_NO_FAULT)
        return self._named(kind, subject, words, changed)

    def _named(self, kind: str, subject: str, words: str, loaded: LoadedScenario) -> Mutant:
        mutant = Mutant(kind, subject, words, loaded)
        name = f"{self.scenario.name} ({mutant.name})"
        return replace(mutant, loaded=replace(loaded, scenario=loaded.scenario.model_copy(update={"name": name})))


@dataclass(frozen=True, slots=True)
class Mutant:
    """A scenario with one fault of its system."""

    kind: str  # the name of a row of the table, such as "motor-off"
    subject: str  # the joint, object or sensor that has the fault, or its strength; or empty
    words: str  # the fault in words
    loaded: LoadedScenario
    # the same fault with less strength, in falling order: the least one that is noticed counts
    milder: tuple[Mutant, ...] = ()
    # the same fault with more strength, in rising order. They run as long as one is not noticed, or an expectation has
    # noticed nothing yet.
    stronger: tuple[Mutant, ...] = ()

    @property
    def name(self) -> str:
        """The name in reports, such as "motor-off:wheel_left_joint"."""
        return f"{self.kind}:{self.subject}" if self.subject else self.kind

    @property
    def strengths(self) -> tuple[Mutant, ...]:
        """The mutant with each of its strengths, this one first."""
        return self, *self.milder, *self.stronger
