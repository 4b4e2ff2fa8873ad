"""The <test> tags of launch files."""

from __future__ import annotations

from pathlib import Path

from sim_action.ros.ros1.verdicts import rostest_files

TEXT = """\
<launch>
  <node pkg="a" type="b" name="c"/>
  <test test-name="moves" pkg="robot" type="moves.py" time-limit="30.0" retry="2"/>
  <group><test pkg="robot"
    type="turns.py" test-name="turns_$(arg side)_far"/></group>
"""


def tags(folder: Path, text: str) -> tuple[rostest_files.TestTag, ...]:
    path = folder / "x.test"
    path.write_text(text)
    return rostest_files.test_tags(path)


def test_each_test_has_its_line_and_its_limit(tmp_path: Path) -> None:
    first, second = tags(tmp_path, TEXT + "</launch>")
    assert first == rostest_files.TestTag(3, "moves", "robot", "moves.py", 30.0, 2)
    assert (second.line, second.time_limit, second.retry) == (4, rostest_files.DEFAULT_TIME_LIMIT_S, 0)


def test_what_is_no_xml_has_those_before(tmp_path: Path) -> None:
    assert [tag.name for tag in tags(tmp_path, TEXT)] == ["moves", "turns_$(arg side)_far"]
    assert rostest_files.test_tags(tmp_path / "nowhere.test") == ()


def test_a_name_with_arguments_in_it_is_found_again(tmp_path: Path) -> None:
    first, second = tags(tmp_path, TEXT)
    assert second.is_called("turns_left_far")
    assert not second.is_called("turns_left")
    assert first.is_called("moves")
    assert not first.is_called("movesX")
