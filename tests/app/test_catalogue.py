from __future__ import annotations

import click

from sim_action.app import catalogue
from sim_action.assertions import ASSERTIONS
from sim_action.commands import COMMANDS


def test_every_assertion_and_command_is_listed_with_a_sentence_and_its_fields() -> None:
    entries = (*catalogue.assertions(), *catalogue.commands())
    assert [entry.name for entry in entries] == [*ASSERTIONS, *COMMANDS]
    assert all(entry.summary.endswith(".") and entry.fields for entry in entries)


def test_fields_say_what_they_take_in_which_unit_and_by_default() -> None:
    reach = next(entry for entry in catalogue.assertions() if entry.name == "reach")
    fields = {field.name: field for field in reach.fields}
    assert (fields["x"].takes, fields["x"].default) == ("length (m)", "required")
    assert (fields["yaw_tolerance"].takes, fields["yaw_tolerance"].default) == ("angle (rad)", "5 deg")


def test_nested_keys_and_lists_are_spelled_out() -> None:
    twist = next(entry for entry in catalogue.commands() if entry.name == "twist")
    assert twist.fields[0].takes == "list of {linear, lateral, angular, for}"


def test_keys_that_a_place_does_not_take_are_left_out() -> None:
    judged = next(entry for entry in catalogue.assertions() if entry.name == "object")
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
    entries = catalogue.commands()
    lines = catalogue.listing(entries).splitlines()
    for entry in entries:
        assert lines[lines.index(click.style(entry.name, bold=True)) + 1] == f"  {entry.summary}"
