"""The nodes of a scenario as the lock-step sees them: those that it lists, or those that a launch file starts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from sim_action.core.records import dataclass


class Process(Protocol):
    """A process of a node."""

    @property
    def label(self) -> str:
        """The name of the process in messages."""

    @property
    def pid(self) -> int:
        """The id of the process."""

    def exit_code(self) -> int | None:
        """Return the exit code once it has ended, negative for a signal; else None."""

    def await_end(self, seconds: float) -> None:
        """Wait until it has ended, for at most some s of wall time."""


@dataclass(frozen=True, slots=True)
class Node:
    """A process with a clock of its own; `number`: of its clock."""

    number: int
    process: Process


class NodeGroup(Protocol):
    """All nodes of a scenario.

    Attributes:
        notes: notes for the user.
        losses: parts of a launch file that are not simulated, if they are allowed.
    """

    notes: list[str]
    losses: list[str]

    @property
    def roots(self) -> Sequence[int]:
        """The ids of the processes from which all others descend."""

    def await_start(self) -> None:
        """Wait until the first nodes are started. Raise SourceProblem, ScriptError."""

    def tell_time(self, seconds: float) -> None:
        """Start what is due at a sim time, in s. Raise ScriptError."""

    def new_nodes(self) -> list[Node]:
        """Return the nodes that were started since the last call, in a fixed order. Raise ScriptError."""

    def refuse_ended(self) -> None:
        """Raise ScriptError if a node has failed, or a required one has finished."""

    def close(self) -> None:
        """End the nodes."""
