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
_TEMPLATES: Final = Path(__file__).with_name("scaffold")
_OTHERS: Final = {"ur5e_gripper": "move_to_pose", "quadruped": "keep_standing"}
"""Built-in robot -> its template; all others drive straight."""

_OWN: Final = "leave out --robot and set robot.model in the scenario"


def files(schema: str, robot: str = _ROBOT) -> dict[str, str]:
    """Path below the folder -> text of each file that `init` writes. Raises UsageError for an unknown robot."""
    if robot not in BUILT_IN:
        raise UsageError(
            f"--robot: unknown robot '{robot}'{did_you_mean(robot, BUILT_IN)}; for a model of your own, {_OWN}"
        )
    name = _OTHERS.get(robot, "drive_straight")
    # The comment behind the name of the robot stays where it is; the tag moves to the newest release of this version.
    scenario = _template(name).replace(f"{_ROBOT:23}", f"{robot:23}")
    workflow = _template("workflow").replace("@VERSION", f"@v{__version__.partition('.')[0]}")
    return {
        f"simulation/{name}.sim.yml": scenario,
        "simulation/scenario.schema.json": schema,
        ".github/workflows/simulation.yml": workflow,
    }


def _template(name: str) -> str:
    return (_TEMPLATES / f"{name}.template").read_text(encoding="utf-8")


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
