"""The ten lines of README.md in a new repository: green, red when the wall is in the way, and green again."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

from tests.integration.conftest import ACTION
from tests.integration.github import CacheStore, WorkflowResult, run_workflow

README = (ACTION / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```yaml\n(.*?)```", README, re.DOTALL)
WORKFLOW = ".github/workflows/simulation.yml"
SCENARIO = "simulation/drive_straight.sim.yml"


def named(path: str) -> str:
    text: str
    (text,) = [block for block in BLOCKS if block.startswith(f"# {path}\n")]
    return text


@pytest.mark.soak
def test_a_new_repository_goes_green_red_and_green_again(tmp_path: Path, runner_temp: Path) -> None:
    repository = tmp_path / "robot"
    for path in (WORKFLOW, SCENARIO):
        (repository / path).parent.mkdir(parents=True, exist_ok=True)
        (repository / path).write_text(named(path), encoding="utf-8")
    subprocess.run(["git", "init", "--quiet"], cwd=repository, check=True)
    caches = CacheStore(tmp_path / "caches")

    def pushed(event: str) -> WorkflowResult:
        file, folder = repository / WORKFLOW, tmp_path / f"run {len(list(tmp_path.iterdir()))}"
        return run_workflow(file, repository, temp=folder, shared_temp=runner_temp, cache=caches, event_name=event)

    assert pushed("push").conclusion == "success"
    (wall,) = [block for block in BLOCKS if block.startswith("world:")]
    scenario = named(SCENARIO).replace("commands:", f"{wall}commands:")
    (repository / SCENARIO).write_text(scenario, encoding="utf-8")
    red = pushed("pull_request")
    assert red.conclusion == "failure"
    line = next(number for number, text in enumerate(scenario.splitlines(), 1) if "travel:" in text)
    (annotation,) = red.jobs["simulation"].annotations
    assert (annotation.level, annotation.file, annotation.line) == ("error", SCENARIO, line)
    (repository / SCENARIO).write_text(scenario.replace("x: 1.0}}", "x: 3.0}}"), encoding="utf-8")
    assert pushed("pull_request").conclusion == "success"
