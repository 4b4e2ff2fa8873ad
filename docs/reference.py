"""The sections of docs/scenario.md: one for each drive, command and sensor, and for what controllers get and give."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel

from sim_action.core.registry import Table
from sim_action.scenario import catalogue
from sim_action.state.trace import Trace

ROOT = Path(__file__).resolve().parent.parent
LANGUAGES = {".yaml": "yaml", ".py": "python", ".js": "javascript", ".pl": "perl", ".csv": "csv"}
KEYS = ("key", "takes", "default", "meaning")
WORKS_OUT = (Trace,)
LONGEST = 40  # lines of a file beside an example that are shown


def table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    """A Markdown table."""
    lines = [head, tuple("---" for _ in head), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines) + "\n"


def sections(family: str, entries: Table[Any]) -> str:
    """A section for each entry of a family: what it is, its keys, an example that the tests run."""
    return "\n".join(_section(family, name, entries.load(name)) for name in entries)


def example(family: str, name: str) -> Path:
    """The scenario that shows one entry of a family."""
    return ROOT / "examples" / family / f"{name}.sim.yml"


def examples(family: str, *names: str) -> str:
    """Scenarios of one family, each with the files that it names beside it."""
    return "\n".join(_shown(example(family, name)) for name in names)


def _section(family: str, name: str, model: type[BaseModel]) -> str:
    parts = [f"### `{name}`\n", f"{inspect.getdoc(model)}\n"]
    if rows := list(keys(model)):
        parts.append(table(KEYS, rows))
    return "\n".join([*parts, _shown(example(family, name))])


def keys(model: type[BaseModel], above: str = "") -> Iterator[tuple[str, str, str, str]]:
    """Each key with those below it."""
    for entry in catalogue.fields(model):
        yield f"`{above}{entry.name}`", entry.takes, entry.default, entry.description
        annotation = next(f.annotation for n, f in model.model_fields.items() if (f.alias or n) == entry.name)
        for below, several in _models_in(annotation):
            yield from keys(below, f"{above}{entry.name}{'[]' if several else ''}.")


def _models_in(annotation: Any, *, several: bool = False) -> Iterator[tuple[type[BaseModel], bool]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation, several
    several = several or getattr(annotation, "__origin__", None) is tuple
    for part in get_args(annotation):
        yield from _models_in(part, several=several)


def _shown(path: Path) -> str:
    """An example, and the files that it names beside it."""
    text = path.read_text(encoding="utf-8")
    beside = [p for p in sorted(path.parent.iterdir()) if p.suffix in LANGUAGES and re.search(rf"\b{p.name}\b", text)]
    shown = [_block(path, "yaml", text), *(_block(p, LANGUAGES[p.suffix], p.read_text("utf-8")) for p in beside)]
    return "\n".join(shown)


def _block(path: Path, language: str, text: str) -> str:
    lines = text.splitlines()
    if len(lines) > LONGEST and language == "csv":
        text = "\n".join([*lines[:10], "..."]) + "\n"
    place = path.relative_to(ROOT)
    return f"[`{place}`](../{place}):\n\n```{language}\n{text}```\n"


def attributes(*types: type) -> str:
    """What controllers get or give: each type with its attributes, from its docstring."""
    return "\n".join(_type_section(each) for each in types)


def _type_section(each: type) -> str:
    text, _, listed = (inspect.getdoc(each) or "").partition("\nAttributes:\n")
    heads = re.findall(r"^ {4}(\w[\w, ]*): (.*(?:\n {8}.*)*)", listed, re.MULTILINE)
    rows = [(f"`{name}`", " ".join(meaning.split())) for name, meaning in (*heads, *_worked_out(each))]
    return f"#### `{each.__name__}`\n\n{text.rstrip()}\n" + (
        f"\n{table(('attribute', 'what it is'), rows)}" if rows else ""
    )


def _worked_out(each: type) -> Iterator[tuple[str, str]]:
    """What a type of arrays works out when it is asked: a name, or a call, and what it is."""
    for name, member in vars(each).items():
        asked = member.fget if isinstance(member, property) else getattr(member, "func", member)
        if each in WORKS_OUT and inspect.isfunction(asked) and not name.startswith("_"):
            parameters = list(inspect.signature(asked).parameters)[1:]
            call = f"({', '.join(parameters)})" if asked is member else ""
            yield f"{name}{call}", inspect.getdoc(asked) or ""
