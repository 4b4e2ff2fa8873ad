"""Errors in xacro files are reported with their line, their cause and the next step."""

from __future__ import annotations

import io
import os
from pathlib import Path

import pytest

from sim_action.core.errors import Location
from sim_action.robot.reading import xacro_documents, xacro_expansion
from sim_action.robot.reading.xacro_documents import XacroError
from sim_action.robot.reading.xacro_expansion import expand, explain_xacro_error
from tests.robot.xacro_models import URDF, element, expanded, refusal, told
from tests.ros_workspace import NAMESPACE, RosWorkspace, written


@pytest.mark.parametrize(
    ("body", "rule", "message"),
    [
        (
            '<a/>\n<a x="${wheel_radus * 2}"/>\n<xacro:property name="wheel_radius" value="1"/>',
            "bad-xacro",
            "test.urdf.xacro:3: property 'wheel_radus' is not defined, when evaluating expression 'wheel_radus * 2'",
        ),
        (
            '<xacro:property name="wheel_radius" value="1"/>\n<a>\n<b>${wheel_radus}</b></a>',
            "bad-xacro",
            (
                "test.urdf.xacro:4: property 'wheel_radus' is not defined; did you mean 'wheel_radius'?, "
                "when evaluating expression 'wheel_radus'"
            ),
        ),
        (
            '<xacro:include filename="wheel.xacro"/>\n<xacro:whel side="left"/>',
            "bad-xacro",
            ("test.urdf.xacro:3: unknown macro 'whel'; did you mean 'wheel'?; check that its file is included"),
        ),
        (
            '<xacro:include filename="wheel.xacro"/>\n<xacro:wheel side="left"/>',
            "bad-xacro",
            "test.urdf.xacro:3: macro 'wheel': Undefined parameters [reflect]",
        ),
        (
            '<xacro:include filename="wheel.xacro"/>\n<xacro:wheel side="left" reflect="1" color="red"/>',
            "bad-xacro",
            "test.urdf.xacro:3: macro 'wheel': Invalid parameter \"color\"",
        ),
        (
            '<xacro:include filename="wheel.xacro"/>\n<xacro:wheel side="left" reflect="1"/>',
            "bad-xacro",
            (
                "wheel.xacro:5: property 'wheel_radius' is not defined, when evaluating expression 'wheel_radius', "
                "in macro 'wheel' called at test.urdf.xacro:3"
            ),
        ),
        (
            '\n<xacro:include filename="whel.xacro"/>',
            "missing-include",
            "test.urdf.xacro:3: 'whel.xacro' does not exist (looked for whel.xacro); did you mean 'wheel.xacro'?",
        ),
        (
            "\n<a x=\"${xacro.load_yaml('absent.yaml')}\"/>",
            "missing-include",
            "test.urdf.xacro:3: 'absent.yaml' does not exist (looked for absent.yaml)",
        ),
        (
            '<xacro:include filename="package://rover_sensors/urdf/lidar.xacro"/>',
            "bad-xacro",
            (
                "test.urdf.xacro:2: 'package://rover_sensors/urdf/lidar.xacro': "
                "in xacro, write $(find name)/path/of/the/file for a file of a package"
            ),
        ),
        (
            '\n<a x="$(arg size)"/>',
            "unknown-argument",
            (
                "test.urdf.xacro:3: argument 'size' has no value: set it in robot.args, "
                'or declare it before its use with <xacro:arg name="size" default="..."/>'
            ),
        ),
        ('\n<a x="$(env ABSENT)"/>', "bad-xacro", "test.urdf.xacro:3: environment variable 'ABSENT' is not set"),
        (
            '<a x="${1 / 0}"/>',
            "bad-xacro",
            "test.urdf.xacro:2: ZeroDivisionError: division by zero, when evaluating expression '1 / 0'",
        ),
        (
            '<a x="${1 +}"/>',
            "bad-xacro",
            "test.urdf.xacro:2: SyntaxError: invalid syntax, when evaluating expression '1 +'",
        ),
        ('<a x="${"/>', "bad-xacro", "test.urdf.xacro:2: invalid expression: ${"),
        ('<xacro:arg name="x"/>', "bad-xacro", "test.urdf.xacro:2: xacro:arg: missing attribute 'default'"),
        ('<xacro:insert_block name="b"/>', "bad-xacro", 'test.urdf.xacro:2: Undefined block "b"'),
        (
            "<a x=\"${xacro.fatal('wrong size')}\"/>",
            "bad-xacro",
            "test.urdf.xacro:2: wrong size, when evaluating expression 'xacro.fatal('wrong size')'",
        ),
        (
            "<a>",
            "bad-xml",
            (
                "test.urdf.xacro:3: not well-formed XML: mismatched tag: found </robot>, "
                "expected the end of <a> from line 2"
            ),
        ),
        (
            "<gazebo:a/>",
            "bad-xml",
            (
                "test.urdf.xacro:2: not well-formed XML: unbound prefix; declare the prefix in the root element, "
                'as in <robot xmlns:xacro="http://www.ros.org/wiki/xacro">'
            ),
        ),
        ("<a>" * 100 + "</a>" * 100, "bad-xml", "test.urdf.xacro:2: more than 100 elements inside each other"),
    ],
)
def test_what_does_not_expand_is_told_with_its_line(body: str, rule: str, message: str, ros: RosWorkspace) -> None:
    error = refusal(ros, body)
    assert (error.rule, told(ros, error)) == (rule, message)


def test_a_hundred_elements_may_be_inside_each_other(ros: RosWorkspace) -> None:
    # One more is the root.
    assert expanded(ros, "<a>" * 99 + "</a>" * 99).text.count("<a") == 99


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


def test_files_that_include_each_other_without_end_are_told(ros: RosWorkspace) -> None:
    ros.write(f"{URDF}/a.xacro", f'<robot {NAMESPACE}><xacro:include filename="b.xacro"/></robot>')
    ros.write(f"{URDF}/b.xacro", f'<robot {NAMESPACE}>\n<xacro:include filename="a.xacro"/></robot>')
    error = refusal(ros, '<xacro:include filename="a.xacro"/>')
    assert error.rule == "bad-xacro"
    assert told(ros, error).startswith("b.xacro:2: files include each other in a loop: a.xacro -> b.xacro -> a.xacro,")
    assert len(error.message) < 2000


def test_includes_that_multiply_are_bounded(ros: RosWorkspace) -> None:
    for name, inner in ("ab", "bc", "cd", "de", "ef"):
        fourfold = f'<xacro:include filename="{inner}.xacro"/>' * 4
        ros.write(f"{URDF}/{name}.xacro", f"<robot {NAMESPACE}>{fourfold}</robot>")
    ros.write(f"{URDF}/f.xacro", "<robot><a/></robot>")
    assert "more than 1000 files are included" in str(refusal(ros, '<xacro:include filename="a.xacro"/>'))


def test_macros_that_call_themselves_without_end_are_told(ros: RosWorkspace) -> None:
    error = refusal(ros, '\n<xacro:macro name="m">\n<xacro:m/></xacro:macro><xacro:m/>')
    assert error.location.line == 4
    assert "macros call each other without end, or too deep" in error.message
    assert "in macro 'm' called at" in error.message


def test_macros_that_multiply_are_bounded(ros: RosWorkspace, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(xacro_documents, "_MAX_COPIES", 1000)
    calls = "".join(
        f'<xacro:macro name="m{n}"><xacro:m{n - 1}/><xacro:m{n - 1}/></xacro:macro>\n' for n in range(1, 30)
    )
    error = refusal(ros, f'<xacro:macro name="m0"><link/></xacro:macro>\n{calls}<xacro:m29/>')
    assert "macros create more than 1,000 elements" in error.message


def test_what_it_expands_to_is_bounded(ros: RosWorkspace) -> None:
    assert "expands to more than 20 MB" in str(refusal(ros, "<a x=\"${'x' * 21000000}\"/>"))
    assert "out of memory" in str(refusal(ros, "<a x=\"${'x' * 10**14}\"/>"))


def test_an_expression_that_ends_the_process_is_an_error(ros: RosWorkspace) -> None:
    """It shows as well that xacro runs any code: this is Python's own exit, which no one gave it."""
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


def test_yaml_that_is_no_text_is_refused(ros: RosWorkspace) -> None:
    (ros.root / URDF / "odd.yaml").write_bytes(b"\xff\xfe")
    assert "save it as UTF-8" in str(refusal(ros, "<a x=\"${xacro.load_yaml('odd.yaml')}\"/>"))


def test_a_pipe_holds_nobody_up(ros: RosWorkspace) -> None:
    os.mkfifo(ros.root / URDF / "pipe.xacro")
    assert refusal(ros, '<xacro:include filename="pipe.xacro"/>').rule == "missing-include"


def test_a_file_that_is_not_there_is_an_error(ros: RosWorkspace) -> None:
    with pytest.raises(XacroError, match=r"absent\.xacro: .*No such file") as raised:
        expand(ros.root / "absent.xacro", {}, ros.packages())
    assert raised.value.rule == "missing-include"


def test_the_end_of_long_chatter_is_dropped() -> None:
    kept = xacro_expansion._Bounded(5)
    for text in ("abc", "def", "ghi"):
        print(text, end="", file=kept)
    assert isinstance(kept, io.StringIO)
    assert kept.getvalue() == "abcde"
