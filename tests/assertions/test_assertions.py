"""What all assertions have in common."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

from sim_action.assertions import ASSERTIONS, Assertion
from sim_action.assertions.clearance import Clearance
from sim_action.assertions.combined import AllOf, AnyOf, AtOnce, Negation
from sim_action.assertions.contact import Touch
from sim_action.assertions.distance import PathLength, Travel
from sim_action.assertions.effort import Effort
from sim_action.assertions.energy import Energy
from sim_action.assertions.final_pose import FinalPose
from sim_action.assertions.follow_path import FollowPath, PathEnd, PathPoint
from sim_action.assertions.grasped import Grasped
from sim_action.assertions.joint import JointReading, JointWithin
from sim_action.assertions.legs import FeetOnGround, SupportMargin
from sim_action.assertions.max_speed import MaxSpeed
from sim_action.assertions.monitors import State
from sim_action.assertions.no_collision import NoCollision
from sim_action.assertions.object import Moved, ObjectAssertion
from sim_action.assertions.odometry_error import OdometryError
from sim_action.assertions.reach import Reach
from sim_action.assertions.self_collision import SelfCollision
from sim_action.assertions.sensor import SensorReading
from sim_action.assertions.settled import Settled
from sim_action.assertions.stay_within import StayWithin
from sim_action.assertions.stops_before import StopsBefore
from sim_action.assertions.temporal_logic.stl_assertion import Stl
from sim_action.assertions.upright import Upright
from sim_action.state.trace_records import BodyRecord, ClearanceRecord, ContactRecord, LinkTouch, Nearness, SensorRecord
from sim_action.state.verdict import Judged
from tests.traces import WHEELS, monitor, scene, trace

WHEELED = ("wheel_left_link", "wheel_right_link", "caster_back_link")
PATH = (PathPoint(x=0, y=0), PathPoint(x=3, y=0))

GOALS: list[Assertion] = [
    Travel(at_least=1.0),
    PathLength(at_least=1.0, at_most=2.0),
    Reach(x=5.0, y=5.0),
    Clearance(at_most=0.5),
    SensorReading(name="scan", reading="ranges", which="min", at_most=1.0, once=True),
    FollowPath(path=PATH, end=PathEnd()),
    Settled(),
    StopsBefore(body="wall", gap=(0.1, 0.5)),
    Touch.model_validate({"with": "wall", "at_least": 1.0, "at_most": 20.0, "for": 1.0}),
    JointReading(name=WHEELS[0], at_least=1.0),
    JointReading(name=WHEELS[0], near=1.0, tolerance=0.1),
    Stl(formula="eventually (travel > 1 m)"),
    AnyOf(parts=(Travel(at_least=1.0), Reach(x=5.0, y=5.0))),
    AllOf(parts=(Travel(at_least=1.0), NoCollision())),
    AtOnce(parts=(Reach(x=5.0, y=5.0), Upright())),
    Negation(part=NoCollision()),
    ObjectAssertion(name="cube", reach=Reach(x=5.0, y=5.0)),
    ObjectAssertion(name="cube", moved=Moved(up=1.0)),
    ObjectAssertion(name="cube", settled=Settled()),
    Grasped(object="cube", by=("wheel_*",)),
]
INVARIANTS: list[Assertion] = [
    Travel(at_most=1.0),
    PathLength(at_most=1.0),
    FinalPose(x=0.0, y=0.0, yaw=0.0),
    NoCollision(),
    Upright(),
    MaxSpeed(linear=1.0, angular=1.0),
    StayWithin(x=(-1.0, 1.0)),
    Clearance(at_least=0.5),
    SensorReading(name="scan", reading="ranges", which="min", at_least=0.5),
    OdometryError(position=0.1, yaw=0.1, drift=0.1),
    FollowPath(path=PATH, max_error=0.5),
    JointReading(name=WHEELS[0], at_most=1.0),
    Stl(formula="always (speed < 1 m/s)"),
    AnyOf(parts=(Travel(at_most=1.0), NoCollision())),
    AllOf(parts=(Travel(at_most=1.0), NoCollision())),
    Negation(part=Reach(x=5.0, y=5.0)),
    JointWithin(position={WHEELS[0]: (-1.0, 1.0)}),
    Effort(at_most=1.0),
    Effort(rms_at_most=1.0),
    Energy(at_most=1.0),
    FeetOnGround(links=WHEELED, at_most=1),
    SupportMargin(links=WHEELED),
    SelfCollision(),
    ObjectAssertion(name="cube", upright=Upright()),
    ObjectAssertion(name="cube", moved=Moved(at_most=1.0, frame="base_scan")),
]


def named(spec: Assertion) -> str:
    return spec.title


@pytest.mark.parametrize("spec", GOALS, ids=named)
def test_a_goal_is_pending_at_first_and_fails_if_nothing_comes(spec: Assertion) -> None:
    opened = monitor(spec)
    assert opened.state is State.PENDING
    assert not opened.verdict().passed
    assert opened.observe(trace([0.1])).state is State.PENDING


@pytest.mark.parametrize("spec", INVARIANTS, ids=named)
def test_an_invariant_holds_at_first(spec: Assertion) -> None:
    assert monitor(spec).state is State.HOLDS
    verdict = monitor(spec).observe(trace([0.1])).verdict()
    reads_more = isinstance(
        spec, Clearance | SensorReading | OdometryError | FeetOnGround | SupportMargin | ObjectAssertion
    )
    assert verdict.counted(Judged(1, 0.1, 0.1)).status == ("not_exercised" if reads_more else "passed")


@pytest.mark.parametrize("spec", [*GOALS, *INVARIANTS], ids=named)
def test_every_spec_pickles_fits_the_burger_and_is_titled_by_its_key(spec: Assertion) -> None:
    assert pickle.loads(pickle.dumps(spec)) == spec
    assert list(spec.problems(scene())) == []
    assert spec.title.startswith(spec.key)


def test_every_assertion_of_the_table_is_tested_here() -> None:
    # These need a file: tests/assertions/test_user_assertion.py, test_matches.py.
    assert {spec.key for spec in (*GOALS, *INVARIANTS)} == set(ASSERTIONS) - {"assertion", "matches"}


@pytest.mark.parametrize("spec", [*GOALS, *INVARIANTS], ids=named)
def test_every_verdict_is_of_plain_python_types(spec: Assertion) -> None:
    seen = trace([0.1, 0.2], x=[0.5, 3.0], roll=[0.0, 1.0], position=[0.5, 2.0])
    near = ClearanceRecord.of([Nearness(0.1, 0.7, "base_scan", "wall"), Nearness(0.2, 0.4, "base_scan", "wall")])
    sensors = {
        "scan": SensorRecord("lidar", np.array([0.1]), {"ranges": np.array([[0.5, 2.0]])}),
        "odometry": SensorRecord(
            "odometry", np.array([0.1]), {"position_xyz": np.ones((1, 3)), "orientation_xyzw": np.eye(4)[3:]}
        ),
    }
    up = LinkTouch("", "ground", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 1.0)
    feet = dict.fromkeys(WHEELED, ContactRecord.of([(0.1, up), (0.2, up)]))
    near_by = dict.fromkeys(spec.channels.clearances, near)
    cube = BodyRecord(seen.time, np.array([[1.0, 0, 0], [3.0, 0, 0]]), np.tile([0.0, 0, 0, 1.0], (2, 1)))
    told = replace(seen, clearances=near_by, sensors=sensors, link_contacts=feet, objects={"cube": cube})
    verdict = monitor(spec).observe(told).verdict()
    assert type(verdict.passed) is bool
    assert {type(value) for value in (verdict.measured, verdict.limit, verdict.margin, verdict.time)} <= {float}
    assert verdict.message.isprintable()
