"""The gate for code of the repository: choices, events, checkouts."""

from __future__ import annotations

from pathlib import Path

import pytest

from action import environment
from sim_action.core.errors import UsageError
from sim_action.core.permissions import (
    PRIVILEGED_BY_REASON,
    PRIVILEGED_EVENTS,
    Permissions,
    checked_names,
    scripts_refused,
)

ALLOWED = ["push", "pull_request", "schedule", "merge_group", "release", "workflow_dispatch", "repository_dispatch", ""]
"""Events that need the right to write, or that have the rights of a fork; and no workflow at all."""

LEAST = {
    *("pull_request_target", "workflow_run", "issue_comment", "issues", "discussion", "discussion_comment"),
    *("fork", "watch", "gollum", "check_run", "check_suite", "status", "deployment", "deployment_status"),
}


def test_the_table_names_each_event_once() -> None:
    assert sum(map(len, PRIVILEGED_BY_REASON.values())) == len(PRIVILEGED_EVENTS)
    assert PRIVILEGED_EVENTS >= LEAST
    assert not PRIVILEGED_EVENTS & set(ALLOWED)


def test_nothing_is_cached_on_the_same_events() -> None:
    assert environment.NEVER_CACHED_ON == PRIVILEGED_EVENTS


@pytest.mark.parametrize("event", ALLOWED)
def test_code_runs_where_only_the_rights_of_its_author_are_at_stake(event: str, tmp_path: Path) -> None:
    assert scripts_refused("auto", {"GITHUB_EVENT_NAME": event}, [tmp_path]) is None


@pytest.mark.parametrize("event", sorted(PRIVILEGED_EVENTS))
def test_code_is_refused_where_strangers_would_have_the_rights_of_the_base_branch(event: str) -> None:
    refusal = scripts_refused("auto", {"GITHUB_EVENT_NAME": event})
    assert refusal is not None
    assert event in refusal
    assert "allow-scripts" in refusal
    assert "\n" not in refusal


def test_code_runs_on_a_machine_of_ones_own(tmp_path: Path) -> None:
    assert scripts_refused("auto", {}, [pull_request(tmp_path)]) is None


def test_the_caller_decides(tmp_path: Path) -> None:
    privileged = {"GITHUB_EVENT_NAME": "pull_request_target"}
    assert scripts_refused("true", privileged, [pull_request(tmp_path)]) is None
    assert scripts_refused("false", {"GITHUB_EVENT_NAME": "push"}) is not None
    assert scripts_refused("false", {}) is not None


@pytest.mark.parametrize("event", [*ALLOWED, "pull_request_review", "an event to come"])
def test_a_pull_request_is_only_trusted_on_its_own_event(event: str, tmp_path: Path) -> None:
    refusal = scripts_refused("auto", {"GITHUB_EVENT_NAME": event}, [pull_request(tmp_path)])
    if event in ("", "pull_request"):
        assert refusal is None
        return
    assert refusal is not None
    assert "refs/remotes/pull/7/merge" in refusal
    assert event in refusal
    assert "allow-scripts to true" in refusal
    assert "\n" not in refusal


def test_a_refusal_is_an_error_that_names_its_subject() -> None:
    Permissions().require_scripts("rostest")
    with pytest.raises(UsageError, match=r"^rostest: no$"):
        Permissions(scripts_refused="no").require_scripts("rostest")


def test_names_of_variables_are_sorted_and_unique() -> None:
    assert checked_names(["B", "A_1", "B"]) == ("A_1", "B")


@pytest.mark.parametrize("name", ["", "A=B", "1A", "A*", "A B", "A\nB", "Ä"])
def test_anything_else_is_no_name_of_a_variable(name: str) -> None:
    with pytest.raises(UsageError, match="--pass-env takes the name"):
        checked_names([name])


def pull_request(folder: Path) -> Path:
    """A checkout of a pull request."""
    ref = folder / ".git/refs/remotes/pull/7/merge"
    ref.parent.mkdir(parents=True)
    ref.write_text("1" * 40 + "\n")
    return folder
