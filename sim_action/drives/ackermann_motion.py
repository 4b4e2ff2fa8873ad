"""The live half of Ackermann steering."""

from __future__ import annotations

from sim_action.core.geometry import Twist
from sim_action.drives import NOT_PLANAR, is_planar
from sim_action.drives.ramp import towards
from sim_action.drives.steering import DrivenWheel, Kingpin, steered, tightest
from sim_action.drives.wheel_speeds import WheelSpeeds
from sim_action.state.command import JointTargets

ON_THE_SPOT = "a twist asked to turn on the spot, which Ackermann steering cannot: it stood still"
TOO_TIGHT = "a twist asked for a tighter curve than the steering allows: it took the tightest there is"


class AckermannMotion:
    """Forward speed and curvature, ramping towards what the last twist asks for.

    Wheels turn as the curve wants it that they are steered for at a step, not the one that steering is on its way to.
    """

    def __init__(
        self,
        kingpins: tuple[Kingpin, ...],
        wheels: tuple[DrivenWheel, ...],
        *,
        steering_limit: float,
        most_steering: float,
        most_speed: float,
        speeds: WheelSpeeds,
        torque: float | None,
    ) -> None:
        """`most_steering`: rad a step; `most_speed`: m/s a step."""
        self._kingpins = kingpins
        self._wheels = wheels
        self._tightest = tightest(kingpins, steering_limit)
        self._most_steering = most_steering
        self._most_speed = most_speed
        self._speeds = speeds
        self._max_effort = {} if torque is None else {found.joint: torque for found in wheels}
        self._speed = self._curvature = 0.0
        self._notes: dict[str, None] = {}

    @property
    def joints(self) -> frozenset[str]:
        """See DriveMotion.joints."""
        return frozenset([*(pin.joint for pin in self._kingpins), *(found.joint for found in self._wheels)])

    @property
    def notes(self) -> tuple[str, ...]:
        """See DriveMotion.notes."""
        return (*self._notes, *self._speeds.notes)

    @property
    def released(self) -> JointTargets:
        """See DriveMotion.released."""
        return JointTargets()

    def targets(self, twist: Twist, steps: int) -> list[JointTargets]:
        """See DriveMotion.targets."""
        if not is_planar(twist):
            self._notes[NOT_PLANAR] = None
        curvature = self._wanted_curvature(twist)
        speed = twist.linear_xyz[0] * self._speeds.told_share(self._wheel_speeds(twist.linear_xyz[0], curvature))
        planned = []
        for _ in range(steps):
            before = (self._speed, self._curvature)
            self._curvature = steered(self._kingpins, self._curvature, curvature, self._most_steering)
            self._speed = self._within_limits(towards(speed, self._speed, self._most_speed))
            planned.append(self._joint_targets())
            if before == (self._speed, self._curvature):
                break
        return planned

    def _wanted_curvature(self, twist: Twist) -> float:
        speed, turn = twist.linear_xyz[0], twist.angular_xyz[2]
        if speed == 0:
            if turn != 0:
                self._notes[ON_THE_SPOT] = None
            # Who stops keeps the wheel where it is.
            return self._curvature
        if abs(turn) > self._tightest * abs(speed):
            self._notes[TOO_TIGHT] = None
            return self._tightest if turn * speed > 0 else -self._tightest
        return turn / speed

    def _within_limits(self, speed: float) -> float:
        """While the wheels are still turned for another curve, that may take them faster than this one."""
        return speed * self._speeds.share(self._wheel_speeds(speed, self._curvature))

    def _wheel_speeds(self, speed: float, curvature: float) -> dict[str, float]:
        """In rad/s."""
        return {found.joint: speed * found.way(curvature) / found.gear for found in self._wheels}

    def _joint_targets(self) -> JointTargets:
        return JointTargets(
            position={pin.joint: pin.turns * pin.angle(self._curvature) for pin in self._kingpins},
            velocity=self._wheel_speeds(self._speed, self._curvature),
            max_effort=self._max_effort,
        )
