"""The table of MJCF: it has all that MuJoCo's schema has, what is read acts in the engine, and the rest is named."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, Final

import pytest

from sim_action.core.errors import ModelError
from sim_action.core.workspace import Workspace
from sim_action.robot.documents.packages import Packages
from sim_action.robot.documents.part_table import ALL, part_table
from sim_action.robot.reading.mjcf.mjcf_files import collect_files
from sim_action.scenario.loading import build_scene
from tests.scenarios import load

mujoco: Any = pytest.importorskip("mujoco", reason="MJCF needs MuJoCo")
np: Any = pytest.importorskip("numpy")
TABLE: Final = part_table("mjcf")
SCENARIO: Final = "name: a\nrobot: {model: robot.xml}\nexpect: [upright]\ntime_limit: 1 s\n"
HERE: Final = Path(__file__).parent
ROBOT: Final = (HERE / "whole.xml").read_text()  # a robot, to whose elements attributes are added
# actuators: element -> what it needs. values: attribute -> values with which MuJoCo makes another model; a value may
# state more attributes. changes: of more than one attribute.
DATA: Final = json.loads((HERE / "whole.json").read_text())
ACTUATORS: Final[dict[str, str]] = DATA["actuators"]
VALUES: Final[dict[str, list[str]]] = DATA["values"]
CHANGES: Final[dict[str, list[str]]] = DATA["changes"]

# They name other parts, so that the model is refused without them or with others; or only what names them knows them.
REFERENCES: Final = frozenset(
    {"name", "class", "childclass", "joint", "jointinparent", "tendon", "site", "refsite", "body", "cranksite", "mesh"}
    | {"slidersite", "cranklength", "geom", "sidesite", "geom1", "geom2", "body1", "body2", "site1", "site2", "hfield"}
    | {"joint1", "joint2", "tendon1", "tendon2", "file", "model", "prefix", "frame"}
)


def schema() -> Iterator[tuple[str, str, list[str]]]:
    """Yield parent, element and attributes of each element that MuJoCo knows, without the inside of others."""
    above: list[str] = []
    rows: list[tuple[str, str, list[str]]] = []
    for line in mujoco.mj_printSchema(False, False).splitlines():
        if found := re.match(r"(\s*)(\S+) \(.\)\s*(.*)", line):
            depth, tag = len(found[1]) // 3, found[2].replace("(world)", "")
            above[depth:] = [tag]
            whole = [TABLE.row(ALL, each) for each in above]
            rows.append((above[depth - 1] if depth else "", tag, [] if any(whole) else found[3].split()))
            is_whole = any(whole)
        elif rows and not is_whole:
            rows[-1][2].extend(line.split())
    assert len(rows) > 100
    yield from rows


def test_the_table_has_all_that_the_engine_knows() -> None:
    missing = [
        f"<{parent}><{tag} {name}>"
        for parent, tag, names in schema()
        for name in names
        if TABLE.row(TABLE.place(parent, tag), f"@{name}") is None
    ]
    assert missing == []


def test_the_table_has_only_what_the_engine_knows() -> None:
    known = {(tag, name) for _, tag, names in schema() for name in names}
    known |= {("option", "timestep"), ("default", "class")}
    # Newer versions have more, and these two are read before the schema is known.
    places = TABLE.places.keys() - {ALL, "replicate", "frame", "attach", "worldbody", "mujoco", "equality", "tendon"}
    unknown = [
        place
        for place in places
        if not any((place.rpartition("/")[2], name[1:]) in known for name in TABLE.places[place])
    ]
    assert unknown in ([], ["flag"])


@pytest.mark.parametrize("place", sorted(TABLE.places))
def test_a_part_that_is_not_read_is_named(place: str, tmp_path: Path) -> None:
    for name, row in TABLE.places[place].items():
        if row.effect == "read":
            continue
        parent, _, tag = (place if place != ALL else "body").rpartition("/")
        stated = "contact" if name == ALL else name[1:]
        inside = f'<{tag} {stated}="7"/>' if name[0] == "@" or name == ALL else f"<{tag}><{name}><x/></{name}></{tag}>"
        (tmp_path / "robot.xml").write_text(f"<mujoco><{parent or 'x'}>{inside}</{parent or 'x'}></mujoco>")
        packages = Packages(Workspace(tmp_path, tmp_path))
        if row.effect == "refused":
            with pytest.raises(ModelError, match=f"<{name}> is not simulated"):
                collect_files(tmp_path / "robot.xml", packages)
            continue
        found = collect_files(tmp_path / "robot.xml", packages).left_out
        rule = "harmless-part" if row.effect == "harmless" else "passed-over"
        notes = [message for kind, message in found if kind == rule]
        assert any(row.text.format(stated) in message for message in notes), name


def robot(place: str = "", stated: str = "") -> str:
    """Return the robot with more attributes of the first element at a place."""
    parent, _, tag = place.rpartition("/")
    kind = tag if tag in ACTUATORS and place != "equality/joint" else "position"
    text = ROBOT.replace("@actuator", f'<{kind} name="act" {ACTUATORS[kind]}/>')
    if not stated:
        return text
    name = stated.partition("=")[0]
    at = text.index(f"<{parent}>") if parent == "equality" else text.index("<fixed") if parent == "fixed" else 0
    found = re.compile(rf"<{tag}\b[^>]*?(?=/?>)").search(text, at)
    assert found is not None
    old = re.sub(rf'\b{name}="[^"]*"', "", found[0])
    return f"{text[: found.start()]}{old} {stated}{text[found.end() :]}"


def fields(model: Any) -> dict[str, bytes]:
    values = {name: getattr(model, name) for name in dir(model) if not name.startswith("_")}
    values |= {f"opt.{name}": getattr(model.opt, name) for name in dir(model.opt) if not name.startswith("_")}
    return {
        name: np.asarray(value).tobytes()
        for name, value in values.items()
        if isinstance(value, np.ndarray | int | float) and not re.search(r"^(names|paths|n|bvh|signature|stat)", name)
    }


def simulated(folder: Path, text: str) -> tuple[dict[str, bytes], list[str]]:
    """Return the fields of the model that the engine simulates, and the notes."""
    from sim_action.engines.mujoco.scene import CompiledScene

    (folder / "robot.xml").write_text(text)
    scene = build_scene(load(folder, SCENARIO))
    drawn = repr((scene.model.links, scene.model.keyframes)).encode()
    found = fields(CompiledScene._compiled(scene).model) | {"drawn": drawn}
    return found, [str(note) for note in scene.model.findings]


@cache
def plain(text: str) -> dict[str, bytes]:
    return fields(mujoco.MjModel.from_xml_string(text))


# Tested by CHANGES, or in test_mjcf_reader.py and test_mjcf_files.py: files, heightfields, other bodies, colours.
ELSEWHERE: Final = {
    "compiler": "alignfree coordinate fitaabb assetdir meshdir texturedir strippath balanceinertia",
    "mesh": "content_type face maxhullvert builtin params",
    "hfield": "content_type elevation ncol nrow size",
    "material": "rgba texture texrepeat texuniform",
    "model": "content_type",
    "body": "mocap",
    "inertial": "fullinertia",
    "freejoint": "align",
    "geom": "fitscale material",
    "site": "fromto",
    "pid": "velrange ffrange",
    "pulley": "divisor",
    "general": "inheritrange actdim velrange ffrange",
    "intvelocity": "actlimited",
    "dcmotor": "nominal",
}


def acting() -> dict[str, list[str]]:
    """Return place -> attributes that are read; each attribute of actuators at the first one that has it."""
    known = {TABLE.place(parent, tag): names for parent, tag, names in schema() if parent != "default"}
    found, of_actuators = dict[str, list[str]](), set[str]()
    for place, rows in TABLE.places.items():
        skipped = REFERENCES | set(ELSEWHERE.get(place, "").split()) | (of_actuators if place in ACTUATORS else set())
        names = [name[1:] for name, row in rows.items() if row.effect == "read" and name[1:] in known.get(place, ())]
        found[place] = [name for name in names if name not in skipped]
        of_actuators |= set(found[place]) if place in ACTUATORS else set()
    return {place: names for place, names in found.items() if names}


@pytest.mark.parametrize(("place", "names"), acting().items(), ids=acting())
def test_an_attribute_that_is_read_acts_or_is_named(place: str, names: list[str], tmp_path: Path) -> None:
    before = simulated(tmp_path, robot(place))
    for name in names:
        texts = (robot(place, f'{name}="{value}"') for value in VALUES[name])
        text = next((text for text in texts if differs(text, robot(place))), "")
        assert text, name
        assert simulated(tmp_path, text) != before, name


def differs(text: str, other: str) -> bool:
    """Return True if MuJoCo accepts a text and makes another model of it."""
    try:
        return plain(text) != plain(other)
    except ValueError:
        return False


@pytest.mark.parametrize("name", CHANGES)
def test_a_change_of_several_attributes_acts(name: str, tmp_path: Path) -> None:
    field = '<hfield name="h" nrow="2" ncol="2" size="1 1 1 1" elevation="0 1 1 0"/></asset>'
    text = re.sub(r"<keyframe>.*</keyframe>", "", robot()).replace("</asset>", field)
    old, new = CHANGES[name]
    changed = text.replace(old, new, 1)
    assert differs(changed, text)
    assert simulated(tmp_path, changed)[0] != simulated(tmp_path, text)[0]
