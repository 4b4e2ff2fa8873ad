"""xacro without ROS: the URDF that a file expands to, and the places of its elements."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
import xacro
import xacro.substitution_args

from sim_action.core.errors import Location
from sim_action.robot.reading.xacro_documents import XacroError
from sim_action.robot.reading.xacro_expansion import Argument, expand
from tests.robot.xacro_models import URDF, element, expanded, refusal
from tests.ros_workspace import NAMESPACE, RosWorkspace, ros_package, written


def test_a_robot_of_two_packages_becomes_a_urdf(ros: RosWorkspace) -> None:
    expansion = expand(ros.rover, {}, ros.packages())
    robot = ET.fromstring(expansion.text)
    assert robot.get("name") == "rover"
    names = [link.get("name") for link in robot.findall("link")]
    assert names == ["base_link", "wheel_left_link", "wheel_right_link", "lidar_link"]
    masses = [float(mass.get("value", "")) for mass in robot.iter("mass")]
    assert masses == [2.0, 0.25]
    origins = [origin.get("xyz", "").split()[1] for origin in robot.iter("origin")]
    assert [float(y) for y in origins] == pytest.approx([0.15, -0.15])
    meshes = [mesh.get("filename") for mesh in robot.iter("mesh")]
    assert meshes == ["package://rover_description/meshes/base.stl", "package://rover_sensors/meshes/lidar.stl"]
    assert expansion.notes == ()


def test_each_element_knows_where_it_was_written(ros: RosWorkspace) -> None:
    expansion = expand(ros.rover, {}, ros.packages())
    elements = list(ET.fromstring(expansion.text).iter())
    assert len(elements) == len(expansion.places)
    for found, place in zip(elements, expansion.places, strict=True):
        assert place.line is not None
        line = Path(place.file).read_text(encoding="utf-8").splitlines()[place.line - 1]
        assert f"<{found.tag}" in line
    places = dict(zip([found.get("name") for found in elements], expansion.places, strict=True))
    assert places["wheel_left_joint"] == places["wheel_right_joint"] == Location(f"{ros.root}/{URDF}/wheel.xacro", 7)
    assert places["lidar_link"] == Location(str(ros.sensors / "urdf/lidar.xacro"), 5)


def test_blocks_and_conditions_keep_their_places(ros: RosWorkspace) -> None:
    body = (
        '<xacro:macro name="twice" params="*block"><xacro:insert_block name="block"/>\n'
        '<xacro:insert_block name="block"/></xacro:macro>\n'
        '<xacro:twice>\n<a/></xacro:twice>\n<xacro:if value="1">\n<b/></xacro:if>\n'
        '<xacro:element\nxacro:name="${1 and &quot;c&quot;}"/>'
    )
    expansion = expanded(ros, body)
    assert [found.tag for found in ET.fromstring(expansion.text)] == ["a", "a", "b", "c"]
    assert [place.line for place in expansion.places[1:]] == [5, 5, 7, 8]


def test_it_is_what_xacro_itself_makes_of_it(ros: RosWorkspace) -> None:
    body = """
      <!-- xacro:eval-comments --><!-- ${1 + 1} -->
      <xacro:include filename="common_properties.xacro" ns="common"/><xacro:include filename="wh*.xacro"/>
      <xacro:property name="wheel_radius" value="${common.wheel_radius / 2}"/>
      <xacro:property name="track" default="1e-1"/><xacro:property name="rim"><b/>text<c x="$${y}"/></xacro:property>
      <xacro:macro name="pair" params="kind:=left reflect:=^|1 *origin **rest"><xacro:insert_block name="origin"/>
        <xacro:call macro="wheel" side="${kind}" reflect="${reflect}"/><xacro:insert_block name="rest"/></xacro:macro>
      <xacro:pair kind="right"><origin xyz="0 0 ${2 ** -1}"/><rest><d/><e>${pi}</e></rest></xacro:pair>
      <xacro:unless value="${track > 1}"><f xmlns:g="http://example.org/g"><g:a g:b="1" b="2"/></f></xacro:unless>
      <data><![CDATA[<raw & ${'unread'}>]]></data><xacro:insert_block name="rim"/>
    """
    path = ros.robot(body)
    theirs = ET.canonicalize(xacro.process(str(path)), strip_text=True)
    assert ET.canonicalize(expand(path, {}, ros.packages()).text, strip_text=True) == theirs
    assert theirs.count("wheel_right_link") == 2
    assert 'radius="0.025"' in theirs


@pytest.mark.parametrize(
    ("value", "text"),
    [("lots", "lots"), (3, "3"), (0.25, "0.25"), (True, "true"), (False, "false"), ("1e-3", "1e-3"), ("", "")],
)
def test_arguments_come_as_text(value: Argument, text: str, ros: RosWorkspace) -> None:
    expansion = expanded(ros, '<xacro:arg name="x" default="d"/><a x="$(arg x)"/>', {"x": value})
    assert element(expansion).get("x") == text


def test_arguments_decide_what_there_is(ros: RosWorkspace) -> None:
    robot = ET.fromstring(expand(ros.rover, {"mass": 5, "with_lidar": False}, ros.packages()).text)
    assert [mass.get("value") for mass in robot.iter("mass")] == ["5"]


def test_an_argument_that_is_not_declared_but_used_is_known(ros: RosWorkspace) -> None:
    assert element(expanded(ros, '<a x="$(arg x)"/>', {"x": 1})).get("x") == "1"


def test_an_argument_that_is_declared_where_nothing_comes_by_is_known(ros: RosWorkspace) -> None:
    body = '<xacro:if value="0"><xacro:arg name="x" default="d"/></xacro:if><a/>'
    assert element(expanded(ros, body, {"x": 1})) is not None


def test_the_environment_is_the_packages_own(ros: RosWorkspace, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SIM_ACTION_TEST", "of the process")
    body = '<a x="$(env ROVER)" y="$(optenv SIM_ACTION_TEST none set)" z="$(optenv ROVER no)"/>'
    assert element(expanded(ros, body, environment={"ROVER": "7"})).attrib == {"x": "7", "y": "none set", "z": "7"}


def test_find_asks_the_packages(ros: RosWorkspace, tmp_path: Path) -> None:
    arm = ros_package(tmp_path.resolve() / "opt/share/arm")
    written(arm / "urdf/arm.xacro", f'<robot {NAMESPACE}>\n<a x="$(find arm)" y="$(find rover_sensors)"/></robot>')
    body = '<xacro:include filename="$(find arm)/urdf/arm.xacro"/>'
    found = element(expanded(ros, body, environment={"AMENT_PREFIX_PATH": str(arm.parent.parent)}))
    assert found.attrib == {"x": str(arm), "y": str(ros.sensors)}


def test_of_two_packages_of_one_name_the_nearer_is_included_with_a_note(ros: RosWorkspace) -> None:
    far, near = (ros_package(ros.root / place / "arm") for place in ("vendor/old", "src"))
    for folder in (far, near):
        written(folder / "arm.xacro", f'<robot {NAMESPACE}><a x="{folder.parent.name}"/></robot>')
    expansion = expanded(ros, '<xacro:include filename="$(find arm)/arm.xacro"/><b x="$(find arm)"/>')
    assert element(expansion).get("x") == "src"
    assert [note.rule for note in expansion.package_notes] == ["several-packages"]
    assert expansion.package_notes[0].text.startswith(
        f"2 packages have the same name: {near} is used, because it is nearest to test.urdf.xacro"
    )


def test_a_package_is_found_from_the_file_that_is_being_included(ros: RosWorkspace) -> None:
    for place in ("src/rover_sensors/vendor", "src/rover_description/vendor"):
        written(ros_package(ros.root / place / "arm") / "arm.xacro", f'<robot><a x="{place}"/></robot>')
    inner = f'<robot {NAMESPACE}><xacro:include filename="$(find arm)/arm.xacro"/></robot>'
    ros.write("src/rover_sensors/urdf/inner.xacro", inner)
    expansion = expanded(ros, '<xacro:include filename="$(find rover_sensors)/urdf/inner.xacro"/>')
    assert element(expansion).get("x") == "src/rover_sensors/vendor"


def test_optional_includes_may_be_absent(ros: RosWorkspace) -> None:
    # The next name is relative to the file that is open then: the absent one's folder would be another.
    body = '<xacro:include filename="{}/absent.xacro" optional="true"/><xacro:include filename="wheel.xacro"/><a/>'
    for folder in (".", "../meshes", "$(find rover_sensors)/urdf"):
        assert element(expanded(ros, body.format(folder))) is not None


def test_a_file_may_include_itself_for_a_while(ros: RosWorkspace) -> None:
    step = '<xacro:property name="n" value="${n - 1}" lazy_eval="false" scope="global"/><a/>'
    again = '<xacro:if value="${n > 0}"><xacro:include filename="part.xacro"/></xacro:if>'
    ros.write(f"{URDF}/part.xacro", f"<robot {NAMESPACE}>{step}{again}</robot>")
    body = '<xacro:property name="n" value="3"/><xacro:include filename="part.xacro"/>'
    assert len(ET.fromstring(expanded(ros, body).text).findall("a")) == 3


def test_other_encodings_are_read(ros: RosWorkspace) -> None:
    text = f'<?xml version="1.0" encoding="ISO-8859-1"?><robot {NAMESPACE}><a x="é"/></robot>'
    (ros.root / URDF / "latin.xacro").write_bytes(text.encode("latin-1"))
    assert element(expanded(ros, '<xacro:include filename="latin.xacro"/>')).get("x") == "é"


def test_what_xacro_says_becomes_notes(ros: RosWorkspace, capfd: pytest.CaptureFixture[str]) -> None:
    body = "<a x=\"${xacro.warning('old', 'file')}${xacro.message('hello')}\"/>\n<xacro:property name='pi' value='3'/>"
    where = f"when processing file: {ros.root}/{URDF}/test.urdf.xacro"
    assert expanded(ros, body).notes == (f"old file, {where}", "hello", f"redefining global symbol: pi, {where}")
    assert capfd.readouterr() == ("", "")


def test_what_xacro_says_is_bounded(ros: RosWorkspace) -> None:
    notes = expanded(ros, "<a x=\"${[xacro.message(str(i) + 'word' * 1000) for i in python.range(100)]}\"/>").notes
    assert 10_000 < sum(map(len, notes)) <= 20_000


@pytest.mark.parametrize("body", ["<a/>", "<xacro:nothing/>", "<a x=\"${xacro.load_yaml('absent')}\"/>"])
def test_nothing_of_xacro_stays_replaced(body: str, ros: RosWorkspace, monkeypatch: pytest.MonkeyPatch) -> None:
    before = (xacro.parse, dict(os.environ), sys.stdout, sys.stderr)
    try:
        expanded(ros, body)
    except XacroError:
        assert body != "<a/>"
    assert (xacro.parse, dict(os.environ), sys.stdout, sys.stderr) == before
    assert xacro.substitution_args.os is os
    assert "open" not in vars(xacro)
    assert "ament_index_python.packages" not in sys.modules


def test_an_ament_that_is_there_is_put_back(ros: RosWorkspace, monkeypatch: pytest.MonkeyPatch) -> None:
    theirs = type(sys)("ament_index_python.packages")
    monkeypatch.setitem(sys.modules, theirs.__name__, theirs)
    assert element(expanded(ros, '<a x="$(find rover_sensors)"/>')).get("x") == str(ros.sensors)
    assert sys.modules[theirs.__name__] is theirs


def test_one_expansion_leaves_nothing_to_the_next(ros: RosWorkspace) -> None:
    expanded(ros, '<xacro:property name="p" value="1"/><xacro:macro name="m"><a/></xacro:macro><b/>')
    assert "'p' is not defined" in str(refusal(ros, '<a x="${p}"/>'))
    assert "unknown macro 'm'" in str(refusal(ros, "<xacro:m/>"))
