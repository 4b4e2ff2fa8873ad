"""A replay from all that a run has left, on disk; and what makes the first one as quick as those after it."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from pathlib import Path

from pydantic import BaseModel

from sim_action.recording.replay import contacts, models, shapes
from sim_action.recording.replay.build import replay_of
from sim_action.recording.replay.curves import stored_marks, stored_signals
from sim_action.recording.replay.storage import write
from sim_action.robot.robot_model import RobotModel
from sim_action.scenario.model import Scenario
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace
from sim_action.world.scene import Scene


def make_replay(scenario: Scenario, scene: Scene, start: Observation, film: Trace, path: Path) -> None:
    """Writes the replay of a run: `start` is the settled state at t = 0, `film` what was seen of it.

    Raises OSError, and ValueError for what is no replay.
    """
    signals, marks = stored_signals(scenario, scene, start, film), stored_marks(scenario, scene, start)
    write(replay_of(scene, film, signals, marks), path)


def warm_up(robots: Iterable[RobotModel]) -> None:
    """Builds the validators of all models, and imports what draws robots, once for all forks of this process."""
    for module in (shapes, models, contacts):
        for model in vars(module).values():
            if isinstance(model, type) and issubclass(model, BaseModel):
                model.model_rebuild()
    if any(link.has_mesh for robot in robots for link in robot.links):
        import_module("sim_action.recording.replay.visual_meshes")
