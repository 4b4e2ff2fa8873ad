"""Tables of the actions' inputs and outputs, and of the workflow templates."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import yaml

from tools.docs.generators.markdown import bullets, escaped

ALIKE = 9  # words
ROOT = Path(__file__).resolve().parents[3]


def inputs(action: str) -> str:
    """Return the list of an action's inputs. Removed inputs are left out.

    Inputs that another action shares with `action.yml` are only named.
    """
    read = _read(action)["inputs"].items()
    entries = {name: _input(entry) for name, entry in read if "deprecationMessage" not in entry}
    main = _read("action.yml")["inputs"]
    same = [n for n, text in entries.items() if action != "action.yml" and n in main and _is_alike(text, main[n])]
    shown = bullets((f"`{name}`", entries[name]) for name in entries if name not in same)
    if same:
        shown += f"- {', '.join(f'`{name}`' for name in same)}: as in [the main action](/docs/workflow/inputs.md)\n"
    return shown


def _is_alike(text: str, entry: dict[str, str]) -> bool:
    """Return True if a text begins as the one of an input: both do the same, with the words of their action."""
    return text.split()[:ALIKE] == _input(entry).split()[:ALIKE]


def _input(entry: dict[str, str]) -> str:
    text = _description(entry)
    if entry.get("required"):
        return f"Required. {text}"
    return f"{text} Default: `{entry['default']}`." if entry["default"] else text


def outputs(action: str) -> str:
    """Return the list of an action's outputs; outputs of `action.yml` are only named."""
    main = _read("action.yml")["outputs"] if action != "action.yml" else {}
    entries = _read(action)["outputs"]
    shown = bullets((f"`{name}`", _description(entry)) for name, entry in entries.items() if name not in main)
    same = [f"`{name}`" for name in entries if name in main]
    return shown + (f"- {', '.join(same)}: as in [the main action](/docs/workflow/outputs.md)\n" if same else "")


def templates() -> str:
    """Return the list of workflow templates: a link, and the first sentence of the file."""
    rows = []
    for path in sorted(ROOT.glob("examples/workflows/*.yml"), key=lambda path: (path.stem != "simulation", path.stem)):
        head = itertools.takewhile(lambda line: line.startswith("#"), path.read_text(encoding="utf-8").splitlines())
        _, _, purpose = " ".join(line.lstrip("# ") for line in head).partition(": ")
        sentence, _, _ = purpose.partition(". ")
        rows.append((f"[`{path.name}`](/{path.relative_to(ROOT)})", sentence[:1].upper() + sentence[1:]))
    return bullets(rows)


def _read(path: str) -> dict[str, dict[str, Any]]:
    action: dict[str, dict[str, Any]] = yaml.safe_load((ROOT / path).read_text(encoding="utf-8"))
    return action


def _description(entry: dict[str, str]) -> str:
    return escaped(" ".join(entry["description"].split()))
