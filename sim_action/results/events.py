"""The events of a call, in the order in which they happen: the terminal, the journal and early stops read them.

    Started, Progressed ..., RunEnded     one run of one scenario, in a child process
    Finished                              an outcome of the results is final

A scenario has several runs with `--repeat`, and several outcomes with several engines. `Finished` comes after the last
run that its outcome depends on. If it depends on one run alone, it comes before the `RunEnded` of that run: a verdict
is in the journal before anything reports it.
"""

from __future__ import annotations

from collections.abc import Callable

from sim_action.core.records import dataclass
from sim_action.results.outcome import Outcome


@dataclass(frozen=True, slots=True)
class Started:
    """A run has started."""

    place: int  # the index of its outcome in the results
    turn: int  # the number of the repetition, counted from 1
    name: str  # the name of the scenario


@dataclass(frozen=True, slots=True)
class Progressed:
    """A run has reached a sim time in s; the other attributes are those of `Started`."""

    place: int
    turn: int
    name: str
    sim_time: float
    real_time_factor: float


@dataclass(frozen=True, slots=True)
class RunEnded:
    """A run has ended; the other attributes are those of `Started`."""

    place: int
    turn: int
    outcome: Outcome  # the outcome of this run alone
    key: str | None = None  # the digest of everything that the outcome may depend on; None: it is not known
    is_one_of_several: bool = False  # True if the final outcome depends on other runs, too
    taken_over: bool = False  # True if an earlier call has run it, see `run --resume`


@dataclass(frozen=True, slots=True)
class Finished:
    """An outcome is final; `place`: its index in the results. The other attributes are those of `RunEnded`."""

    place: int
    outcome: Outcome
    key: str | None = None
    taken_over: bool = False


Event = Started | Progressed | RunEnded | Finished
Listener = Callable[[Event], None]
