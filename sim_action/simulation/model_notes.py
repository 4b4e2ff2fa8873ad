"""Notes on the robot model before a run: its drive, its links, and what the model states otherwise."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from sim_action.drives import Drive, DriveMotion, recognise
from sim_action.drives.ignored_statements import ignored_statements
from sim_action.drives.wheels import axis_in_base, opposed_note
from sim_action.scenario.model import Scenario
from sim_action.world.scene import Scene

BOLTED: Final = "the base is fixed: twists turn the wheels, but the robot does not move"


def noted_drive(scenario: Scenario, scene: Scene, drive: Drive | None) -> Drive | None:
    """Return the drive whose wheels commands turn or sensors read."""
    if drive is None and any(mounted.sensor.reads_wheels for mounted in scenario.sensors):
        return scenario.robot.drive or recognise(scene.model)
    return drive


def about_drive(scenario: Scenario, scene: Scene, drive: Drive | None) -> Iterator[str]:
    """Yield notes on a drive."""
    if drive is not None:
        yield ("" if scenario.robot.drive else "recognised: ") + drive.describe(scene.model, scene.world.weight)
        if scene.bolted and any(source.gives_twists(scene) for source in scenario.commands):
            yield BOLTED


def about_links(scenario: Scenario, scene: Scene) -> Iterator[str]:
    """Yield a note if links of the robot pass through each other, and nothing watches them."""
    # The episodes of ROS nodes expect nothing.
    keys = {assertion.key for assertion in scenario.assertions}
    # Most robots that drive have fewer motors than an arm; the rest of the check is imported for others.
    if keys and "self_collision" not in keys and len(scene.model.motor_joints) > (1 if scene.bolted else 2):
        from sim_action.robot.model.link_pairs import unwatched_note

        note = unwatched_note(scene.model, scene.robot, bolted=scene.bolted)
        yield from () if note is None else (note,)


def about_model_of_drive(
    scenario: Scenario, scene: Scene, drive: Drive | None, motion: DriveMotion | None
) -> Iterator[str]:
    """Yield notes on what the model states about a drive, and the drive does otherwise; `motion`: if it is open."""
    if drive is not None:
        joints = (motion or drive.open(scene.model, scenario.physics.rate, scene.world.weight)).joints
        axes = {name: axis_in_base(scene.model, scene.model.joints_by_name[name]) for name in sorted(joints)}
        turning = {name: axis for name, axis in axes.items() if scene.model.joints_by_name[name].type == "continuous"}
        if (note := opposed_note(turning)) is not None:
            yield note
        if scenario.robot.drive is None:
            yield from ignored_statements(scene.model, drive.source(scene.model), joints)
