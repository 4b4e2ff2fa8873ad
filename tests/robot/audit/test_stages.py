"""Every rule of the audit: what breaks it, on which line, and that a good model breaks none."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from sim_action import meshes
from sim_action.core.errors import RefusedModel
from sim_action.robot.audit.links import principal_moments
from sim_action.robot.documents.xml_document import read_document
from sim_action.robot.model.findings import ALLOWABLE, RULES, Finding
from sim_action.robot.model.robot_model import Moments
from sim_action.robot.reading.building import audit
from sim_action.robot.reading.urdf import draft_of, read_urdf
from tests.mesh_files import CORNERS, HALF, moved, obj
from tests.robot.bad_models import BAD_MODELS, GOOD, BadModel
from tests.ros_workspace import written


def findings(folder: Path, text: str) -> list[Finding]:
    draft, of_elements = draft_of(read_document(written(folder / "robot.urdf", text)))
    return [*of_elements, *(audit(draft) if draft else ())]


def test_a_good_model_has_no_findings(tmp_path: Path) -> None:
    assert findings(tmp_path, GOOD) == []


VISUAL = (
    '<visual><geometry><box size="1 1 1"/></geometry><material{}><color rgba="1 0 0 1"/></material></visual></link>'
)


@pytest.mark.parametrize("bad", BAD_MODELS, ids=lambda bad: bad.name)
def test_a_bad_model_breaks_its_rule_on_its_line(bad: BadModel, tmp_path: Path) -> None:
    path = written(tmp_path / "robot.urdf", bad.text)
    if RULES[bad.rule].level == "warning":
        (found,) = read_urdf(path).findings
        assert (found.rule, found.location.line) == (bad.rule, bad.line)
        return
    with pytest.raises(RefusedModel) as refused:
        read_urdf(path)
    problem = refused.value.problems[0]
    assert problem.message.endswith(f"[{bad.rule}]")
    assert problem.location.line == bad.line
    assert problem.message.isprintable()


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        ('<cylinder radius="33" length="18"/>', "<cylinder> is 66 m large; models are in metres"),
        ('<sphere radius="25.5"/>', "<sphere> is 51 m large; models are in metres"),
        ('<cylinder radius="20" length="18"/>', "<cylinder> is 40 m large, but the other parts at most 0.2 m: is it"),
        ('<box size="21 1 1"/>', "<box> is 21 m large, but the other parts at most 0.2 m: is it"),
        ('<box size="19 1 1"/>', ""),
        ('<cylinder radius="4.9" length="9"/>', ""),
    ],
)
def test_a_part_in_millimetres_is_too_large(shape: str, message: str, tmp_path: Path) -> None:
    wheel = f'<link name="upper"><collision><geometry>{shape}</geometry></collision>'
    found = findings(tmp_path, GOOD.replace('radius="0.5"', 'radius="0.1"').replace('<link name="upper">', wheel))
    assert [each.message[: len(message)] for each in found if each.rule == "absurd-size"] == [message] * bool(message)


@pytest.mark.parametrize(("kind", "meant"), [("continous", "continuous"), ("Revolute", "revolute")])
def test_a_misspelled_joint_type_leads_to_the_nearest(kind: str, meant: str, tmp_path: Path) -> None:
    (found,) = findings(tmp_path, GOOD.replace('type="revolute"', f'type="{kind}"'))
    assert found.message.startswith(f"unknown joint type '{kind}'; did you mean '{meant}'? (allowed: revolute, ")


@pytest.mark.parametrize(
    ("leader", "follower", "mimic"),
    [
        ('lower="-1" upper="2"', 'lower="-1" upper="2"', ""),
        ('lower="-1" upper="2"', 'lower="-1.0005" upper="1.9995"', ""),
        ('lower="-1" upper="2"', 'lower="-4" upper="2"', 'multiplier="-2"'),
        ('lower="-1" upper="2"', 'lower="-1e16" upper="1e16"', 'multiplier="9"'),
        ('lower="-1e16" upper="1"', 'lower="-1" upper="1e16"', 'multiplier="-1"'),
        ('upper="1"', 'upper="1"', ""),
    ],
)
def test_a_follower_that_goes_as_far_as_its_leader_takes_it_is_left_alone(
    leader: str, follower: str, mimic: str, tmp_path: Path
) -> None:
    hinge = '<joint name="j" type="revolute"><parent link="base"/><child link="spare"/>'
    link = f'<link name="spare">{GOOD[GOOD.index("<inertial>") : GOOD.index("</inertial>")]}</inertial></link>'
    more = f'{hinge}<limit {follower}/><mimic joint="shoulder" {mimic}/></joint>{link}</robot>'
    assert findings(tmp_path, GOOD.replace('lower="-1" upper="2"', leader).replace("</robot>", more)) == []


def test_both_zeros_of_a_limit_are_told_at_once_and_not_of_a_joint_that_is_held(tmp_path: Path) -> None:
    text = GOOD.replace('effort="10" velocity="3"', 'effort="0" velocity="0"')
    (found,) = findings(tmp_path, text)
    assert "an effort of 0 and a velocity of 0" in found.message
    assert findings(tmp_path, text.replace("revolute", "fixed")) == []


def test_a_link_that_is_fixed_to_the_world_needs_no_mass(tmp_path: Path) -> None:
    base = f'<parent link="world"/><child link="stand"/></joint>{_end("stand", "base")}'
    more = f'<link name="world"/><link name="stand"/><joint name="bolt" type="fixed">{base}</robot>'
    assert findings(tmp_path, GOOD.replace("</robot>", more)) == []


def _end(parent: str, child: str) -> str:
    return f'<joint name="{child}_bolt" type="fixed"><parent link="{parent}"/><child link="{child}"/></joint>'


def test_every_rule_has_a_model_that_breaks_it() -> None:
    # Rules of packages and xacro are in test_package_layouts.py, test_urdf.py and test_xacro_expansion.py.
    elsewhere = {"package-folder", "file-spelling", "several-packages", "xacro-warning"}
    elsewhere |= {"bad-xacro", "unknown-argument", "missing-include"}
    # Rules of SDF are in reading/sdf.
    elsewhere |= {"unknown-frame", "frame-loop", "include-loop", "unsupported-part", "unsupported-joint"}
    elsewhere |= {"default-inertia", "turned-base", "shared-friction"}
    # Rules of extensions and of MJCF are in tests/integration: test_model_extensions.py and test_native_robots.py.
    elsewhere |= {"start-position", "control-mimic", "lenient-xml", "moving-surface", "open-mesh"}
    # Parts are in test_part_table.py.
    elsewhere |= {"harmless-part"}
    # Rules of mesh files are in test_bad_meshes.py and below.
    elsewhere |= {"unknown-mesh-format", "broken-mesh", "empty-mesh", "mesh-index"}
    elsewhere |= {"too-large-mesh", "concave-mesh", "flat-mesh", "tiny-mesh"}
    assert {bad.rule for bad in BAD_MODELS} == set(RULES) - elsewhere


@pytest.mark.parametrize("rule", sorted({*ALLOWABLE} - {"unsupported-part", "unsupported-joint"}))
def test_an_error_can_be_let_go_and_is_told_all_the_same(rule: str, tmp_path: Path) -> None:
    bad = next(bad for bad in BAD_MODELS if bad.rule == rule)
    path = written(tmp_path / "robot.urdf", bad.text)
    others = {"zero-mass": "massless-model", "massless-model": "zero-mass"}
    model = read_urdf(path, allow=[rule, others.get(rule, rule)])
    assert rule in {finding.rule for finding in model.findings}


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("</link>", '<contact><restitution value="0"/></contact></link>'),
        ("</link>", '<contact><restitution value="0.0"/><lateral_friction value="0.8"/></contact></link>'),
        ("</robot>", "<gazebo reference='base'><restitution_coefficient>0</restitution_coefficient></gazebo></robot>"),
        ("</link>", VISUAL.format(' name=""')),  # the exporter of SolidWorks always writes an empty name
        ("</link>", VISUAL.format("")),
        ("</link>", '<visual><geometry><box size="1 1 1"/><box size=""/></geometry></visual></link>'),
        ('lower="-1" upper="2"', 'lower="-1e16" upper="1e16"'),
        ('lower="-1" upper="2"', 'lower="-12.566" upper="12.566"'),
        ('rpy="0 0 0"', 'rpy="0 -6.2832 6.2832"'),
    ],
)
def test_what_is_rare_but_right_is_not_told(old: str, new: str, tmp_path: Path) -> None:
    assert old in GOOD
    assert findings(tmp_path, GOOD.replace(old, new)) == []


IGNORED = "<joint> is ignored; did you mean"
EXPECTED = "expected a finite number of at most 1e+18"


@pytest.mark.parametrize(
    ("old", "new", "rule", "message"),
    [
        ("<dynamics", "<dynamic", "unknown-tag", f"unknown element <dynamic> in {IGNORED} <dynamics>?"),
        ('value="2"', f'value="{"9" * 10_000}"', "bad-number", f'<mass value="{"9" * 100}...">: {EXPECTED}'),
        # The link below it is not reported as a loop.
        (
            '<parent link="base"/>',
            '<parent link="bas"/>',
            "unknown-link",
            "joint 'shoulder' names the unknown link 'bas'; did you mean 'base'? (allowed: base, upper)",
        ),
        *(
            ("1 2 3", text, "bad-number", f'<origin xyz="{text}">: expected {wanted}')
            for text, wanted in {
                "1 1 1 1": "3 finite numbers, found 4",
                "1, 2, 3": "3 finite numbers, separated by spaces, not commas",
                "1 2 1e999": "3 finite numbers of at most 1e+18",
                "1 2 -1E19": "3 finite numbers of at most 1e+18",
                "1 2 inf": "3 finite numbers",
                "1 2 x": "3 finite numbers",
            }.items()
        ),
    ],
)
def test_a_finding_says_what_is_wrong(old: str, new: str, rule: str, message: str, tmp_path: Path) -> None:
    (found,) = findings(tmp_path, GOOD.replace(old, new))
    assert (found.rule, found.message) == (rule, message)


def test_only_the_first_unknown_links_have_hints(tmp_path: Path) -> None:
    joints = (f'<joint name="j{n}" type="fixed"><parent link="base"/><child link="bas{n}"/></joint>' for n in range(12))
    found = findings(tmp_path, GOOD.replace("</robot>", f"{''.join(joints)}</robot>"))
    assert sum("did you mean 'base'" in finding.message for finding in found) == 10


def test_all_that_a_stage_finds_is_told_at_once(tmp_path: Path) -> None:
    text = GOOD.replace('mass value="2"', 'mass value="-2"').replace('radius="0.5"', 'radius="-1"')
    assert {finding.rule for finding in findings(tmp_path, text)} == {"negative-mass", "bad-shape"}


@pytest.mark.parametrize(("others", "rules"), [("200", []), ("2", ["odd-inertia"])])
def test_a_placeholder_is_told_where_it_counts(others: str, rules: list[str], tmp_path: Path) -> None:
    # An IMU of 1 g has had nobody's care, and beside 200 kg it needs none.
    inertia = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
    imu = f'<mass value="0.001"/>{inertia}</inertial><collision><geometry><box size="1e-2 1e-2 1e-2"/></geometry>'
    text = GOOD.replace(f'<mass value="1"/>{inertia}</inertial>', f"{imu}</collision>")
    assert text != GOOD
    path = written(tmp_path / "robot.urdf", text.replace('value="2"', f'value="{others}"'))
    assert [finding.rule for finding in read_urdf(path).findings] == rules


def test_the_reach_of_a_link_is_from_its_centre_of_mass_to_a_mesh_wherever_that_is_drawn(tmp_path: Path) -> None:
    # The box lies 10 m along x in its file, and the file lies 5 m along y in the link.
    (tmp_path / "far.obj").write_bytes(obj(moved(CORNERS, 10.0)))
    text = GOOD.replace('<sphere radius="0.5"/>', '<mesh filename="far.obj"/>').replace("1 2 3", "0 5 0")
    (tmp_path / "robot.urdf").write_text(re.sub('(i..)="1"', r'\1="1e9"', text).replace("0 0 0.1", "0 0 0"))
    found = read_urdf(tmp_path / "robot.urdf").findings
    reach = math.hypot(10.0, 5.0) + math.hypot(*HALF)
    assert any(f"extends only {reach:.2g} m" in finding.message for finding in found), found


@pytest.mark.parametrize(
    ("moments", "principal"),
    [
        ((1, 0, 0, 2, 0, 3), (1, 2, 3)),
        ((2, 0, 0, 2, 0, 2), (2, 2, 2)),
        ((2, 1, 0, 2, 0, 5), (1, 3, 5)),
        ((2, -1, 0, 2, 1, 2), (2 - 2**0.5, 2, 2 + 2**0.5)),
        ((0, 0, 0, 0, 0, 0), (0, 0, 0)),
    ],
)
def test_principal_moments_are_eigenvalues(moments: Moments, principal: tuple[float, float, float]) -> None:
    assert principal_moments(moments) == pytest.approx(principal, abs=1e-12)


SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
CUBE = SQUARE + SQUARE.replace(" 0\n", " 1\n") + "f 1 2 3 4\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n"


def meshed(folder: Path, name: str, text: str, scale: str = "") -> Path:
    (folder / name).write_text(text)
    mesh = f'<mesh filename="{name}"{scale}/>'
    return written(folder / "robot.urdf", GOOD.replace('<sphere radius="0.5"/>', mesh))


@pytest.mark.parametrize(
    ("name", "text", "rule", "message"),
    [
        ("part.ply", "ply", "unknown-mesh-format", "mesh 'part.ply': "),
        ("part.stl", "garbage", "broken-mesh", "mesh 'part.stl': "),
        ("part.stl", "solid a\nendsolid a\n", "empty-mesh", "there is no triangle in it"),
        ("part.obj", f"{SQUARE}f 1 2 9\n", "mesh-index", "line 5"),
        ("part.obj", "version https://git-lfs.github.com/spec/v1\n", "broken-mesh", "git lfs pull"),
    ],
)
def test_a_mesh_is_refused_on_the_line_that_names_it(
    name: str, text: str, rule: str, message: str, tmp_path: Path
) -> None:
    with pytest.raises(RefusedModel) as refused:
        read_urdf(meshed(tmp_path, name, text))
    (problem,) = refused.value.problems
    assert problem.location.line == 10
    assert message in problem.message
    assert problem.message.endswith(f"[{rule}]")


@pytest.mark.parametrize("scale", ["-", "1 1", "1 1 x", "nan nan nan", "1e999 1 1", "ä" * 700, "1_0 1 1"])
@pytest.mark.parametrize("tag", ["visual", "collision"])
def test_a_scale_that_is_no_three_numbers_is_refused_on_its_line(tag: str, scale: str, tmp_path: Path) -> None:
    (tmp_path / "part.obj").write_text(CUBE)
    mesh = f'<{tag}><geometry><mesh filename="part.obj" scale="{scale}"/></geometry></{tag}>'
    path = written(tmp_path / "robot.urdf", GOOD.replace("</link>", f"\n{mesh}</link>", 1))
    line = path.read_text().partition("scale=")[0].count("\n") + 1
    with pytest.raises(RefusedModel) as refused:
        read_urdf(path)
    (problem,) = refused.value.problems
    assert problem.location.line == line
    assert "scale" in problem.message


def test_what_is_not_convex_is_told(tmp_path: Path) -> None:
    dented = CUBE.replace("f 5 6 7 8\n", "v 0.5 0.5 0.2\nf 5 6 9\nf 6 7 9\nf 7 8 9\nf 8 5 9\n")
    texts = (CUBE, dented, f"{SQUARE}f 1 2 3 4\n")
    rules = [[found.rule for found in read_urdf(meshed(tmp_path, "part.obj", text)).findings] for text in texts]
    assert rules == [[], ["concave-mesh"], ["flat-mesh"]]


@pytest.mark.parametrize(
    ("scale", "lower", "upper"),
    [
        ("", (0, 0, 0), (1, 1, 1)),
        (' scale="2 1 0.5"', (0, 0, 0), (2, 1, 0.5)),
        (' scale="-1 -2 3"', (-1, -2, 0), (0, 0, 3)),
    ],
)
def test_a_mesh_is_as_large_as_its_scale_makes_it(
    scale: str, lower: tuple[float, ...], upper: tuple[float, ...], tmp_path: Path
) -> None:
    (shape,) = read_urdf(meshed(tmp_path, "part.obj", CUBE, scale)).links[0].collisions
    assert (shape.lower_xyz, shape.upper_xyz) == (lower, upper)


def test_the_size_of_a_mesh_that_is_known_costs_no_second_look_at_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    path = meshed(tmp_path, "part.obj", CUBE, ' scale="-1 2 0.5"')
    first = read_urdf(path)
    monkeypatch.setattr(meshes, "READERS", {"obj": None})
    assert read_urdf(path).links == first.links
    (tmp_path / "part.obj").write_text(CUBE + "# changed\n")
    with pytest.raises(TypeError):
        read_urdf(path)


@pytest.mark.parametrize(
    ("scale", "rule", "message"),
    [
        ("100 100 100", "absurd-size", 'is 100 m large: if it is in millimetres, write scale="0.1 0.1 0.1"'),
        ("-1 -51 1", "absurd-size", 'is 51 m large: if it is in millimetres, write scale="-0.001 -0.051 0.001"'),
        (
            "1e-4 2e-4 1e-4",
            "tiny-mesh",
            'is only 0.0002 m large: if it is already in metres, write scale="0.1 0.2 0.1"',
        ),
    ],
)
def test_millimetres_that_were_taken_for_metres_are_told_where_the_mesh_is_named(
    scale: str, rule: str, message: str, tmp_path: Path
) -> None:
    path = meshed(tmp_path, "part.obj", CUBE, f' scale="{scale}"')
    # Its mass is none of such a size, either.
    (found,) = (found for found in read_urdf(path, allow=["absurd-size"]).findings if found.rule == rule)
    assert found.location.line == 10
    assert found.message == f"mesh 'part.obj' {message}"


def test_a_part_as_long_as_a_house_is_not_absurd(tmp_path: Path) -> None:
    # The engine gets meshes in metres.
    urdf = read_urdf(meshed(tmp_path, "part.obj", CUBE, ' scale="0.001 0.001 0.001"')).urdf
    assert not [word for word in ("scale", "part.obj") if word in urdf]
    scales = ("50 50 50", "0.001 0.001 0.001")
    models = [read_urdf(meshed(tmp_path, "part.obj", CUBE, f' scale="{scale}"')) for scale in scales]
    assert [finding.rule for model in models for finding in model.findings] == ["odd-mass"]
