"""Models with one thing wrong each, and the rule and line that say so."""

from __future__ import annotations

from dataclasses import dataclass

_INERTIA = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
_SPARE = f'<link name="spare"><inertial><mass value="1"/>{_INERTIA}</inertial></link>'

GOOD = f"""\
<robot name="arm">
  <link name="base">
    <inertial>
      <origin xyz="0 0 0.1"/>
      <mass value="2"/>
      {_INERTIA}
    </inertial>
    <collision>
      <origin xyz="1 2 3"/>
      <geometry><sphere radius="0.5"/></geometry>
    </collision>
  </link>
  <link name="upper"><inertial><mass value="1"/>{_INERTIA}</inertial></link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/>
    <child link="upper"/>
    <origin xyz="0 0 1" rpy="0 0 0"/>
    <axis xyz="0 0 2"/>
    <limit lower="-1" upper="2" effort="10" velocity="3"/>
    <dynamics damping="0.1"/>
  </joint>
</robot>
"""

_BALL = GOOD.replace("revolute", "ball").replace('<limit lower="-1" upper="2" effort="10" velocity="3"/>', "")
_FRAME = _SPARE.replace('mass value="1"', 'mass value="0"')
_PLANAR, _FLOATING = (_BALL.replace('"ball"', f'"{kind}"') for kind in ("planar", "floating"))
_UNIVERSAL = _BALL.replace('"ball"', '"universal"').replace("</joint>", '<axis2 xyz="0 0 0"/></joint>')
_SPHERE = '<sphere radius="0.5"/>'
_SHAPE = f"<collision><geometry>{_SPHERE}</geometry></collision>"
_END = "</robot>"
_TURNS = '<parent link="base"/><child link="spare"/><limit lower="-1" upper="1" effort="1" velocity="1"/>'
_HINGE = f'<joint name="j" type="revolute">{_TURNS}</joint>'
_HINGE_AFTER = f'<joint name="j" type="revolute">{_TURNS}<mimic joint="shoulder"/></joint>'
_LOOP = "".join(
    f"{_SPARE}{_HINGE_AFTER}".replace("spare", name).replace('"j"', f'"{name}"').replace("shoulder", leader)
    for name, leader in (("j", "k"), ("k", "j"))
)


@dataclass(frozen=True, slots=True)
class BadModel:
    """A text, the first rule that it breaks, and where."""

    name: str
    rule: str
    line: int | None
    text: str


def _bad(rule: str, line: int | None, old: str, new: str, name: str = "") -> BadModel:
    assert old in GOOD, old
    return BadModel(name or f"{rule}: {new[:40]}", rule, line, GOOD.replace(old, new, 1))


def _follower(limits: str, how: str) -> str:
    ends = '<parent link="base"/><child link="spare"/>'
    hinge = f'<joint name="j" type="revolute">{ends}<limit {limits}/><mimic joint="shoulder" {how}/></joint>'
    return f"{hinge}{_SPARE}{_END}"


def _scaled(factor: float) -> str:
    return _INERTIA.replace('"1"', f'"{factor}"')


def _fixed(name: str, parent: str, child: str) -> str:
    return _joint("fixed", name, parent, child)


def _joint(kind: str, name: str, parent: str, child: str) -> str:
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/></joint>'


def _chain(count: int, kind: str = "fixed") -> str:
    """A good model with a long tail."""
    links = "".join(
        f'<link name="l{n}"><inertial><mass value="1"/>{_INERTIA}</inertial></link>\n' for n in range(count)
    )
    joints = "".join(_joint(kind, f"j{n}", f"l{n - 1}" if n else "base", f"l{n}") + "\n" for n in range(count))
    return f"{links}{joints}{_END}"


_BOUNCE = "<surface><bounce><restitution_coefficient>0.2</restitution_coefficient></bounce></surface>"
_DECLARED = '<?xml version="1.0"?>'
_DRAWN = "<visual>{}<geometry>{}</geometry></visual></link>"

BAD_MODELS = [
    _bad("bad-xml", 23, _END, ""),
    _bad("bad-xml", 22, _END, f"{_END}\0"),
    _bad("bad-xml", 22, _END, f"{_END}junk"),
    _bad("bad-xml", 12, "</link>", "</lnk>"),
    _bad("bad-xml", 1, "<robot", 'text<?xml version="1.0"?><robot', "text before the declaration"),
    _bad("bad-xml", 12, "</link>", '<?xml version="1.0"?></link>', "a declaration inside"),
    _bad("bad-xml", 2, "<robot", '\n<?xml version="1.0"?><?xml version="1.0"?><robot', "two declarations"),
    _bad("bad-xml", 2, "<robot", '\n<?xml version="1.0"?><!DOCTYPE robot><robot', "a DOCTYPE after a late declaration"),
    _bad("late-declaration", 2, "<robot", '\n<?xml version="1.0"?><robot', "a blank line before the declaration"),
    _bad("late-declaration", 2, "<robot", f"<!--\n-->{_DECLARED}<robot", "a comment before it"),
    _bad("bad-xml", 1, "<robot", '<!DOCTYPE robot [<!ENTITY a "b">]><robot'),
    _bad("bad-xml", 1, "<robot", '<?xml version="1.0" encoding="nonsense"?><robot'),
    _bad("bad-xml", 22, _END, "<a>" * 200 + "</a>" * 200 + _END, "deep"),
    _bad("bad-xml", 22, _END, "<a/>" * 50_000 + _END, "more elements than a robot has"),
    _bad("bad-xml", 1, _END, '<a b="" c=""/>' * 250_000 + _END, "more attributes"),
    BadModel("an image", "bad-xml", 1, "\x89PNG\r\n\x1a\n\0\0\0\rIHDR"),
    BadModel("an empty file", "bad-xml", 1, ""),
    BadModel("text", "bad-xml", 1, "robot"),
    BadModel("another root", "not-a-robot", 1, "<world><model/></world>"),
    BadModel("no links", "not-a-robot", 1, '<robot name="a"/>'),
    _bad("missing-part", 2, ' name="base"', ""),
    _bad("missing-part", 5, ' value="2"', ""),
    _bad("missing-part", 3, '<mass value="2"/>', ""),
    _bad("missing-part", 3, f"      {_INERTIA}\n", "", "no inertia"),
    _bad("missing-part", 6, ' iyz="0"', ""),
    _bad("missing-part", 8, f"<geometry>{_SPHERE}</geometry>", ""),
    _bad("missing-part", 8, _SPHERE, "", "no shape"),
    _bad("missing-part", 10, _SPHERE, "<sphere/>"),
    _bad("missing-part", 10, _SPHERE, "<mesh/>"),
    _bad("missing-part", 10, _SPHERE, '<cylinder radius="1"/>'),
    _bad("missing-part", 10, _SPHERE, "<box/>"),
    _bad("missing-part", 10, _SPHERE, '<capsule radius="0.5"/>'),
    _bad("missing-part", 14, ' type="revolute"', ""),
    _bad("missing-part", 14, '    <parent link="base"/>\n', "", "no parent"),
    _bad("missing-part", 14, '    <child link="upper"/>\n', "", "no child"),
    _bad("missing-part", 15, '<parent link="base"/>', "<parent/>"),
    _bad("bad-number", 5, 'value="2"', 'value="nan"'),
    _bad("restitution", 12, "  </link>", '  <contact><restitution value="0.9"/></contact></link>', "a ball"),
    _bad(
        "restitution",
        22,
        _END,
        f"<gazebo reference='base'><collision>{_BOUNCE}</collision></gazebo>{_END}",
        "bounces in Gazebo",
    ),
    _bad("bad-number", 5, 'value="2"', 'value="1e999"'),
    _bad("bad-number", 5, 'value="2"', 'value="2 kg"'),
    _bad("bad-number", 5, 'value="2"', 'value="\u0661"'),
    _bad("bad-number", 5, 'value="2"', 'value="1e308"'),
    _bad("bad-number", 6, 'ixx="1"', 'ixx="1e155"'),
    _bad("bad-number", 6, 'ixy="0"', 'ixy="-1e200"'),
    _bad("bad-number", 9, "1 2 3", "1 2"),
    _bad("bad-number", 9, "1 2 3", "1,2,3"),
    _bad("bad-number", 9, "1 2 3", "1 2 nan"),
    _bad("bad-number", 10, "0.5", "wide"),
    _bad("bad-number", 17, 'rpy="0 0 0"', 'rpy="0 0 0 0"'),
    _bad("bad-number", 18, "0 0 2", "0 0 z"),
    _bad("bad-number", 19, 'lower="-1"', 'lower="low"'),
    _bad("bad-number", 19, 'effort="10"', 'effort="strong"'),
    _bad("zero-limit", 19, 'effort="10"', 'effort="-10"'),
    _bad("zero-limit", 19, 'velocity="3"', 'velocity="-3"'),
    _bad("bad-number", 20, '"0.1"', '"-"'),
    _bad("bad-number", 20, '"0.1"', '"-0.1"'),
    _bad("bad-number", 12, "</link>", '<contact><rolling_friction value="much"/></contact></link>'),
    _bad("bad-number", 12, "</link>", '<contact><stiffness value="-1"/></contact></link>'),
    _bad("bad-number", 12, "</link>", '<contact><inertia_scaling value="0"/></contact></link>'),
    _bad("bad-number", 5, 'value="2"', 'value="${mass}"'),
    _bad("unexpanded-expression", 9, "1 2 3", "0 0 ${height / 2}"),
    _bad("unexpanded-expression", 19, 'lower="-1"', 'lower="$(arg lower)"'),
    BadModel("a link of a long name", "bad-name", 13, GOOD.replace('"upper"', f'"{"u" * 256}"')),
    _bad("bad-name", 14, 'name="shoulder"', f'name="{"é" * 128}"', "a joint of a long name, in two bytes each"),
    _bad("duplicate-name", 13, 'name="upper"', 'name="base"'),
    _bad("duplicate-name", 22, _END, f"{_fixed('shoulder', 'base', 'upper')}{_END}"),
    _bad("unknown-link", 14, '<parent link="base"/>', '<parent link="bas"/>'),
    _bad("unknown-link", 14, '<child link="upper"/>', '<child link="uper"/>'),
    _bad("two-parents", 22, _END, f"{_fixed('j', 'base', 'upper')}{_END}"),
    _bad("one-root", 1, _END, f"{_SPARE}{_END}"),
    _bad("one-root", 1, _END, f"{_fixed('j', 'upper', 'base')}{_END}"),
    _bad("loop", 1, '<parent link="base"/>', '<parent link="upper"/>', "its own parent"),
    _bad("loop", 1, _END, f'{_SPARE}<link name="x"/>{_fixed("j", "spare", "x")}{_fixed("k", "x", "spare")}{_END}'),
    _bad("joint-type", 14, "revolute", "hinge"),
    _bad("joint-type", 14, "revolute", "Revolute"),
    _bad("too-many-joints", 4021, _END, _chain(3000), "a chain of 3,000 links"),
    _bad("many-joints", 275, _END, _chain(127), "one joint more than there may be"),
    _bad("many-joints", 263, _END, _chain(121, "continuous"), "one more that moves than there may be"),
    _bad("passed-over", 14, "revolute", "spherical", "limits of a ball joint"),
    BadModel("friction of a ball joint", "passed-over", 14, _BALL.replace('damping="0.1"', 'friction="0.1"')),
    BadModel("two names of a ball joint", "duplicate-name", 14, _BALL.replace('"upper"', '"shoulder_x"')),
    _bad("passed-over", 14, "revolute", "floating", "limits of a floating joint"),
    _bad("passed-over", 14, "revolute", "planar", "limits of a planar joint"),
    BadModel("two names of a planar joint", "duplicate-name", 14, _PLANAR.replace('"upper"', '"shoulder_turn"')),
    BadModel("two names of a floating joint", "duplicate-name", 14, _FLOATING.replace('"upper"', '"shoulder_y"')),
    BadModel("a second axis of length 0", "zero-axis", 21, _UNIVERSAL),
    _bad("missing-part", 21, "</joint>", "<mimic/></joint>"),
    _bad("bad-number", 21, "</joint>", '<mimic joint="elbow" offset="half"/></joint>'),
    _bad("bad-mimic", 14, "</joint>", '<mimic joint="elbow"/></joint>'),
    _bad("bad-mimic", 14, "</joint>", '<mimic joint="shoulder"/></joint>', "mimics itself"),
    _bad("still-mimic", 14, "</joint>", f'<mimic joint="j"/></joint>{_SPARE}{_fixed("j", "base", "spare")}', "of one"),
    _bad("still-mimic", 14, "</joint>", f'<mimic joint="j" multiplier="0"/></joint>{_SPARE}{_HINGE}', "times zero"),
    _bad("bad-mimic", 14, "</joint>", f'<mimic joint="j"/></joint>{_SPARE}{_HINGE_AFTER}', "each other"),
    _bad("bad-mimic", 14, "</joint>", f'<mimic joint="j"/></joint>{_LOOP}', "two that mimic each other"),
    _bad("zero-limit", 19, 'effort="10"', 'effort="0"'),
    _bad("zero-limit", 19, 'velocity="3"', 'velocity="0.0"'),
    _bad("follower-limits", 22, _END, _follower('lower="-1" upper="1.9"', ""), "less far up than its leader"),
    _bad("follower-limits", 22, _END, _follower('lower="-1" upper="2"', 'multiplier="-1"'), "the other way round"),
    _bad("follower-limits", 22, _END, _follower('lower="-1" upper="2"', 'offset="0.1"'), "further on"),
    _bad("bad-number", 22, _END, f'<gazebo reference="upper"><mu1>slippery</mu1></gazebo>{_END}'),
    _bad("bad-number", 22, _END, f'<gazebo reference="upper"><mu2 value="-1"/></gazebo>{_END}'),
    _bad("bad-number", 12, "</link>", '<contact><lateral_friction value="much"/></contact></link>'),
    _bad("unexpanded-expression", 22, _END, f'<gazebo reference="upper"><kp>${{kp}}</kp></gazebo>{_END}'),
    _bad("unknown-reference", 22, _END, f'<gazebo reference="uper"><mu1>1</mu1></gazebo>{_END}'),
    _bad("two-frictions", 22, _END, f'<gazebo reference="upper"><mu1>1</mu1><mu2>0.5</mu2></gazebo>{_END}'),
    _bad("unknown-shape", 10, _SPHERE, '<cone radius="1"/>'),
    _bad("unknown-shape", 10, _SPHERE, f'<material name="m"/>{_SPHERE}'),
    _bad("empty-shape", 10, "0.5", "0"),
    _bad("empty-shape", 10, _SPHERE, '<box size="0 0 0"/>'),
    _bad("empty-shape", 10, _SPHERE, '<cylinder radius="0" length="1"/>'),
    _bad("bad-shape", 10, "0.5", "-1"),
    _bad("bad-shape", 10, _SPHERE, '<box size="1 0 1"/>'),
    _bad("bad-shape", 10, _SPHERE, '<box size="1 -1 1"/>'),
    _bad("bad-shape", 10, _SPHERE, '<cylinder radius="1" length="0"/>'),
    _bad("bad-shape", 10, _SPHERE, '<cylinder radius="-1" length="1"/>'),
    _bad("zero-axis", 18, "0 0 2", "0 0 0"),
    _bad("negative-mass", 5, 'value="2"', 'value="-2"'),
    _bad("missing-mesh", 10, _SPHERE, '<mesh filename="absent.stl"/>'),
    _bad("outside-workspace", 10, _SPHERE, '<mesh filename="../../outside.stl"/>'),
    _bad("bad-reference", 10, _SPHERE, f'<mesh filename="{"a" * 300}.stl"/>', "a long name"),
    _bad("missing-package", 10, _SPHERE, '<mesh filename="package://absent/a.stl"/>'),
    _bad("outside-workspace", 12, "</link>", _DRAWN.format("", '<mesh filename="../../a.dae"/>'), "a visual"),
    _bad("missing-visual", 12, "</link>", _DRAWN.format("", '<mesh filename="a.dae"/>')),
    _bad("unlimited-joint", 14, '    <limit lower="-1" upper="2" effort="10" velocity="3"/>\n', "", "no limit"),
    _bad("continuous-limits", 19, "revolute", "continuous"),
    _bad("missing-limits", 19, 'lower="-1" upper="2" ', ""),
    _bad("reversed-limits", 19, 'lower="-1" upper="2"', 'lower="2" upper="-1"'),
    _bad("locked-joint", 19, 'lower="-1" upper="2"', 'lower="0" upper="0"'),
    _bad("locked-joint", 19, 'lower="-1" upper="2"', 'lower="0"'),
    _bad("locked-joint", 19, 'lower="-1" upper="2"', 'lower="0.5" upper="0.5"'),
    _bad("massless-base", 5, 'value="2"', 'value="0"'),
    _bad("zero-mass", 13, 'value="1"', 'value="0"', "a moving link of mass 0"),
    _bad("massless-frame", 22, _END, f"{_FRAME}{_fixed('j', 'upper', 'spare')}{_END}"),
    _bad("rounded-inertia", 6, 'ixx="1"', 'ixx="0"', "a line has no moment about itself"),
    _bad("rounded-inertia", 6, 'ixx="1"', 'ixx="2.01"', "one per cent"),
    _bad("rounded-inertia", 6, 'ixx="1" ixy="0" ixz="0" iyy="1"', 'ixx="0.2" ixy="0" ixz="0" iyy="0.7"', "one digit"),
    _bad("zero-inertia", 6, _INERTIA, _scaled(0.0)),
    _bad("default-expression", 17, "0 0 1", "$(optenv ARM_XYZ 0 0 0.5)"),
    _bad("passed-over", 12, "</link>", _DRAWN.format('<origin xyz="0 0 ${z}"/>', _SPHERE)),
    _bad("unused-sensor", 22, _END, '<gazebo reference="upper"><sensor type="ray" name="lidar"/></gazebo>' + _END),
    _bad("impossible-inertia", 6, 'ixx="1"', 'ixx="-1"'),
    _bad("impossible-inertia", 6, 'ixy="0"', 'ixy="2"'),
    _bad("uneven-inertia", 6, 'ixx="1"', 'ixx="3"'),
    _bad("uneven-inertia", 6, 'ixx="1"', 'ixx="3000"', "far off"),
    _bad("uneven-inertia", 6, 'ixx="1" ixy="0" ixz="0" iyy="1"', 'ixx="0" ixy="0" ixz="0" iyy="3"', "a thin plate"),
    BadModel("massless-model", "massless-model", 1, f'<robot name="a"><link name="b">{_SHAPE}</link></robot>'),
    _bad("odd-angle", 17, 'rpy="0 0 0"', 'rpy="0 90 0"'),
    _bad("odd-angle", 9, 'xyz="1 2 3"', 'rpy="0 0 -180"'),
    _bad("odd-limits", 19, 'lower="-1" upper="2"', 'lower="-90" upper="90"'),
    _bad("odd-limits", 19, 'lower="-1" upper="2"', 'lower="-30" upper="0"'),
    BadModel("millimetres", "odd-limits", 19, GOOD.replace("revolute", "prismatic").replace('"2"', '"300"')),
    _bad("unknown-tag", 22, _END, f'<lnik name="spare"/>{_END}'),
    _bad("unknown-tag", 12, "</link>", "<colision><geometry/></colision></link>"),
    _bad("unknown-tag", 11, "</collision>", '<orgin xyz="0 0 1"/></collision>'),
    _bad("unknown-tag", 21, "</joint>", "<Limits/></joint>"),
    _bad("unknown-part", 22, _END, f"<self_collide/>{_END}"),
    _bad("unknown-part", 8, "<collision", "<colour/><collision"),
    _bad("second-inertial", 12, "</link>", f'<inertial><mass value="1"/>{_INERTIA}</inertial></link>'),
    _bad("odd-inertia", 6, _INERTIA, _scaled(1e9)),
    _bad("odd-inertia", 6, _INERTIA, _scaled(1e-4)),
    BadModel("tonnes", "odd-mass", 5, GOOD.replace('value="2"', 'value="1e5"').replace(_INERTIA, _scaled(1e5))),
    _bad("absurd-size", 10, "0.5", "500"),
    _bad("absurd-size", 10, _SPHERE, '<box size="120 80 40"/>'),
    _bad("absurd-size", 9, "1 2 3", "1 2 -300"),
    _bad("absurd-size", 4, "0 0 0.1", "0 0 100"),
    _bad("absurd-size", 17, 'xyz="0 0 1"', 'xyz="0 0 1000"'),
    _bad("missing-inertia", 13, f'<inertial><mass value="1"/>{_INERTIA}</inertial>', "", "no inertial"),
    BadModel("nothing to touch", "no-collision-shape", 1, f'<robot name="a">{_SPARE}</robot>'),
]
