"""The page "Thirty ways to check nothing": each way gives the status, the rule and the message that the page states."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from tests.integration.conftest import sim_action

PAGE = (Path(__file__).parents[2] / "docs/scenario/check-nothing.md").read_text(encoding="utf-8")
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


def given(outcome: dict[str, Any]) -> tuple[str, list[str], str]:
    """The status of an outcome in the words of the page, the rules of its findings, and all messages."""
    messages = [told["message"] for told in (*outcome["failures"], *outcome["warnings"])]
    messages += [told["verdict"]["message"] for told in outcome["expectations"]]
    invalid = any(failure["kind"] == "invalid" for failure in outcome["failures"])
    status = "refused" if invalid else outcome["status"].replace("_", " ")
    status += " with a warning" if status == "passed" and outcome["warnings"] else ""
    rules = [*re.findall(r"\[([a-z-]+)\]$", "\n".join(messages), re.MULTILINE)]
    return status, rules + [told["rule"] for told in outcome["warnings"]], "\n".join(messages)


def test_there_are_thirty() -> None:
    assert [way.name.split(". ")[0] for way in WAYS] == [str(number) for number in range(1, 31)]
    assert all(len(way.fragment.splitlines()) <= 4 for way in WAYS)


def test_each_way_gives_what_the_page_states(tmp_path: Path) -> None:
    (tmp_path / ".git").mkdir()
    for number, way in enumerate(WAYS, start=1):
        way.write(tmp_path / f"{number:02}")
    ran = sim_action(tmp_path, "run", "--no-report", ".")
    assert ran.returncode == 2, ran.stdout + ran.stderr
    outcomes = json.loads((tmp_path / "sim-results/results.json").read_text())["outcomes"]
    found = {outcome["file"].split("/")[0]: given(outcome) for outcome in outcomes}
    wrong = []
    for number, way in enumerate(WAYS, start=1):
        (stated, rule, message), (status, rules, messages) = way.stated, found[f"{number:02}"]
        if stated != status or rules != [rule] * bool(rule) or message not in messages:
            wrong.append((way.name, stated, status, rules, messages))
    assert not wrong
