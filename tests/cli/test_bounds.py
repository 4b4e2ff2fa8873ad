"""Numbers within bounds: errors say in plain words which numbers are allowed, and the value that was found."""

from __future__ import annotations

import click
import pytest

from sim_action.cli.bounds import Bounded
from sim_action.cli.options import SEED


@pytest.mark.parametrize(
    ("type_", "text", "message"),
    [
        (Bounded(click.IntRange(1, 256)), "0", "expected a whole number from 1 to 256, found '0'"),
        (Bounded(click.IntRange(1, 256)), "twice", "expected a whole number from 1 to 256, found 'twice'"),
        (Bounded(click.IntRange(1, 256)), "1.5", "expected a whole number from 1 to 256, found '1.5'"),
        (Bounded(click.IntRange(1, 256)), "a\nb", r"expected a whole number from 1 to 256, found 'a\nb'"),
        (Bounded(click.FloatRange(0, 1)), "2", "expected a number from 0 to 1, found '2'"),
        (Bounded(click.FloatRange(min=0)), "-1", "expected a number of at least 0, found '-1'"),
        (
            Bounded(click.FloatRange(min=0, min_open=True, max=1e9)),
            "0",
            "expected a number greater than 0 and at most 1,000,000,000, found '0'",
        ),
        (SEED, "-1", "expected a whole number from 0 to 9223372036854775807, found '-1'"),
    ],
)
def test_an_error_names_the_allowed_numbers_and_the_found_value(type_: Bounded, text: str, message: str) -> None:
    with pytest.raises(click.BadParameter) as raised:
        type_.convert(text, None, None)
    assert raised.value.message == message


def test_a_number_within_the_bounds_is_taken() -> None:
    assert Bounded(click.IntRange(1, 256)).convert("256", None, None) == 256
