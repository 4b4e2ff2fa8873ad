"""Write the generated parts of README.md and of the pages in docs/, sim_action/parts.py, and the JSON Schemas.

The schemas are not committed.

A generated part stands between `<!-- generated: NAME ARGUMENT ... -->` and `<!-- end -->`. BLOCKS has a function for
each NAME. Its links start at the root of the repository, as in `](/examples/...)`, and become relative to the page.
With `--check`, nothing is written; the exit code is 1 if a file is stale.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable
from pathlib import Path

from sim_action.app.schema import SCHEMAS, schema_text
from sim_action.scenario.model import ExpectationOptions
from sim_action.sensors import Mounting
from sim_action.state.transmission import Transmission
from sim_action.world import Disturbance, PathPoint
from tools.docs.generators import accuracy, actions, by_hand, command_line, lists, scenario, surprises

ROOT = Path(__file__).resolve().parents[2]
SITE = ROOT / "docs/_site"
BLOCK = re.compile(r"(<!-- generated: ([a-z-]+)((?: [\w./-]+)*) -->\n).*?(<!-- end -->)", re.DOTALL)

BLOCKS: dict[str, Callable[..., str]] = {
    "inputs": actions.inputs,
    "outputs": actions.outputs,
    "templates": actions.templates,
    "command-line": command_line.commands,
    "sections": scenario.sections,
    "assertion-sections": scenario.assertion_sections,
    "examples": scenario.examples,
    "file": scenario.file_of,
    "first-scenario": scenario.first_scenario,
    "scenario-keys": scenario.scenario_keys,
    "expectation-keys": lambda: scenario.keys_table(ExpectationOptions),
    "sensor-keys": lambda: scenario.keys_table(Mounting, without=Transmission),
    "transmission-keys": lambda: scenario.keys_table(Transmission),
    "path-keys": lambda: scenario.keys_table(PathPoint),
    "disturbance-keys": lambda: scenario.keys_table(Disturbance),
    "controller-types": lambda: scenario.attributes(*scenario.CONTROLLER_TYPES),
    "judge-types": lambda: scenario.attributes(*scenario.JUDGE_TYPES),
    "readings": lambda: scenario.attributes(*scenario.READINGS),
    "reading-columns": lists.reading_columns,
    "assertions": scenario.assertions,
    "models": lists.models,
    "claim-rules": lists.claim_rules,
    "rules": lists.rules,
    "parts": lists.parts,
    "recordings": lists.recordings,
    "statuses": lists.statuses,
    "mutants": lists.mutants,
    "passed-variables": lists.passed_variables,
    "privileged-events": lists.privileged_events,
    "exit-codes": lists.exit_codes,
    "defaults": lists.defaults,
    "accuracy": accuracy.errors,
    "by-hand": by_hand.costs,
    "differences": accuracy.differences,
    "surprises": surprises.rows,
}


def pages() -> list[Path]:
    """Return the README and every page of the documents."""
    return [ROOT / "README.md", *sorted(p for p in (ROOT / "docs").rglob("*.md") if SITE not in p.parents)]


def generated() -> dict[Path, str]:
    """Return each generated file with the text that it should hold."""
    return {path: _filled(path) for path in pages()} | {ROOT / "sim_action/parts.py": scenario.parts_module()}


def _filled(page: Path) -> str:
    def block(match: re.Match[str]) -> str:
        if match[2] not in BLOCKS:  # one that another program writes: tools/docs/robots.py
            return match[0]
        return f"{match[1]}{_with_relative_links(BLOCKS[match[2]](*match[3].split()), page)}{match[4]}"

    return BLOCK.sub(block, page.read_text(encoding="utf-8"))


def _with_relative_links(text: str, page: Path) -> str:
    up = Path(os.path.relpath(ROOT, page.parent)).as_posix()
    return text.replace("](/", "](" if up == "." else f"]({up}/")


def main() -> None:
    """Write all generated parts, or with `--check` exit with 1 if one is stale."""
    stale = {path: text for path, text in generated().items() if path.read_text(encoding="utf-8") != text}
    if "--check" in sys.argv:
        sys.exit(f"stale: {', '.join(str(p.relative_to(ROOT)) for p in stale)}; run: make docs" if stale else 0)
    for path, text in stale.items():
        path.write_text(text, encoding="utf-8")
        print(f"wrote {path.relative_to(ROOT)}")
    for name, schema in SCHEMAS.items():
        (ROOT / f"docs/{name}.schema.json").write_text(schema_text(schema()), encoding="utf-8")


if __name__ == "__main__":
    main()
