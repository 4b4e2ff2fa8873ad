"""Every case of the zoo on both engines, against its oracle.

Cases that are not within their tolerance are in `known.KNOWN`. A case that comes to be must be removed from there. The
table in the documents is made from recorded values (`measured.json`). It stays true: a value may move by half of its
tolerance at the most, and a case is within its tolerance if the record is. Outside of it, values are not compared:
they may differ between machines.
"""

from __future__ import annotations

from typing import Final

import pytest

from tests.physics.case import BETWEEN, Case
from tests.physics.known import KNOWN, entries
from tests.physics.record import RECORDED
from tests.physics.zoo import GROUPS, ZOO

QUICK: Final = frozenset(case.name for case in ZOO if case.quick)


@pytest.mark.parametrize(("engine", "case"), entries(ZOO, KNOWN, QUICK))
def test_a_case_is_within_its_tolerance(engine: str, case: Case) -> None:
    for name in ("pybullet", "mujoco") if engine == BETWEEN else (engine,):
        pytest.importorskip(name, reason=f"{name} is not installed")
    measured = case.measured(engine)
    recorded = RECORDED[engine][case.name]
    assert case.error(measured) <= case.tolerance, (
        f"{case.name}: {measured:.6g} {case.unit} in place of {case.truth:.6g}, tolerance {case.tolerance:.3g}"
    )
    assert abs(measured - recorded) <= case.tolerance / 2, f"{recorded:.6g} is recorded: run make accuracy"


def test_known_failures_are_of_cases() -> None:
    assert set(KNOWN) <= {(engine, case.name) for case in ZOO for engine in case.engines}


def test_the_record_has_every_case_and_no_other() -> None:
    assert {(engine, name) for engine, cases in RECORDED.items() for name in cases} == {
        (engine, case.name) for case in ZOO for engine in case.engines
    }


def test_cases_outside_of_their_tolerance_in_the_record_are_those_that_are_known() -> None:
    outside = {
        (engine, case.name)
        for case in ZOO
        for engine in case.engines
        if case.error(RECORDED[engine][case.name]) > case.tolerance
    }
    assert outside == set(KNOWN)


@pytest.mark.parametrize("group", GROUPS)
def test_every_group_has_a_quick_case(group: str) -> None:
    assert any(case.quick for case in ZOO if case.group == group)
