"""Every workflow, the action and its lock file: third parties are pinned, no expression is pasted into a shell."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parent.parent
FILES = sorted((ROOT / ".github/workflows").glob("*.yml")) + sorted((ROOT / "examples/workflows").glob("*.yml"))
FILES += [ROOT / "action.yml"]

OWN = "sim-action/sim-action@v1"
USES = re.compile(r"^\s*(?:- )?uses: (?P<action>\S+)(?P<comment>.*)$", re.MULTILINE)
PINNED = re.compile(r"[\w.-]+/[\w./-]+@[0-9a-f]{40}")
VERSION_COMMENT = re.compile(r" # v\d+\.\d+\.\d+")

every_file = pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(ROOT)))


def steps(file: Path) -> Iterator[dict[str, object]]:
    document = yaml.safe_load(file.read_text(encoding="utf-8"))
    if "runs" in document:
        yield from document["runs"]["steps"]
    for job in document.get("jobs", {}).values():
        yield from job["steps"]


@every_file
def test_parses_and_every_step_does_something(file: Path) -> None:
    assert all(("run" in step) != ("uses" in step) for step in steps(file))


@every_file
def test_third_parties_are_pinned_by_sha_with_their_version_beside_it(file: Path) -> None:
    uses = list(USES.finditer(file.read_text(encoding="utf-8")))
    assert len(uses) == sum("uses" in step for step in steps(file))
    for use in uses:
        if use["action"] not in {"./", OWN}:
            assert PINNED.fullmatch(use["action"]), use["action"]
            assert VERSION_COMMENT.fullmatch(use["comment"]), use["action"]


@every_file
def test_no_expression_is_pasted_into_a_shell(file: Path) -> None:
    for step in steps(file):
        assert "${{" not in str(step.get("run", ""))


@every_file
def test_workflows_may_only_read(file: Path) -> None:
    document = yaml.safe_load(file.read_text(encoding="utf-8"))
    if "jobs" in document:
        assert document["permissions"] == {"contents": "read"}


def test_every_step_of_the_action_names_its_shell() -> None:
    assert all(step["shell"] == "bash" for step in steps(ROOT / "action.yml") if "run" in step)


def test_lock_file_has_every_dependency_and_leaves_the_index_to_the_user() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    lock = (ROOT / "requirements.lock").read_text(encoding="utf-8")
    needed = {re.split(r"[^\w-]", dependency)[0] for dependency in project["dependencies"]}
    assert needed <= set(re.findall(r"^([\w-]+)==", lock, re.MULTILINE))
    assert not re.search(r"://|index|find-links| @ |[\w.-]/", lock)
