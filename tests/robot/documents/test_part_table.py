"""The tables of elements and attributes: they know what the formats have, and each of their rows is true."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final, get_args
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

import pytest

import sim_action
from sim_action.core.errors import ModelError
from sim_action.core.workspace import Workspace
from sim_action.robot.documents.part_table import ALL, Format, PartRow, part_table
from sim_action.robot.documents.xml_document import parse_document
from sim_action.robot.model.findings import ALLOWABLE
from sim_action.robot.model.robot_model import RobotModel
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.loading import load_model
from tests.mesh_files import stl

# The names that the specifications have: SDF 1.4 to 1.12, URDF 1.0 to 1.2. Place -> names, without what is whole.
SPECIFICATIONS: Final = json.loads((Path(__file__).parent / "specification_parts.json").read_text())

PART: Final = (
    '<sdf version="1.9"><model name="part"><frame name="low"><pose>0 0 .1 0 0 0</pose></frame>'
    '<link name="base"/></model></sdf>'
)
# Models with each part that is read.
BASES: Final[dict[Format, bytes]] = {
    kind: (Path(__file__).parent / f"whole.{kind}").read_bytes() for kind in get_args(Format) if kind in ("urdf", "sdf")
}
ROOTS: Final = {"urdf": "robot", "sdf": "sdf"}


def read(folder: Path, kind: Format, root: Element) -> RobotModel:
    (folder / "part.stl").write_bytes(stl())
    (folder / "part.sdf").write_text(PART)
    (folder / "merged.sdf").write_text(PART.replace('"base"', '"extra"').replace("low", "lower"))
    (folder / f"robot.{kind}").write_bytes(ET.tostring(root))
    return load_model(Robot(model=f"robot.{kind}", allow=ALLOWABLE), Workspace(folder, folder))


def base(kind: Format) -> Element:
    return parse_document(BASES[kind], "base").root


def places(kind: Format, root: Element) -> Iterator[tuple[str, Element, Element | None]]:
    """Yield place, element and parent of each element that the table looks into."""
    table = part_table(kind)
    joints = {joint.get("name") for joint in root.findall("joint")}
    waiting: list[tuple[str, Element, Element | None]] = [(ROOTS[kind], root, None)]
    while waiting:
        place, element, parent = waiting.pop()
        yield place, element, parent
        # The inside of <gazebo> is SDF, which has the other table.
        for child in element if not place.startswith("gazebo/") else ():
            row = table.row(place, child.tag)
            if row is not None and row.effect == "read" and ALL not in row.names:
                at = table.place(place, child.tag)
                if child.tag == "gazebo":
                    name = child.get("reference")
                    at = "gazebo/model" if name is None else "gazebo/joint" if name in joints else "gazebo/link"
                waiting.append((at, child, element))


def seen(model: RobotModel) -> object:
    """Return what is read of a model, and the notes without their lines."""
    notes = {(note.rule, re.sub(r"; lines? [\d, ]+\)", ")", note.message)) for note in model.findings}
    plugins = [(plugin.name, plugin.parameters, plugin.title) for plugin in model.plugins]
    commanded = [(joint.joint, joint.interfaces, joint.tag) for joint in model.commanded]
    return model.links, model.joints, model.urdf, model.name, plugins, commanded, sorted(notes)


# The value in the base model is the default, or a part of old versions; other tests have models with them.
ELSEWHERE: Final = {
    ("sdf", "world"),
    ("model", "static"),
    ("model", "@canonical_link"),
    ("include", "static"),
    ("pose", "@frame"),
    ("axis", "use_parent_model_frame"),
    ("axis2", "use_parent_model_frame"),
    ("mimic", "@axis"),
}


def without(kind: Format, place: str, name: str) -> Iterator[Element]:
    """Yield the base model without a part, once for each element at a place that has it."""
    count = sum(at == place for at, *_ in places(kind, base(kind)))
    for number in range(count):
        root = base(kind)
        element = [each for at, each, _ in places(kind, root) if at == place][number]
        part = next((child for child in element if child.tag == name), None)
        if name[1:] in element.attrib and name.startswith("@"):
            del element.attrib[name[1:]]
            yield root
        elif part is not None:
            element.remove(part)
            yield root


def groups(effects: set[str]) -> list[tuple[Format, str]]:
    """Return format and place of rows with an effect; each group is one test."""
    return [
        (kind, place)
        for kind in BASES
        for place, rows in part_table(kind).places.items()
        if any(row.effect in effects and name != ALL for name, row in rows.items())
    ]


def names(kind: Format, place: str, *effects: str) -> list[str]:
    rows = part_table(kind).places[place]
    return [name for name, row in rows.items() if row.effect in effects and "*" not in name]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[Format, object]:
    """Return format -> what is read of the base model."""
    return {kind: seen(read(tmp_path_factory.mktemp(kind), kind, base(kind))) for kind in BASES}


@pytest.mark.parametrize("kind", BASES)
def test_the_table_has_every_part_of_the_specification(kind: Format) -> None:
    table = part_table(kind)
    missing = []
    for path, parts in SPECIFICATIONS[kind].items():
        parent, _, tag = path.rpartition("/")
        row = table.row(table.place("", parent), tag)
        if row is not None and row.effect != "read":
            continue
        missing += [(path, part) for part in parts.split() if table.row(table.place(parent, tag), part) is None]
    assert missing == []


@pytest.mark.parametrize("kind", get_args(Format))
def test_what_reads_a_part_exists(kind: Format) -> None:
    code = "".join(path.read_text() for path in Path(sim_action.__file__).parent.rglob("*.py"))
    defined = set(re.findall(r"^ *(?:def|class) (\w+)", code, re.MULTILINE))
    rows = {row for rows in part_table(kind).places.values() for row in rows.values()}
    assert {row.text for row in rows if row.effect == "read"} <= defined
    assert all(row.text for row in rows)


@pytest.mark.parametrize(("kind", "place"), groups({"read"}))
def test_a_part_that_is_read_acts(kind: Format, place: str, whole: dict[Format, object], tmp_path: Path) -> None:
    """Without it, the model or its notes are others, or the model is refused."""

    def acts(root: Element) -> bool:
        try:
            return seen(read(tmp_path, kind, root)) != whole[kind]
        except ModelError:
            return True

    rows = [name for name in names(kind, place, "read") if (place, name) not in ELSEWHERE]
    assert [name for name in rows if not any(map(acts, without(kind, place, name)))] == []


@pytest.mark.parametrize(("kind", "place"), groups({"harmless", "reported"}))
def test_a_part_that_is_not_read_is_named(kind: Format, place: str, tmp_path: Path) -> None:
    root, table = base(kind), part_table(kind)
    inside = [element for at, element, _ in places(kind, root) if at == place]
    assert inside or place in ABSENT
    rows = names(kind, place, "harmless", "reported")
    for name in rows if inside else ():
        if name.startswith("@"):
            inside[0].set(name[1:], "7")
        else:
            inside[0][:] = [child for child in inside[0] if child.tag != name]
            ET.SubElement(inside[0], name).text = "7"
    model = read(tmp_path, kind, root)
    for name in rows if inside else ():
        row = table.row(place, name)
        assert row is not None
        notes = model.harmless if row.effect == "harmless" else model.findings
        stated = f' {name[1:]}="7">' if name.startswith("@") else f"<{name}>7</{name}>"
        assert any(stated in note.message and row.text in note.message for note in notes), name


# The inside of shapes that no robot can have, and of parts of SDF in the base model of which there are none.
ABSENT: Final = {"submesh"}


@pytest.mark.parametrize("kind", BASES)
def test_an_unknown_part_is_named_wherever_it_is(kind: Format, tmp_path: Path) -> None:
    table, root = part_table(kind), base(kind)
    first = {place: element for place, element, _ in reversed([*places(kind, root)])}
    open_ended = {
        place for place in first if table.row(place, "zzz") is not None or place in ("geometry", "plugin", "sensor")
    }
    for place in first.keys() - open_ended:
        ET.SubElement(first[place], f"zzz.{place.replace('/', '.')}")
    messages = [note.message for note in read(tmp_path, kind, root).findings if note.rule == "unknown-part"]
    unnamed = [place for place in first.keys() - open_ended if not any(place.replace("/", ".") in m for m in messages)]
    assert unnamed == []


@pytest.mark.parametrize("kind", BASES)
def test_a_refused_shape_is_refused_by_name(kind: Format, tmp_path: Path) -> None:
    for name in [*names(kind, "geometry", "refused"), *(["cone"] if kind == "urdf" else [])]:
        root = base(kind)
        shape = next(element for at, element, _ in places(kind, root) if at == "geometry")
        shape[:] = [Element(name)]
        with pytest.raises(ModelError, match=name):
            read(tmp_path, kind, root)


@pytest.mark.parametrize(
    ("usual", "value", "is_lost"),
    [
        ("true", "1", False), ("true", "True", False), ("true", "false", True), ("0", "0 0 0", False),
        ("0", "0 1", True), ("100000000", "1e8", False), ("inf", "INF", False), ("inf", "3", True), ("0", "zero", True),
        ("0 0 0", "0", True), ("R8G8B8", "R8G8B8", False), ("R8G8B8", "r8g8b8", False), ("R8G8B8", "L8", True),
    ],
)  # fmt: skip
def test_a_usual_value_is_not_lost(usual: str, value: str, *, is_lost: bool) -> None:
    assert PartRow("reported", ("a",), "", {"a": (usual,)}).is_lost("a", value) is is_lost
