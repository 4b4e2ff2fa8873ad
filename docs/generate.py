"""Writes what is made from the code: the README's tables and the JSON Schema. `--check` only says what is stale."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import yaml

from sim_action import catalogue
from sim_action.catalogue import Entry, FieldEntry
from sim_action.errors import ExitCode
from sim_action.scenario import ExpectationOptions, Scenario, TraceSettings
from sim_action.schema import schema_text
from sim_action.world import Body, Ground, Physics, Placement, Robot

ROOT = Path(__file__).resolve().parent.parent
README = ROOT / "README.md"
SCHEMA = ROOT / "docs/scenario.schema.json"
BLOCK = re.compile(r"(<!-- generated: ([a-z-]+) -->\n).*?(<!-- end -->)", re.DOTALL)

EXIT_CODES = {
    ExitCode.PASSED: "all scenarios passed",
    ExitCode.FAILED: "a scenario failed, or has no verdict (crash, wall limit, script error)",
    ExitCode.INVALID: "a scenario, or the command line, is invalid",
    ExitCode.INTERNAL: "a fault of sim-action itself",
    ExitCode.NO_SCENARIO: "no scenario found",
    ExitCode.INTERRUPTED: "interrupted",
}


def table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    """A Markdown table."""
    lines = [head, tuple("---" for _ in head), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines) + "\n"


def _keys(fields: Iterable[FieldEntry]) -> str:
    return "<br>".join(
        f"`{field.name}`: {field.takes}"
        + (f" [{field.default}]" if field.default else "")
        + (f"; {field.description}" if field.description else "")
        for field in fields
    )


def _entries(entries: Iterable[Entry], kind: str) -> str:
    rows = ((f"`{entry.name}`", entry.summary, _keys(entry.fields)) for entry in entries)
    return table((kind, "what it is", "keys: what they take [default]"), rows)


def _scenario_keys() -> str:
    parts = (
        ("", Scenario),
        ("robot.", Robot),
        ("robot.pose.", Placement),
        ("world.ground.", Ground),
        ("world.objects[].", Body),
        ("physics.", Physics),
        ("expect[].", ExpectationOptions),
        ("trace.", TraceSettings),
    )
    rows = (
        (f"`{prefix}{field.name}`", field.takes, field.default, field.description)
        for prefix, model in parts
        for field in catalogue.fields(model)
        if field.name not in ("robot", "world", "physics", "commands", "expect", "trace", "pose")
    )
    return table(("key", "takes", "default", "meaning"), rows)


def _action(part: str) -> str:
    action: dict[str, Any] = yaml.safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
    if part == "inputs":
        rows = (
            (f"`{name}`", f"`{e['default']}`", " ".join(e["description"].split())) for name, e in _items(action, part)
        )
        return table(("input", "default", "meaning"), rows)
    return table(
        ("output", "meaning"), ((f"`{n}`", " ".join(e["description"].split())) for n, e in _items(action, part))
    )


def _items(action: dict[str, Any], part: str) -> Iterable[tuple[str, Any]]:
    return action[part].items()


BLOCKS: dict[str, Callable[[], str]] = {
    "assertions": lambda: _entries(catalogue.assertions(), "assertion"),
    "commands": lambda: _entries(catalogue.commands(), "command"),
    "drives": lambda: _entries(catalogue.drives(), "drive"),
    "models": lambda: table(("robot", "what it is"), ((f"`{e.name}`", e.summary) for e in catalogue.models())),
    "scenario-keys": _scenario_keys,
    "inputs": lambda: _action("inputs"),
    "outputs": lambda: _action("outputs"),
    "exit-codes": lambda: table(("code", "meaning"), ((str(code.value), text) for code, text in EXIT_CODES.items())),
}


def generated() -> dict[Path, str]:
    """Each file with what it should hold."""
    readme = BLOCK.sub(lambda m: f"{m[1]}{BLOCKS[m[2]]()}{m[3]}", README.read_text(encoding="utf-8"))
    return {README: readme, SCHEMA: schema_text()}


def main() -> None:
    """Writes, or with `--check` fails if something would change."""
    stale = {p: text for p, text in generated().items() if not p.exists() or p.read_text(encoding="utf-8") != text}
    if "--check" in sys.argv:
        sys.exit(f"stale: {', '.join(str(p.relative_to(ROOT)) for p in stale)}; run: make docs" if stale else 0)
    for path, text in stale.items():
        path.write_text(text, encoding="utf-8")
        print(f"wrote {path.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
