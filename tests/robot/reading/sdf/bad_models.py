"""SDF models with one thing wrong each, and the rule, line and words that say so."""

from __future__ import annotations

from dataclasses import dataclass

from tests.robot.reading.sdf.models import INERTIAL, SPHERE, joint, link, sdf

BASE, TOOL = link("base"), link("tool", "<pose>0 0 1 0 0 0</pose>")
JOINT = joint("lift", "base", "tool", "<axis><xyz>0 0 1</xyz></axis>", "continuous")
FRAME = '<frame name="tip" attached_to="tool"><pose>0 0 1 0 0 0</pose></frame>'
GOOD = sdf(BASE, TOOL, JOINT, FRAME)  # base on line 3, tool on 4, the joint on 5, a frame on 6


@dataclass(frozen=True, slots=True)
class BadSdf:
    """A text, the first rule that it breaks, on which line, and words of the message."""

    name: str
    rule: str
    line: int
    words: str
    text: str


def _bad(rule: str, line: int, words: str, old: str, new: str) -> BadSdf:
    assert old in GOOD, old
    return BadSdf(f"{rule}: {new[:60]}", rule, line, words, GOOD.replace(old, new, 1))


def _also(rule: str, line: int, words: str, *parts: str, version: str = "1.9") -> BadSdf:
    """Parts beside the good ones; the first is on line 7."""
    text = sdf(BASE, TOOL, JOINT, FRAME, *parts, version=version)
    return BadSdf(f"{rule}: {parts[0][:60]}", rule, line, words, text)


def _shape(rule: str, words: str, shape: str) -> BadSdf:
    return _bad(rule, 3, words, "<sphere><radius>0.1</radius></sphere>", shape)


def _surface(rule: str, words: str, contact: str) -> BadSdf:
    return _bad(rule, 3, words, "</geometry>", f"</geometry><surface><contact>{contact}</contact></surface>")


def _kind(rule: str, words: str, kind: str) -> BadSdf:
    return _bad(rule, 5, words, 'type="continuous"', f'type="{kind}"')


_SDF, _TWO = '<sdf version="1.9">\n', "<model name='a'/><model name='b'/>"
_NESTED = f'<model name="a" canonical_link="{{}}">{link("b")}<frame name="tip"/></model>{joint("j", "base", "a")}'
_LOOP = '<frame name="f" attached_to="g"><pose relative_to="base"/></frame><frame name="g" attached_to="f"/>'
_DRAWN = "<visual name='v'><geometry><mesh><uri>a.dae</uri></mesh></geometry></visual>"
_REVERSED = "</xyz><limit><lower>2</lower><upper>1</upper></limit>"
_FAR = '<mimic joint="lift"><multiplier>1e18</multiplier><reference>1e18</reference></mimic>'
_HEAVY = f'<inertial auto="1"><density>1e18</density></inertial>{SPHERE.replace("0.1", "40")}'
_PLACED = "<placement_frame>tip</placement_frame>"
_CHANGED = "<name>g</name><experimental:params xmlns:experimental='e'/>"
_POSE, _AXIS = "<pose>0 0 1 0 0 0</pose>", "<axis><xyz>0 0 1</xyz></axis>"

BAD_SDF_MODELS = [
    # What the file is.
    BadSdf(
        "a world", "not-a-robot", 2, "a world with the models 'a', 'b'", f"{_SDF}<world name='w'>{_TWO}</world></sdf>"
    ),
    BadSdf("no model", "not-a-robot", 1, "has no <model>", '<sdf version="1.9"/>'),
    BadSdf("two models", "not-a-robot", 2, "2 models: 'a', 'b'", f"{_SDF}{_TWO}</sdf>"),
    BadSdf("no version", "missing-part", 1, "<sdf> has no attribute 'version'", '<sdf><model name="a"/></sdf>'),
    BadSdf("old", "not-a-robot", 1, "'gz sdf -p'", '<sdf version="1.2"><model name="a"/></sdf>'),
    BadSdf("odd version", "not-a-robot", 1, "'one' is not supported", '<sdf version="one"><model name="a"/></sdf>'),
    BadSdf("gazebo", "not-a-robot", 1, "older than SDF 1.3", '<gazebo version="1.0"><model name="a"/></gazebo>'),
    BadSdf("a blank line", "late-declaration", 2, "<?xml ...?> follows", f"\n<?xml version='1.0'?>{GOOD}"),
    BadSdf("DOCTYPE", "bad-xml", 1, "DOCTYPE", f"<!DOCTYPE sdf>{GOOD}"),
    BadSdf("no links", "not-a-robot", 2, "the model has no <link>", '<sdf version="1.9">\n<model name="a"/></sdf>'),
    # Names.
    _bad("missing-part", 3, "<link> has no attribute 'name'", '<link name="base">', "<link>"),
    _bad("missing-part", 6, "<frame> has no attribute 'name'", 'name="tip" ', ""),
    _also("missing-part", 7, "<model> has no attribute 'name'", "<model/>"),
    _also("duplicate-name", 7, "two links have the name 'base'", BASE),
    _also("duplicate-name", 7, "a link and a frame have the name 'base'", '<frame name="base"/>'),
    _also("duplicate-name", 7, "two links have the name 'base'", BASE, version="1.6"),
    _also("duplicate-name", 7, "a second link is named 'a::b'", f'{link("a::b")}<model name="a">{link("b")}</model>'),
    # Frames.
    _bad("unknown-frame", 4, "did you mean 'base'?", "<pose>", '<pose relative_to="bas">'),
    _bad("unknown-frame", 6, "refers to 'tol'", 'attached_to="tool"', 'attached_to="tol"'),
    _bad("unknown-frame", 5, "refers to 'up'", "<xyz>", '<xyz expressed_in="up">'),
    _bad("unknown-frame", 5, "<parent> refers to 'bas'", "<parent>base", "<parent>bas"),
    _bad("unknown-frame", 5, "<child> refers to 'a::tool'", "<child>tool", "<child>a::tool"),
    _bad("unknown-frame", 2, "refers to 'x'", '<model name="m">', '<model name="m" placement_frame="x">'),
    _also("unknown-frame", 7, "relative to 'tip'", '<pose relative_to="tip"/>'),
    _also("unknown-frame", 7, "canonical_link 'tip' is not a link", _NESTED.format("tip")),
    _also("unknown-frame", 7, "'c', which does not exist (allowed: b", _NESTED.format("c")),
    _bad("frame-loop", 4, "in a loop: 'tip', 'tool'", "<pose>", '<pose relative_to="tip">'),
    _bad("frame-loop", 4, "in a loop", "<pose>", '<pose relative_to="tool">'),
    _also("frame-loop", 7, "attached to itself", _LOOP + joint("j", "f", "tool")),
    _also("missing-part", 7, "nothing can be attached to its frame", f'<model name="a"/>{joint("j", "a", "tool")}'),
    # Numbers.
    _bad("bad-number", 4, "<pose> is '0 0 1': expected 6 finite numbers", _POSE, "<pose>0 0 1</pose>"),
    _bad("bad-number", 4, "expected 6 finite numbers", _POSE, "<pose>0 0 nan 0 0 0</pose>"),
    _bad("bad-number", 4, "expected 7 finite numbers", "<pose>", '<pose rotation_format="quat_xyzw">'),
    _bad("bad-number", 4, "of length 0", _POSE, '<pose rotation_format="quat_xyzw">0 0 1 0 0 0 0</pose>'),
    _bad("bad-number", 4, "allowed are 'euler_rpy'", "<pose>", '<pose rotation_format="matrix">'),
    _bad("bad-number", 4, "expected true or false", "<pose>", '<pose degrees="yes">'),
    _bad("bad-number", 2, "expected true or false", '<model name="m">', '<model name="m"><static>maybe</static>'),
    _bad("bad-number", 3, "<mass> is 'heavy'", "<mass>1", "<mass>heavy"),
    _bad("bad-number", 3, "<ixx> is ''", "<ixx>1", "<ixx>"),
    _bad("bad-number", 5, "<xyz> is '0 0'", "0 0 1</xyz>", "0 0</xyz>"),
    _bad("bad-number", 5, "<lower> is 'low'", "</xyz>", "</xyz><limit><lower>low</lower></limit>"),
    # Joints.
    _bad("missing-part", 5, "<joint> has no <child>", "<child>tool</child>", ""),
    _bad("missing-part", 5, "empty <parent>", "<parent>base</parent>", "<parent/>"),
    _bad("missing-part", 5, "<joint> has no <axis>", _AXIS, ""),
    _bad("unknown-link", 5, "has the world as its child", "<child>tool", "<child>world"),
    _kind("joint-type", "the unknown type 'hinge'; the types are revolute", "hinge"),
    _kind("joint-type", "use <mimic> in the <axis>", "gearbox"),
    _kind("unsupported-joint", "no engine couples a rotation and a translation", "screw"),
    _bad("zero-axis", 5, "has an axis of length 0", "0 0 1</xyz>", "0 0 0</xyz>"),
    BadSdf(
        *("reversed", "reversed-limits", 5, "a lower limit of 2 above its upper limit of 1"),
        GOOD.replace("</xyz>", _REVERSED).replace("continuous", "revolute"),
    ),
    _bad("unknown-frame", 5, "must refer to a joint with one axis", "</xyz>", '</xyz><mimic joint="base"/>'),
    _bad("bad-number", 5, "is -1e+36: at most 1e+18", "</xyz>", f"</xyz>{_FAR}"),
    _also("one-root", 2, "it has 2: base, lid; connect them", link("lid")),
    _also("two-parents", 7, "the child of two joints, 'lift' and 'j'", joint("j", "base", "tool")),
    _also("one-root", 2, "none: its joints form a loop", joint("j", "tool", "base")),
    # Links.
    _bad("negative-mass", 3, "a mass must not be negative", "<mass>1", "<mass>-1"),
    _bad("impossible-inertia", 3, "principal moments", "<ixx>1", "<ixx>-9"),
    _bad("uneven-inertia", 3, "9 kg m^2: none may be", "<ixx>1", "<ixx>9"),
    _bad("bad-number", 3, "mass or moments of more than 1e+18", f"{INERTIAL}{SPHERE}", _HEAVY),
    _bad("unsupported-part", 3, "needs a <collision>", f"{INERTIAL}{SPHERE}", '<inertial auto="true"/>'),
    _surface(
        "unsupported-part", "<collide_without_contact> of", "<collide_without_contact>1</collide_without_contact>"
    ),
    _surface("unsupported-part", "excludes every contact", "<collide_bitmask>0x00</collide_bitmask>"),
    _surface("bad-number", "<collide_bitmask> is 'all': expected an integer", "<collide_bitmask>all</collide_bitmask>"),
    _also("unsupported-part", 7, "included model is not changed", f"<include><uri>good.sdf</uri>{_CHANGED}</include>"),
    _shape("missing-part", "<geometry> has no shape", ""),
    _shape("missing-part", "<box> has no <size>", "<box/>"),
    _shape("missing-part", "<mesh> has no <uri>", "<mesh/>"),
    _shape("missing-mesh", "'absent.stl' does not exist", "<mesh><uri>absent.stl</uri></mesh>"),
    _shape("unsupported-part", "<submesh>", "<mesh><uri>a.stl</uri><submesh><name>b</name></submesh></mesh>"),
    _shape("bad-shape", "the radius must be greater than 0", "<sphere><radius>-1</radius></sphere>"),
    _shape("absurd-size", "is it in millimetres?", "<box><size>120 80 40</size></box>"),
    _shape("unknown-shape", "it has no bounds", "<plane><normal>0 0 1</normal></plane>"),
    _shape("unknown-shape", "it can be part of a world only", "<heightmap/>"),
    _shape("unknown-shape", "convert it to a mesh", "<ellipsoid><radii>1 2 3</radii></ellipsoid>"),
    _shape("unknown-shape", "the shapes are box, sphere", "<torus/>"),
    _bad("missing-part", 3, "<collision> has no <geometry>", SPHERE, '<collision name="c"/>'),
    _bad("missing-visual", 3, "'a.dae' does not exist", SPHERE, SPHERE + _DRAWN),
    _surface("bad-number", "of 0 or more", "<ode><kp>-1</kp></ode>"),
    _bad("default-inertia", 3, "is missing or empty; SDF's defaults are used: mass = 1 kg", INERTIAL, ""),
    # Includes.
    _also("missing-part", 7, "<include> has no <uri>", "<include/>"),
    _also("missing-part", 7, "an empty <uri>", "<include><uri/></include>"),
    _also("missing-include", 7, "'absent.sdf' does not exist", "<include><uri>absent.sdf</uri></include>"),
    _also("missing-package", 7, "the model 'absent'", "<include><uri>model://absent</uri></include>"),
    _also("bad-reference", 7, "is not a valid reference", "<include><uri>https://fuel.org/a</uri></include>"),
    _also("outside-workspace", 7, "is outside the workspace", "<include><uri>../robot.sdf</uri></include>"),
    _also("include-loop", 7, "robot.sdf -> robot.sdf", "<include><uri>robot.sdf</uri></include>"),
    _also("missing-part", 7, "but no <pose>", f"<include><uri>good.sdf</uri>{_PLACED}</include>"),
    _also("duplicate-name", 7, "two links have the name 'base'", '<include merge="true"><uri>good.sdf</uri></include>'),
    _also("not-a-robot", 1, "can include only SDF", "<include><uri>arm.urdf</uri></include>"),
]
