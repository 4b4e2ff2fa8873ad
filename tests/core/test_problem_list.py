"""Problems of one file are collected: each once, those of the file first, in the order of its lines."""

from __future__ import annotations

from sim_action.core.location import Location, Problem
from sim_action.core.problem_list import ProblemList
from sim_action.core.yaml_document import read_document

TEXT = "name: a\nrobot:\n  model: b\nexpect: []\n"


def problems() -> ProblemList:
    return ProblemList(read_document("a.sim.yml", TEXT))


def test_none_is_none() -> None:
    assert not problems()


def test_each_is_told_once_and_in_the_order_of_lines() -> None:
    found = problems()
    found.note_elsewhere(Problem(Location("b.urdf", 1), "broken"))
    found.note(("expect",), "is empty")
    found.note_all(("robot",), iter([(("model",), "is not there"), (("model",), "is not there")]))
    assert [str(problem) for problem in found.error().problems] == [
        "a.sim.yml:3:3: robot.model: is not there",
        "a.sim.yml:4:1: expect: is empty",
        "b.urdf:1: broken",
    ]


def test_what_is_wrong_further_down_is_known() -> None:
    found = problems()
    found.note(("robot", "model"), "is not there")
    assert found.has_below(("robot",))
    assert not found.has_below(("robot", "model"))
    assert not found.has_below(("expect",))
