"""Sections and tables of docs/scenario/: worlds, drives, commands, sensors, assertions, keys, types for controllers."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Final, get_args

from pydantic import BaseModel

from sim_action.app import catalogue
from sim_action.assertions import ASSERTIONS, Reference
from sim_action.cli.init import files
from sim_action.commands import COMMANDS
from sim_action.commands.robot_description import JointDescription, RobotDescription
from sim_action.core.field_types import Placement, Without
from sim_action.core.geometry import Pose, Twist
from sim_action.core.registry import Table
from sim_action.drives import DRIVES
from sim_action.robot.model.link_motion import LinkMotion
from sim_action.robot.model.robot_spec import Robot
from sim_action.scenario.model import Scenario, TraceSettings
from sim_action.sensors import SENSORS
from sim_action.state import readings
from sim_action.state.command import JointTargets, LinkWrench
from sim_action.state.observation import Contact, JointState, LinkState, Observation
from sim_action.state.trace import Trace
from sim_action.state.transmission import Transmission
from sim_action.state.verdict import Verdict
from sim_action.world import Body, Disturbance, Ground, Patch, PathPoint, Physics, World
from tools.docs.generators.markdown import fenced, table

ROOT: Final = Path(__file__).resolve().parents[3]
LANGUAGES: Final = {".yaml": "yaml", ".py": "python", ".js": "javascript", ".pl": "perl", ".csv": "csv"}
KEYS: Final = ("key", "takes", "default", "meaning")
MAX_LINES_SHOWN: Final = 40  # of a CSV file that an example names

WORLDS: Final = Table[type[BaseModel]](
    "world",
    {
        "ramp": "sim_action.world:Ramp",
        "stairs": "sim_action.world:Stairs",
        "mesh": "sim_action.world:MeshFile",
        "heightfield": "sim_action.world:Heightfield",
        "map": "sim_action.world:OccupancyMap",
        "patches": "sim_action.world:Patch",
    },
)
FAMILIES: Final[dict[str, Table[Any]]] = {
    "worlds": WORLDS,
    "drives": DRIVES,
    "commands": COMMANDS,
    "sensors": SENSORS,
    "assertions": ASSERTIONS,
}

CONTROLLER_TYPES: Final = (
    *(Observation, Pose, Twist, JointState, LinkState, Contact, JointTargets, LinkWrench),
    *(RobotDescription, JointDescription),
)
READINGS: Final = (
    readings.ContactReading,
    readings.ImuReading,
    readings.OdometryReading,
    readings.LidarScan,
    readings.CameraImage,
)
JUDGE_TYPES: Final = (Trace, LinkMotion, Verdict)
# Types whose properties and methods are listed too.
_WITH_MEMBERS: Final = (Trace, LinkMotion)

_PARTS_OF_A_SCENARIO: Final = (
    ("", Scenario),
    ("robot.", Robot),
    ("robot.pose.", Placement),
    ("world.", World),
    ("world.ground.", Ground),
    ("world.patches[].", Patch),
    ("world.objects[].", Body),
    ("world.objects[].path[].", PathPoint),
    ("world.disturbances[].", Disturbance),
    ("physics.", Physics),
    ("trace.", TraceSettings),
)
# Keys of a scenario whose own keys have rows or sections of their own.
_SHOWN_ELSEWHERE: Final = (
    *("robot", "world", "physics", "commands", "sensors", "expect", "trace", "pose"),
    *("ground", "patches", "objects", "disturbances"),
)
# Keys that every command source has; a table of their own lists them.
_OF_EVERY_SOURCE: Final = frozenset(f"`{key}`" for key in Transmission.model_fields)
# Keys of a scenario that have rows for the keys below them.
_OPENED: Final = ("agreement", "sphere", "cylinder")


def sections(family: str, *names: str) -> str:
    """Return a section for each entry of a family: its text, its keys, an example that the tests run."""
    table_of_family = FAMILIES[family]
    return "\n".join(_section(family, name, table_of_family.load(name)) for name in names or table_of_family)


def assertion_sections(page: str) -> str:
    """Return a section for each assertion of a page, in the order of their table."""
    classes = {name: ASSERTIONS.load(name) for name in ASSERTIONS}
    return "\n".join(_section("assertions", name, cls) for name, cls in classes.items() if cls.reference.page == page)


def _verdicts(reference: Reference) -> str:
    rows = zip(("passed", "failed", "not exercised"), reference[2:], strict=True)
    return table(("verdict", "when"), rows)


def assertions() -> str:
    """Return the table of assertions: a link to the section, the kind, the requirement."""
    references = {name: ASSERTIONS.load(name).reference for name in ASSERTIONS}
    rows = (
        (f"[`{entry.name}`](assertions-{of.page}.md#{entry.name})", of.kind, entry.summary)
        for entry in catalogue.assertions()
        for of in (references[entry.name],)
    )
    return table(("assertion", "goal or invariant", "requirement"), rows)


def parts_module() -> str:
    """Return sim_action/parts.py: its docstring, and the class of each part that a scenario can name."""
    paths = [path for parts in (ASSERTIONS, COMMANDS, DRIVES, SENSORS) for path in parts.paths.values()]
    places = sorted(path.split(":") for path in (*paths, "sim_action.scenario.model:DrivenRobot"))
    imports = "".join(f"from {module} import {name} as {name}\n" for module, name in places)
    head, _, _ = (ROOT / "sim_action/parts.py").read_text(encoding="utf-8").partition("\nfrom sim_action")
    return f"{head}\n{imports}"


def first_scenario() -> str:
    """Return the scenario that `sim-action init` writes, without the line for editors."""
    text = files("")["simulation/drive_straight.sim.yml"]
    return fenced("yaml", text.partition("\n")[2])


def example(family: str, name: str) -> Path:
    """Return the path of the scenario that shows one entry of a family."""
    return ROOT / "examples" / family / f"{name}.sim.yml"


def examples(family: str, *names: str) -> str:
    """Return scenarios of one family, each with the files that it names."""
    return "\n".join(_shown(example(family, name)) for name in names)


def file_of(path: str, language: str) -> str:
    """Return one file of the repository as a fenced block."""
    return fenced(language, (ROOT / path).read_text(encoding="utf-8"))


def _section(family: str, name: str, model: type[BaseModel]) -> str:
    parts = [f"## `{name}`\n", f"{inspect.getdoc(model)}\n"]
    if rows := [row for row in keys(model) if row[0] not in _OF_EVERY_SOURCE]:
        parts.append(table(KEYS, rows))
    if family == "assertions":
        parts.append(_verdicts(ASSERTIONS.load(name).reference))
    return "\n".join([*parts, _shown(example(family, name))])


def keys_table(model: type[BaseModel]) -> str:
    """Return the table of a model's keys, its own ones first."""
    return table(KEYS, sorted(keys(model), key=lambda row: row[0] in _OF_EVERY_SOURCE))


def keys(model: type[BaseModel], above: str = "") -> Iterator[tuple[str, str, str, str]]:
    """Yield a row for each key, followed by the keys below it."""
    for entry in catalogue.fields(model):
        yield f"`{above}{entry.name}`", entry.takes, entry.default, entry.description
        annotation = next(f.annotation for n, f in model.model_fields.items() if (f.alias or n) == entry.name)
        for below, step, refused in _models_in(annotation):
            start = f"{above}{entry.name}{step}."
            names = tuple(f"`{start}{name}{end}" for name in refused for end in ("`", ".", "["))
            yield from (row for row in keys(below, start) if not row[0].startswith(names))


_STEPS: Final[dict[object, str]] = {tuple: "[]", dict: ".NAME"}
"""A container -> the step from it to an entry, as tables of keys show it."""


def _models_in(
    annotation: Any, step: str = "", refused: frozenset[str] = frozenset()
) -> Iterator[tuple[type[BaseModel], str, frozenset[str]]]:
    """Yield the models in a type, each with the step to it and the keys that it does not take there."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation, step, refused
    step = step or _STEPS.get(getattr(annotation, "__origin__", None), "")
    for item in getattr(annotation, "__metadata__", ()):
        refused |= item.names if isinstance(item, Without) else frozenset()
    for part in get_args(annotation):
        yield from _models_in(part, step, refused)


def scenario_keys() -> str:
    """Return the table of all keys of a scenario that have no section of their own."""
    return table(KEYS, (row for prefix, model in _PARTS_OF_A_SCENARIO for row in _rows(prefix, model)))


def _rows(prefix: str, model: type[BaseModel]) -> Iterator[tuple[str, ...]]:
    shown = {f"`{prefix}{field.name}`" for field in catalogue.fields(model) if field.name not in _SHOWN_ELSEWHERE}
    opened = tuple(f"`{prefix}{name}." for name in _OPENED)
    return (row for row in keys(model, prefix) if row[0] in shown or row[0].startswith(opened))


def _shown(path: Path) -> str:
    """Return an example and the files that it names."""
    text = path.read_text(encoding="utf-8")
    named = [p for p in sorted(path.parent.iterdir()) if p.suffix in LANGUAGES and re.search(rf"\b{p.name}\b", text)]
    shown = [_block(path, "yaml", text), *(_block(p, LANGUAGES[p.suffix], p.read_text("utf-8")) for p in named)]
    return "\n".join(shown)


def _block(path: Path, language: str, text: str) -> str:
    lines = text.splitlines()
    if len(lines) > MAX_LINES_SHOWN and language == "csv":
        text = "\n".join([*lines[:10], "..."]) + "\n"
    place = path.relative_to(ROOT)
    return f"[`{place}`](/{place}):\n\n{fenced(language, text)}"


def attributes(*types: type) -> str:
    """Return a section for each type with its attributes, from its docstring."""
    return "\n".join(_type_section(kind) for kind in types)


def _type_section(kind: type) -> str:
    text, _, listed = (inspect.getdoc(kind) or "").partition("\nAttributes:\n")
    heads = re.findall(r"^ {4}(\w[\w, ]*): (.*(?:\n {8}.*)*)", listed, re.MULTILINE)
    rows = [(f"`{name}`", " ".join(meaning.split())) for name, meaning in (*heads, *_members(kind))]
    return f"### `{kind.__name__}`\n\n{text.rstrip()}\n" + (
        f"\n{table(('attribute', 'meaning'), rows)}" if rows else ""
    )


def _members(kind: type) -> Iterable[tuple[str, str]]:
    """Yield properties and methods of a type of arrays: the name or the call, and the docstring."""
    for name, member in vars(kind).items():
        function = member.fget if isinstance(member, property) else getattr(member, "func", member)
        if kind in _WITH_MEMBERS and inspect.isfunction(function) and not name.startswith("_"):
            parameters = list(inspect.signature(function).parameters)[1:]
            call = f"({', '.join(parameters)})" if function is member else ""
            yield f"{name}{call}", inspect.getdoc(function) or ""
