"""Survey the robot models below folders: which of them load without a key in the scenario, and why others do not.

    python -m tools.docs.survey FOLDER... [--json FILE] [--time-limit SECONDS] [--jobs N]

Each model is read as `sim-action inspect` reads it, in a process of its own, so that no model can end the survey. The
workspace is the FOLDER. Models are files of URDF and xacro, SDF models, and MJCF files with bodies; xacro files that
others include are parts, and so are files without a link.

A model is complete if the folder has each file that it needs: meshes and included files, not textures. A file counts as
present if a file of the folder ends with the same three names (arm/meshes/base.stl), or as many as the model states, in
any letter case. The path of a relative name must exist. What sim-action found is present in any case.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import re
import sys
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field
from functools import cached_property
from itertools import chain
from multiprocessing.connection import Connection
from pathlib import Path, PurePosixPath
from typing import Final
from urllib.parse import unquote

from sim_action.app.inspect import inspect_model
from sim_action.core.errors import ModelError, RefusedModel
from sim_action.core.workspace import Workspace
from sim_action.robot.documents.packages import PackageError, Packages, find_model_file
from sim_action.robot.model.robot_spec import Robot
from tools.docs.generators.markdown import table

HEAD: Final = ("model", "loads", "mass", "needs", "notes", "drive")
_SUFFIXES: Final = (".urdf", ".xacro", ".sdf", ".xml")
_SKIPPED: Final = frozenset({".git", "node_modules", "__pycache__"})
_TIME_LIMIT_S: Final = 60.0
_MAX_SHOWN_CHARS: Final = 300
_NAMED: Final = re.compile(r"""<(?!texture\b)(?:\w+:)?\w+\b[^<>]*?\b(?:filename|file)\s*=\s*["']([^"']+)["']""")
_URIS: Final = re.compile(r"<(?:mesh|include)>(?:(?!</(?:mesh|include)>).)*?<uri>\s*([^<]*?)\s*</uri>", re.DOTALL)
_INCLUDED: Final = re.compile(r"""<(?:xacro:)?include\b[^<>]*?\b(?:filename|file)\s*=\s*["']([^"']+)["']""")
_MISSING_FILE: Final = re.compile(r"'([^']+)' (?:does not exist \(looked for ([^)]+)\)|is not a valid reference)")
_MISSING_PACKAGE: Final = re.compile(r"refers to the (?:package|model) '([^']+)', which was not found")
_COMMENTS: Final = re.compile(r"<!--.*?-->", re.DOTALL)
_READ: Final = frozenset({".stl", ".obj", ".dae", ".msh", ".xacro", ".xml", ".sdf", ".urdf", ".mesh", ".ply"})


@dataclass(frozen=True)
class Survey:
    """The result of reading one model.

    Attributes:
        model: the path below the folder.
        loads: True if it loads without `allow` and other keys.
        reasons: rule and message of each problem without such keys; "time-limit" and "crash" are rules, too.
        mass: in kg; None if the model does not load with keys either.
        needs: the rules that `robot.allow` must name for it to load; empty if that does not help.
        notes: the rule of each note, with its count.
        drive: the recognised drive; empty if there is none.
        is_part: True for a file without a model, such as a file of macros.
        is_complete: True if the folder has all files that the model names.
        missing: the names of the files and packages that the folder lacks.
        absent: the names that sim-action did not find, and where it searched the files.
    """

    model: str
    loads: bool = False
    reasons: tuple[tuple[str, str], ...] = ()
    mass: float | None = None
    needs: tuple[str, ...] = ()
    base: str = ""
    notes: dict[str, int] = field(default_factory=dict)
    drive: str = ""
    is_part: bool = False
    is_complete: bool = True
    missing: tuple[str, ...] = ()
    absent: tuple[tuple[str, str], ...] = ()
    seconds: float = 0.0


class Collection:
    """A folder of models."""

    def __init__(self, folder: Path, skipped: frozenset[str] = frozenset()) -> None:
        self.folder = folder.resolve()
        self._skipped = _SKIPPED | skipped

    @cached_property
    def files(self) -> tuple[Path, ...]:
        """All files, in the order of their names."""
        found = list[Path]()
        for folder, below, names in os.walk(self.folder):
            below[:] = sorted(name for name in below if name not in self._skipped)
            found += [Path(folder, name) for name in names]
        return tuple(sorted(found))

    @cached_property
    def models(self) -> tuple[Path, ...]:
        """The files of models."""
        candidates = {path: _text(path) for path in self.files if path.suffix in _SUFFIXES}
        included = {PurePosixPath(name).name for text in candidates.values() for name in _INCLUDED.findall(text)}
        return tuple(path for path, text in candidates.items() if self._is_model(path, text, included))

    def missing(self, path: Path, text: str) -> Iterator[str]:
        """Yield the files that the text of a model names, and that the folder lacks."""
        for name in dict.fromkeys((*_NAMED.findall(text), *_URIS.findall(text))):
            stated = re.sub(r"\$\(find ([\w.-]+)\)", r"\1", name).replace("\\", "/")
            place = unquote(stated.partition("://")[2] or stated)
            known = PurePosixPath(place.casefold())
            is_read = known.suffix in _READ or (not known.suffix and path.suffix == ".sdf")
            if is_read and "$" not in place and not self._has(name, known, path):
                yield name

    def lacks(self, absent: Iterable[tuple[str, str]]) -> Iterator[str]:
        """Yield the names of packages and files that sim-action did not find, and that are nowhere in the folder."""
        for name, place in absent:
            known = PurePosixPath((name.partition("://")[2] or place or name).casefold())
            if known.parts[-3:] not in self._endings:
                yield name

    def _has(self, name: str, known: PurePosixPath, referrer: Path) -> bool:
        if ":" not in name and "$" not in name:
            beside = os.path.normpath(referrer.relative_to(self.folder.parent).parent / known).casefold()
            if Path(beside).parts in self._endings or referrer.suffix != ".xml":
                return Path(beside).parts in self._endings
        return known.parts[-3:] in self._endings

    def _is_model(self, path: Path, text: str, included: set[str]) -> bool:
        if path.suffix == ".xml":
            body = re.search(r"<worldbody\b.*<(?:body|frame|attach)\b", text, re.DOTALL)
            return re.search(r"<mujoco\b", text) is not None and body is not None
        if path.suffix == ".sdf":
            if "<model" not in text or "<world" in text:
                return False
            try:
                packages = Packages(Workspace(path.parent, self.folder), environment={})
                # Of several versions in a folder, the newest counts.
                return find_model_file(str(path.parent), path, packages).path == path.resolve()
            except (PackageError, ModelError):
                return True
        root = re.search(r"<robot\b[^<>]*>", text)
        if path.suffix == ".urdf":
            return root is not None and "<link" in text
        is_part = path.suffix == ".xacro" and (path.name in included or not root or "name" not in root[0])
        return root is not None and not is_part

    @cached_property
    def _endings(self) -> set[tuple[str, ...]]:
        paths = [path.relative_to(self.folder.parent) for path in self.files]
        paths += list(dict.fromkeys(folder for path in paths for folder in path.parents))
        return {tuple(map(str.casefold, path.parts[-count:])) for path in paths for count in (0, 1, 2, 3)}


def _text(path: Path) -> str:
    try:
        return _COMMENTS.sub("", path.read_text(encoding="utf-8", errors="replace"))
    except OSError:
        return ""


def surveyed(
    folder: Path, time_limit_s: float = _TIME_LIMIT_S, jobs: int = 1, skipped: frozenset[str] = frozenset()
) -> list[Survey]:
    """Return the results of all models below a folder, in the order of their paths.

    :param skipped: names of folders that are left out.
    """
    collection = Collection(folder, skipped)
    with ThreadPoolExecutor(jobs) as pool:
        return list(pool.map(lambda path: _one(collection, path, time_limit_s), collection.models))


def _one(collection: Collection, path: Path, time_limit_s: float) -> Survey:
    """Return the result of one model, read in a process of its own."""
    model = str(path.relative_to(collection.folder))
    start = time.monotonic()
    ours, theirs = multiprocessing.Pipe(duplex=False)
    child = multiprocessing.get_context("fork").Process(target=_send, args=(theirs, model, collection.folder))
    child.start()
    theirs.close()
    try:
        result = Survey(**ours.recv()) if ours.poll(time_limit_s) else None
    except EOFError:
        result = Survey(model, reasons=(("crash", "the process ended"),))
    if result is None:
        child.kill()
        result = Survey(model, reasons=(("time-limit", f"more than {time_limit_s:g} s"),))
    child.join()
    missing = tuple(dict.fromkeys(collection.lacks(result.absent)))
    if result.mass is None:
        missing = (*missing, *collection.missing(path, _text(path)))
    facts = {**asdict(result), "missing": missing, "is_complete": not missing, "seconds": time.monotonic() - start}
    return Survey(**facts)


def _send(pipe: Connection, model: str, folder: Path) -> None:
    # A program in the model's file must not write into the survey's output.
    sys.stdout = sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115, PTH123 - until the process ends
    pipe.send(asdict(survey(model, folder)))


def survey(model: str, folder: Path) -> Survey:
    """Return the result of one model of a folder, read in this process."""
    workspace = Workspace(folder, folder)
    try:
        found = inspect_model(Robot(model=model), workspace)
    except RefusedModel as refused:
        reasons = tuple(_rule(problem.message) for problem in refused.problems)
        absent = _absent([problem.message for problem in refused.problems])
        return Survey(model, reasons=reasons, is_part=_is_part(model, reasons), absent=absent)
    except ModelError as error:
        return Survey(model, reasons=(("refused", str(error)[:_MAX_SHOWN_CHARS]),), absent=_absent([str(error)]))
    except Exception as error:  # noqa: BLE001 - any error is a result
        return Survey(model, reasons=(("internal-error", f"{type(error).__name__}: {error}"[:_MAX_SHOWN_CHARS]),))
    errors = [finding for finding in found.findings if finding.level == "error"]
    return Survey(
        model,
        loads=not errors,
        reasons=tuple((finding.rule, finding.message[:_MAX_SHOWN_CHARS]) for finding in errors),
        mass=found.mass,
        needs=found.needs,
        base="fixed" if "\n  base: fixed" in found.robot else "",
        notes=dict(Counter(finding.rule for finding in found.findings if finding.level == "warning")),
        drive=found.drive or "",
        is_part=not found.links,
        absent=_absent([finding.message for finding in found.findings]),
    )


def _rule(message: str) -> tuple[str, str]:
    """Return the rule at the end of a message, and the message."""
    match = re.fullmatch(r"(.*) \[([a-z-]+)\]", message, re.DOTALL)
    text, rule = match.groups() if match else (message, "refused")
    return rule, text[:_MAX_SHOWN_CHARS]


def _absent(messages: Iterable[str]) -> tuple[tuple[str, str], ...]:
    """Return the names in the messages about missing files and packages, each with the place where it was searched."""
    files = ((found[1], found[2] or "") for message in messages for found in _MISSING_FILE.finditer(message))
    packages = ((found[1], "") for message in messages for found in _MISSING_PACKAGE.finditer(message))
    return tuple(chain(files, packages))


def _is_part(model: str, reasons: Iterable[tuple[str, str]]) -> bool:
    rules = {rule for rule, _ in reasons}
    return model.endswith(".xacro") and bool(rules & {"not-a-robot"})


def row(result: Survey, name: str) -> tuple[str, ...]:
    """Return the row of a model in a table."""
    rules = Counter(rule for rule, _ in result.reasons)
    refused = "no: " + ", ".join(f"`{rule}`" for rule in rules)
    needs = [f"`allow: [{', '.join(result.needs)}]`"] if result.needs else []
    needs += ["`base: fixed`"] if result.base else []
    return (
        name,
        "yes" if result.loads else refused,
        "" if result.mass is None else f"{result.mass:.4g} kg",
        "<br>".join(needs) or ("none" if result.loads else ""),
        rules_cell(result.notes),
        result.drive.partition(":")[0],
    )


def rules_cell(counts: Mapping[str, int]) -> str:
    """Return the cell of a table with the rules of findings and their counts."""
    return "<br>".join(f"`{rule}` {count}" for rule, count in counts.items()) or "none"


def share(results: Iterable[Survey]) -> tuple[str, str, str, str]:
    """Return the number of models, how many load, how many are complete, and how many of these load, as text."""
    models = [result for result in results if not result.is_part]
    complete = [result for result in models if result.is_complete]
    loads = sum(result.loads for result in complete)
    part = f" ({100 * loads / len(complete):.1f} %)" if complete else ""
    return str(len(models)), str(sum(result.loads for result in models)), str(len(complete)), f"{loads}{part}"


def summary(results: Iterable[Survey]) -> str:
    """Return the share of models that load, as a line of text."""
    models, loading, complete, good = share(results)
    return f"{models} models, {loading} load without a key; {complete} are complete, and {good} of these load"


def main() -> None:
    """Survey the folders of the command line, and print a table for each of them."""
    parser = argparse.ArgumentParser(description="Survey the robot models below folders.")
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER")
    parser.add_argument("--json", type=Path, help="file for all results")
    parser.add_argument("--time-limit", type=float, default=_TIME_LIMIT_S, metavar="SECONDS", help="for each model")
    parser.add_argument("--jobs", type=int, default=1, help="models that are read at the same time")
    options = parser.parse_args()
    everything = dict[str, list[Survey]]()
    for folder in options.folders:
        results = everything[folder.name] = surveyed(folder, options.time_limit, options.jobs)
        models = (result for result in results if not result.is_part)
        print(f"## {folder.name}\n\n{summary(results)}\n\n{table(HEAD, (row(found, found.model) for found in models))}")
    print(f"all: {summary(found for results in everything.values() for found in results)}")
    if options.json:
        facts = {name: [asdict(found) for found in results] for name, results in everything.items()}
        options.json.write_text(json.dumps(facts, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
