"""Models inside models of SDF: names, poses, and files that are included."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import pytest

from sim_action.core.errors import ModelError, RefusedModel
from sim_action.core.geometry import Vector3
from sim_action.robot.model.robot_model import RobotModel
from tests.robot.reading.sdf.models import joint, link, load, load_named, near, position, sdf
from tests.robot.reading.test_urdf import TETRAHEDRON, mesh_text
from tests.ros_workspace import written
from tests.work import work_of

CONFIG = "<model><name>wheel</name>{}</model>"
MESH = "<collision name='m'><geometry><mesh><uri>{}</uri></mesh></geometry></collision>"


def names(model: RobotModel) -> tuple[list[str], list[str]]:
    return [link.name for link in model.links], [joint.name for joint in model.joints]


# A model of two links, 1 m above each other, with a frame beside them.
ARM = "\n".join(
    (
        link("low"),
        link("high", "<pose>0 0 1 0 0 0</pose>"),
        joint("lift", "low", "high", "<axis><xyz>0 0 1</xyz></axis>", "continuous"),
        '<frame name="flange" attached_to="high"><pose>0.5 0 0 0 0 0</pose></frame>',
    )
)


def include(uri: str, inside: str = "", attributes: str = "") -> str:
    return f"<include{attributes}><uri>{uri}</uri>{inside}</include>"


def test_a_nested_model_is_placed_as_a_whole_or_by_a_frame_of_its_own(tmp_path: Path) -> None:
    inner = f'<model name="arm"><pose>0 5 0 0 0 0</pose>{ARM}</model>'
    model = load(tmp_path, sdf(link("base"), inner, joint("mount", "base", "arm::low")))
    assert names(model) == (["base", "arm::low", "arm::high"], ["arm::lift", "mount"])
    assert (position(model, "arm::low"), position(model, "arm::high")) == (near(0, 5, 0), near(0, 5, 1))
    inner = f'<model name="arm" placement_frame="flange"><pose>0 5 0 0 0 0</pose>{ARM}</model>'
    model = load(tmp_path, sdf(link("base"), inner, joint("mount", "base", "arm")))
    # The flange is where the pose says; the lower link half a metre behind it and a metre below.
    assert position(model, "arm::low") == near(-0.5, 5, -1)


@pytest.mark.parametrize(
    ("relative_to", "expected"), [("arm", (0, 5, 2)), ("arm::flange", (0.5, 5, 3)), ("arm::__model__", (0, 5, 2))]
)
def test_frames_inside_a_nested_model_are_named_from_outside(
    relative_to: str, expected: Vector3, tmp_path: Path
) -> None:
    inner = f'<model name="arm"><pose>0 5 0 0 0 0</pose>{ARM}</model>'
    tool = link("tool", f'<pose relative_to="{relative_to}">0 0 2 0 0 0</pose>')
    model = load(tmp_path, sdf(tool, inner, link("base"), joint("a", "base", "arm"), joint("b", "arm::flange", "tool")))
    assert position(model, "tool") == near(*expected)
    assert model.joints_by_name["b"].parent == "arm::high"


def test_models_are_nested_in_nested_ones(tmp_path: Path) -> None:
    hand = f'<model name="hand"><pose relative_to="flange"/>{link("palm")}</model>'
    arm = f'<model name="arm"><pose>0 5 0 0 0 0</pose>{ARM}{hand}{joint("grip", "high", "hand::palm")}</model>'
    model = load(tmp_path, sdf(link("base"), arm, joint("mount", "base", "arm::low")))
    assert position(model, "arm::hand::palm") == near(0.5, 5, 1)
    assert model.joints_by_name["arm::grip"].child == "arm::hand::palm"


def test_a_model_that_is_included_twice_is_there_twice(tmp_path: Path) -> None:
    written(tmp_path / "parts/arm.sdf", sdf(ARM).replace('name="m"', 'name="arm"'))
    left = include("parts/arm.sdf", "<name>left</name><pose>0 1 0 0 0 0</pose>")
    right = include("parts/arm.sdf", '<name>right</name><pose relative_to="left::flange">0 -2 0 0 0 0</pose>')
    plain = include("parts/arm.sdf")
    ends = [joint(f"to_{name}", "base", f"{name}::low") for name in ("left", "right", "arm")]
    model = load(tmp_path, sdf(link("base"), left, right, plain, *ends))
    assert {name.partition("::")[0] for name in names(model)[0]} == {"base", "left", "right", "arm"}
    assert position(model, "right::low") == near(0.5, -1, 1)
    assert position(model, "arm::low") == near(0, 0, 0)


def test_an_include_may_place_a_frame_of_the_model(tmp_path: Path) -> None:
    written(tmp_path / "arm.sdf", sdf("<pose>9 9 9 0 0 0</pose>", ARM))
    placed = include("arm.sdf", "<placement_frame>flange</placement_frame><pose>0 1 0 0 0 0</pose>")
    model = load(tmp_path, sdf(link("base"), placed, joint("j", "base", "m")))
    assert position(model, "m::low") == near(-0.5, 1, -1)


def test_what_is_merged_has_no_name_of_its_own(tmp_path: Path) -> None:
    written(tmp_path / "arm.sdf", sdf(ARM, '<frame name="foot"/>', version="1.6"))
    merged = include("arm.sdf", "<name>arm</name><pose>0 5 0 0 0 0</pose>", ' merge="true"')
    tool = (link("tool", '<pose relative_to="foot"/>'), joint("hold", "high", "tool"))
    model = load(tmp_path, sdf(link("base"), merged, joint("mount", "base", "low"), *tool))
    assert names(model) == (["base", "low", "high", "tool"], ["lift", "mount", "hold"])
    assert (position(model, "low"), position(model, "high")) == (near(0, 5, 0), near(0, 5, 1))
    assert position(model, "tool") == near(0, 5, 0)
    # Only a merged model is the model.
    written(tmp_path / "arm.sdf", sdf(ARM))
    assert load(tmp_path, sdf(include("arm.sdf", "", ' merge="true"'))).root == "low"


@pytest.mark.parametrize(
    "uri", ["model://wheel", "wheel", "parts/wheel", "model://wheel/wheel-1_9.sdf", "parts/wheel/wheel-1_9.sdf"]
)
def test_a_model_of_a_folder_is_its_newest_file(uri: str, tmp_path: Path) -> None:
    files = "".join(f'<sdf version="{v}">wheel-{v.replace(".", "_")}.sdf</sdf>' for v in ("1.4", "1.9", "1.5", "1.99"))
    written(tmp_path / "parts/wheel/model.config", CONFIG.format(files))
    written(tmp_path / "parts/wheel/wheel-1_9.sdf", sdf(link("rim")))
    model = load(tmp_path, sdf(link("base"), include(uri, "<name>wheel</name>"), joint("j", "base", "wheel::rim")))
    assert model.joints[0].child == "wheel::rim"
    if "/" in uri:
        assert load_named(tmp_path, uri).root == "rim"


def test_of_two_models_of_a_name_the_nearer_is_taken_and_said(tmp_path: Path) -> None:
    for folder in ("parts", "far/away"):
        written(tmp_path / folder / "wheel/model.sdf", sdf(link(folder[:3])))
    model = load(tmp_path, sdf(link("base"), include("model://wheel", "<name>w</name>"), joint("j", "base", "w")))
    assert model.joints[0].child == "w::par"
    assert [finding.rule for finding in model.findings] == ["several-packages"]


def test_meshes_lie_beside_the_file_that_names_them(tmp_path: Path) -> None:
    written(tmp_path / "parts/wheel/model.sdf", sdf(link("rim", MESH.format("meshes/rim.stl"))))
    written(tmp_path / "parts/wheel/meshes/rim.stl", TETRAHEDRON)
    model = load(tmp_path, sdf(link("base"), include("model://wheel", "<name>w</name>"), joint("j", "base", "w::rim")))
    assert mesh_text(model)
    # A finding names the file that it is in.
    hub = (link("hub", MESH.format("absent.stl")), joint("j", "rim", "hub"))
    written(tmp_path / "parts/wheel/model.sdf", sdf(link("rim"), *hub))
    with pytest.raises(RefusedModel) as refused:
        load(tmp_path, sdf(include("model://wheel", "<name>w</name>")))
    (problem,) = refused.value.problems
    assert problem.location.file.endswith("parts/wheel/model.sdf")
    assert (problem.location.line, "[missing-mesh]" in problem.message) == (4, True)


@pytest.mark.parametrize("where", ["model", "include", "outer", "nested", "around"])
def test_a_static_part_hangs_on_the_world_with_what_is_nested_in_it(where: str, tmp_path: Path) -> None:
    said = {where: "<static>true</static>"}
    written(tmp_path / "arm.sdf", sdf(ARM, said.get("model", "")))
    parts = (said.get("outer", ""), include("arm.sdf", f"<name>a</name>{said.get('include', '')}"))
    if where in ("nested", "around"):
        inner = f'<model name="a">{said.get("nested", "")}{ARM}</model>'
        parts = (said.get("around", ""), f'<model name="o">{inner}</model>')
    model = load(tmp_path, sdf(*parts))
    assert (model.root, {joint.type for joint in model.joints}) == ("world", {"fixed"})


def test_plugins_of_all_models_are_handed_on(tmp_path: Path) -> None:
    written(tmp_path / "arm.sdf", sdf(ARM, '<plugin filename="libb.so" name="b"/>'))
    parts = ('<plugin filename="liba.so" name="a"/>', include("arm.sdf", '<plugin filename="libc.so" name="c"/>'))
    assert {plugin.name for plugin in load(tmp_path, sdf(*parts)).plugins} == {"a", "b", "c"}


LINK = link("a")
MANY_FRAMES = {
    "before the first link": ('<frame name="f{n}"/>', "", LINK),
    "without a link": ('<frame name="f{n}"/>', "", ""),
    "attached in a circle": ('<frame name="f{n}" attached_to="f{after}"><pose relative_to="a"/></frame>', LINK, ""),
    "placed in a circle": ('<frame name="f{n}"><pose relative_to="f{after}"/></frame>', LINK, ""),
    "chained to nothing": ('<frame name="f{n}" attached_to="f{above}"/>', LINK, ""),
}


@pytest.mark.parametrize(("frame", "first", "last"), MANY_FRAMES.values(), ids=MANY_FRAMES)
def test_frames_cost_the_same_each(frame: str, first: str, last: str, tmp_path: Path) -> None:
    def read(count: int) -> None:
        frames = (frame.format(n=n, after=(n + 1) % count, above=n + 1) for n in range(count))
        with suppress(ModelError):
            load(tmp_path, sdf(first, *frames, last))

    small, large = work_of(lambda: read(200)), work_of(lambda: read(400))
    assert large < 2.2 * small
