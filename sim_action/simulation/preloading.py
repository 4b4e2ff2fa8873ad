"""Modules that only some runs need, imported once for all runs before processes are forked.

A forked process would import them again in each of many variations. A single run imports them where it uses them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from importlib import import_module

from sim_action.drives import recognise
from sim_action.engines import ENGINES, chosen
from sim_action.robot.model.robot_model import RobotModel
from sim_action.scenario.model import LoadedScenario, Scenario


def preload(scenarios: Iterable[LoadedScenario]) -> None:
    """Import the modules that some of these scenarios may need."""
    for module in needed_modules(scenarios):
        import_module(module)


def needed_modules(scenarios: Iterable[LoadedScenario]) -> set[str]:
    """Return the names of the modules that some of these scenarios may need, but not every run."""
    needed = set[str]()
    robots = set[tuple[object, ...]]()
    for loaded in scenarios:
        modules = ENGINES[chosen(loaded.scenario.backend)].feature_modules
        if loaded.scenario.robot.is_mjcf and "MJCF" in modules:
            needed.add(modules["MJCF"])
        if loaded.model is None:
            continue
        needed.update(_of_world(loaded))
        # Variations often have the same robot.
        scenario = loaded.scenario
        drive = scenario.robot.drive
        robot = id(loaded.model), drive and drive.key, bool(scenario.commands), scenario.backend
        if robot not in robots:
            robots.add(robot)
            needed.update(_of_robot(scenario, loaded.model))
    return {f"sim_action.{name}" for name in needed}


def _of_world(loaded: LoadedScenario) -> Iterator[str]:
    world = loaded.scenario.world
    if world.objects:
        yield "simulation.tunnelling"
    if any(body.path for body in world.objects):
        yield "simulation.bodies_on_paths"
    if loaded.scenario.faults:
        yield "simulation.faults"
    if not (loaded.scenario.commands or world.disturbances):
        yield "simulation.energy"


def _of_robot(scenario: Scenario, model: RobotModel) -> Iterator[str]:
    modules = ENGINES[chosen(scenario.backend)].feature_modules
    if any(joint.damping for joint in model.joints) and "damped joints" in modules:
        yield modules["damped joints"]
    if "skid drive" not in modules:
        return
    drive = (scenario.robot.drive or recognise(model)) if scenario.commands else None
    if drive is not None and drive.slips:
        yield modules["skid drive"]
