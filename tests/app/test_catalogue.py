from __future__ import annotations

import re
from pathlib import Path

import click
import pytest

from sim_action import load
from sim_action.app import catalogue
from sim_action.app.catalogue import explanation, fields, guide, names, overview
from sim_action.assertions import ASSERTIONS
from sim_action.commands import COMMANDS
from sim_action.core.errors import UsageError
from sim_action.sensors import SENSORS
from tests.integration.conftest import sim_action


def test_every_assertion_and_command_is_listed_with_a_sentence_and_its_fields() -> None:
    entries = (*catalogue.entries(ASSERTIONS), *catalogue.entries(COMMANDS))
    assert [entry.name for entry in entries] == [*ASSERTIONS, *COMMANDS]
    assert all(entry.summary.endswith(".") and entry.fields for entry in entries)


def test_fields_say_what_they_take_in_which_unit_and_by_default() -> None:
    reach = next(entry for entry in catalogue.entries(ASSERTIONS) if entry.name == "reach")
    fields = {field.name: field for field in reach.fields}
    assert (fields["x"].takes, fields["x"].default) == ("length (m)", "required")
    assert (fields["yaw_tolerance"].takes, fields["yaw_tolerance"].default) == ("angle (rad)", "5 deg")
    twist = next(entry for entry in catalogue.entries(COMMANDS) if entry.name == "twist")
    assert twist.fields[0].takes == "list of {linear, lateral, angular, for}"
    # Keys that a place does not take are left out.
    judged = next(entry for entry in catalogue.entries(ASSERTIONS) if entry.name == "object")
    takes = {field.name: field.takes for field in judged.fields}
    assert takes["upright"] == "{max_tilt, frame}"
    assert takes["settled"] == "{speed, turn_rate, for, frame}"


def test_models_are_those_that_can_be_named() -> None:
    assert [entry.name for entry in catalogue.models()] == [
        "turtlebot3_burger",
        "husky_a200",
        "f1tenth",
        "ur5e_gripper",
        "quadruped",
    ]


def test_a_listing_names_each_entry_in_bold_above_its_summary() -> None:
    entries = catalogue.entries(COMMANDS)
    lines = catalogue.listing(entries).splitlines()
    for entry in entries:
        assert lines[lines.index(click.style(entry.name, bold=True)) + 1] == f"  {entry.summary}"


@pytest.mark.parametrize("width", [40, 100])
def test_every_name_has_an_explanation_that_fits(width: int) -> None:
    for name in names():
        text = explanation(name, width)
        # An example keeps its lines, and a word is not broken.
        wide = [line for line in click.unstyle(text).splitlines() if len(line) > width]
        assert all(len(line.split()) <= 2 or line.startswith("      ") for line in wide), (name, wide)
        assert click.unstyle(text).startswith(f"{name}: ")
        assert "<class" not in text, name


@pytest.mark.parametrize("name", list(ASSERTIONS))
def test_an_assertion_is_explained_with_all_of_its_keys(name: str) -> None:
    text = explanation(name, 80)
    for entry in fields(ASSERTIONS.load(name)):
        assert f"    {entry.name}: " in text
    assert "severity: error or warning [error]" in text


def test_names_of_several_kinds_and_places_are_explained_as_each() -> None:
    text = click.unstyle(explanation("contact", 80))
    assert "contact: assertion, below expect" in text
    assert "contact: sensor, below sensors" in text
    text = click.unstyle(explanation("robot", 80))
    assert "robot: key of a scenario" in text
    assert "robot: key of world" in text


@pytest.mark.parametrize(
    ("name", "place", "below"),
    [("ground", "world", "friction: number"), ("physics", "a scenario", "rate: frequency"), ("seed", "a scenario", "")],
)
def test_a_single_key_is_explained_with_the_keys_below_it(name: str, place: str, below: str) -> None:
    text = click.unstyle(explanation(name, 80))
    assert text.startswith(f"{name}: key of {place}\n")
    assert below in text


def test_the_overview_has_every_name_and_others_are_told_with_the_nearest() -> None:
    assert all(name in overview() for name in names())
    with pytest.raises(UsageError, match=r"no part of a scenario is called 'uprigt'; did you mean 'upright'\?"):
        explanation("uprigt", 80)


def written(folder: Path) -> list[Path]:
    """Write the examples of the guide into a folder."""
    (folder / "controller.py").write_text(re.findall(r"```python\n(.*?)```", guide(), re.DOTALL)[0])
    paths = []
    for number, text in enumerate(re.findall(r"```yaml\n(.*?)```", guide(), re.DOTALL)):
        paths.append(folder / f"{number}.sim.yml")
        paths[-1].write_text(text)
    return paths


def test_the_guide_is_short_and_names_every_part() -> None:
    text = guide()
    assert len(text.split()) <= 6_000
    assert [name for table in (ASSERTIONS, COMMANDS, SENSORS) for name in table if f"**{name}**: " not in text] == []


def test_the_examples_of_the_guide_are_valid(tmp_path: Path) -> None:
    paths = written(tmp_path)
    assert len(paths) == 10
    assert all(load(path) for path in paths)


@pytest.mark.soak
@pytest.mark.process
def test_the_examples_of_the_guide_pass(tmp_path: Path) -> None:
    written(tmp_path)
    ran = sim_action(tmp_path, "run", "--strict", "--no-report", ".")
    assert ran.returncode == 0, ran.stdout
