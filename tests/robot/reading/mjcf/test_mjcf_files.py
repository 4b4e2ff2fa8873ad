"""The files that an MJCF model names, and the counts in it: what is collected, and what is refused."""

from __future__ import annotations

import itertools
import re
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET
from xml.sax.saxutils import quoteattr

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.errors import ModelError
from sim_action.core.workspace import Workspace
from sim_action.robot.documents.packages import Packages
from sim_action.robot.documents.part_table import ALL, part_table
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.loading import check_text, load_model
from sim_action.robot.reading.mjcf.mjcf_files import (
    DROPPED,
    FILES,
    LIKE_A_FILE,
    LIMITS,
    MAX_FILES,
    NO_FILES,
    MjcfFiles,
    collect_files,
)
from tests.mesh_files import stl

BODY: Final = '<worldbody><body name="k"><freejoint/><geom size="1"/>{}</body></worldbody>'
ASSET: Final = "<mujoco><asset>{}</asset>" + BODY.format("") + "</mujoco>"


def collected(folder: Path, text: str, **files: str) -> MjcfFiles:
    """Collect a model in `folder`/inside; `files`: name, with `__` for a slash and `_xml` for the suffix -> text."""
    inside = folder / "inside"
    for name, content in {"robot_xml": text, **files}.items():
        path = inside / name.replace("__", "/").replace("_xml", ".xml")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content, encoding="utf-8")
    return collect_files(inside / "robot.xml", Packages(Workspace(inside, inside), {}))


def refused(folder: Path, text: str, **files: str) -> str:
    with pytest.raises(ModelError) as error:
        collected(folder, text, **files)
    message = str(error.value).replace(str(folder / "inside"), ".")
    assert message.isprintable()
    return message


def schema() -> list[tuple[str, list[str]]]:
    """Return each element that MuJoCo knows, and its attributes."""
    mujoco = pytest.importorskip("mujoco", reason="the schema is that of MuJoCo, which is not installed")
    rows: list[tuple[str, list[str]]] = []
    for line in mujoco.mj_printSchema(False, False).splitlines():
        if found := re.match(r"\s*(\S+) \(.\)\s*(.*)", line):
            rows.append((found[1], found[2].split()))
        elif rows:
            rows[-1][1].extend(line.split())
    assert len(rows) > 100
    return rows


def test_every_attribute_of_mujoco_that_may_name_a_file_is_in_the_table() -> None:
    unknown = [
        (element, name)
        for element, names in schema()
        for name in names
        if LIKE_A_FILE.search(name)
        and getattr(part_table("mjcf").row(ALL, element), "effect", "") != "refused"
        and (element, name) not in NO_FILES
        and not (name in DROPPED and (element in FILES or element == "compiler"))
        and not (element in FILES and name in FILES[element].attributes)
    ]
    assert unknown == []


def test_every_row_of_the_tables_is_an_attribute_of_mujoco() -> None:
    known = {(element, name) for element, names in schema() for name in names}
    # MuJoCo reads these two before it compares the rest with its schema.
    known |= {("replicate", "count"), ("include", "file")}
    assert {(element, name) for element, row in FILES.items() for name in row.attributes} <= known
    assert set(LIMITS) <= known
    assert known >= NO_FILES


def test_the_text_for_the_engine_names_no_file_of_the_user(tmp_path: Path) -> None:
    for folder in ("m", "t"):
        (tmp_path / "inside" / folder).mkdir(parents=True)
    (tmp_path / "inside/m/box.stl").write_bytes(stl())
    found = collected(
        tmp_path,
        ASSET.format(
            '<mesh file="box.stl" content_type="model/stl"/><texture file="wood.png"/>'
            '<texture name="sky" type="cube" fileup="up.png"/>'
            '<hfield file="h.png" size="1 1 1 1"/><skin name="s" file="s.skn"/>'
        ).replace("<asset>", '<compiler meshdir="m" texturedir="t" strippath="false"/><asset>'),
    )
    for word in ("box.stl", "wood.png", "up.png", "h.png", "s.skn", "meshdir", "texturedir", "content_type", "strip"):
        assert word not in found.text
    root = ET.fromstring(found.text)
    assert [element.get("name") for element in root.iter("mesh")] == ["box"]
    # Pictures have no effect on a simulation.
    assert list(root.iter("texture")) == list(root.iter("skin")) == []
    ((token, mesh),) = found.meshes.items()
    assert token == root.find(".//mesh").get("file")  # type: ignore[union-attr]
    assert (mesh.path, mesh.name) == (tmp_path / "inside/m/box.stl", "box.stl")


@pytest.mark.parametrize(
    ("compiler", "reference", "place"),
    [
        ("", "a.stl", "a.stl"),
        ('assetdir="m"', "a.stl", "m/a.stl"),
        ('assetdir="t" meshdir="m"', "a.stl", "m/a.stl"),
        ('meshdir="m" strippath="true"', "elsewhere/../../a.stl", "m/a.stl"),
        ('meshdir="m"', "../a.stl", "a.stl"),
        ('meshdir="m"/><compiler meshdir="t"', "a.stl", "t/a.stl"),
    ],
)
def test_the_folders_of_meshes_are_those_of_mujoco(compiler: str, reference: str, place: str, tmp_path: Path) -> None:
    for name in ("a.stl", "m/a.stl", "t/a.stl"):
        (tmp_path / "inside" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "inside" / name).write_bytes(stl())
    text = ASSET.format(f'<mesh file="{reference}"/>').replace("<asset>", f"<compiler {compiler}/><asset>")
    (mesh,) = collected(tmp_path, text).meshes.values()
    assert mesh.path == tmp_path / "inside" / place


def test_files_of_an_included_file_lie_beside_it_and_includes_beside_the_model_come_first(tmp_path: Path) -> None:
    (tmp_path / "inside/parts").mkdir(parents=True)
    (tmp_path / "inside/parts/a.stl").write_bytes(stl())
    model = ASSET.format('<include file="parts/a.xml"/>')
    part = '<x><include file="b.xml"/><mesh file="a.stl"/></x>'
    found = collected(tmp_path, model, parts__a_xml=part, parts__b_xml='<x><material name="nested"/></x>')
    assert [mesh.path.parent.name for mesh in found.meshes.values()] == ["parts"]
    assert 'name="nested"' in found.text
    found = collected(tmp_path, model, b_xml='<x><material name="main"/></x>')
    assert 'name="main"' in found.text


@given(st.text(st.characters(exclude_categories=["Cs", "Cc", "Cn"], include_characters="\t\n\r'\"<>&"), max_size=30))
def test_all_attributes_keep_their_text(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    quoted = quoteattr(text)
    folder = tmp_path_factory.mktemp("text")
    found = collected(folder, f"<mujoco><custom><text name='t' data={quoted}/></custom></mujoco>")
    assert ET.fromstring(found.text).find("custom/text").get("data") == text  # type: ignore[union-attr]


def test_a_model_to_attach_is_part_of_the_robot(tmp_path: Path) -> None:
    pytest.importorskip("mujoco", reason="MJCF is read by MuJoCo, which is not installed")
    (tmp_path / "hand").mkdir()
    (tmp_path / "hand/box.stl").write_bytes(stl())
    (tmp_path / "hand/hand.xml").write_text(
        '<mujoco><compiler meshdir="."/><asset><mesh file="box.stl"/></asset>'
        '<worldbody><body name="palm"><geom type="mesh" mesh="box" density="1000"/></body></worldbody></mujoco>'
    )
    model = '<mujoco><asset><model name="hand" file="hand/hand.xml"/></asset>' + BODY.format(
        '<attach model="hand" body="palm" prefix="left_"/>'
    )
    (tmp_path / "robot.xml").write_text(f"{model}</mujoco>")
    found = load_model(Robot(model="robot.xml"), Workspace(tmp_path, tmp_path))
    assert found.links_by_name["left_palm"].mass == pytest.approx(1000 * 0.2 * 0.4 * 0.6, rel=1e-5)
    assert found.mjcf is not None
    assert set(found.mjcf.meshes) == {"left_box"}


@pytest.mark.parametrize(("name", "line"), [("parts__a_xml", 3), ("hand_xml", 2)])
def test_an_error_of_mujoco_is_at_the_line_of_its_own_file(name: str, line: int, tmp_path: Path) -> None:
    pytest.importorskip("mujoco", reason="MJCF is read by MuJoCo, which is not installed")
    files = {
        "parts__a_xml": "<x>\n<site name='a'/>\n<site {}name='b'/></x>",
        "hand_xml": "<mujoco><worldbody><body name='k'>\n<geom {}size='1'/></body></worldbody></mujoco>",
    }
    text = '<mujoco><asset>\n\n\n<model name="hand" file="hand.xml"/></asset>' + BODY.format(
        '\n\n<include file="parts/a.xml"/><attach model="hand" body="k" prefix="p"/>'
    )
    broken = {key: content.format("typ='1' " if key == name else "") for key, content in files.items()}
    collected(tmp_path, f"{text}</mujoco>", **broken)
    inside = tmp_path / "inside"
    with pytest.raises(ModelError, match=rf"unrecognized attribute: 'typ' Element .*, line {line}\b") as error:
        load_model(Robot(model="robot.xml"), Workspace(inside, inside))
    assert f"{name.replace('__', '/').replace('_xml', '.xml')}:{line}: " in str(error.value)


OUTSIDE: Final = "is outside the workspace"


@pytest.mark.parametrize(
    ("asset", "message"),
    [
        ('<mesh file="../out.stl"/>', OUTSIDE),
        ('<mesh file="/etc/passwd"/>', OUTSIDE),
        ('<mesh file="file:///etc/passwd"/>', "does not exist"),
        (r'<mesh file="..\out.stl"/>', "does not exist"),
        ('<mesh file="a&#10;b.stl"/>', "is not a valid path"),
        (f'<mesh file="{"x" * 2000}"/>', "is not a valid path"),
        (f'<mesh file="{"x" * 900}"/>', "is not a valid path"),
        ('<mesh file="."/>', "is a folder"),
        ('<texture file="../out.png"/>', OUTSIDE),
        ('<texture name="t" fileup="/dev/zero"/>', OUTSIDE),
        ('<hfield file="/proc/self/environ" size="1 1 1 1"/>', OUTSIDE),
        ('<skin name="s" file="../out.skn"/>', OUTSIDE),
        ('<model file="../out.xml"/>', OUTSIDE),
        ("<model/>", "<model> has no attribute 'file', or it is empty"),
        ("<include/>", "<include> has no attribute 'file', or it is empty"),
        ('<include file="../out.xml"/>', OUTSIDE),
        ('<include file="empty.xml"><mesh/></include>', "<include> has elements in it"),
        ('<include file="empty.xml" path="x"/>', "<include path> may not name a file; allowed are <include file>, <mo"),
        ('<include file="empty.xml"/><include file="./empty.xml"/>', "'./empty.xml' includes itself, or is included"),
        ('<model file="robot.xml"/>', "'robot.xml' attaches itself"),
        ('<model file="urdf.xml"/>', "the root element of an MJCF file is <mujoco>, but this file has <robot>"),
        ('<material file="x.png"/>', "<material file> may not name a file"),
        ('<mesh filename="x.stl"/>', "<mesh filename> may not name a file"),
        ('<mesh library="x.so"/>', "<mesh library> may not name a file"),
        ('<compiler meshdir="/etc"/><mesh file="passwd"/>', OUTSIDE),
        ('<compiler assetdir="../.."/><mesh file="passwd"/>', OUTSIDE),
        ('<mesh name="m"><plugin plugin="mujoco.sdf.bolt"/></mesh>', "<plugin> is not simulated, because plugins are"),
        ("<flexcomp/>", "<flexcomp> is not simulated, because a robot consists of rigid bodies; remove it"),
        ('<replicate count="100000"><site/></replicate>', "this is too large; at most 50,000 is allowed"),
        ('<replicate count="1e3"/>', "<replicate count='1e3'>: this is not a whole number"),
        ('<replicate count="-1"/>', "this is not a whole number"),
        ('<hfield nrow="100000" ncol="2"/>', "<hfield nrow='100000'>: this is too large; at most 1,000 is allowed"),
        ('<texture builtin="flat" width="100000"/>', "<texture width='100000'>: this is too large"),
        ('<texture builtin="flat" width="0x9999"/>', "<texture width='0x9999'>: this is not a number"),
        ('<texture builtin="flat" width="nan"/>', "this is not a number"),
        (f'<texture width="{"9" * 5000}"/>', "this is too large"),
        ('<mesh builtin="supersphere" params="1e9 1 1"/>', "<mesh params='1e9 1 1'>: this is too large"),
        ('<size memory="100G"/>', "<size memory='100G'>: this is too much memory; at most 1,073,741,824 is allowed"),
        ('<size memory="all"/>', "this is not a size in bytes, such as 10M"),
        ('<size nkey="100000000"/>', "<size nkey='100000000'>: this is too large; at most 1,000 is allowed"),
        ('<size nuser_geom="1000000"/>', "this is too large; at most 100 is allowed"),
    ],
)
def test_each_refusal_has_its_line_and_a_reason(asset: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "out.stl").write_bytes(stl())
    files = {"empty_xml": "<mujoco/>", "urdf_xml": '<robot name="r"/>'}
    found = refused(tmp_path, ASSET.format(f"\n{asset}"), **files)
    assert message in found
    place = "./urdf.xml:1: " if "urdf.xml" in asset else "./robot.xml:2: "
    assert found.startswith(place)


def test_links_are_resolved_before_they_are_judged(tmp_path: Path) -> None:
    (tmp_path / "inside").mkdir()
    (tmp_path / "out.stl").write_bytes(stl())
    (tmp_path / "inside/link.stl").symlink_to("../out.stl")
    (tmp_path / "inside/folder").symlink_to("..")
    for asset in ('<mesh file="link.stl"/>', '<mesh file="folder/out.stl"/>', '<skin name="s" file="link.stl"/>'):
        assert OUTSIDE in refused(tmp_path, ASSET.format(asset))


def test_counts_multiply(tmp_path: Path) -> None:
    nested = "<replicate count='40'>" * 3 + "\n<site/>" + "</replicate>" * 3
    found = refused(tmp_path, f"<mujoco>\n{BODY.format(nested)}</mujoco>")
    assert found == "./robot.xml:2: <replicate> makes 65,640 elements; at most 50,000 are allowed: reduce the counts"
    # In <mujoco>: the world, the body, its joint and shape, the replication and 49,995 sites.
    sites = "<replicate count='{}'><site/></replicate>"
    assert collected(tmp_path, f"<mujoco>{BODY.format(sites.format(49_995))}</mujoco>").left_out == {}
    found = refused(tmp_path, f"<mujoco>{BODY.format(sites.format(49_996))}</mujoco>")
    assert "<mujoco> makes 50,001 elements; at most 50,000 are allowed" in found


@pytest.mark.parametrize(
    "text",
    [
        "<custom>" + "<numeric size='100000' data='0'/>" * 101 + "</custom>",
        "<asset>" + "<hfield nrow='1000' ncol='1000' size='1 1 1 1'/>" * 11 + "</asset>",
        "<asset>" + "<mesh builtin='supersphere' params='300 1 1'/>" * 120 + "</asset>",
    ],
)
def test_numbers_of_all_elements_are_limited_together(text: str, tmp_path: Path) -> None:
    found = refused(tmp_path, f"<mujoco>{BODY.format('')}{text}</mujoco>")
    assert "200 numbers of a heightfield, mesh or <numeric> count as one: reduce the counts" in found


@pytest.mark.parametrize("text", ["<option timestep='{}'/>", "<size nkey='{}'/>"])
def test_the_text_of_a_number_takes_no_quadratic_time(text: str, tmp_path: Path) -> None:
    # This would take minutes.
    model = f"<mujoco>{text.format('1' * 1_000_000 + 'x')}{BODY.format('')}</mujoco>"
    if "size" in text:
        assert "this is too large" in refused(tmp_path, model)
    else:
        assert collected(tmp_path, model).left_out == {}


def test_attached_models_multiply_and_may_not_attach_each_other(tmp_path: Path) -> None:
    names = ["robot_xml", *(f"m{number}_xml" for number in range(5)), "leaf_xml"]
    files = {"leaf_xml": f"<mujoco>{BODY.format('')}</mujoco>"}
    for name, below in itertools.pairwise(names):
        attached = "".join(f"<attach model='m' body='k' prefix='p{number}'/>" for number in range(12))
        asset = f"<asset><model name='m' file='{below.replace('_xml', '.xml')}'/></asset>"
        files[name] = f"<mujoco>{asset}{BODY.format(attached)}</mujoco>"
    assert "elements; at most 50,000 are allowed" in refused(tmp_path, files.pop("robot_xml"), **files)
    text = ASSET.format('\n<model file="{}"/>')
    found = refused(tmp_path, text.format("other.xml"), other_xml=text.format("robot.xml"))
    assert found == "./other.xml:2: 'robot.xml' attaches itself"


def test_files_their_elements_and_their_depth_are_counted_together(tmp_path: Path) -> None:
    files = {f"f{number}_xml": "<x/>" for number in range(MAX_FILES)}
    includes = "\n".join(f'<include file="f{number}.xml"/>' for number in range(MAX_FILES))
    assert "a model may have at most 100 files" in refused(tmp_path, ASSET.format(includes), **files)
    collected(tmp_path, ASSET.format(includes.replace('<include file="f7.xml"/>', "")), **files)
    many = f"<x>{'<site/>' * 30_000}</x>"
    found = refused(tmp_path, ASSET.format('<include file="a.xml"/>\n<include file="b.xml"/>'), a_xml=many, b_xml=many)
    assert found == "./b.xml:1: more than 50,000 elements, all included files together"
    deep = "<x>" + "<frame>" * 60 + "{}" + "</frame>" * 60 + "</x>"
    text = ASSET.format('<include file="a.xml"/>')
    found = refused(tmp_path, text, a_xml=deep.format('<include file="b.xml"/>'), b_xml=deep.format(""))
    assert found == "./b.xml:1: more than 100 elements inside each other"


def test_a_heightfield_of_the_scenery_is_left_out_and_one_of_the_robot_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("mujoco", reason="MJCF is read by MuJoCo, which is not installed")
    workspace = Workspace(tmp_path, tmp_path)
    text = ASSET.format('<hfield name="hills" file="absent.png" size="1 1 1 1"/>')
    ground = text.replace("<worldbody>", '<worldbody><geom type="hfield" hfield="hills"/>')
    (tmp_path / "robot.xml").write_text(ground)
    assert load_model(Robot(model="robot.xml"), workspace).root == "k"
    (tmp_path / "robot.xml").write_text(text.replace("</body>", '<geom type="hfield" hfield="hills"/></body>'))
    with pytest.raises(ModelError, match=r"heightfield 'hills' of geom '.*' is read from a file, which is not supp"):
        load_model(Robot(model="robot.xml"), workspace)


def test_the_check_without_an_engine_finds_the_files_too(tmp_path: Path) -> None:
    (tmp_path / "robot.xml").write_text(ASSET.format('<mesh file="absent.stl"/>'))
    with pytest.raises(ModelError, match=r"'absent\.stl' does not exist"):
        check_text(Robot(model="robot.xml"), Workspace(tmp_path, tmp_path))


@pytest.mark.parametrize("name", ["PART.stl", "meshes/part.stl", "meshes\\\\part.stl"])
def test_a_file_in_another_letter_case_is_found_with_a_note(name: str, tmp_path: Path) -> None:
    path = tmp_path / "inside/Assets/Meshes/part.STL"
    path.parent.mkdir(parents=True)
    path.write_bytes(stl())
    folder = "assets/" if "/" in name or "\\" in name else "assets/meshes"
    text = f'<mujoco>\n<compiler meshdir="{folder}"/>\n' + ASSET.format(f'<mesh file="{name}"/>')[8:]
    found = collected(tmp_path, text)
    assert [mesh.path for mesh in found.meshes.values()] == [path]
    (note,) = found.findings
    assert (note.rule, note.location.line) == ("file-spelling", 3)
    assert "is spelled Assets/Meshes/part.STL on the disk" in note.message
    found = collected(tmp_path, '<mujoco><include file="Arm.xml"/></mujoco>', arm_xml=f"<mujoco>{BODY}</mujoco>")
    assert [note.rule for note in found.findings] == ["file-spelling"]


def test_another_letter_case_leads_to_no_file_outside_of_the_workspace(tmp_path: Path) -> None:
    (tmp_path / "part.stl").write_bytes(stl())
    (tmp_path / "inside").mkdir()
    (tmp_path / "inside/out.stl").symlink_to(tmp_path / "part.stl")
    for name in ("../Part.stl", "Out.stl", "package://Part.stl"):
        assert f"'{name}'" in refused(tmp_path, ASSET.format(f'<mesh file="{name}"/>'))
