"""The scenarios and the controller of the documents do what they say, on every engine and in a new repository."""

from __future__ import annotations

import json
import re
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import yaml

from sim_action.engines import installed
from tests.integration.conftest import ACTION, outcomes, sim_action
from tests.integration.github import CacheStore, WorkflowResult, run_workflow


def blocks(language: str, page: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", (ACTION / page).read_text(encoding="utf-8"), re.DOTALL)


CONTROLLED = """\
name: burger stops half a metre in front of the wall
robot: {model: turtlebot3_burger}
world: {objects: [{name: wall, box: [0.1, 2.0, 0.5], pose: {x: 3.0}}]}
commands: {script: controller.py}
expect:
  - stops_before: {body: wall, gap: [49 cm, 51 cm]}
  - clearance: {at_least: 49 cm, to: [wall]}
duration: 15 s
time_limit: 15 s
"""


@pytest.mark.parametrize("engine", installed())
def test_scenarios_of_pages_pass(engine: str, tmp_path: Path) -> None:
    straight, stops = [text for text in blocks("yaml", "README.md") if "time_limit:" in text]
    first = blocks("yaml", "docs/scenario/index.md")[0]
    (tmp_path / "straight.sim.yml").write_text(straight)
    (tmp_path / "stops.sim.yml").write_text(stops)
    # It stays where it stopped, however long it runs.
    (tmp_path / "long.sim.yml").write_text(
        stops.replace("duration: 8 s", "duration: 20 s").replace("name: burger", "name: long", 1)
    )
    (tmp_path / "first.sim.yml").write_text(first)
    (tmp_path / "controller.py").write_text(blocks("python", "README.md")[0])
    (tmp_path / "controlled.sim.yml").write_text(CONTROLLED)

    ran = sim_action(tmp_path, "run", "--backend", engine, "--no-report", "-v", PATH="", COLUMNS="120")

    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert "5 passed in " in ran.stdout  # without warnings


WORKFLOW = ".github/workflows/simulation.yml"
SCENARIO = "simulation/drive_straight.sim.yml"


def named(path: str) -> str:
    text: str
    (text,) = [block for block in blocks("yaml", "README.md") if block.startswith(f"# {path}\n")]
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
    (wall,) = [block for block in blocks("yaml", "README.md") if block.startswith("world:")]
    scenario = named(SCENARIO).replace("commands:", f"{wall}commands:")
    (repository / SCENARIO).write_text(scenario, encoding="utf-8")
    red = pushed("pull_request")
    assert red.conclusion == "failure"
    line = next(number for number, text in enumerate(scenario.splitlines(), 1) if "travel:" in text)
    (annotation,) = red.jobs["simulation"].annotations
    assert (annotation.level, annotation.file, annotation.line) == ("error", SCENARIO, line)
    (repository / SCENARIO).write_text(scenario.replace("x: 1.0}}", "x: 3.0}}"), encoding="utf-8")
    assert pushed("pull_request").conclusion == "success"


# Each of "Thirty ways to check nothing" gives the status, the rule and the message that the page states.
PAGE = (ACTION / "docs/scenario/check-nothing.md").read_text(encoding="utf-8")
BASE = next(re.finditer(r"```yaml\n(.*?)```", PAGE, re.DOTALL))[1]
STATED = re.compile(
    r"\*\*(refused|failed|not exercised|passed|passed with a warning)\*\*(?: \[`([a-z-]+)`\])?:\s`([^`]+)`"
)


@dataclass(frozen=True)
class Way:
    """One of the thirty: its heading and the text below it."""

    name: str
    text: str

    @property
    def fragment(self) -> str:
        """The keys that replace those of the scenario at the top of the page."""
        return self._block("yaml")

    @property
    def stated(self) -> tuple[str, str, str]:
        """The status, the rule (may be empty) and a part of the message."""
        (found,) = STATED.findall(re.sub(r"```.*?```", "", self.text, flags=re.DOTALL))
        return found[0], found[1], " ".join(found[2].split())

    def write(self, folder: Path) -> None:
        """Write the scenario, and the files that its fragment names."""
        folder.mkdir()
        scenario = {**yaml.safe_load(BASE), **yaml.safe_load(self.fragment), "name": self.name}
        (folder / "way.sim.yml").write_text(json.dumps(scenario))
        for language, suffix in (("python", "py"), ("text", "csv")):
            for name in re.findall(rf"\w+\.{suffix}\b", self.fragment):
                (folder / name).write_text(self._block(language))

    def _block(self, language: str) -> str:
        (found,) = re.findall(rf"```{language}\n(.*?)```", self.text, re.DOTALL)
        return str(found)


_, *_parts = re.split(r"^### (?=\d+\. )", PAGE, flags=re.MULTILINE)
WAYS = [Way(*part.split("\n", 1)) for part in _parts]


def reported(outcome: dict[str, Any]) -> tuple[str, list[str], str]:
    """The status of an outcome in the words of the page, the rules of its findings, and all messages."""
    messages = [finding["message"] for finding in (*outcome["failures"], *outcome["warnings"])]
    messages += [expectation["verdict"]["message"] for expectation in outcome["expectations"]]
    invalid = any(failure["kind"] == "invalid" for failure in outcome["failures"])
    status = "refused" if invalid else outcome["status"].replace("_", " ")
    status += " with a warning" if status == "passed" and outcome["warnings"] else ""
    rules = re.findall(r"\[([a-z-]+)\]$", "\n".join(messages), re.MULTILINE)
    return status, rules + [warning["rule"] for warning in outcome["warnings"]], "\n".join(messages)


def test_there_are_thirty() -> None:
    assert [way.name.split(". ")[0] for way in WAYS] == [str(number) for number in range(1, 31)]
    assert all(len(way.fragment.splitlines()) <= 4 for way in WAYS)


def test_each_way_gives_what_the_page_states(tmp_path: Path) -> None:
    (tmp_path / ".git").mkdir()
    for number, way in enumerate(WAYS, start=1):
        way.write(tmp_path / f"{number:02}")
    ran = sim_action(tmp_path, "run", "--no-report", ".")
    assert ran.returncode == 2, ran.stdout + ran.stderr
    by_number = {outcome["file"].split("/")[0]: reported(outcome) for outcome in outcomes(tmp_path)}
    wrong = []
    for number, way in enumerate(WAYS, start=1):
        (stated, rule, message), (status, rules, messages) = way.stated, by_number[f"{number:02}"]
        if stated != status or rules != [rule] * bool(rule) or message not in messages:
            wrong.append((way.name, stated, status, rules, messages))
    assert not wrong
