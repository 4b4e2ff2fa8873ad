"""What all assertions have in common."""

from __future__ import annotations

import math
import pickle
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from sim_action.assertions import ASSERTIONS, Assertion
from sim_action.assertions.clearance import Clearance
from sim_action.assertions.combined import AllOf, AnyOf, AtOnce, Negation
from sim_action.assertions.contact import Touch
from sim_action.assertions.distance import PathLength, Travel
from sim_action.assertions.effort import Effort, Energy
from sim_action.assertions.follow_path import FollowPath, PathEnd, PathPoint
from sim_action.assertions.grasped import Grasped
from sim_action.assertions.joint import JointReading, JointWithin
from sim_action.assertions.legs import FeetOnGround, SupportMargin
from sim_action.assertions.max_speed import MaxSpeed
from sim_action.assertions.monitors import AdaptedMonitor, State
from sim_action.assertions.no_collision import NoCollision, SelfCollision
from sim_action.assertions.object import Moved, ObjectAssertion
from sim_action.assertions.odometry_error import OdometryError
from sim_action.assertions.reach import FinalPose, Reach
from sim_action.assertions.sensor import SensorReading
from sim_action.assertions.settled import Settled, StopsBefore
from sim_action.assertions.stay_within import StayWithin
from sim_action.assertions.temporal_logic.stl_assertion import Stl
from sim_action.assertions.upright import Upright
from sim_action.state.trace import Trace
from sim_action.state.trace_records import BodyRecord, ClearanceRecord, ContactRecord, LinkTouch, Nearness, SensorRecord
from sim_action.state.verdict import Judged, Verdict
from tests.assertions.limits import further_specs
from tests.traces import START, WHEELS, judged, monitor, scene, trace

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
FURTHER = further_specs([*GOALS, *INVARIANTS])
GOALS += [spec for spec in FURTHER if spec.is_goal]
INVARIANTS += [spec for spec in FURTHER if not spec.is_goal]


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
    more = Clearance | SensorReading | OdometryError | FeetOnGround | SupportMargin | ObjectAssertion
    assert verdict.counted(Judged(1, 0.1, 0.1)).status == ("not_exercised" if isinstance(spec, more) else "passed")


@pytest.mark.parametrize("spec", [*GOALS, *INVARIANTS], ids=named)
def test_every_spec_pickles_fits_the_burger_and_is_titled_by_its_key(spec: Assertion) -> None:
    assert pickle.loads(pickle.dumps(spec)) == spec
    assert list(spec.problems(scene())) == []
    assert spec.title.startswith(spec.key)
    # The monitors of the product need no defaults.
    assert not isinstance(spec.started(scene(), START), AdaptedMonitor)


def test_every_assertion_of_the_table_is_tested_here() -> None:
    # These need a file: tests/assertions/test_user_assertion.py, test_matches.py.
    assert {spec.key for spec in (*GOALS, *INVARIANTS)} == set(ASSERTIONS) - {"assertion", "matches"}


@pytest.mark.parametrize("spec", [*GOALS, *INVARIANTS], ids=named)
def test_every_verdict_is_of_plain_python_types(spec: Assertion) -> None:
    seen = trace([0.1, 0.2], x=[0.5, 3.0], roll=[0.0, 1.0], position=[0.5, 2.0])
    near = ClearanceRecord.of([Nearness(0.1, 0.7, "base_scan", "wall"), Nearness(0.2, 0.4, "base_scan", "wall")])
    columns = {
        "scan": ("lidar", {"ranges": np.array([[0.5, 2.0]])}),
        "odometry": ("odometry", {"position_xyz": np.ones((1, 3)), "orientation_xyzw": np.eye(4)[3:]}),
    }
    sensors = {name: SensorRecord(kind, np.array([0.1]), values) for name, (kind, values) in columns.items()}
    up = LinkTouch("", "ground", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 1.0)
    feet = dict.fromkeys(WHEELED, ContactRecord.of([(0.1, up), (0.2, up)]))
    near_by = dict.fromkeys(spec.channels.clearances, near)
    cube = BodyRecord(seen.time, np.array([[1.0, 0, 0], [3.0, 0, 0]]), np.tile([0.0, 0, 0, 1.0], (2, 1)))
    told = replace(seen, clearances=near_by, sensors=sensors, link_contacts=feet, objects={"cube": cube})
    verdict = monitor(spec).observe(told).verdict()
    assert type(verdict.passed) is bool
    assert {type(value) for value in (verdict.measured, verdict.limit, verdict.margin, verdict.time)} <= {float}
    assert verdict.message.isprintable()


def read(key: str, value: Any) -> Assertion:
    """Return an assertion as from YAML."""
    return ASSERTIONS.load(key).model_validate(value)


WALL = {"body": "wall", "gap": (0.5, 2.0)}
LINE = ({"x": 0, "y": 0}, {"x": 4, "y": 0})
LEFT = WHEELS[0]


@pytest.mark.parametrize(
    ("key", "value", "title"),
    [
        ("clearance", {"at_least": 0.2}, "clearance at least 0.2 m"),
        (
            "clearance",
            {"at_least": 0.2, "at_most": 0.5, "to": ("wall",), "links": ("arm", "hand")},
            "clearance of arm, hand to wall at least 0.2 m, at most 0.5 m",
        ),
        ("contact", "ball", "contact with ball"),
        (
            "contact",
            {"with": "ball", "link": "*_finger", "at_least": "1 N", "at_most": "20 N", "for": "500 ms"},
            "contact of *_finger with ball at least 1 N, at most 20 N over 50 ms, for 0.5 s",
        ),
        (
            "contact",
            {"with": "ball", "at_most": "20 N", "impulse": {"at_most": 0.6}, "window": "1.5 s"},
            "contact with ball at most 20 N over 1.5 s, impulse at most 0.6 N s within 1.5 s",
        ),
        ("effort", {"at_most": "5 N m", "rms_at_most": "2 N m"}, "effort at most 5 N m, RMS at most 2 N m"),
        ("effort", {"joints": ("elbow", "w*"), "at_most": 2}, "effort of elbow, w* at most 2"),
        ("energy", {"at_most": "1 Wh"}, "energy at most 3600 J"),
        ("energy", {"at_most": 1.5, "joints": ("elbow",)}, "energy of elbow at most 1.5 J"),
        ("final_pose", {"x": "2 m", "y": 0}, "final_pose (2, 0) within 0.05 m"),
        ("final_pose", {"x": 1, "z": 3, "tolerance": "10 cm"}, "final_pose x = 1 m, z = 3 m within 0.1 m"),
        ("final_pose", {"yaw": "90 deg"}, "final_pose facing 90 deg"),
        (
            "final_pose",
            {"x": 1, "y": 0, "yaw": 0, "relative": True},
            "final_pose (1, 0) facing 0 deg within 0.05 m from the start",
        ),
        (
            "joint",
            {"name": "elbow", "reading": "velocity", "at_least": 1, "at_most": 2},
            "joint elbow velocity at least 1, at most 2",
        ),
        ("joint", {"name": "elbow", "near": "90 deg", "tolerance": "1 deg"}, "joint elbow position near 90 deg"),
        (
            "joint_within",
            {"position": {"elbow": ("0 deg", "90 deg")}, "effort": {"*": (-1, 1.5)}},
            "joint_within elbow position 0 deg to 90 deg, * effort -1 to 1.5",
        ),
        (
            "matches",
            {"trace": "golden/x.csv", "position": 0.02, "joints": {"elbow": "2 deg"}},
            "matches golden/x.csv within 0.02 m, elbow 2 deg",
        ),
        ("max_speed", {"linear": 0.5}, "max_speed 0.5 m/s"),
        ("max_speed", {"linear": 0.5, "angular": math.pi}, "max_speed 0.5 m/s, 180 deg/s"),
        ("no_collision", {}, "no_collision"),
        ("no_collision", {"allow": ("wall", "ball")}, "no_collision but wall, ball"),
        ("reach", {"x": "2 m", "y": 0}, "reach (2, 0) within 0.05 m"),
        ("reach", {"x": 1, "y": 2, "z": 3, "tolerance": "10 cm"}, "reach (1, 2, 3) within 0.1 m"),
        ("reach", {"x": 1, "y": 2, "yaw": "90 deg"}, "reach (1, 2) facing 90 deg within 0.05 m"),
        ("settled", {"for": "500 ms"}, "settled for 0.5 s"),
        ("stay_within", {"x": ("-1 m", "2 m"), "z": (0, "50 cm")}, "stay_within x -1 m to 2 m, z 0 m to 0.5 m"),
        ("stops_before", {**WALL, "gap": ("20 cm", "60 cm")}, "stops_before wall with a gap of 0.2 m to 0.6 m"),
    ],
)
def test_the_title_says_what_is_asked(key: str, value: Any, title: str) -> None:
    assert read(key, value).title == title


@pytest.mark.parametrize(
    ("key", "value", "limit", "message"),
    [
        ("contact", "ball", (1.0, "contacts"), "no physics step to measure"),
        ("effort", {"rms_at_most": 1.0}, (1.0, "N m"), "no physics step to measure"),
        ("energy", {"at_most": 1.0}, (1.0, "J"), "no physics step to measure"),
        ("final_pose", {"x": 0.0}, (0.05, "m"), "no physics step to measure"),
        ("joint", {"name": LEFT, "near": 1.0, "tolerance": 0.1}, (0.1, "rad"), "no physics step to measure"),
        ("joint_within", {"position": {LEFT: (0, 1)}}, (None, "rad"), "no physics step to measure"),
        ("reach", {"x": 0.0, "y": 0.0}, (0.05, "m"), "no physics step to measure"),
        ("settled", {"for": 1.0}, (1.0, "s"), "no physics step to measure"),
        ("stay_within", {"x": (0.0, 1.0)}, (None, "m"), "no physics step to measure"),
        ("stops_before", WALL, (2.0, "m"), "no physics step to measure"),
        ("travel", {"at_least": 1.0}, (1.0, "m"), "travelled nothing: no physics step to measure"),
    ],
)
def test_it_needs_a_moment(key: str, value: Any, limit: tuple[float | None, str], message: str) -> None:
    spec = read(key, value)
    verdict = judged(spec, trace([]))
    assert verdict.passed is not (spec.is_goal or key == "final_pose")
    assert (verdict.measured, verdict.margin, verdict.time, verdict.message) == (None, None, None, message)
    assert (verdict.limit, verdict.unit) == limit


@pytest.mark.parametrize(
    ("key", "value", "problem"),
    [
        ("clearance", {}, "give 'at_least', 'at_most' or both"),
        ("clearance", {"at_least": 0.5, "at_most": 0.2}, "nothing is at least 0.5 m and at most 0.2 m"),
        ("clearance", {"at_least": 0}, "greater than 0"),
        ("clearance", {"at_least": 0.5, "to": ()}, "at least 1 item"),
        ("clearance", {"at_least": 0.5, "links": ()}, "at least 1 item"),
        ("clearance", {"at_least": 0.5, "links": ("arm",), "link": "hand"}, "give 'link' or 'links', not both"),
        ("contact", {"with": "ball", "at_least": 0}, "greater than 0"),
        ("contact", {"with": "ball", "at_least": 2, "at_most": 1}, "nothing is at least 2 N and at most 1 N"),
        ("contact", {"with": "ball", "for": 0}, "greater than 0"),
        ("contact", {"with": "ball", "window": 0}, "greater than 0"),
        ("contact", {"with": "ball", "window": 11}, "less than or equal to 10"),
        ("contact", {"with": "ball", "impulse": {}}, "give 'at_least', 'at_most' or both"),
        ("contact", {"with": "ball", "impulse": {"at_least": 2, "at_most": 1}}, "at least 2 N s and at most 1 N s"),
        ("contact", {"with": "ball", "impulse": {"at_least": 0}}, "greater than 0"),
        ("contact", {"with": "ball", "impulse": {"at_most": "1 N"}}, "is not a unit of impulse; use one of: N s, Ns"),
        ("effort", {}, "give 'at_most', 'rms_at_most' or both"),
        ("effort", {"at_most": "-1 N m"}, "'at_most' must not be less than 0"),
        ("effort", {"rms_at_most": "1 m"}, "'m' is not a unit of torque or force"),
        ("energy", {}, "Field required"),
        ("energy", {"at_most": -1}, "greater than or equal to 0"),
        ("energy", {"at_most": "1 N"}, "'N' is not a unit of energy"),
        ("energy", {"at_most": 1, "braking": "dear"}, "'free', 'costs' or 'regained'"),
        ("final_pose", {}, "at least one of 'x', 'y', 'z', 'yaw' and 'orientation'"),
        ("final_pose", {"x": 1, "tolerance": 0}, "greater than 0"),
        ("follow_path", {"path": LINE}, "give 'max_error', 'rms', 'end' or several of them"),
        ("follow_path", {"max_error": 0.1}, "give either 'path' or 'file'"),
        ("follow_path", {"path": LINE, "file": "p.csv", "max_error": 0.1}, "give either 'path' or 'file'"),
        ("follow_path", {"path": LINE[:1], "max_error": 0.1}, "at least 2 items"),
        ("follow_path", {"path": (*LINE, LINE[1]), "max_error": 0.1}, "point 3 of the path equals the point before it"),
        ("follow_path", {"path": LINE, "max_error": 0}, "greater than 0"),
        ("joint", {"name": LEFT}, "give 'at_least' or 'at_most', or else 'near' with 'tolerance'"),
        ("joint", {"name": LEFT, "near": 1, "tolerance": 1, "at_most": 1}, "give 'at_least' or 'at_most', or else"),
        ("joint", {"name": LEFT, "near": 1}, "'near' and 'tolerance' go together"),
        ("joint", {"name": LEFT, "at_most": 1, "tolerance": 1}, "'near' and 'tolerance' go together"),
        ("joint", {"name": LEFT, "near": 1, "tolerance": 0}, "greater than 0"),
        ("joint", {"name": LEFT, "at_least": 2, "at_most": 1}, "nothing is at least 2 and at most 1"),
        ("joint", {"name": LEFT, "at_least": "1 N m"}, "'N m' is not a unit of angle or length"),
        ("joint", {"name": LEFT, "reading": "velocity", "at_least": "1 rad"}, "not a unit of angular speed or speed"),
        ("joint", {"name": LEFT, "reading": "effort", "at_least": "1 m/s"}, "'m/s' is not a unit of torque or force"),
        ("joint", {"name": LEFT, "reading": "temperature", "at_least": "1 K"}, "'position', 'velocity' or 'effort'"),
        ("joint_within", {}, "give at least one joint in 'position', 'velocity' or 'effort'"),
        ("joint_within", {"position": {}}, "give at least one joint"),
        ("joint_within", {"position": {LEFT: ("90 deg", "1 deg")}}, "swapped or equal: 90 deg is not less than 1 deg"),
        ("joint_within", {"position": {LEFT: ("0 rad", "1 N")}}, "'N' is not a unit of angle or length"),
        ("joint_within", {"velocity": {LEFT: 1}}, "valid tuple"),
        ("matches", {"trace": "x.csv"}, "give a tolerance: 'position', 'yaw', 'joints' or several"),
        ("matches", {"trace": "x.csv", "position": 0.0}, "greater than 0"),
        ("matches", {"trace": "x.csv", "position": 1e-5}, "greater than or equal to 0.0002"),
        ("matches", {"trace": "x.csv", "yaw": 1e-5}, "greater than or equal to 0.000349"),
        ("matches", {"trace": "x.csv", "joints": {"*": "0.01 mm"}}, "the tolerance of '.' must be at least 0.0002"),
        ("matches", {"trace": "x.txt", "position": 1.0}, "should match pattern"),
        ("matches", {"trace": "$name.csv", "position": 1.0}, "only .variation is allowed"),
        ("matches", {"trace": "x.csv", "position": 1.0, "duration": -1.0}, "greater than or equal to 0"),
        ("matches", {"trace": "x.csv", "position": 1.0, "rate": 1001.0}, "less than or equal to 1000"),
        ("max_speed", {}, "give 'linear', 'angular' or both"),
        ("max_speed", {"linear": -1}, "greater than"),
        ("max_speed", {"linear": "1 deg/s"}, "'deg/s' is not a unit of speed"),
        ("max_speed", {"angular": "1 m/s"}, "'m/s' is not a unit of angular speed"),
        ("reach", {"x": 1}, "Field required"),
        ("reach", {"x": 1, "y": 2, "tolerance": 0}, "greater than 0"),
        ("reach", {"x": 1, "y": 2, "yaw": "1 m"}, "'m' is not a unit of angle"),
        ("sensor", {"name": "scan", "reading": "ranges"}, "give 'at_least', 'at_most' or both"),
        ("sensor", {"name": "scan", "reading": "ranges", "at_least": 2, "at_most": "30 cm"}, "nothing is at least 2"),
        ("settled", {"for": 0}, "greater than 0"),
        ("settled", {"speed": 0}, "greater than 0"),
        ("settled", {"turn_rate": "1 m/s"}, "'m/s' is not a unit of angular speed"),
        ("settled", {"speed": "1 rad/s"}, "'rad/s' is not a unit of speed"),
        ("stay_within", {}, "give at least one of 'x', 'y' and 'z'"),
        ("stay_within", {"x": (1, -1)}, "the bounds of 'x' are swapped or equal: 1 m is not less than -1 m"),
        ("stay_within", {"x": (1, 1)}, "the bounds of 'x' are swapped or equal: 1 m is not less than 1 m"),
        ("stay_within", {"x": ("1 s", 2)}, "'s' is not a unit of length"),
        ("stay_within", {"x": (1,)}, "Field required"),
        ("stops_before", {**WALL, "gap": (0.5, 0.25)}, "the bounds of 'gap' are swapped or equal: 0.5 m is not less"),
        ("stops_before", {**WALL, "gap": (-0.5, 0.25)}, "greater than or equal to 0"),
        ("stops_before", {**WALL, "for": 0}, "greater than 0"),
    ],
)
def test_what_nothing_can_be_is_refused(key: str, value: Any, problem: str) -> None:
    with pytest.raises(ValidationError, match=problem):
        read(key, value)


@dataclass(frozen=True)
class Nearby:
    """A goal of an installed package, which does not derive from Monitor."""

    state: State = State.PENDING
    needed_until: float = 2.0

    def observe(self, trace: Trace) -> Nearby:
        return Nearby(State.HOLDS, 0.0)

    def verdict(self) -> Verdict:
        return Verdict(self.state is State.HOLDS)


class Sampled:
    """A monitor of an installed package, which sets what it says of itself when it is made."""

    def __init__(self) -> None:
        self.state = State.HOLDS
        self.is_sampled = True
        self.is_momentary = True


def test_a_monitor_without_the_base_class_gets_what_it_lacks() -> None:
    sampled = AdaptedMonitor.of(Sampled())
    assert sampled.is_sampled
    assert sampled.is_momentary
    opened = AdaptedMonitor.of(Nearby())
    assert (opened.state, opened.is_decided) == (State.PENDING, False)
    assert (opened.unmet_premises, opened.is_sampled) == ((), False)
    assert opened.begin(trace([0.0])) is opened
    assert opened.signals(trace([0.0])) == ()
    with pytest.raises(NotImplementedError):
        opened.truth(trace([0.0]))
    came = opened.observe(trace([0.0]))
    assert (opened.needed_until, came.needed_until, came.is_decided) == (2.0, 0.0, True)
    assert came.verdict().passed
