"""Scenarios that check less than before: `compare` sees it, whether the motion changed or not."""

from __future__ import annotations

from typing import Any

import pytest

from sim_action import Scenario, run
from sim_action.results.comparison import compare_outcomes
from sim_action.results.outcome import Outcome
from tests.integration.engines import on_every_engine

GOAL: dict[str, Any] = {"travel": {"at_least": "10 cm"}}
LANE: dict[str, Any] = {"stay_within": {"y": [-0.1, 0.1]}, "name": "in its lane"}
EITHER: list[Any] = [GOAL, {"max_speed": {"linear": 0.01}}]
LIDAR: list[Any] = [{"lidar": {"rays": 36, "range": 3.5}, "name": "scan", "link": "base_scan", "rate": 5}]


def placed(name: str = "wall", x: float = 3.0) -> dict[str, Any]:
    return {"objects": [{"name": name, "box": [0.1, 2.0, 0.5], "pose": {"x": x}}]}


def scenario(**keys: Any) -> Scenario:
    stated = {
        "name": "in its lane",
        "robot": {"model": "turtlebot3_burger"},
        "world": placed(),
        "commands": {"twist": [{"linear": 0.4}]},
        "expect": [GOAL],
        "time_limit": 1,
        **keys,
    }
    return Scenario(**stated)


def expecting(*more: Any, **keys: Any) -> dict[str, Any]:
    return {"expect": [GOAL, *more], **keys}


WEAKER: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "a longer time limit": ({}, {"time_limit": 10}),
    "a shorter duration": ({"expect": ["upright"], "duration": 1}, {"expect": ["upright"], "duration": 0.5}),
    "a link": (
        expecting({"max_speed": {"linear": 1}, "name": "slow"}),
        expecting({"max_speed": {"linear": 1, "link": "wheel_left_link"}, "name": "slow"}),
    ),
    "a rule that is allowed": ({}, {"allow": ["never-moved"]}),
    "a wall that moved": (expecting("no_collision"), expecting("no_collision", world=placed(x=30.0))),
    "another wall": (expecting("no_collision"), expecting("no_collision", world=placed(name="box"))),
    "an easy part of any_of": ({"expect": [{"any_of": EITHER}]}, {"expect": [{"any_of": [*EITHER, "upright"]}]}),
    "an easier part of any_of": (
        {"expect": [{"any_of": EITHER}]},
        {"expect": [{"any_of": [{"travel": {"at_least": "1 cm"}}, EITHER[1]]}]},
    ),
    "wider bounds": (expecting(LANE), expecting({"stay_within": {"y": [-5, 5]}, "name": "in its lane"})),
    "an axis less": (
        expecting({"stay_within": {"x": [-1, 1], "y": [-0.1, 0.1]}, "name": "in its lane"}),
        expecting(LANE),
    ),
    "one reading is enough": (
        expecting({"sensor": {"name": "scan", "reading": "ranges", "which": "min", "at_least": 0.2}}, sensors=LIDAR),
        expecting(
            {"sensor": {"name": "scan", "reading": "ranges", "which": "min", "at_least": 0.2, "once": True}},
            sensors=LIDAR,
        ),
    ),
    "a greater tilt": (expecting({"upright": {"max_tilt": 0.1}}), expecting({"upright": {"max_tilt": 0.5}})),
    "a formula": (expecting({"stl": "always (tilt < 0.1)"}), expecting({"stl": "always (tilt < 0.5)"})),
    "a warning": (expecting("upright"), expecting({"upright": {}, "severity": "warning"})),
    "a later window": (expecting("upright"), expecting({"upright": {}, "after": 0.1})),
    "an expectation less": (expecting("upright"), {}),
}
TURN = {"commands": {"twist": [{"linear": 0.4, "angular": 0.05}]}}


def outcomes(engine: Any, side: int, **keys: Any) -> list[Outcome]:
    stated = {name: scenario(**(sides[side] | keys | {"name": name})) for name, sides in WEAKER.items()}
    return list(run(list(stated.values()), backend=engine, report=False).record.outcomes)


@on_every_engine
@pytest.mark.parametrize("moves", ["the same", "otherwise"])
def test_each_way_to_check_less_is_a_warning(moves: str, engine: Any) -> None:
    more = {} if moves == "the same" else TURN
    old, new = outcomes(engine, 0), outcomes(engine, 1, **more)
    seen = [change.outcome.name for change in compare_outcomes(old, new).changes if change.weaker or _weaker(change)]
    assert seen == [*WEAKER]


@on_every_engine
def test_what_did_not_change_is_no_warning(engine: Any) -> None:
    old, new = outcomes(engine, 0), outcomes(engine, 0, **TURN)
    changes = compare_outcomes(old, new).changes
    assert [change.outcome.name for change in changes if change.weaker or change.claims or change.stricter] == []


def _weaker(change: Any) -> bool:
    return any(claim.is_weaker for claim in change.claims)
