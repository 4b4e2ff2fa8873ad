"""The places of nodes, worlds and tests in launch files."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.errors import Location
from sim_action.ros.ros1.verdicts import findings
from sim_action.ros.ros1.verdicts.findings import DEFAULT_TIME_LIMIT_S, LaunchTags
from tests.ros_workspace import written

LAUNCH = """\
<launch>
  <include file="$(find other)/launch/inner.launch">
    <arg name="world_name" value="$(find pkg)/worlds/yard.world"/>
  </include>
  <node name="a" pkg="pkg" type="a.py"/>
  <include file="$(find absent)/launch/inner.launch"/>
  <include file="$(arg file)"/>
</launch>
"""
INNER = """\
<launch>
  <node name="b" pkg="pkg" type="b.py" required="true"/>
  <node name="gazebo" pkg="gazebo_ros" type="gzserver" args="-e ode $(find pkg)/worlds/other.world"/>
  <include file="$(find other)/launch/inner.launch"/>
</launch>
"""

TEXT = """\
<launch>
  <node pkg="a" type="b" name="c"/>
  <test test-name="moves" pkg="robot" type="moves.py" time-limit="30.0" retry="2"/>
  <group><test pkg="robot"
    type="turns.py" test-name="turns_$(arg side)_far"/></group>
"""


@pytest.fixture
def tags(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> LaunchTags:
    monkeypatch.chdir(tmp_path)
    path = written(tmp_path / "pkg/a.launch", LAUNCH)
    written(tmp_path / "other/launch/inner.launch", INNER)
    return LaunchTags.read([path], {"pkg": tmp_path / "pkg", "other": tmp_path / "other"})


def test_a_node_is_found_also_in_an_included_file(tags: LaunchTags) -> None:
    own, inner = tags.node("pkg", "a.py"), tags.node("pkg", "b.py")
    assert own is not None
    assert own.place == Location("pkg/a.launch", 5)
    assert inner is not None
    assert (inner.place, inner.attributes["required"]) == (Location("other/launch/inner.launch", 2), "true")
    assert tags.node("pkg", "c.py") is None


def test_a_world_is_found_where_it_is_named(tags: LaunchTags) -> None:
    assert tags.world("/ws/src/pkg/worlds/yard.world") == Location("pkg/a.launch", 3)
    assert tags.world("/ws/src/pkg/worlds/other.world") == Location("other/launch/inner.launch", 3)
    assert tags.world("/elsewhere/third.world") == Location("pkg/a.launch")


def test_a_broken_file_has_the_tags_before_the_error(tmp_path: Path) -> None:
    path = written(tmp_path / "a.launch", '<launch><node pkg="p" type="t"/></lunch>')
    assert LaunchTags.read([path], {}).node("p", "t") is not None
    assert LaunchTags.read([tmp_path / "none.launch"], {}).tags == ()


def test_each_test_has_its_line_and_its_limit_also_before_an_error(tmp_path: Path) -> None:
    path = tmp_path / "x.test"
    for text in (f"{TEXT}</launch>", TEXT):
        path.write_text(text)
        first, second = findings.test_tags(path)
        assert first == findings.TestTag(3, "moves", 30.0, 2)
        assert (second.line, second.time_limit, second.retry) == (4, DEFAULT_TIME_LIMIT_S, 0)
    called = {name: (first.is_called(name), second.is_called(name)) for name in ("moves", "movesX", "turns_left_far")}
    assert called == {"moves": (True, False), "movesX": (False, False), "turns_left_far": (False, True)}
    assert not second.is_called("turns_left")
    assert findings.test_tags(tmp_path / "nowhere.test") == ()
