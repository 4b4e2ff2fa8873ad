"""Sections and tables of docs/scenario/: worlds, drives, commands, sensors, assertions, keys, types for controllers."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Final

from pydantic import BaseModel

from sim_action.app import catalogue
from sim_action.assertions import ASSERTIONS, Reference
from sim_action.cli.init import files
from sim_action.commands import COMMANDS, CommandSource
from sim_action.commands.controller_answers import RobotDescription
from sim_action.core.field_types import Placement
from sim_action.core.geometry import Pose, Twist
from sim_action.core.registry import Table
from sim_action.drives import DRIVES
from sim_action.robot.model.kinematics import LinkMotion
from sim_action.robot.model.robot_spec import Robot
from sim_action.scenario.model import Scenario, TraceSettings
from sim_action.sensors import SENSORS
from sim_action.state import readings
from sim_action.state.command import JointTargets, LinkWrench
from sim_action.state.observation import Contact, JointState, LinkState, Observation
from sim_action.state.trace import Trace
from sim_action.state.transmission import Transmission
from sim_action.state.verdict import Verdict
from sim_action.world import Body, Ground, Physics, World
from tools.docs.generators.markdown import bullets, fenced

ROOT: Final = Path(__file__).resolve().parents[3]
LANGUAGES: Final = {".yaml": "yaml", ".py": "python", ".js": "javascript", ".pl": "perl", ".csv": "csv"}
BLOCKS: Final = {
    "worlds": "world",
    "drives": "robot",
    "commands": "commands",
    "sensors": "sensors",
    "assertions": "expect",
}
"""A family -> the top-level key of a scenario below which its parts stand."""
MIN_WORDS_REPEATED: Final = 4  # of a key that a later section only names
ENDED_EARLY: Final = "The run ended before `after`."
SI: Final = re.compile(r"(?<=[a-z]) \([^,()]*\)|, (?:-[\d,]{6,} to|at most) [\d,]{6,}(?: (?!default)[\w/]+)?")
"""The unit after a quantity, which scenario/index.md has, and bounds far beyond a robot."""
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
    RobotDescription,
)
READINGS: Final = (
    readings.ContactReading,
    readings.ImuReading,
    readings.OdometryReading,
    readings.LidarScan,
    readings.CameraImage,
)
JUDGE_TYPES: Final = (Trace, LinkMotion, Verdict)
# Attributes that neither controllers nor classes of users need.
_INTERNAL: Final[dict[type, frozenset[str]]] = {
    JointTargets: frozenset({"base", "motions", "wrenches"}),
    Contact: frozenset({"normal_xyz"}),
    Verdict: frozenset({"body", "cut_off", "extreme", "goal", "inconclusive", "joint", "judged"}),
    Trace: frozenset({"bodies", "clearances", "first", "kinematics", "link_contacts", "rows", "self_contacts"}),
}
# Types whose properties and methods are listed too.
_WITH_MEMBERS: Final = (Trace, LinkMotion)

_PARTS_OF_A_SCENARIO: Final = (
    ("", Scenario),
    ("robot.", Robot),
    ("robot.pose.", Placement),
    ("world.", World),
    ("world.ground.", Ground),
    ("world.objects[].", Body),
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
# The key that every command source has for events, which have a section.
_NAME_OF_SOURCE: Final = CommandSource.model_fields["name"].description or ""
# Keys of a scenario that have rows for the keys below them.
_OPENED: Final = ("agreement", "sphere", "cylinder")


Key = tuple[str, str]
"""The name of a key, and what it takes and means."""


def sections(family: str, *names: str) -> str:
    """Return a section for each entry of a family: its text, its keys, the lines of an example that name it."""
    seen: set[Key] = set()
    return "\n".join(_section(family, name, seen) for name in names or FAMILIES[family])


def assertion_sections(page: str) -> str:
    """Return a section for each assertion of a page, in the order of their table."""
    return sections("assertions", *(name for name in ASSERTIONS if ASSERTIONS.load(name).reference.page == page))


def _verdicts(reference: Reference) -> str:
    """Return when an assertion passes, unless its first sentence says so, and when it is not exercised."""
    repeats = reference.kind == "invariant" and "](" not in reference.passed
    rows = [("**passed**", reference.passed)] * (not repeats)
    never = re.sub(r",? (?:or|Or) the run ended before `after`", "", reference.not_exercised)
    rows += [("**not exercised**", never)] * (never != ENDED_EARLY)
    return bullets(rows)


def assertions() -> str:
    """Return the list of assertions by their pages: links to the sections, and the kinds."""
    references = {name: ASSERTIONS.load(name).reference for name in ASSERTIONS}
    by_page: dict[str, list[str]] = {}
    for name, of in references.items():
        link = f"[`{name}`](assertions-{of.page}.md#{name}) ({of.kind})"
        by_page.setdefault(of.page, []).append(link)
    return bullets((f"**{page}**", ", ".join(links)) for page, links in by_page.items())


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


def _section(family: str, name: str, seen: set[Key]) -> str:
    model = FAMILIES[family].load(name)
    parts = [f"## `{name}`\n", f"{inspect.getdoc(model)}\n"]
    rows = [row for row in keys(model) if row[0] not in _OF_EVERY_SOURCE and not row[1].endswith(_NAME_OF_SOURCE)]
    lines = bullets(row for row in rows if row not in seen)
    if repeated := [row[0] for row in rows if row in seen]:
        lines += f"- {', '.join(repeated)}: as above\n"
    seen.update(row for row in rows if len(row[1].split()) >= MIN_WORDS_REPEATED)
    if lines:
        parts.append(lines)
    if family == "assertions":
        parts.append(_verdicts(ASSERTIONS.load(name).reference))
    return "\n".join([*parts, _excerpt(family, name)])


def _excerpt(family: str, name: str) -> str:
    """Return the lines of an example that name an entry of a family, after links to its files."""
    path = example(family, name)
    text = path.read_text(encoding="utf-8")
    block = re.search(rf"^{BLOCKS[family]}:.*\n(?:[ #].*\n)*", text, re.MULTILINE)
    lines = (
        []
        if block is None
        else [line for line in block[0].splitlines(True) if "ed with: " not in line and "fails with: " not in line]
    )
    if family == "assertions":
        entries = re.findall(r"^  - .*\n(?:   .*\n)*", "".join(lines), re.MULTILINE)
        lines = [lines[0], *(entry for entry in entries if re.match(rf"  - {name}\b", entry))]
    links = ", ".join(f"[`{p.relative_to(ROOT)}`](/{p.relative_to(ROOT)})" for p in (path, *_files_named(path, text)))
    return f"From {links}:\n\n{fenced('yaml', ''.join(lines))}"


def keys_table(model: type[BaseModel], without: type[BaseModel] = BaseModel) -> str:
    """Return the list of a model's keys that `without` lacks."""
    elsewhere = {f"`{name}`" for name in without.model_fields}
    return bullets(row for row in keys(model) if row[0] not in elsewhere)


def keys(model: type[BaseModel], above: str = "") -> list[Key]:
    """Return each key, followed by the keys below it, unless these stand elsewhere."""
    return [(f"`{entry.name}`", _meaning(entry)) for entry in catalogue.key_rows(model, above)]


def _meaning(entry: catalogue.FieldEntry) -> str:
    default = {"required": ", required", "": ""}.get(entry.default, f", default {entry.default}")
    return f"{SI.sub('', entry.takes)}{default}" + (f"; {entry.description}" if entry.description else "")


def scenario_keys() -> str:
    """Return the list of all keys of a scenario that have no section of their own."""
    return "\n".join(bullets(_rows(prefix, model)) for prefix, model in _PARTS_OF_A_SCENARIO)


def _rows(prefix: str, model: type[BaseModel]) -> Iterator[Key]:
    shown = {f"`{prefix}{field.name}`" for field in catalogue.fields(model) if field.name not in _SHOWN_ELSEWHERE}
    opened = tuple(f"`{prefix}{name}." for name in _OPENED)
    return (row for row in keys(model, prefix) if row[0] in shown or row[0].startswith(opened))


def _shown(path: Path) -> str:
    """Return an example and the files that it names."""
    text = path.read_text(encoding="utf-8")
    files = _files_named(path, text)
    return "\n".join(
        [_block(path, "yaml", text), *(_block(p, LANGUAGES[p.suffix], p.read_text("utf-8")) for p in files)]
    )


def _files_named(path: Path, text: str) -> list[Path]:
    """Return the files of code and data next to an example that its text names."""
    return [p for p in sorted(path.parent.iterdir()) if p.suffix in LANGUAGES and re.search(rf"\b{p.name}\b", text)]


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
    rows = [
        (f"`{name}`", " ".join(meaning.split()))
        for name, meaning in (*heads, *_members(kind))
        if re.split(r"\W", name)[0] not in _INTERNAL.get(kind, ())
    ]
    return f"### `{kind.__name__}`\n\n{text.rstrip()}\n" + (f"\n{bullets(rows)}" if rows else "")


def _members(kind: type) -> Iterable[tuple[str, str]]:
    """Yield properties and methods of a type of arrays: the name or the call, and the docstring."""
    for name, member in vars(kind).items():
        function = member.fget if isinstance(member, property) else getattr(member, "func", member)
        if kind in _WITH_MEMBERS and inspect.isfunction(function) and not name.startswith("_"):
            parameters = list(inspect.signature(function).parameters)[1:]
            call = f"({', '.join(parameters)})" if function is member else ""
            yield f"{name}{call}", inspect.getdoc(function) or ""
