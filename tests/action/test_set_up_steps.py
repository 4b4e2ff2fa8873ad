"""The set-up steps are written once in each action, because an action cannot use another one by a relative path."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parents[2]
# Action -> its lock file, and what its steps get from its inputs.
ACTIONS: dict[str, tuple[str, set[str]]] = {
    ".": ("requirements.lock", {"cache", "extras", "backend", "working-directory"}),
    "prove": ("requirements.lock", {"cache", "extras", "backend", "working-directory"}),
    "rostest": ("requirements.lock", {"cache", "backend", "working-directory"}),
    "merge": ("requirements-reports.lock", set()),
    "compare": ("requirements-core.lock", set()),
    "matrix": ("requirements-core.lock", set()),
}
FIRST, LAST = "Provide Python", "Save wheels"
OF_EXTRAS = ("Restore wheels of extras", "Save wheels of extras")


def document(action: str) -> dict[str, Any]:
    loaded: dict[str, Any] = yaml.safe_load((ROOT / action / "action.yml").read_text(encoding="utf-8"))
    return loaded


def set_up_steps(action: str) -> list[dict[str, Any]]:
    steps = document(action)["runs"]["steps"]
    names = [step["name"] for step in steps]
    last = next(name for name in (OF_EXTRAS[1], LAST) if name in names)
    return list(steps[names.index(FIRST) : names.index(last) + 1])


def test_every_action_is_in_the_table() -> None:
    assert {
        path.parent.relative_to(ROOT).as_posix()
        for path in ROOT.glob("**/action.yml")
        if "node_modules" not in path.parts
    } == set(ACTIONS)


@pytest.mark.parametrize("action", ACTIONS)
def test_set_up_steps_agree_but_for_the_lock_file_and_the_inputs(action: str) -> None:
    lock, inputs = ACTIONS[action]
    steps, expected = set_up_steps(action), set_up_steps(".")
    if "extras" not in inputs:
        expected = [step for step in expected if step["name"] not in OF_EXTRAS]
    for step in expected:
        step["run"] = step.get("run", "").replace("requirements.lock", lock)
        if action != ".":
            step["run"] = step["run"].replace("$GITHUB_ACTION_PATH/", "$GITHUB_ACTION_PATH/../")
        for name in ACTIONS["."][1] - inputs:
            step.get("env", {}).pop(f"INPUT_{name.upper().replace('-', '_')}", None)
    if "cache" not in inputs:
        expected[1]["env"]["INPUT_CACHE"] = "true"
    assert [{"run": "", **step} for step in steps] == expected


@pytest.mark.parametrize("action", ACTIONS)
def test_the_steps_get_every_input_that_they_read(action: str) -> None:
    """An input such as `backend` that an action has must reach its set-up."""
    text = "\n".join(str(step.get("env", {})) for step in set_up_steps(action))
    assert set(re.findall(r"inputs\.([\w-]+)", text)) == ACTIONS[action][1]
    read = {"cache", "extras", "backend"} & set(document(action).get("inputs", {}))
    assert read <= ACTIONS[action][1]


@pytest.mark.parametrize("action", ACTIONS)
def test_wheels_are_saved_before_code_of_the_repository_runs(action: str) -> None:
    names = [step["name"] for step in document(action)["runs"]["steps"]]
    before = names[: names.index(LAST)]
    assert set(before) <= {"Check the runner", *(step["name"] for step in set_up_steps("."))}
