"""The table of accuracy has a row for every case of the zoo, and says of each which are outside of their tolerance."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from tests.physics.known import KNOWN
from tests.physics.zoo import ZOO
from tools.docs.generators.accuracy import TOPICS, Row, differences, errors, place, shown


def test_every_case_has_a_row_and_every_row_a_case() -> None:
    assert {place(case) for case in ZOO} == set(range(len(TOPICS)))


def test_rows_do_not_mix_errors_with_units_and_without() -> None:
    for index, (title, _) in enumerate(TOPICS):
        row = Row(title, [case for case in ZOO if place(case) == index])
        assert row.relative or len({case.unit for case in row.cases}) == 1, title


def test_a_case_without_a_row_is_named() -> None:
    with pytest.raises(LookupError, match="the case 'a new one': add it to TOPICS"):
        place(replace(ZOO[0], name="a new one"))


def test_the_tables_count_all_cases_and_all_that_are_outside() -> None:
    outside = sum(map(int, re.findall(r"\*\* \((\d+)\)", errors() + differences())))
    assert outside == len(KNOWN)


@pytest.mark.parametrize(
    ("number", "text"),
    [(0.0, "< 0.01"), (0.00999, "< 0.01"), (0.0123, "0.01"), (0.96, "1"), (1.26, "1.3"), (12.6, "13"), (126.4, "126")],
)
def test_numbers_have_two_digits(number: float, text: str) -> None:
    assert shown(number) == text
