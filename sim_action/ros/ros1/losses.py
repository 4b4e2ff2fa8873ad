"""Losses: the parts of a world, a robot, a plugin or a launch file that Gazebo simulates and sim-action does not.

A loss is an error, because the test would check something else than its author thinks. `--allow-losses`, or the key
`allow_losses` of a scenario, turns it into a warning. A part that changes nothing that is simulated, measured or
published is not a loss: the tables in `world_tags` and `plugin_tags` give the reason for each.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Final

from sim_action.core.errors import Location
from sim_action.core.wording import counted, escaped_line
from sim_action.results.outcome import Failure
from sim_action.scenario.claim_audit import NOT_SIMULATED, AuditWarning
from sim_action.world.world_files.losses import Loss

OPTION: Final = "--allow-losses"

TITLE: Final = "not simulated"
"""The title of failures."""

_MAX_REPORTED: Final = 20


def loss_failures(losses: Iterable[Loss]) -> tuple[Failure, ...]:
    """Return a failure for each of the first losses, and one that counts the rest."""
    return tuple(
        Failure(kind="invalid", title=TITLE, message=f"{loss.message}; to run without it: {OPTION}", location=place)
        for loss, place in ((loss, loss.location) for loss in _first(losses))
    )


def loss_warnings(losses: Iterable[Loss], otherwise: Location) -> tuple[AuditWarning, ...]:
    """Return a warning for each of the first losses, and one that counts the rest; `otherwise`: for unknown places."""
    found = _first(losses)
    return tuple(
        AuditWarning(rule=NOT_SIMULATED, message=loss.message, location=loss.location or otherwise) for loss in found
    )


def _first(losses: Iterable[Loss]) -> Iterator[Loss]:
    found = [Loss(message=escaped_line(loss.message), location=loss.location) for loss in dict.fromkeys(losses)]
    yield from found[:_MAX_REPORTED]
    if more := found[_MAX_REPORTED:]:
        yield Loss(message=f"{counted(len(more), 'more part')} of the launch", location=more[0].location)
