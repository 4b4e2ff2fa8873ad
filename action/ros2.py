"""ROS 2 for the action's input `ros2`: the runner's, else wheels in an environment of their own.

    ros2.py look      prints the ROS 2 of the runner, or the plan of the installation and the cache to use
    ros2.py install   installs the wheels of the lock file that LOCK names
    ros2.py messages  builds the messages that the scenarios of INPUT_SCENARIO need

The first two write outputs of their step, and need the standard library alone; the last one needs sim-action.
"""

from __future__ import annotations

if __name__ == "__main__":
    import sys
    from pathlib import Path

    # -I leaves out the folder of this file.
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from action import environment
from action import lock as locks
from action.lock import LockError
from action.wheels import InstallError, WheelError
from sim_action.core.errors import UsageError
from sim_action.ros.ros2.installation import PYTHON_VARIABLE, NotInstalled, Ros2, find_ros

LOCKS: Final = {"jazzy": "requirements-ros2.lock", "kilted": "requirements-ros2-kilted.lock"}
"""Distribution -> the lock file of its wheels. `true` takes the first one."""

_MESSAGES: Final = "requirements-ros2-messages.lock"
_ANY: Final = "true"
_WITH_WHEELS: Final = ("Linux", "X64")
_TITLE: Final = "::error title=sim-action::"


def look(folder: Path, variables: Mapping[str, str]) -> dict[str, object]:
    """Return the outputs that the next steps need. Raise UsageError, LockError.

    `folder`: the one with the lock files.
    """
    setting = variables["INPUT_ROS2"]
    if setting not in (_ANY, *LOCKS):
        raise UsageError(f"the input ros2 must be true, {', '.join(LOCKS)} or false; found '{setting}'")
    ros = _present(setting, variables)
    if ros is not None:
        print(f"ROS 2: {ros}")
        return {"lock": "", "cache": False}
    distribution = next(iter(LOCKS)) if setting == _ANY else setting
    runner = (variables["RUNNER_OS"], variables["RUNNER_ARCH"])
    if runner != _WITH_WHEELS:
        raise UsageError(
            f"ros2: {setting} needs a runner with Linux x86-64, such as ubuntu-latest, or one with ROS 2 "
            f"({' or '.join(LOCKS)}), such as the container ros:{distribution}; this one is {' '.join(runner)}"
        )
    lock = folder / LOCKS[distribution]
    return {"lock": lock, **environment.look(locks.entries_here([lock]), Path(variables["RUNNER_TEMP"]), variables)}


def _present(setting: str, variables: Mapping[str, str]) -> Ros2 | None:
    """Return the ROS 2 of the runner; None if there is none, or none of the distribution of this setting."""
    try:
        ros = find_ros(variables)
    except NotInstalled:
        return None
    except UsageError as error:
        if setting == _ANY:
            raise UsageError(f"{error}; set ros2: {next(iter(LOCKS))} to use the wheels") from None
        return None
    return ros if setting in (_ANY, ros.distribution) else None


def install(lock: Path, variables: Mapping[str, str]) -> dict[str, object]:
    """Install the wheels, and return the outputs of the step. Raise UsageError, InstallError, WheelError, OSError."""
    plan = environment.Plan.parse(variables["PLAN"])
    outputs = environment.install(locks.entries_here([lock]), plan, Path(variables["RUNNER_TEMP"]))
    print(f"ROS 2: {find_ros({PYTHON_VARIABLE: str(outputs['python'])})}")
    return outputs


def messages(locks_folder: Path, variables: Mapping[str, str]) -> int:
    """Return the exit code of `sim-action ros2 prepare` for the scenarios; 0 if they need nothing, or may not run code.

    SETUP_PYTHON is an interpreter with pip: it installs the generators into the environment of ROS 2.
    """
    # The other subcommands run before sim-action's dependencies are installed.
    from sim_action.core.permissions import scripts_refused
    from sim_action.core.workspace import discover
    from sim_action.ros.ros2.preparation import needed_by

    os.chdir(variables["INPUT_WORKING_DIRECTORY"].strip())
    names = [line.strip() for line in variables["INPUT_SCENARIO"].split("\n") if line.strip()] or ["."]
    folders = needed_by(path for paths in discover(names).values() for path in paths)
    allowed = variables["INPUT_ALLOW_SCRIPTS"].strip()
    if not folders or allowed not in ("true", "auto"):
        return 0
    if allowed == "auto" and scripts_refused("auto", variables, (Path.cwd(), *folders)):
        return 0
    environment_folder = str(Path(variables[PYTHON_VARIABLE]).parent.parent)
    pip = [variables["SETUP_PYTHON"], "-I", "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    pip += ["--no-deps", "--require-hashes", "--ignore-installed", "--prefix", environment_folder, "--requirement"]
    subprocess.run([*pip, locks_folder / _MESSAGES], check=True)
    words = [f"--scenario={name}" for name in names] + [f"--allow-scripts={allowed}"]
    words += [f"--pass-env={line.strip()}" for line in variables["INPUT_PASS_ENV"].split("\n") if line.strip()]
    return subprocess.run([sys.executable, "-P", "-m", "sim_action", "ros2", "prepare", *words], check=False).returncode


def main() -> None:
    """Run the subcommand that the first argument names. Exit with 2 if it is not possible."""
    try:
        locks_folder = Path(__file__).resolve().parent / "locks"
        if sys.argv[1] == "look":
            environment.say(look(locks_folder, os.environ))
        elif sys.argv[1] == "messages":
            sys.exit(messages(locks_folder, os.environ))
        else:
            environment.say(install(Path(os.environ["LOCK"]), os.environ))
    except (UsageError, LockError) as error:
        print(f"{_TITLE}{error}", file=sys.stderr)
        sys.exit(2)
    except (InstallError, subprocess.CalledProcessError):
        sys.exit(f"{_TITLE}ROS 2 could not be installed; the log above says why")
    except (WheelError, OSError) as error:
        sys.exit(f"{_TITLE}ROS 2 could not be installed: {error}")


if __name__ == "__main__":
    main()
