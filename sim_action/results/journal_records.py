"""The lines of the journal: its header with the plan of a call, and its records."""

from __future__ import annotations

import platform
from collections.abc import Iterable
from dataclasses import fields
from typing import Annotated, ClassVar, Literal, Self

from pydantic import ConfigDict, Field

from sim_action.core.errors import ExitCode
from sim_action.core.field_types import FrozenModel
from sim_action.core.provenance import platform_name
from sim_action.core.records import dataclass
from sim_action.core.version import __version__
from sim_action.results.outcome import Failure, NotNegative, Outcome
from sim_action.results.results_json import MAX_OUTCOMES
from sim_action.results.shards import Shard
from sim_action.scenario.source import Variation
from sim_action.scenario.variations.gate import PlannedGate

Place = Annotated[int, Field(ge=0)]
Kind = Literal["started", "run", "finished", "ended"]


@dataclass(frozen=True, slots=True)
class Planned:
    """One planned outcome; the attributes are those of `Outcome`. A call keeps all: they are smaller than models."""

    name: str
    file: str
    line: Annotated[int, Field(ge=1)] | None = None
    number: Annotated[int, Field(ge=1)] | None = None
    group: str | None = None
    variation: Variation = ()
    gate: str | None = None
    __pydantic_config__: ClassVar[ConfigDict] = FrozenModel.model_config

    @classmethod
    def of(cls, outcome: Outcome) -> Self:
        """Return the plan of an outcome."""
        return cls(*(getattr(outcome, each.name) for each in fields(cls)))

    def unfinished(self, message: str) -> Outcome:
        """Return the outcome of a scenario that has not finished."""
        failure = Failure(kind="interrupted", title="not finished", message=message)
        known = {each.name: getattr(self, each.name) for each in fields(self)}
        return Outcome(**known, status="error", failures=(failure,))


class Header(FrozenModel):
    """The first line of a journal.

    Attributes:
        journal: the version of the format.
        shard, selected: as in `Results`.
        files: the files that the call may write, relative to the journal; the next call removes them.
        gates: the gates of the planned outcomes.
        planned: the planned outcomes, in the order of the results.
    """

    journal: Literal[1]
    sim_action: str
    python: str
    platform: str
    shard: Shard | None = None
    selected: bool = False
    files: tuple[str, ...] = ()
    gates: tuple[PlannedGate, ...] = ()
    planned: Annotated[tuple[Planned, ...], Field(max_length=MAX_OUTCOMES)] = ()

    @classmethod
    def of_call(
        cls,
        planned: Iterable[Planned],
        files: Iterable[str],
        shard: Shard | None = None,
        *,
        selected: bool = False,
        gates: Iterable[PlannedGate] = (),
    ) -> Self:
        """Return the header of a call by this version on this machine."""
        return cls(
            journal=1,
            sim_action=__version__,
            python=platform.python_version(),
            platform=platform_name(),
            shard=shard,
            selected=selected,
            files=tuple(files),
            gates=tuple(gates),
            planned=tuple(planned),
        )


@dataclass(frozen=True, slots=True)
class Record:
    """A line of the journal. A call keeps several for each run, so they are smaller than models.

    Attributes:
        at: the wall time in s since the start of the call.
        event: the kind of the record; "ended": the call has ended, and has no `place`.
        place: the index of the planned outcome.
        turn: the number of the repetition, counted from 1; None for a final outcome.
        key: the digest of everything that the outcome may depend on; None: it is not known.
        taken_over: True for an outcome of an earlier call, see `run --resume`.
    """

    at: NotNegative
    event: Kind
    place: Place | None = None
    turn: Annotated[int, Field(ge=1)] | None = None
    key: str | None = None
    taken_over: bool = False
    outcome: Outcome | None = None

    __pydantic_config__: ClassVar[ConfigDict] = FrozenModel.model_config

    @property
    def is_interrupted(self) -> bool:
        """Return True for the outcome of an interrupted scenario. It is not written: it is no result."""
        return self.outcome is not None and self.outcome.exit_code is ExitCode.INTERRUPTED
