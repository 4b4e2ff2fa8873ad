"""Writes what is made from the code: parts of the README and of docs/scenario.md, the JSON Schemas.

`--check` only says what is stale.
"""

from __future__ import annotations

import itertools
import re
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel

from docs.reference import KEYS, attributes, examples, keys, sections, table
from sim_action.app.schema import results_schema, scenario_schema, schema_text
from sim_action.assertions import ASSERTIONS
from sim_action.cli.default_options import Defaults
from sim_action.commands import COMMANDS
from sim_action.commands.robot_description import JointDescription, RobotDescription
from sim_action.core.errors import ExitCode
from sim_action.core.field_types import Placement
from sim_action.core.geometry import Pose, Twist
from sim_action.core.registry import Table
from sim_action.drives import DRIVES
from sim_action.recording.export import EXPORTS
from sim_action.robot.findings import RULES
from sim_action.robot.spec import Robot
from sim_action.scenario import catalogue
from sim_action.scenario.catalogue import Entry, FieldEntry
from sim_action.scenario.model import ExpectationOptions, Scenario, TraceSettings
from sim_action.sensors import SENSORS
from sim_action.sensors.mounting import Mounting
from sim_action.state import readings
from sim_action.state.command import JointTargets
from sim_action.state.observation import Contact, JointState, Observation
from sim_action.state.readings import READING_COLUMNS, ReadingColumn
from sim_action.state.trace import Trace
from sim_action.state.verdict import Verdict
from sim_action.world import Body, Disturbance, Ground, Patch, PathPoint, Physics, World

ROOT = Path(__file__).resolve().parent.parent
PAGES = (ROOT / "README.md", ROOT / "docs/scenario.md")
SCHEMAS = {"docs/scenario.schema.json": scenario_schema, "docs/results.schema.json": results_schema}
BLOCK = re.compile(r"(<!-- generated: ([a-z-]+) -->\n).*?(<!-- end -->)", re.DOTALL)

CONTROLLER_TYPES = (
    Observation,
    Pose,
    Twist,
    JointState,
    Contact,
    JointTargets,
    RobotDescription,
    JointDescription,
)
READINGS = (
    readings.ContactReading,
    readings.ImuReading,
    readings.OdometryReading,
    readings.LidarScan,
    readings.CameraImage,
)

# Keys of a scenario whose own keys have rows or sections of their own.
TOLD_BELOW = (
    *("robot", "world", "physics", "commands", "sensors", "expect", "trace", "pose"),
    *("ground", "patches", "objects", "disturbances"),
)
# Keys of a scenario that are told there with those below them.
OPENED = ("agreement", "sphere", "cylinder")
WORLDS = Table[type[BaseModel]](
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

EXIT_CODES = {
    ExitCode.PASSED: "all scenarios passed",
    ExitCode.FAILED: "a scenario failed, is flaky, or has no verdict (crash, wall limit, script error)",
    ExitCode.INVALID: "a scenario, or the command line, is invalid, or a result is missing",
    ExitCode.INTERNAL: "a fault of sim-action itself",
    ExitCode.NO_SCENARIO: "no scenario found",
    ExitCode.INTERRUPTED: "interrupted",
}


def _keys_in_a_cell(fields: Iterable[FieldEntry]) -> str:
    return "<br>".join(
        f"`{field.name}`: {field.takes}"
        + (f" [{field.default}]" if field.default else "")
        + (f"; {field.description}" if field.description else "")
        for field in fields
    )


def _entries(entries: Iterable[Entry], kind: str) -> str:
    rows = ((f"`{entry.name}`", entry.summary, _keys_in_a_cell(entry.fields)) for entry in entries)
    return table((kind, "what it is", "keys: what they take [default]"), rows)


def _scenario_keys() -> str:
    parts = (
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
    rows = (row for prefix, model in parts for row in _rows(prefix, model))
    return table(KEYS, rows)


def _rows(prefix: str, model: type[BaseModel]) -> Iterator[tuple[str, ...]]:
    shown = {f"`{prefix}{field.name}`" for field in catalogue.fields(model) if field.name not in TOLD_BELOW}
    opened = tuple(f"`{prefix}{name}." for name in OPENED)
    return (row for row in keys(model, prefix) if row[0] in shown or row[0].startswith(opened))


def _reading_columns() -> str:
    """What is kept of each kind of sensor."""
    rows = []
    for kind, columns in READING_COLUMNS.items():
        told = (f"`{name}` ({_shape(column)})" for name, column in columns.items())
        rows.append((f"`{kind}`", ", ".join(told)))
    return table(("sensor", "columns of n readings"), rows)


def _shape(column: ReadingColumn) -> str:
    shape = "n, ..." if column.many else f"n, {len(column.axes)}" if column.axes else "n"
    return f"{shape}; {column.dimension.si}" if column.dimension.si else shape


def _inputs(action: str) -> str:
    rows = ((f"`{name}`", _default(entry), _description(entry)) for name, entry in _action(action)["inputs"].items())
    return table(("input", "default", "meaning"), rows)


def _default(entry: dict[str, str]) -> str:
    if entry.get("required"):
        return "required"
    return f"`{entry['default']}`" if entry["default"] else "empty"


def _outputs(action: str) -> str:
    rows = ((f"`{name}`", _description(entry)) for name, entry in _action(action)["outputs"].items())
    return table(("output", "meaning"), rows)


def _action(path: str) -> dict[str, dict[str, Any]]:
    action: dict[str, dict[str, Any]] = yaml.safe_load((ROOT / path).read_text(encoding="utf-8"))
    return action


def _description(entry: dict[str, str]) -> str:
    return " ".join(entry["description"].split())


def _rules() -> str:
    means = {"fatal": "refused", "error": "refused, unless allowed", "warning": "a note"}
    return table(("rule", "what it is", ""), ((f"`{name}`", r.summary, means[r.level]) for name, r in RULES.items()))


def _templates() -> str:
    """Each template's first comment: where to copy it, and what it does."""
    rows = []
    for path in sorted(ROOT.glob("examples/workflows/*.yml"), key=lambda path: (path.stem != "simulation", path.stem)):
        head = itertools.takewhile(lambda line: line.startswith("#"), path.read_text(encoding="utf-8").splitlines())
        _, _, purpose = " ".join(line.lstrip("# ") for line in head).partition(": ")
        rows.append((f"[`{path.name}`]({path.relative_to(ROOT)})", purpose[:1].upper() + purpose[1:]))
    return table(("template", "what it does"), rows)


def _example(name: str) -> str:
    text = (ROOT / "examples/reuse" / name).read_text(encoding="utf-8")
    return f"```yaml\n{text}```\n"


def _recordings() -> str:
    """Of each format the first sentence, and the extra that it needs."""
    rows = []
    for name in EXPORTS:
        export = EXPORTS.load(name)
        told = " ".join((export.__doc__ or "").split("\n\n")[0].split())
        rows.append((f"`{name}`", told, f"`{export.extra}`" if export.extra else ""))
    return table(("format", "what it is", "extra"), rows)


def _defaults() -> Iterable[FieldEntry]:
    return catalogue.fields(Defaults)


BLOCKS: dict[str, Callable[[], str]] = {
    "assertions": lambda: _entries(catalogue.assertions(), "assertion"),
    "commands": lambda: _entries(catalogue.commands(), "command"),
    "sensors": lambda: _entries(catalogue.sensors(), "sensor"),
    "drive-sections": lambda: sections("drives", DRIVES),
    "command-sections": lambda: sections("commands", COMMANDS),
    "world-sections": lambda: sections("worlds", WORLDS),
    "sensor-sections": lambda: sections("sensors", SENSORS),
    "assertion-sections": lambda: sections("assertions", ASSERTIONS),
    "expectation-keys": lambda: table(KEYS, keys(ExpectationOptions)),
    "sensor-keys": lambda: table(KEYS, keys(Mounting)),
    "path-keys": lambda: table(KEYS, keys(PathPoint)) + "\n" + examples("worlds", "moving_body"),
    "appearing": lambda: examples("worlds", "dropped_body"),
    "disturbance-keys": lambda: table(KEYS, keys(Disturbance)) + "\n" + examples("worlds", "disturbance"),
    "controller-types": lambda: attributes(*CONTROLLER_TYPES),
    "judge-types": lambda: attributes(Trace, Verdict),
    "readings": lambda: attributes(*READINGS),
    "reading-columns": _reading_columns,
    "drives": lambda: _entries(catalogue.drives(), "drive"),
    "models": lambda: table(("robot", "what it is"), ((f"`{e.name}`", e.summary) for e in catalogue.models())),
    "scenario-keys": _scenario_keys,
    "inputs": lambda: _inputs("action.yml"),
    "outputs": lambda: _outputs("action.yml"),
    "matrix-inputs": lambda: _inputs("matrix/action.yml"),
    "matrix-outputs": lambda: _outputs("matrix/action.yml"),
    "merge-inputs": lambda: _inputs("merge/action.yml"),
    "compare-inputs": lambda: _inputs("compare/action.yml"),
    "compare-outputs": lambda: _outputs("compare/action.yml"),
    "templates": _templates,
    "example-base": lambda: _example("burger.base.yml"),
    "example-extends": lambda: _example("beside_wall.sim.yml"),
    "example-scenarios": lambda: _example("speeds.sim.yml"),
    "example-variations": lambda: _example("grip.sim.yml"),
    "defaults": lambda: table(
        ("key", "takes", "meaning"), ((f"`{f.name}`", f.takes, f.description) for f in _defaults())
    ),
    "rules": _rules,
    "recordings": _recordings,
    "exit-codes": lambda: table(("code", "meaning"), ((str(code.value), text) for code, text in EXIT_CODES.items())),
}


def generated() -> dict[Path, str]:
    """Each file with what it should hold."""
    pages = {p: BLOCK.sub(lambda m: f"{m[1]}{BLOCKS[m[2]]()}{m[3]}", p.read_text(encoding="utf-8")) for p in PAGES}
    return pages | {ROOT / name: schema_text(schema()) for name, schema in SCHEMAS.items()}


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
