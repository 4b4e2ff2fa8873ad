"""The channels of a replay: what the base, the joints, contacts and sensors did, and what was commanded."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence

import numpy as np

from sim_action.core.geometry import ZERO, Pose, Twist, quaternion_from_rpy
from sim_action.recording.replay import channels
from sim_action.recording.replay.channels import Curve, stored_channels, thinned_curves
from sim_action.recording.replay.replay_data import MAX_CHANNELS, ChannelData
from sim_action.sensors import ReadingLog
from sim_action.sensors.camera import Camera
from sim_action.sensors.imu import Imu
from sim_action.sensors.odometry import Odometry
from sim_action.state.observation import Contact
from sim_action.state.readings import ImuReading, OdometryReading, Reading
from sim_action.state.trace import Trace
from sim_action.state.trace_records import CommandedValues
from tests.recording.replay import logs
from tests.traces import contact, scene, trace

TIME = [0.0, 1 / 30, 2 / 30, 0.1]


def stored(
    seen: Trace,
    *,
    contacts: Sequence[Contact] = (),
    commanded: Mapping[str, CommandedValues] | None = None,
    readings: Sequence[ReadingLog] = (),
) -> dict[tuple[str, str, bool], ChannelData]:
    """The channels by group, name, and whether they are commanded."""
    logged = {log.mounted.name: log for log in readings}
    found = stored_channels(scene(), seen, contacts, commanded or {}, logged)
    for channel in found:
        assert ChannelData.model_validate_json(channel.model_dump_json()) == channel
    return {(channel.group, channel.name, channel.commanded): channel for channel in found}


def test_the_velocity_of_the_base_is_in_its_own_frame_beside_the_commanded_one() -> None:
    seen = trace(TIME, yaw=[math.pi / 2] * 4, speed=[0.0, 0.1, 0.2, 0.3], turn_rate=[0.5] * 4)
    told = CommandedValues.of([(0.0, {"linear x": 1.0, "linear y": 0.0}), (0.06, {"linear x": 2.0})])
    found = stored(seen, commanded={"base": told})
    assert list(found) == [
        ("base", "linear x", False),
        ("base", "linear x", True),
        ("base", "linear y", False),
        ("base", "linear y", True),
        ("base", "angular z", False),
    ]
    # Along the x axis of the world, and the robot looks along y.
    np.testing.assert_allclose(found["base", "linear y", False].values.decoded(4), [0, -0.1, -0.2, -0.3], atol=1e-9)
    np.testing.assert_allclose(found["base", "linear x", True].values.decoded(4), [1, 1, 2, 2])
    assert {channel.unit for (_, name, _), channel in found.items() if name == "angular z"} == {"rad/s"}


def test_joints_have_velocities_and_efforts_and_what_was_commanded() -> None:
    seen = trace(TIME, velocity=[0.0, 1.0, 2.0, 3.0], effort=[0.25] * 4)
    told = {"velocity": CommandedValues.of([(1 / 30, {"wheel_right_joint": 4.0})])}
    found = stored(seen, commanded=told)
    assert list(found) == [
        ("joints", "wheel_left_joint velocity", False),
        ("joints", "wheel_right_joint velocity", False),
        ("joints", "wheel_right_joint velocity", True),
        ("joints", "wheel_left_joint effort", False),
    ]
    aim = found["joints", "wheel_right_joint velocity", True]
    np.testing.assert_array_equal(aim.values.decoded(4), [np.nan, 4, 4, 4])
    assert [found["joints", f"wheel_left_joint {kind}", False].unit for kind in ("velocity", "effort")] == [
        "rad/s",
        "N m",
    ]


def test_channels_of_contacts() -> None:
    # Contact forces are the mean between two moments.
    pushed = [contact(step / 240, force=8.0) for step in range(9, 17)] + [contact(16 / 240, "ball", force=16.0)]
    found = stored(trace(TIME), contacts=pushed)
    forces = {name: channel.values.decoded(4).tolist() for (_, name, _), channel in found.items()}
    assert list(forces) == ["force of all bodies", "force of wall", "force of ball"]
    assert list(forces.values()) == [[0, 0, 10, 0], [0, 0, 8, 0], [0, 0, 2, 0]]
    # A contact without a force has no curve.
    rigid = contact(0.01, "gate", force=0.0)._replace(has_force=False)
    assert stored(trace(TIME), contacts=[rigid]) == {}
    assert list(stored(trace(TIME), contacts=[rigid, contact(0.01)])) == [("contacts", "force of wall", False)]
    # Many touched bodies have one force.
    pushed = [contact(0.01, f"body {number}") for number in range(channels.MAX_TOUCHED + 1)]
    assert list(stored(trace(TIME), contacts=pushed)) == [("contacts", "force of all bodies", False)]


def test_channels_of_sensors_and_wrenches() -> None:
    # A lidar has its nearest range and where it is.
    log = logs.lidar("scan", 3, lambda time: [math.inf] * 4 if time > 0.15 else [2.0, -math.inf if time else 1.5, 3, 3])
    found = stored(trace([0.0, 0.1, 0.2]), readings=[log])
    nearest, bearing = found["scan", "nearest range", False], found["scan", "bearing of the nearest", False]
    np.testing.assert_array_equal(nearest.values.decoded(3), [1.5, 0.0, np.nan])
    np.testing.assert_allclose(bearing.values.decoded(3), [math.pi / 2, math.pi / 2, np.nan], atol=1e-3)
    assert nearest.time is None


def test_sensors_have_their_columns_with_orientations_as_angles() -> None:
    def measured(number: int) -> Reading:
        turned = quaternion_from_rpy(0.0, 0.0, 0.1 * number)
        return ImuReading(number / 10, turned, (0.0, 0.0, 1.0), (0.0, 0.0, 9.81))

    log = logs.log(Imu(), "imu", [measured(number) for number in range(4)])
    found = stored(trace([0.0, 0.05, 0.1, 0.2]), readings=[log])
    assert {group for group, _, _ in found} == {"imu"}
    yaw = found["imu", "yaw", False]
    assert yaw.time is not None
    # The last reading is later than the run.
    np.testing.assert_allclose(yaw.time.decoded(3), [0.0, 0.1, 0.2])
    np.testing.assert_allclose(yaw.values.decoded(3), [0.0, 0.1, 0.2], atol=1e-4)
    assert found["imu", "linear acceleration z", False].unit == "m/s^2"


def test_channels_of_other_sensors_and_of_wrenches() -> None:
    assert stored(trace(TIME)) == stored(trace(TIME), readings=[logs.log(Camera(), "eye", [])]) == {}
    # Odometry has pose and twist.
    log = logs.log(Odometry(), "odometry", [OdometryReading(0.0, Pose(), Twist(linear_xyz=ZERO))])
    names = [name for _, name, _ in stored(trace([0.0]), readings=[log])]
    assert names[:6] == ["position x", "position y", "position z", "roll", "pitch", "yaw"]
    # Wrenches that push are channels.
    told = CommandedValues.of([(0.0, {"force on arm x": 0.0, "force on arm z": 5.0, "torque on arm z": 1.0})])
    found = stored(trace(TIME), commanded={"wrench": told})
    assert {key: channel.unit for key, channel in found.items()} == {
        ("wrenches", "force on arm z", True): "N",
        ("wrenches", "torque on arm z", True): "N m",
    }


def test_the_number_of_values_is_limited() -> None:
    # Ranges without a return take no space and give no warning.
    values = np.array([math.inf, math.inf, 1.0, 1.0, math.inf])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert Curve("a", "b", "m", np.arange(5.0), values).size == 2

    # Those with the most values are halved first.
    def curve(count: int) -> Curve:
        time = np.arange(count, dtype=np.float64)
        return Curve("a", "b", "m", time, time)

    slow, fast, also_fast = curve(100), curve(1000), curve(1000)
    kept = thinned_curves([slow, fast, also_fast], 700)
    assert [len(found.time) for found in kept] == [100, 250, 250]
    assert thinned_curves([slow, fast], 5000) == [slow, fast]
    # There are no more channels than can be read.
    told = CommandedValues.of([(0.0, {f"force on link {number} z": 1.0 for number in range(MAX_CHANNELS + 10)})])
    assert len(stored(trace(TIME), commanded={"wrench": told})) == MAX_CHANNELS
