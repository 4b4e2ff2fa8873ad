"""xacro without ROS: the URDF that a file expands to, the places of its elements, and errors with their lines."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
import xacro
import xacro.substitution_args

from sim_action.core.errors import Location
from sim_action.robot.reading import xacro_documents
from sim_action.robot.reading.xacro_documents import XacroError
from sim_action.robot.reading.xacro_expansion import Argument, expand, explain_xacro_error
from tests.robot.xacro_models import URDF, element, expanded, refusal, told
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


def test_an_argument_that_is_used_or_declared_where_nothing_comes_by_is_known(ros: RosWorkspace) -> None:
    assert element(expanded(ros, '<a x="$(arg x)"/>', {"x": 1})).get("x") == "1"
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


def test_other_encodings_and_a_hundred_elements_inside_each_other_are_read(ros: RosWorkspace) -> None:
    # One more is the root.
    assert expanded(ros, "<a>" * 99 + "</a>" * 99).text.count("<a") == 99
    text = f'<?xml version="1.0" encoding="ISO-8859-1"?><robot {NAMESPACE}><a x="é"/></robot>'
    (ros.root / URDF / "latin.xacro").write_bytes(text.encode("latin-1"))
    assert element(expanded(ros, '<xacro:include filename="latin.xacro"/>')).get("x") == "é"


def test_what_xacro_says_becomes_notes_within_bounds(ros: RosWorkspace, capfd: pytest.CaptureFixture[str]) -> None:
    body = "<a x=\"${xacro.warning('old', 'file')}${xacro.message('hello')}\"/>\n<xacro:property name='pi' value='3'/>"
    where = f"when processing file: {ros.root}/{URDF}/test.urdf.xacro"
    assert expanded(ros, body).notes == (f"old file, {where}", "hello", f"redefining global symbol: pi, {where}")
    assert capfd.readouterr() == ("", "")
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
    # An ament that is there is put back.
    theirs = type(sys)("ament_index_python.packages")
    monkeypatch.setitem(sys.modules, theirs.__name__, theirs)
    assert element(expanded(ros, '<a x="$(find rover_sensors)"/>')).get("x") == str(ros.sensors)
    assert sys.modules[theirs.__name__] is theirs


def test_one_expansion_leaves_nothing_to_the_next(ros: RosWorkspace) -> None:
    expanded(ros, '<xacro:property name="p" value="1"/><xacro:macro name="m"><a/></xacro:macro><b/>')
    assert "'p' is not defined" in str(refusal(ros, '<a x="${p}"/>'))
    assert "unknown macro 'm'" in str(refusal(ros, "<xacro:m/>"))


INCLUDED = '<xacro:include filename="wheel.xacro"/>\n'
IN_WHEEL = "when evaluating expression 'wheel_radius', in macro 'wheel' called at test.urdf.xacro:3"
REMEDY = "set it in robot.args, or for inspect by --arg size=VALUE, or declare it before its use"
NOT_SET = f'has no value: {REMEDY} with <xacro:arg name="size" default="..."/>'
PREFIX = 'declare the prefix in the root element, as in <robot xmlns:xacro="http://www.ros.org/wiki/xacro">'
LIDAR = "package://rover_sensors/urdf/lidar.xacro"
# rule -> texts, and the message
REFUSED: dict[str, list[tuple[str, str]]] = {
    "bad-xacro": [
        (
            '<a/>\n<a x="${wheel_radus * 2}"/>\n<xacro:property name="wheel_radius" value="1"/>',
            "3: property 'wheel_radus' is not defined, when evaluating expression 'wheel_radus * 2'",
        ),
        (
            '<xacro:property name="track" value="1"/>\n<a>\n<b>${trak}</b></a>',
            "4: property 'trak' is not defined; did you mean 'track'?, when evaluating expression 'trak'",
        ),
        (
            f'{INCLUDED}<xacro:whel side="left"/>',
            "3: unknown macro 'whel'; did you mean 'wheel'?; check that its file is included",
        ),
        (f'{INCLUDED}<xacro:wheel side="left"/>', "3: macro 'wheel': Undefined parameters [reflect]"),
        (
            f'{INCLUDED}<xacro:wheel side="left" reflect="1" color="red"/>',
            "3: macro 'wheel': Invalid parameter \"color\"",
        ),
        (
            f'{INCLUDED}<xacro:wheel side="left" reflect="1"/>',
            f"wheel.xacro:5: property 'wheel_radius' is not defined, {IN_WHEEL}",
        ),
        (
            f'<xacro:include filename="{LIDAR}"/>',
            f"2: '{LIDAR}': in xacro, write $(find name)/path/of/the/file for a file of a package",
        ),
        ('\n<a x="$(env ABSENT)"/>', "3: environment variable 'ABSENT' is not set"),
        ('<a x="${1 / 0}"/>', "2: ZeroDivisionError: division by zero, when evaluating expression '1 / 0'"),
        ('<a x="${1 +}"/>', "2: SyntaxError: invalid syntax, when evaluating expression '1 +'"),
        ('<a x="${"/>', "2: invalid expression: ${"),
        ('<xacro:arg name="x"/>', "2: xacro:arg: missing attribute 'default'"),
        ('<xacro:insert_block name="b"/>', '2: Undefined block "b"'),
        ("<a x=\"${xacro.fatal('small')}\"/>", "2: small, when evaluating expression 'xacro.fatal('small')'"),
    ],
    "missing-include": [
        (
            '\n<xacro:include filename="whel.xacro"/>',
            "3: 'whel.xacro' does not exist (looked for whel.xacro); did you mean 'wheel.xacro'?",
        ),
        ("\n<a x=\"${xacro.load_yaml('a.yaml')}\"/>", "3: 'a.yaml' does not exist (looked for a.yaml)"),
    ],
    "unknown-argument": [('\n<a x="$(arg size)"/>', f"3: argument 'size' {NOT_SET}")],
    "bad-xml": [
        ("<a>", "3: not well-formed XML: mismatched tag: found </robot>, expected the end of <a> from line 2"),
        ("<gazebo:a/>", f"2: not well-formed XML: unbound prefix; {PREFIX}"),
        ("<a>" * 100 + "</a>" * 100, "2: more than 100 elements inside each other"),
    ],
}


@pytest.mark.parametrize(
    ("body", "rule", "message"), [(body, rule, message) for rule, rows in REFUSED.items() for body, message in rows]
)
def test_what_does_not_expand_is_told_with_its_line(body: str, rule: str, message: str, ros: RosWorkspace) -> None:
    error = refusal(ros, body)
    assert (error.rule, told(ros, error).removeprefix("test.urdf.xacro:")) == (rule, message)


def test_the_way_to_an_error_goes_through_macros_and_files(ros: RosWorkspace) -> None:
    outer = f'<robot {NAMESPACE}>\n\n<xacro:include filename="inner.xacro"/>\n</robot>'
    ros.write(f"{URDF}/outer.xacro", outer)
    ros.write(f"{URDF}/inner.xacro", f'<robot {NAMESPACE}>\n<a x="${{nope}}"/></robot>')
    error = refusal(ros, '<xacro:include filename="outer.xacro"/>')
    assert error.location == Location(f"{ros.root}/{URDF}/inner.xacro", 2)
    assert told(ros, error).endswith(", included at outer.xacro:3, included at test.urdf.xacro:2")


def test_an_error_that_no_frame_has_a_place_for_is_told_of_the_file() -> None:
    """As all would be if a later xacro held its elements by other names."""
    error = explain_xacro_error(NameError("no matter", name="width"), Path("robot.xacro"))
    assert str(error) == "robot.xacro: property 'width' is not defined"


def test_bad_xml_in_an_included_file_is_told_there(ros: RosWorkspace) -> None:
    ros.write(f"{URDF}/inner.xacro", "<robot>\n<a\n</robot>")
    error = refusal(ros, '<xacro:include filename="inner.xacro"/>')
    assert error.rule == "bad-xml"
    assert told(ros, error).startswith("inner.xacro:3: not well-formed XML: ")
    assert told(ros, error).endswith(", included at test.urdf.xacro:2")


def test_an_unknown_argument_is_told_with_those_that_there_are(ros: RosWorkspace) -> None:
    with pytest.raises(XacroError) as raised:
        expand(ros.rover, {"with_lidr": True}, ros.packages())
    assert raised.value.rule == "unknown-argument"
    assert told(ros, raised.value) == (
        "rover.urdf.xacro: robot.args: no <xacro:arg> has the name 'with_lidr'; did you mean 'with_lidar'? "
        "(allowed: mass, with_lidar)"
    )


def test_a_missing_package_is_told_as_packages_tells_it(ros: RosWorkspace) -> None:
    error = refusal(ros, '\n<xacro:include filename="$(find rover_sensor)/urdf/lidar.xacro"/>')
    assert error.rule == "missing-package"
    assert error.location.line == 3
    assert "refers to the package 'rover_sensor', which was not found; did you mean 'rover_sensors'?" in error.message


@pytest.mark.parametrize(
    "body",
    [
        '<xacro:include filename="../../../../secret.xacro"/>',
        '<xacro:include filename="{outside}"/>',
        '<xacro:include filename="{outside}" optional="true"/>',
        '<xacro:include filename="../../../../secr*.xacro"/>',
        '<xacro:include filename="link.xacro"/>',
        "<a x=\"${{xacro.load_yaml('{outside}')}}\"/>",
        "<a x=\"${{xacro.load_yaml('../../../../secret.xacro')}}\"/>",
    ],
)
def test_nothing_outside_the_workspace_is_read(body: str, ros: RosWorkspace, tmp_path: Path) -> None:
    outside = written(tmp_path.resolve() / "secret.xacro", "<robot><a/></robot>")
    (ros.root / URDF / "link.xacro").symlink_to(outside)
    error = refusal(ros, body.format(outside=outside))
    assert error.rule == "outside-workspace"
    assert error.location == Location(f"{ros.root}/{URDF}/test.urdf.xacro", 2)


def test_allow_outside_lifts_it(ros: RosWorkspace, tmp_path: Path) -> None:
    written(tmp_path / "open.xacro", '<robot><a x="1"/></robot>')
    path = ros.robot('<xacro:include filename="../../../../open.xacro"/>')
    assert element(expand(path, {}, ros.packages(allow_outside=True))).get("x") == "1"


def test_files_that_include_each_other_without_end_or_multiply_are_told(ros: RosWorkspace) -> None:
    ros.write(f"{URDF}/a.xacro", f'<robot {NAMESPACE}><xacro:include filename="b.xacro"/></robot>')
    ros.write(f"{URDF}/b.xacro", f'<robot {NAMESPACE}>\n<xacro:include filename="a.xacro"/></robot>')
    error = refusal(ros, '<xacro:include filename="a.xacro"/>')
    assert error.rule == "bad-xacro"
    assert told(ros, error).startswith("b.xacro:2: files include each other in a loop: a.xacro -> b.xacro -> a.xacro,")
    assert len(error.message) < 2000
    for name, inner in ("ab", "bc", "cd", "de", "ef"):
        fourfold = f'<xacro:include filename="{inner}.xacro"/>' * 4
        ros.write(f"{URDF}/{name}.xacro", f"<robot {NAMESPACE}>{fourfold}</robot>")
    ros.write(f"{URDF}/f.xacro", "<robot><a/></robot>")
    assert "more than 1000 files are included" in str(refusal(ros, '<xacro:include filename="a.xacro"/>'))


def test_macros_that_call_themselves_without_end_or_multiply_are_told(
    ros: RosWorkspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    error = refusal(ros, '\n<xacro:macro name="m">\n<xacro:m/></xacro:macro><xacro:m/>')
    assert error.location.line == 4
    assert "macros call each other without end, or too deep" in error.message
    assert "in macro 'm' called at" in error.message
    monkeypatch.setattr(xacro_documents, "_MAX_COPIES", 1000)
    calls = "".join(
        f'<xacro:macro name="m{n}"><xacro:m{n - 1}/><xacro:m{n - 1}/></xacro:macro>\n' for n in range(1, 30)
    )
    error = refusal(ros, f'<xacro:macro name="m0"><link/></xacro:macro>\n{calls}<xacro:m29/>')
    assert "macros create more than 1,000 elements" in error.message


def test_what_it_expands_to_is_bounded_and_its_exit_is_an_error(ros: RosWorkspace) -> None:
    assert "expands to more than 20 MB" in str(refusal(ros, "<a x=\"${'x' * 21000000}\"/>"))
    assert "out of memory" in str(refusal(ros, "<a x=\"${'x' * 10**14}\"/>"))
    # It shows as well that xacro runs any code: this is Python's own exit, which no one gave it.
    error = refusal(ros, '<xacro:property name="p" value="exit(3)"/>\n<a x="$(eval ${p})"/>')
    assert told(ros, error) == "test.urdf.xacro:3: SystemExit: 3"


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b'<!DOCTYPE robot [<!ENTITY a "b">]><robot/>', ":1: a DOCTYPE is not allowed in a model"),
        (b"", ":1: not well-formed XML: no element found"),
        (b"\xff\xfe\x00", "not well-formed XML"),
        (b'<?xml version="1.0" encoding="nonsense"?><robot/>', "unknown encoding: nonsense; save the file as UTF-8"),
        (b'<?xml version="1.0" encoding="utf-7"?><robot/>', "save the file as UTF-8"),
        (b" " * 6_000_000, "the file is too large: at most 5 MB are allowed"),
    ],
)
def test_files_that_are_no_xacro_are_refused(data: bytes, message: str, ros: RosWorkspace) -> None:
    (ros.root / URDF / "odd.xacro").write_bytes(data)
    for path in (ros.root / URDF / "odd.xacro", ros.robot('<xacro:include filename="odd.xacro"/>')):
        with pytest.raises(XacroError, match=message) as raised:
            expand(path, {}, ros.packages())
        assert raised.value.location.file == f"{ros.root}/{URDF}/odd.xacro"


def test_yaml_that_is_no_text_a_pipe_and_a_missing_file_are_refused(ros: RosWorkspace) -> None:
    (ros.root / URDF / "odd.yaml").write_bytes(b"\xff\xfe")
    assert "save it as UTF-8" in str(refusal(ros, "<a x=\"${xacro.load_yaml('odd.yaml')}\"/>"))
    os.mkfifo(ros.root / URDF / "pipe.xacro")
    assert refusal(ros, '<xacro:include filename="pipe.xacro"/>').rule == "missing-include"
    with pytest.raises(XacroError, match=r"absent\.xacro: .*No such file") as raised:
        expand(ros.root / "absent.xacro", {}, ros.packages())
    assert raised.value.rule == "missing-include"
