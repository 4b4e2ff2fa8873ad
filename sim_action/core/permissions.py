"""What a scenario may do beyond reading the files of its own workspace."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

AllowScripts = Literal["auto", "true", "false"]

_PRIVILEGED_EVENTS: Final = frozenset({"pull_request_target", "workflow_run"})
"""A workflow that these start has the rights and secrets of the base branch, also if a stranger's pull request did."""


@dataclass(frozen=True, slots=True)
class Permissions:
    """What the caller allows.

    Attributes:
        outside: whether files may lie outside the workspace.
        scripts_refused: why no code of the user's is run; None: it is.
        updates_golden: whether golden trajectories are written, inside the workspace.
    """

    outside: bool = False
    scripts_refused: str | None = None
    updates_golden: bool = False


def scripts_refused(choice: AllowScripts, environment: Mapping[str, str]) -> str | None:
    """Why scripts are not run here; None if they are. `auto` looks at the event that GitHub names."""
    if choice == "false":
        return "scripts are not allowed to run here (allow-scripts is false)"
    event = environment.get("GITHUB_EVENT_NAME", "")
    if choice == "auto" and event in _PRIVILEGED_EVENTS:
        return (
            f"scripts are not run on {event}: whoever opens a pull request could run code with the secrets of this "
            "repository; run simulations on pull_request, or set allow-scripts to true if no stranger's files are here"
        )
    return None
