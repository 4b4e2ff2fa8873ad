"""The node `gazebo`: waits for a robot, and simulates it among the other nodes until they are done."""

from __future__ import annotations

import os
import time
from pathlib import Path
from threading import Event
from typing import Final

import rospy

from sim_action.errors import ModelError, RunError, SourceOver
from sim_action.outcome import Failure
from sim_action.replay.build import replay_of
from sim_action.replay.storage import write
from sim_action.ros1.exchange import REPLAY_FILE, TRACE_FILE, End, NodeRun, Request
from sim_action.ros1.graph import Master
from sim_action.ros1.node.bridge import Pace, Session
from sim_action.ros1.node.changes import BeginAnew, Changes
from sim_action.ros1.node.episode import Episode, Stage
from sim_action.ros1.node.lockstep import Lockstep, TestOver
from sim_action.ros1.node.population import Population
from sim_action.ros1.node.present import Present
from sim_action.ros1.node.services import Services
from sim_action.ros1.node.topics import Topics
from sim_action.ros1.worlds import BadWorld, model_folders, read_world
from sim_action.simulation import SimulationRun
from sim_action.trace_storage import save_trace
from sim_action.world import World

NAME: Final = "/gazebo"

_LOOK: Final = 0.01


def serve(folder: Path, request: Request) -> None:
    """Runs the node until the launch is over; writes what became of the simulation when that is known."""
    rospy.init_node(NAME.strip("/"))
    server = _Server(folder, request)
    try:
        run = server.run()
    except (RunError, ModelError, BadWorld) as error:
        kind = "invalid" if isinstance(error, ModelError | BadWorld) else "engine"
        failure = Failure(kind=kind, title=f"{kind} error", message=str(error))
        run = NodeRun(end="failed", failure=failure, notes=tuple(server.notes))
    run.write(folder)
    # Whoever is left may still ask; what tells it to leave is roslaunch.
    rospy.spin()


class _Server:
    def __init__(self, folder: Path, request: Request) -> None:
        self._folder, self._request = folder, request
        self._began = time.monotonic()
        self.notes: list[str] = []
        world = self._world()
        paused = Event()
        if rospy.get_param("/gazebo/paused", False):
            paused.set()
        present, changes = Present(Population(world)), Changes()
        lockstep = Lockstep(Master(os.environ["ROS_MASTER_URI"], NAME), NAME)
        self._session = Session(present, Topics(), lockstep, changes, paused, Pace(request.real_time_factor))
        self._services = Services(present, changes, paused)
        self._stage = Stage(self._session, request, folder)

    def _world(self) -> World:
        """As the launch file names it; one that is Gazebo's own, and not here, is empty. Raises BadWorld."""
        named = Path(str(rospy.get_param("/gazebo/world_name", "worlds/empty.world")))
        if not named.is_absolute() or not named.exists():
            if named.name != "empty.world":
                self.notes.append(f"the world '{named}' is not here; the robot is in an empty one")
            return World()
        world, notes = read_world(named, model_folders())
        self.notes += notes
        return world

    def run(self) -> NodeRun:
        """Raises RunError, ModelError."""
        self._await_robot()
        limit, first_command = self._request.sim_time_limit, None
        started: float | None = None
        while True:
            present = self._session.present
            step = 1 / self._request.physics_rate
            episode = self._stage.episode(left=None if limit is None else max(limit - present.time, step))
            if started is None:
                self._session.lockstep.begin(frozenset({"/cmd_vel"}))
                episode.bridge.begin()
                started = time.monotonic()
            run = episode.run()
            first_command = episode.bridge.first_command if first_command is None else first_command
            if not isinstance(episode.bridge.over, BeginAnew):
                break
            self._begin_anew()
        self._store(episode)
        return self._told(run, episode, first_command, started)

    def _told(self, run: SimulationRun, episode: Episode, first_command: float | None, started: float) -> NodeRun:
        lockstep, sim_time = self._session.lockstep, self._session.present.time
        ends: dict[bool, End] = {True: "time limit", False: "nodes gone"}
        end: End = "test over" if isinstance(episode.bridge.over, TestOver) else ends[episode.bridge.over is None]
        wall_time = time.monotonic() - started
        return NodeRun(
            end=end,
            sim_time=sim_time,
            first_command=first_command,
            travelled=run.travelled,
            digest=run.digest,
            real_time_factor=sim_time / wall_time if wall_time else None,
            starting=started - self._began,
            engine=run.engine,
            notes=(*self.notes, *self._stage.notes, *run.notes, *lockstep.notes),
            in_step=lockstep.is_kept,
        )

    def _await_robot(self) -> None:
        """Raises SourceOver if none comes before everybody leaves."""
        present, changes = self._session.present, self._session.changes
        while present.population.robot is None:
            if rospy.is_shutdown():
                raise SourceOver("the nodes have left before a robot was spawned")
            present.population, _ = changes.make(present.population)
            time.sleep(_LOOK)

    def _begin_anew(self) -> None:
        """Makes what was asked for, of the world as it is now."""
        present = self._session.present
        present.population, restarts = self._session.changes.make(present.carried_on())
        if restarts:
            present.time = 0.0
        self._await_robot()

    def _store(self, episode: Episode) -> None:
        """What there is to be seen: of the last episode, if there were several."""
        trace, film = episode.footage.trace(), episode.footage.film()
        if trace is not None:
            save_trace(trace, self._folder / TRACE_FILE)
        if film is not None:
            write(replay_of(episode.scene, film), self._folder / REPLAY_FILE)
