"""`sim-action init`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

import click

from sim_action.app.schema import schema_here, schema_text
from sim_action.cli.options import flag
from sim_action.core.errors import UsageError
from sim_action.core.version import __version__
from sim_action.core.wording import did_you_mean
from sim_action.robot.built_in import BUILT_IN


@click.command()
@click.argument("folder", default=".", metavar="[FOLDER]")
@click.option(
    "--robot",
    metavar="NAME",
    default="turtlebot3_burger",
    show_default=True,
    help="Built-in robot of the scenario; sim-action models lists them.",
)
@flag("--force", text="Overwrite existing files.")
def init(folder: str, robot: str, force: bool) -> None:
    """Create an example scenario with explanations, which passes, and a GitHub workflow that runs it.

    FOLDER is created if it does not exist. The default is the current folder.
    """
    for path in write_scaffold(Path(folder), schema_text(schema_here("scenario")), force=force, robot=robot):
        click.echo(f"wrote {path}")
    click.echo(f"next: sim-action run {Path(folder) / 'simulation'}")


_ROBOT: Final = "turtlebot3_burger"

_DRIVE: Final = """\
# yaml-language-server: $schema=scenario.schema.json
# A simulation test of a robot. Run it in the folder above this one: sim-action run simulation
name: robot drives straight

robot:
  model: turtlebot3_burger      # a built-in model (sim-action models), or the path of your .urdf, relative to this file

world:                          # flat ground, and a wall that the robot must not touch
  objects:
    - {name: wall, box: [0.1, 2.0, 0.5], pose: {x: 3.0}}

commands:                       # what drives the robot (sim-action commands lists more)
  rate: 10 Hz
  twist:
    - {linear: 0.5, for: 4 s}
    - {linear: 0.2, angular: 30 deg/s}   # a curve; not reached here, as the run ends at 1.5 m

expect:                         # expectations (sim-action assertions lists what they can be)
  - travel: {at_least: 1.5 m}   # a goal: it must come true once; the run ends when all goals are met
    before: 5 s                 # deadline of this goal
  - no_collision                # an invariant: it must always hold; the run ends when it is broken
  - max_speed: {linear: 0.6 m/s}

time_limit: 20 s                # sim time at which the scenario fails if a goal is not met
"""

_ARM: Final = """\
# yaml-language-server: $schema=scenario.schema.json
# A simulation test of an arm. Run it in the folder above this one: sim-action run simulation
name: arm moves to a pose

robot:
  model: ur5e_gripper           # a built-in model (sim-action models), or the path of your .urdf, relative to this file
  joints: {shoulder_lift_joint: -90 deg}   # where joints begin; all others begin at 0

world:                          # flat ground, and a box below the gripper that the arm must not touch
  objects:
    - {name: box, box: [0.2, 0.2, 0.2], pose: {x: 0.5, y: 0.1}}

commands:                       # what moves the arm (sim-action commands lists more)
  joints:
    - {at: 1.5 s, position: {elbow_joint: 90 deg, wrist_1_joint: -90 deg, wrist_2_joint: -90 deg}}
    - {at: 2 s, position: {left_finger_joint: 40 mm}}   # 0 is open, 42.5 mm is closed; the other finger follows
  interpolation: minimum_jerk   # each motion starts and ends at rest

expect:                         # expectations (sim-action assertions lists what they can be)
  - joint: {name: elbow_joint, near: 90 deg, tolerance: 1 deg}   # a goal: it must come true once
    before: 2 s                 # deadline of this goal
  - joint: {name: right_finger_joint, near: 40 mm, tolerance: 1 mm}
  - no_collision                # an invariant: it must always hold; the run ends when it is broken
  - effort: {joints: ["shoulder_*", elbow_joint], at_most: 60 N m}

time_limit: 5 s                 # sim time at which the scenario fails if a goal is not met
"""

_LEGS: Final = """\
# yaml-language-server: $schema=scenario.schema.json
# A simulation test of a robot with legs. Run it in the folder above this one: sim-action run simulation
name: robot is pushed, keeps standing, and crouches

robot:
  model: quadruped              # a built-in model (sim-action models), or the path of your .urdf, relative to this file
  joints: {"*_thigh": 40 deg, "*_knee": -90 deg}   # where joints begin; all others begin at 0

world:                          # flat ground, and a force on the trunk
  disturbances:
    - {at: 0.5 s, for: 0.5 s, force: [0, 20 N, 0]}

commands:                       # what moves the legs (sim-action commands lists more)
  rate: 40 Hz
  joints:
    - {at: 2 s, position: {"*_thigh": 40 deg, "*_knee": -90 deg}}    # it stands
    - {at: 3 s, position: {"*_thigh": 50 deg, "*_knee": -116 deg}}   # and crouches
  interpolation: minimum_jerk   # each motion starts and ends at rest

expect:                         # expectations (sim-action assertions lists what they can be)
  - final_pose: {x: 0, y: 0, z: 22.5 cm, tolerance: 1 cm}   # judged at the end
  - upright: {max_tilt: 5 deg}  # an invariant: it must always hold; the run ends when it is broken
  - feet_on_ground: {links: ["*_foot"]}
    before: 2 s                 # while it stands
  - stay_within: {x: [-5 cm, 5 cm], y: [-5 cm, 5 cm]}

time_limit: 4 s                 # sim time at which the run ends
"""

# The tag that moves to the newest release of this major version.
_MOVING_TAG: Final = f"v{__version__.partition('.')[0]}"

_WORKFLOW: Final = f"""\
name: simulation
on: [push, pull_request]
permissions:
  contents: read
jobs:
  simulation:
    runs-on: ubuntu-latest
    steps:
      - uses: actions/checkout@3d3c42e5aac5ba805825da76410c181273ba90b1 # v7.0.1
      - uses: sim-action/sim-action@{_MOVING_TAG}
        id: simulation
        with:
          scenario: simulation
          strict: true
      # Keep the report: the files of a job are lost when it ends.
      - uses: actions/upload-artifact@043fb46d1a93c77aae656e7c1c64a875d1fc6a0a # v7.0.1
        if: ${{{{ !cancelled() && steps.simulation.outputs.output-directory != '' }}}}
        with: {{name: sim-results, path: "${{{{ steps.simulation.outputs.output-directory }}}}"}}
"""


def _scenario(robot: str) -> tuple[str, str]:
    """Return the name and the text of the scenario of a built-in robot. Raises UsageError for any other name."""
    if robot not in BUILT_IN:
        raise UsageError(
            f"--robot: unknown robot '{robot}'{did_you_mean(robot, BUILT_IN)}; for a model of your own, {_OWN}"
        )
    if robot == "ur5e_gripper":
        return "move_to_pose", _ARM
    if robot == "quadruped":
        return "keep_standing", _LEGS
    # The comment stays where it is.
    return "drive_straight", _DRIVE.replace(f"{_ROBOT:23}", f"{robot:23}")


_OWN: Final = "leave out --robot and set robot.model in the scenario"


def files(schema: str, robot: str = _ROBOT) -> dict[str, str]:
    """Path below the folder -> text of each file that `init` writes."""
    name, text = _scenario(robot)
    return {
        f"simulation/{name}.sim.yml": text,
        "simulation/scenario.schema.json": schema,
        ".github/workflows/simulation.yml": _WORKFLOW,
    }


def write_scaffold(folder: Path, schema: str, *, force: bool, robot: str = _ROBOT) -> list[Path]:
    """Write the files for a built-in robot; return their paths. Raise UsageError if one is there already."""
    targets = {folder / name: text for name, text in files(schema, robot).items()}
    existing = [str(path) for path in targets if os.path.exists(path)]  # noqa: PTH110 - a name may be too long
    if existing and not force:
        raise UsageError(f"file exists already: {', '.join(existing)}; use --force to overwrite it")
    for path, text in targets.items():
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        except OSError as error:
            raise UsageError(f"cannot write {path}: {error.strerror}") from None
    return list(targets)
