"""The private environment of the actions: the packages of a lock file, in a virtual environment without pip.

    environment.py look            prints the plan: the engines to install, what exists already, and the cache to use
    environment.py install         makes the environment, unless an earlier step of the job has made it
    environment.py add FOLDER ...  installs an engine that was left out, when it is first imported

LOCK names the lock file; for INPUT_EXTRAS, the lock files next to it are used. The packages of extras have a cache of
their own, so that jobs with and without them share the other one. This needs the standard library alone. `look` and
`install` write outputs of their step.
"""

from __future__ import annotations

if __name__ == "__main__":
    import sys
    from pathlib import Path

    # -I leaves out the folder of this file.
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import hashlib
import json
import os
import shutil
import sys
import sysconfig
import tempfile
import time
import uuid
import venv
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

from action import lock as locks
from action import placeholder, wheels
from action.asked_engines import asked_engines
from action.lock import Entry, LockError
from action.wheels import InstallError, Target, WheelError

# These events have the rights of the base branch, and could leave files in its cache. They are the same as in
# sim_action/core/permissions.py, which is not imported here: the installation must not depend on it.
NEVER_CACHED_ON: Final = frozenset(
    {
        *("pull_request_target", "workflow_run"),
        *("issue_comment", "issues", "discussion", "discussion_comment", "fork", "gollum", "watch"),
        *("check_run", "check_suite", "deployment", "deployment_status", "status"),
    }
)
_PREFIX: Final = "sim-action-"
_MARKER: Final = "requirements.lock"
_CACHE: Final = ".cache/sim-action-wheels"
_MAX_UNUSED_S: Final = 30 * 86_400.0
_TITLE: Final = "::error title=sim-action::"


@dataclass(frozen=True)
class Plan:
    """The decisions of `look`, which `install` carries out.

    Attributes:
        ready: the folder of a complete environment that an earlier step of the job has made; empty: there is none.
        left_out: the engines that are not installed.
        kept: the folder of the wheels that are cached, from `~`; empty: nothing is cached.
        kept_extras: the same for the packages of extras.
    """

    ready: str
    left_out: tuple[str, ...]
    kept: str
    kept_extras: str = ""

    def text(self) -> str:
        """Return the plan as JSON of one line."""
        return json.dumps(asdict(self))

    @classmethod
    def parse(cls, text: str) -> Plan:
        """Return the plan of a text."""
        values = json.loads(text)
        return cls(**{**values, "left_out": tuple(values["left_out"])})


def look(
    packages: Sequence[Entry], temp: Path, variables: Mapping[str, str], extras: Sequence[Entry] = ()
) -> dict[str, object]:
    """Return the outputs that the next steps need. Raises LockError.

    `packages`: all of the lock files but `extras`, the packages that extras add. `temp`: RUNNER_TEMP.
    """
    setting = variables.get("INPUT_CACHE", "false")
    if setting not in {"true", "false"}:
        raise LockError("the input cache must be true or false")
    available = locks.engines_of(packages)
    asked = asked_engines(variables) & set(available) if len(available) > 1 else ()
    left_out = tuple(engine for engine in available if asked and engine not in asked)
    chosen = locks.without_engines(packages, left_out)
    ready = _ready((*chosen, *extras), temp)
    is_cached = setting == "true" and variables.get("GITHUB_EVENT_NAME") not in NEVER_CACHED_ON and bool(_home())
    kept, kept_extras = (
        f"~/{_CACHE}/{locks.digest(part)[:16]}" if is_cached and part else "" for part in (chosen, extras)
    )
    outputs: dict[str, object] = {"plan": Plan(str(ready or ""), left_out, kept, kept_extras).text(), "at": time.time()}
    for name, part, folder in (("", chosen, kept), ("-extras", extras, kept_extras)):
        restores = bool(folder) and not ready and not wheels.are_there(part, Path(folder).expanduser())
        outputs |= {f"cache{name}": restores, f"wheels{name}": folder, f"key{name}": key(part, variables)}
    return outputs


def folder_problem(name: str) -> str | None:
    """Return the problem with the working directory, as data of a workflow command; None if it is a folder."""
    try:
        if not name.strip() or Path(name.strip()).is_dir():
            return None
    except (OSError, ValueError):
        pass
    # Text of a workflow: GitHub also obeys `##[command]` inside a line.
    shown = ascii(name.strip()).replace("%", "%25").replace("##[", "# #[")
    return f"the input working-directory: there is no folder {shown}; name one that is checked out, from its top"


def key(packages: Sequence[Entry], variables: Mapping[str, str]) -> str:
    """Return the cache key: everything that the wheels depend on, and where they lie as seen from the workspace.

    A cache holds paths that are relative to the workspace. On runners where the home folder lies elsewhere from there,
    they would lead to another folder.
    """
    machine = f"{variables['RUNNER_OS']}-{variables['RUNNER_ARCH']}-{sys.implementation.cache_tag}"
    content = "-".join(locks.engines_of(packages)) or "no-engine"
    try:
        place = os.path.relpath(_home() or ".", variables.get("GITHUB_WORKSPACE") or ".")
    except ValueError:  # another drive
        place = _home()
    position = hashlib.sha256(place.replace(os.sep, "/").encode()).hexdigest()[:8]
    return f"{_PREFIX}{machine}-{content}-{locks.digest(packages)}-{position}"


def install(packages: Sequence[Entry], plan: Plan, temp: Path, extras: Sequence[Entry] = ()) -> dict[str, object]:
    """Install the packages that the plan leaves, and return the outputs of the step. Raises InstallError, OSError."""
    began = time.time()
    fetched = fetched_extras = False
    if plan.ready:
        folder = Path(plan.ready)
    else:
        chosen = locks.without_engines(packages, plan.left_out)
        # The name is new each time: no other process has or gets this folder, and it holds nothing of a cache.
        folder = Path(tempfile.mkdtemp(dir=temp, prefix=f"{_PREFIX}{locks.digest((*chosen, *extras))[:12]}-"))
        try:
            venv.EnvBuilder(symlinks=sys.platform != "win32", with_pip=False).create(folder)
            size, fetched = _filled(folder, chosen, plan.kept, temp)
            more, fetched_extras = _filled(folder, extras, plan.kept_extras, temp) if extras else (0, False)
        except BaseException:
            shutil.rmtree(folder, ignore_errors=True)
            raise
        placeholders = [entry for entry in packages if entry not in chosen]
        _complete(folder, (*chosen, *extras), placeholders)
        print(f"Installed {(size + more) / 1e6:.0f} MB of wheels in {time.time() - began:.1f} s ({_content(chosen)}).")
    done = {"fetched": fetched, "fetched-extras": fetched_extras}
    return {"python": _python(folder), **done, "began": began, "ended": time.time()}


def _content(packages: Sequence[Entry]) -> str:
    has_ros = any(entry.name == "ros-rclpy" for entry in packages)
    return "ROS 2" if has_ros else ", ".join(locks.engines_of(packages)) or "no engine"


def add(folder: Path, lock: Path, engine: str) -> None:
    """Install an engine that was left out. Raises InstallError, WheelError, OSError.

    Processes that need it at the same time can do so together: each moves complete files into their place.
    """
    packages = [entry for entry in locks.entries_here([lock]) if entry.name == locks.ENGINES[engine]]
    with tempfile.TemporaryDirectory(dir=folder, prefix="adding-") as name:
        staging = Path(name, "site-packages")
        wheels.download(packages, Path(name, "wheels"))
        wheels.install(packages, Path(name, "wheels"), Target(_python(folder), dict.fromkeys(_PACKAGES, staging)))
        placeholder.replace(engine, staging, _folders(folder)["purelib"])
    present = locks.entries((folder / _MARKER).read_text(encoding="utf-8"))
    _mark(folder, tuple(dict.fromkeys((*present, *packages))))


def _filled(folder: Path, packages: Sequence[Entry], stated: str, temp: Path) -> tuple[int, bool]:
    """Unpack packages into an environment; return the size of their wheels in bytes, True if new ones are to be cached.

    `stated`: the folder of their wheels that is cached, or empty.
    """
    target = Target(_python(folder), _folders(folder))
    kept = Path(stated).expanduser() if stated else None
    if kept and wheels.are_there(packages, kept):
        try:
            size = wheels.install(packages, kept, target)
        except (WheelError, OSError) as error:
            print(f"The cached wheels are not those of the lock file, and are downloaded again: {error}")
            shutil.rmtree(kept, ignore_errors=True)
        else:
            _remove_unused(kept)
            return size, False
    with tempfile.TemporaryDirectory(dir=temp, prefix=f"{_PREFIX}wheels-") as name:
        downloaded = Path(name)
        wheels.download(packages, downloaded)
        return wheels.install(packages, downloaded, target), kept is not None and _keep(downloaded, kept)


def _keep(downloaded: Path, kept: Path) -> bool:
    """Copy wheels into the folder that is cached, each in one step; return True if that was possible."""
    try:
        kept.mkdir(parents=True, exist_ok=True)
        for wheel in downloaded.iterdir():
            part = kept / f".{wheel.name}.{uuid.uuid4().hex}"
            shutil.copyfile(wheel, part)
            part.replace(kept / wheel.name)
    except OSError as error:
        print(f"The wheels are not cached: {error}")
        return False
    return True


def _remove_unused(kept: Path) -> None:
    """Remove the wheels of other installations that no job has used for a month; only self-hosted runners keep any."""
    try:
        os.utime(kept)
        old = [folder for folder in kept.parent.iterdir() if folder.stat().st_mtime < time.time() - _MAX_UNUSED_S]
    except OSError:
        return  # another job removes them, too
    for folder in old:
        shutil.rmtree(folder, ignore_errors=True)


def _complete(folder: Path, packages: Sequence[Entry], left_out: Sequence[Entry]) -> None:
    """Add placeholders for the engines that were left out, and mark the environment as complete."""
    (folder / "left-out.lock").write_text(locks.text_of(left_out), encoding="utf-8", newline="\n")
    for engine in locks.engines_of(left_out):
        command = [sys.executable, "-I", str(Path(__file__).resolve()), "add", str(folder), engine]
        version = next(entry.version for entry in left_out if entry.name == locks.ENGINES[engine])
        placeholder.write(engine, locks.ENGINES[engine], version, command, _folders(folder)["purelib"])
    _mark(folder, packages)


def _mark(folder: Path, packages: Sequence[Entry]) -> None:
    """Write the lock file of the packages that are installed; an environment with this file is complete."""
    part = folder / f"{_MARKER}.{os.getpid()}"
    part.write_text(locks.text_of(packages), encoding="utf-8", newline="\n")
    part.replace(folder / _MARKER)


def _ready(packages: Sequence[Entry], temp: Path) -> Path | None:
    """Return an environment of this job that has all of the packages, the one with the fewest others."""
    environments = []
    for marker in sorted(temp.glob(f"{_PREFIX}*/{_MARKER}")):
        try:
            present = set(locks.entries(marker.read_text(encoding="utf-8")))
        except (OSError, ValueError, LockError):
            continue
        if present >= set(packages) and _python(marker.parent).exists():
            environments.append((len(present), marker.parent))
    return min(environments, default=(0, None))[1]


_PACKAGES: Final = ("purelib", "platlib")


def _folders(folder: Path) -> dict[str, Path]:
    """Return the folders of an environment by the kind of files that they are for."""
    places = {"base": str(folder), "platbase": str(folder), "installed_base": str(folder)}
    paths = sysconfig.get_paths("venv", {**places, "installed_platbase": str(folder)})
    return {kind: Path(paths[kind]) for kind in (*_PACKAGES, "scripts", "data")}


def _python(folder: Path) -> Path:
    return folder / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")


def _home() -> str:
    """Return the home folder; empty if there is none."""
    home = os.path.expanduser("~")  # noqa: PTH111 - Path.home() raises where there is none
    return "" if home == "~" else home


def say(outputs: Mapping[str, object]) -> None:
    """Write outputs: booleans as expressions compare them, times in milliseconds."""
    with Path(os.environ["GITHUB_OUTPUT"]).open("a", encoding="utf-8", newline="\n") as file:
        for name, value in outputs.items():
            text = str(value).lower() if isinstance(value, bool) else value
            file.write(f"{name}={text:.3f}\n" if isinstance(text, float) else f"{name}={text}\n")


def main() -> None:
    """Run the subcommand that the first argument names."""
    try:
        if sys.argv[1] == "add":
            folder = Path(sys.argv[2])
            add(folder, folder / "left-out.lock", sys.argv[3])
            return
        temp = Path(os.environ["RUNNER_TEMP"])
        lock = Path(os.environ["LOCK"])
        chosen = locks.chosen_locks(lock, os.environ.get("INPUT_EXTRAS", ""))
        packages = locks.entries_here([lock])
        extras = [entry for entry in locks.entries_here(chosen) if entry not in packages]
        if sys.argv[1] == "look":
            # Before a download, and before a cache is saved.
            if problem := folder_problem(os.environ.get("INPUT_WORKING_DIRECTORY", "")):
                print(f"{_TITLE}{problem}")
                sys.exit(2)
            say(look(packages, temp, os.environ, extras))
        else:
            say(install(packages, Plan.parse(os.environ["PLAN"]), temp, extras))
    except LockError as error:
        sys.exit(f"{_TITLE}{error}")
    except InstallError:
        sys.exit(f"{_TITLE}the dependencies could not be installed; the log above says why")
    except (WheelError, OSError) as error:
        sys.exit(f"{_TITLE}the dependencies could not be installed: {error}")


if __name__ == "__main__":
    main()
