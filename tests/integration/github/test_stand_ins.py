"""What stands in for setup-python and checkout."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from tests.integration.github import UnsupportedFeature, base_python
from tests.integration.github.conftest import CHECKOUT, Perform, printed, run, run_job, uses

PYTHON = "actions/setup-python@5fda3b95a4ea91299a34e894583c3862153e4b97"


def test_python_comes_first_in_the_path_of_later_steps(perform: Perform) -> None:
    step = uses(PYTHON, {"python-version": " 3.11 "})
    result = run_job(perform, step, run("command -v python3.11; echo $pythonLocation"))
    assert printed(result).splitlines() == [str(base_python()), str(base_python().parent.parent)]


def test_python_leaves_the_environment_alone_if_it_is_told_to(perform: Perform) -> None:
    step = uses(PYTHON, {"python-version": "3.11", "update-environment": "false"})
    assert printed(run_job(perform, step, run("echo $pythonLocation"))) == "\n"


def test_python_must_be_given_a_version(perform: Perform) -> None:
    result = run_job(perform, uses(PYTHON))
    assert result.result == "failure"
    assert result.annotations[0].message == "Input required and not supplied: python-version"


def test_booleans_are_true_or_false(perform: Perform) -> None:
    result = run_job(perform, uses(PYTHON, {"python-version": "3.11", "update-environment": "no"}))
    assert "YAML 1.2 Core Schema" in result.annotations[0].message


def test_checkout_replaces_what_is_there_by_what_git_does_not_ignore(perform: Perform, repository: Path) -> None:
    for name in ("kept", "ignored", "gone"):
        (repository / name).write_text(name, encoding="utf-8")
    (repository / ".gitignore").write_text("ignored\n", encoding="utf-8")
    subprocess.run(["git", "init", "--quiet"], cwd=repository, check=True)
    subprocess.run(["git", "add", "gone"], cwd=repository, check=True)
    (repository / "gone").unlink()
    result = run_job(perform, run("touch before"), uses(CHECKOUT), run("ls -A"))
    assert printed(result) == ".git\n.github\n.gitignore\nkept\n"


def test_checkout_of_something_else_is_refused(perform: Perform) -> None:
    with pytest.raises(UnsupportedFeature, match="ref: other, where there is only"):
        run_job(perform, uses(CHECKOUT, {"ref": "other"}))
