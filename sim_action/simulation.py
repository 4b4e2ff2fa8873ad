"""The loop: ticks of the command sources, physics steps in between, and a panel of monitors that sees every step."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sim_action.backends import BACKENDS, Backend
from sim_action.command import JointTargets
from sim_action.commands import Controller
from sim_action.drives import Drive, DriveMotion, recognise
from sim_action.errors import RunError, SimulationUnstable
from sim_action.geometry import Twist
from sim_action.panel import End, Panel
from sim_action.scenario import Scenario
from sim_action.scene import Scene
from sim_action.trace import Digest, Trace
from sim_action.verdict import Verdict

ENGINE: Final = "pybullet"

Progress = Callable[[float], None]
"""Told the sim time in s as the run goes on."""

# At rest: nothing moves faster than this, in m/s and rad/s, at the end of a period of settling.
_REST_SPEED: Final = 5e-3
_SETTLE_PERIOD: Final = 0.1
# Without ticks, how long the panel waits for its next look.
_LONGEST_BLOCK: Final = 0.25
# Bullet's speeds saturate near 160 m/s when a simulation explodes.
_FASTEST: Final = 100.0


@dataclass(frozen=True, eq=False)
class SimulationRun:
    """What came of one scenario.

    Attributes:
        trace: decimated to `Scenario.trace_rate`, from t = 0 to the end.
        verdicts: one for each expectation, in their order.
        digest: SHA-256 over the full-rate state.
        travelled: m between the base's first and last place, on the ground plane.
        wall_time: s of the loop, without loading and settling.
        notes: what was assumed or noticed, for people.
    """

    trace: Trace
    verdicts: tuple[Verdict, ...]
    end: End
    digest: str
    travelled: float
    wall_time: float
    engine: str
    notes: tuple[str, ...]

    @property
    def sim_time(self) -> float:
        """When the run was over, in s."""
        return float(self.trace.time[-1])


def simulate(scenario: Scenario, scene: Scene, progress: Progress) -> SimulationRun:
    """Runs a scenario to its end. Raises RunError where there can be no verdict."""
    contacts = any(expected.assertion.watches_contacts for expected in scenario.expect)
    backend = BACKENDS.load(ENGINE)(scene, contacts=contacts)
    try:
        return _Loop(scenario, scene, backend).run(progress)
    finally:
        backend.close()


@dataclass(frozen=True, slots=True)
class _Ticker:
    """A controller and how many physics steps lie between its ticks."""

    controller: Controller
    period: int
    watches_contacts: bool


class _Loop:
    """One run; the step count is its clock."""

    def __init__(self, scenario: Scenario, scene: Scene, backend: Backend) -> None:
        self._scenario = scenario
        self._scene = scene
        self._backend = backend
        self._notes: list[str] = []
        self._motion = self._open_drive()
        self._twist: Twist | None = None
        self._last_step = scenario.steps(scenario.time_limit)
        self._stride = max(1, round(scenario.physics.rate / scenario.trace_rate))
        self._step = 0

    def run(self, progress: Progress) -> SimulationRun:
        tickers = [
            _Ticker(source.open(self._scene), self._scenario.steps_between_ticks(source.rate), source.watches_contacts)
            for source in self._scenario.commands
        ]
        self._settle()
        self._present = first = self._backend.observe(0)
        panel = Panel.open(self._scenario, self._scene, first.observation(0))
        kept, digest = [first], Digest()
        started = time.perf_counter()
        while panel.end is None:
            panel, seen = panel.observe_until_end(self._advance(tickers))
            digest.add(seen)
            kept.append(self._decimated(seen, keep_last=panel.end is not None))
            progress(panel.time)
        wall_time = time.perf_counter() - started
        trace = Trace.concatenate(kept)
        x, y, _ = first.base_position_xyz[0].tolist()
        return SimulationRun(
            trace=trace,
            verdicts=panel.verdicts(),
            end=panel.end,
            digest=digest.hexdigest(),
            travelled=float(trace.planar_distance_to(x, y)[-1]),
            wall_time=wall_time,
            engine=self._backend.version,
            notes=tuple(self._notes),
        )

    def _open_drive(self) -> DriveMotion | None:
        if not self._scenario.commands:
            return None
        model, stated = self._scene.model, self._scenario.robot.drive
        drive: Drive | None = stated or recognise(model)
        if drive is None:
            return None
        self._notes.append(("" if stated else "recognised: ") + drive.describe(model))
        return drive.open(model, self._scenario.physics.rate)

    def _settle(self) -> None:
        """Lets the robot come to rest before t = 0, with its wheels braked."""
        limit = self._scenario.physics.settle
        steps = self._scenario.steps(_SETTLE_PERIOD)
        brake = self._motion.targets(Twist(), 1) if self._motion else []
        speed = 0.0
        for _ in range(round(limit / _SETTLE_PERIOD)):
            trace = self._stable(self._backend.advance(-steps, steps, brake))
            speed = _fastest(trace)
            if speed < _REST_SPEED:
                return
        if limit:
            self._notes.append(f"not at rest after {limit:g} s of settling: {speed:.2g} m/s or rad/s at t = 0")

    def _advance(self, tickers: list[_Ticker]) -> Trace:
        """The moments up to the next tick, after asking the controllers whose tick is now."""
        asked = self._ask([ticker for ticker in tickers if self._step % ticker.period == 0])
        steps = min(
            self._last_step - self._step,
            max(1, self._scenario.steps(_LONGEST_BLOCK)),
            *(ticker.period - self._step % ticker.period for ticker in tickers),
        )
        targets = self._motion.targets(self._twist, steps) if self._motion and self._twist else []
        targets = [asked.updated_by(targets[0]), *targets[1:]] if targets else [asked]
        trace = self._stable(self._backend.advance(self._step, steps, targets))
        self._step += steps
        self._present = trace
        return trace

    def _ask(self, tickers: list[_Ticker]) -> JointTargets:
        """Takes the commands of this tick; returns the joint targets among them."""
        targets = JointTargets()
        if not tickers:
            return targets
        observation = self._present.observation(-1)
        if any(ticker.watches_contacts for ticker in tickers):
            observation = replace(observation, contacts=self._backend.contacts(self._step))
        for ticker in tickers:
            command = ticker.controller(observation)
            if isinstance(command, JointTargets):
                targets = targets.updated_by(command)
                if self._motion and not self._motion.joints.isdisjoint(command.names()):
                    # Whoever turns the wheels by hand takes them over from the drive.
                    self._twist = None
            elif command is not None:
                self._twist = self._drivable(command)
        return targets

    def _drivable(self, twist: Twist) -> Twist:
        if self._motion is None:
            raise RunError(
                "a controller gave a twist, but which joints are wheels is not known; name them: robot.drive"
            )
        return twist

    def _decimated(self, trace: Trace, *, keep_last: bool) -> Trace:
        """Every stride-th step, counted from t = 0."""
        first_step = round(trace.time[0] * self._scenario.physics.rate)
        kept = trace.rows(slice(-first_step % self._stride, None, self._stride))
        ended_between = keep_last and (first_step + len(trace) - 1) % self._stride
        return Trace.concatenate((kept, replace(trace.rows(slice(-1, None)), contacts=()))) if ended_between else kept

    def _stable(self, trace: Trace) -> Trace:
        """The trace, if it is still physics. A NaN would fail no comparison and pass none."""
        if np.isfinite(trace.state).all() and trace.speed.max() < _FASTEST:
            return trace
        ok = np.isfinite(trace.state).all(axis=1) & (trace.speed < _FASTEST)
        first = int(np.argmin(ok))
        raise SimulationUnstable(
            f"simulation unstable at t = {trace.time[first]:.2f} s: the base moves at {trace.speed[first]:.3g} m/s"
        )


def _fastest(trace: Trace) -> float:
    last = (trace.speed[-1:], trace.turn_rate[-1:], np.abs(trace.joint_velocity[-1]))
    return float(np.concatenate(last).max())
