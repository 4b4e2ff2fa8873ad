"""Explanations of what a scenario can name."""

from __future__ import annotations

import click
import pytest

from sim_action.app.catalogue import fields
from sim_action.app.explain import explanation, names, overview
from sim_action.assertions import ASSERTIONS
from sim_action.core.errors import UsageError


@pytest.mark.parametrize("name", names())
def test_every_name_has_an_explanation_that_fits(name: str) -> None:
    for width in (40, 100):
        text = explanation(name, width)
        # An example keeps its lines, and a word is not broken.
        wide = [line for line in click.unstyle(text).splitlines() if len(line) > width]
        assert all(len(line.split()) <= 2 or line.startswith("      ") for line in wide), wide
        assert click.unstyle(text).startswith(f"{name}: ")


@pytest.mark.parametrize("name", list(ASSERTIONS))
def test_an_assertion_is_explained_with_all_of_its_keys(name: str) -> None:
    text = explanation(name, 80)
    for entry in fields(ASSERTIONS.load(name)):
        assert f"    {entry.name}: " in text
    assert "severity: error or warning [error]" in text


def test_a_name_of_several_kinds_is_explained_as_each() -> None:
    text = click.unstyle(explanation("contact", 80))
    assert "contact: assertion, below expect" in text
    assert "contact: sensor, below sensors" in text


@pytest.mark.parametrize(
    ("name", "place", "below"),
    [("ground", "world", "friction: number"), ("physics", "a scenario", "rate: frequency"), ("seed", "a scenario", "")],
)
def test_a_single_key_is_explained_with_the_keys_below_it(name: str, place: str, below: str) -> None:
    text = click.unstyle(explanation(name, 80))
    assert text.startswith(f"{name}: key of {place}\n")
    assert below in text


def test_a_key_of_two_places_is_explained_in_both() -> None:
    text = click.unstyle(explanation("robot", 80))
    assert "robot: key of a scenario" in text
    assert "robot: key of world" in text


def test_no_class_of_python_is_shown() -> None:
    assert not [name for name in names() if "<class" in explanation(name, 200)]


def test_an_unknown_name_is_told_with_the_nearest() -> None:
    with pytest.raises(UsageError, match=r"no part of a scenario is called 'uprigt'; did you mean 'upright'\?"):
        explanation("uprigt", 80)


def test_the_overview_has_every_name() -> None:
    assert all(name in overview() for name in names())
