"""The node `gazebo`: waits for a robot, and simulates it until the launch ends."""

from __future__ import annotations

import os
import signal
import threading
import time
from contextlib import suppress
from pathlib import Path
from threading import Event
from types import UnionType
from typing import Final

import rospy

from sim_action.core.errors import (
    BadStart,
    ControllersFinished,
    MissedContact,
    ModelError,
    RunError,
    SimulationUnstable,
)
from sim_action.results.outcome import Failure, FailureKind
from sim_action.robot.documents.sdf_elements import SdfProblem
from sim_action.robot.model.robot_spec import IN_WORLD
from sim_action.ros.ros1.gazebo_worlds import BadWorld, MissingWorld, find_world, read_world, remarks_once
from sim_action.ros.ros1.launch.ros_patches import ALONE, TEST_LIMIT
from sim_action.ros.ros1.launch_request import PROGRESS_FILE, TITLE, End, SimulationRequest, SimulationResult
from sim_action.ros.ros1.lockstep import TestFinished
from sim_action.ros.ros1.node.episode import Episode, EpisodeFactory, Pace, Session
from sim_action.ros.ros1.node.episode_record import EpisodeRecord
from sim_action.ros.ros1.node.services import GazeboServices
from sim_action.ros.ros1.node.topics import GazeboTopics, Traffic
from sim_action.ros.ros1.node.world_models import (
    ChangeQueue,
    CurrentState,
    JointEfforts,
    SpawnedRobot,
    WorldChanged,
    WorldModels,
)
from sim_action.simulation.loop import SimulationRun
from sim_action.world import World
from sim_action.world.claims import NOT_REPRODUCIBLE
from sim_action.world.world_files.losses import Loss

_POLL_S: Final = 0.01

# Wall time in which nodes that are up may call the services that spawn a robot.
_MAX_SPAWN_WAIT_S: Final = 10.0
_SPAWN_ADVICE: Final = (
    "add a spawn_model node, or launch the file that has it together with this one, as in: sim-action roslaunch "
    "MY_ROBOT world.launch MY_ROBOT spawn.launch"
)

_SIGNALS: Final = (signal.SIGINT, signal.SIGTERM)


class _NoRobot(Exception):
    """Nothing spawns a robot."""


class _Incomplete(Exception):
    """Parts of the world or of the robot are not simulated, and the request does not allow it."""


def serve(folder: Path, request: SimulationRequest) -> None:
    """Run the node until the launch ends; write the result as soon as it is known."""
    # A thread waits for the signals, which are blocked before any thread starts. rospy's own handler would run between
    # two steps of the main thread, and wait for locks that this thread may hold: a node that publishes all the time
    # would never end.
    signal.pthread_sigmask(signal.SIG_BLOCK, _SIGNALS)
    rospy.init_node("gazebo", disable_signals=True)
    # rospy's own hooks run before: the master knows by then that this node has left.
    rospy.core.add_shutdown_hook(lambda _: _left.set())
    threading.Thread(target=_await_signal, name="leaving", daemon=True).start()
    _Server(folder, request).run().write(folder)
    # Nodes that are left may still call services; roslaunch ends this node. rospy.spin() would poll for that.
    _left.wait()


class _Server:
    def __init__(self, folder: Path, request: SimulationRequest) -> None:
        self._folder, self._request = folder, request
        self._limit = _sim_time_limit(request)
        self._notes: list[str] = []
        self._losses: list[Loss] = []
        self._missing_world: str | None = None
        self._services: GazeboServices | None = None
        self._record = EpisodeRecord()
        self._traffic = Traffic()
        self._changes = ChangeQueue()
        self._current = CurrentState(WorldModels(World()))
        paused = Event()
        topics = GazeboTopics(self._traffic)
        self._lockstep = topics.lockstep(os.getppid())
        if rospy.get_param("/gazebo/paused", default="-u" in rospy.myargv()):
            paused.set()
        self._session = Session(
            self._current,
            self._traffic,
            topics,
            self._lockstep,
            self._changes,
            paused,
            Pace(request.real_time_factor, folder / PROGRESS_FILE),
            JointEfforts(),
        )
        self._stage = EpisodeFactory(self._session, request, folder)

    def run(self) -> SimulationResult:
        """Run to the end, and return the result."""
        end: End = "failed"
        failure: Failure | None = None
        try:
            self._current.world_models = self._populated()
            session = self._session
            self._services = GazeboServices(
                self._current, self._changes, session.paused, session.efforts, self._request.physics_rate
            )
            end = self._simulate()
            self._lockstep.await_leavers()
        except TestFinished:
            end = "test finished"
        except ControllersFinished:
            end = "nodes finished"
        except MissingWorld as error:
            failure = _failure_of(error)
            self._missing_world = str(error.path)
        except _Incomplete:
            failure = Failure(kind="invalid", title=TITLE, message="parts of the world or of the robot are missing")
        except (RunError, ModelError, SdfProblem, BadWorld, OSError, _NoRobot) as error:
            failure = _failure_of(error)
        self._record.store(self._folder)
        return self._result(end, failure)

    def _populated(self) -> WorldModels:
        """Return the models of the world file, or of Gazebo's own empty world. Raises BadWorld, MissingWorld."""
        argument = next((word for word in rospy.myargv()[1:] if word.endswith(".world")), "worlds/empty.world")
        path = find_world(str(rospy.get_param("/gazebo/world_name", argument)))
        if path is None:
            return WorldModels(World())
        world_file = read_world(path)
        self._losses += remarks_once(world_file.losses)
        if (robot := world_file.robot) is None:
            return WorldModels(world_file.world)
        file = f"{path.resolve()}{IN_WORLD}{robot.name}"
        return WorldModels(world_file.world, SpawnedRobot(robot.name, robot.entry.flat_model, robot.pose, file=file))

    def _simulate(self) -> End:
        """Simulate to the end. Raises RunError; ControllersFinished if all nodes leave before a robot is spawned."""
        self._await_robot()
        while True:
            episode = self._stage.episode(left=self._left())
            if not self._request.allows_losses and not all(loss.is_remark for loss in self._all_losses()):
                raise _Incomplete
            self._run(episode)
            over = episode.bridge.over
            if not isinstance(over, WorldChanged):
                return _end_of(over)
            if self._current.time > self._current.began:
                self._notes.append(
                    f"{over} at {self._current.time:g} s of sim time: everything that moved continued from rest"
                )
            self._current.world_models, restarts = self._changes.apply(self._current.models_now())
            if restarts:
                self._current.time = 0.0
            self._current.began = self._current.time
            self._await_robot()

    def _run(self, episode: Episode) -> None:
        """Run one episode. Raises RunError."""
        self._record.begin(episode)
        run: SimulationRun | None = None
        try:
            run = episode.run()
        finally:
            self._record.end(episode, run)

    def _left(self) -> float | None:
        limit = self._limit
        return None if limit is None else max(limit - self._current.time, 1 / self._request.physics_rate)

    def _await_robot(self) -> None:
        """Wait for a robot. Raises ControllersFinished if all nodes leave before, _NoRobot if nothing spawns one."""
        began = time.monotonic()
        # A test may need no robot.
        is_test = Path(os.environ["ROS_LOG_DIR"], TEST_LIMIT).exists()
        while self._current.world_models.robot is None:
            if rospy.is_shutdown():
                raise ControllersFinished("the nodes ended before a robot was spawned")
            self._current.world_models, _ = self._changes.apply(self._current.world_models)
            if Path(os.environ["ROS_LOG_DIR"], ALONE).exists():
                raise _NoRobot(f"no node of the launch spawns a robot, and the world has none: {_SPAWN_ADVICE}")
            if not is_test and time.monotonic() > began + _MAX_SPAWN_WAIT_S:
                if not self._lockstep.may_start_nodes(b"spawn_model\0"):
                    within = f"within {_MAX_SPAWN_WAIT_S:g} s of wall time, and all other nodes are up"
                    raise _NoRobot(f"no node has spawned a robot {within}: {_SPAWN_ADVICE}")
                began = time.monotonic()
            time.sleep(_POLL_S)

    def _all_losses(self) -> tuple[Loss, ...]:
        spawned = self._services.losses if self._services else ()
        return tuple(dict.fromkeys((*self._losses, *spawned, *self._stage.losses)))

    def _races(self) -> dict[str, str]:
        reasons = self._lockstep.not_reproducible
        return {NOT_REPRODUCIBLE: f"the run is not reproducible: {'; '.join(reasons)}"} if reasons else {}

    def _result(self, end: End, failure: Failure | None) -> SimulationResult:
        now, record = time.monotonic(), self._record
        started = self._current.started or now
        return SimulationResult(
            end=end,
            failure=failure,
            sim_time=self._current.time,
            sim_time_limit=self._limit,
            first_command=record.first_command,
            travelled=record.travelled,
            digest=record.digest,
            real_time_factor=self._current.time / (now - started) if now > started else None,
            engine=record.engine,
            notes=tuple(dict.fromkeys((*self._notes, *self._stage.notes, *record.notes, *self._lockstep.notes))),
            messages=dict(sorted(self._traffic.counts.items())),
            in_step=self._lockstep.is_kept,
            losses=self._all_losses(),
            missing_world=self._missing_world,
            claims={**record.claims, **self._races()},
        )


def _sim_time_limit(request: SimulationRequest) -> float | None:
    """Return the limit in s of the test that runs, else the limit of the request."""
    if not request.limits_tests:
        with suppress(OSError):
            return float(Path(os.environ["ROS_LOG_DIR"], TEST_LIMIT).read_text())
    return request.sim_time_limit


def _end_of(over: ControllersFinished | None) -> End:
    if isinstance(over, TestFinished):
        return "test finished"
    return "time limit" if over is None else "nodes finished"


_FAILURES: Final[tuple[tuple[type[Exception] | UnionType, FailureKind, str], ...]] = (
    (SimulationUnstable, "unstable", "simulation unstable"),
    (MissingWorld, "invalid", "no such world"),
    (_NoRobot, "invalid", "no robot"),
    (MissedContact, "missed contact", "missed contact"),
    (ModelError | SdfProblem | BadStart | BadWorld, "invalid", "the simulation cannot start"),
    (Exception, "engine", "the simulation failed"),
)
"""Class of an exception -> kind and title of the failure; the first that fits counts."""


def _failure_of(error: Exception) -> Failure:
    kind, title = next((kind, title) for classes, kind, title in _FAILURES if isinstance(error, classes))
    return Failure(kind=kind, title=title, message=str(error))


_left: Final = threading.Event()


def _await_signal() -> None:
    number = signal.sigwait(_SIGNALS)
    rospy.signal_shutdown(signal.Signals(number).name)
