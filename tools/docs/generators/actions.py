"""Tables of the actions' inputs and outputs, and of the workflow templates."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import yaml

from tools.docs.generators.markdown import escaped, table

ROOT = Path(__file__).resolve().parents[3]
# The inputs that the README shows. The action has more: docs/workflow/inputs.md.
MOST_USED = ("scenario", "working-directory", "backend", "only", "repeat", "jobs", "extras", "allow-scripts")


def inputs(action: str, *names: str) -> str:
    """Return the table of an action's inputs, or of the named ones only. Removed inputs are left out."""
    read = _read(action)["inputs"].items()
    entries = {name: entry for name, entry in read if "deprecationMessage" not in entry}
    rows = ((f"`{name}`", _default(entries[name]), _description(entries[name])) for name in names or entries)
    return table(("input", "default", "meaning"), rows)


def outputs(action: str) -> str:
    """Return the table of an action's outputs."""
    rows = ((f"`{name}`", _description(entry)) for name, entry in _read(action)["outputs"].items())
    return table(("output", "meaning"), rows)


def templates() -> str:
    """Return the table of workflow templates: a link, and the first comment of the file."""
    rows = []
    for path in sorted(ROOT.glob("examples/workflows/*.yml"), key=lambda path: (path.stem != "simulation", path.stem)):
        head = itertools.takewhile(lambda line: line.startswith("#"), path.read_text(encoding="utf-8").splitlines())
        _, _, purpose = " ".join(line.lstrip("# ") for line in head).partition(": ")
        rows.append((f"[`{path.name}`](/{path.relative_to(ROOT)})", purpose[:1].upper() + purpose[1:]))
    return table(("template", "purpose"), rows)


def _read(path: str) -> dict[str, dict[str, Any]]:
    action: dict[str, dict[str, Any]] = yaml.safe_load((ROOT / path).read_text(encoding="utf-8"))
    return action


def _default(entry: dict[str, str]) -> str:
    if entry.get("required"):
        return "required"
    return f"`{entry['default']}`" if entry["default"] else "empty"


def _description(entry: dict[str, str]) -> str:
    return escaped(" ".join(entry["description"].split()))
