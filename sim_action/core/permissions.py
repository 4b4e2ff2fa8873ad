"""The permissions that the caller gives, and the gate for code of the repository.

Code of the repository is everything that can run a command of its author: controllers (`script`, `process`, `policy`),
assertion classes, assertions and sensors of installed packages, xacro, and nodes, launch files and tests of ROS 1. All
subcommands that run it ask this module.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Final, Literal

from sim_action.core.errors import UsageError
from sim_action.core.records import dataclass
from sim_action.core.wording import escaped_line, shown

AllowScripts = Literal["auto", "true", "false"]

PRIVILEGED_BY_REASON: Final[Mapping[str, tuple[str, ...]]] = {
    "it has the rights of the base branch, and works on a pull request": ("pull_request_target", "workflow_run"),
    "strangers trigger it, and it has the rights of the default branch": (
        *("issue_comment", "issues", "discussion", "discussion_comment", "fork", "gollum", "watch"),
    ),
    "an app triggers it for a commit, which may belong to a pull request": (
        *("check_run", "check_suite", "deployment", "deployment_status", "status"),
    ),
}
"""Reason -> events of GitHub workflows on which code of the repository is not run with `auto`.

These events need the right to write to the repository, or run with the rights of a fork, and are not in the table:
`push`, `schedule`, `merge_group`, `release`, `workflow_dispatch`, `repository_dispatch`, `pull_request`. All of them
except `pull_request` are refused if the checkout is of a pull request or a fork; so are `pull_request_review` and
`pull_request_review_comment`, whose default checkout is of a pull request.
"""

PRIVILEGED_EVENTS: Final = frozenset(event for events in PRIVILEGED_BY_REASON.values() for event in events)

_FORK_EVENT: Final = "pull_request"
"""The event that has no secrets and may not write if the pull request comes from a fork."""

_REMEDY: Final = (
    "run simulations on pull_request, or set allow-scripts to true (--allow-scripts true) if all files here can be "
    "trusted"
)
_VARIABLE: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


@dataclass(frozen=True, slots=True)
class Permissions:
    """The permissions that the caller gives.

    Attributes:
        outside: True if files may be outside the workspace.
        scripts_refused: the reason why code of the repository is not run; None: it is run.
        imports_refused: the reason why assertions and sensors of installed packages are not imported, although nothing
            is run; None: `scripts_refused` decides.
        updates_golden: True if golden trajectories are written, inside the workspace.
        pass_env: names of environment variables that code of the repository may see, in addition to the harmless ones.
        packages: names of ROS packages with their folders, absolute and without links; they may be outside the
            workspace.
    """

    outside: bool = False
    scripts_refused: str | None = None
    imports_refused: str | None = None
    updates_golden: bool = False
    pass_env: tuple[str, ...] = ()
    packages: tuple[tuple[str, str], ...] = ()

    def require_scripts(self, subject: str) -> None:
        """Raise UsageError if `subject`, which is code of the repository, is not run here."""
        if self.scripts_refused is not None:
            raise UsageError(f"{subject}: {self.scripts_refused}")


def scripts_refused(choice: AllowScripts, environment: Mapping[str, str], folders: Iterable[Path] = ()) -> str | None:
    """Return the reason why code of the repository is not run here, in one line; None: it is run.

    `auto` depends on the event of the GitHub workflow, and on the checkouts around `folders`, which are the folders of
    the files that may run code.
    """
    if choice == "false":
        return "scripts are not allowed to run here (allow-scripts is false)"
    event = environment.get("GITHUB_EVENT_NAME", "")
    if choice == "true" or event in ("", _FORK_EVENT):
        return None
    if event in PRIVILEGED_EVENTS:
        return (
            f"scripts are not run on {event}: a pull request from a fork could run code with the secrets of this "
            f"repository; {_REMEDY}"
        )
    from sim_action.core.checkout import foreign_checkout

    if (found := foreign_checkout(environment, folders)) is not None:
        return f"scripts are not run on {event} here, because {found}; {_REMEDY}"
    return None


def checked_names(names: Iterable[str]) -> tuple[str, ...]:
    """Return the names of environment variables, sorted, each once. Raise UsageError for one that cannot be a name."""
    for name in names:
        if not _VARIABLE.fullmatch(name):
            raise UsageError(
                f"--pass-env takes the name of an environment variable, such as API_URL; found {shown(name)}"
            )
    return tuple(sorted(set(names)))


def package_folders(named: Mapping[str, str]) -> tuple[tuple[str, str], ...]:
    """Return the names of ROS packages with their folders, absolute and without links. Raise UsageError."""
    found = {}
    for name, folder in named.items():
        try:
            place = Path(folder).resolve() if folder else None
            is_folder = place is not None and place.is_dir()
        except (OSError, ValueError, RuntimeError):  # too long, a NUL in it, links in a circle
            place, is_folder = Path(folder), False
        if place is None or not is_folder or not name.isprintable() or "/" in name:
            where = f"looked for {place}" if folder else "it is empty"
            reason = "the name of a package has no slash" if "/" in name else f"there is no such folder ({where})"
            raise UsageError(escaped_line(f"--package {name}={folder}: {reason}; name a folder that is checked out"))
        found[name] = str(place)
    return tuple(found.items())
