"""The private environment of the action, made from a lock file: LOCK names it, or for INPUT_EXTRAS those beside it.

    environment.py look       says what is there, and whether and where wheels are kept between runs
    environment.py install    makes the environment, once per job

Nothing is installed when this runs: it needs the standard library alone. What it says are outputs of the step.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

# They run with the rights of the base branch, and so would what they leave in its cache. The same events as in
# sim_action/core/permissions.py, which cannot be imported before the installation.
_NEVER_CACHED_ON: Final = frozenset(
    {
        *("pull_request_target", "workflow_run"),
        *("issue_comment", "issues", "discussion", "discussion_comment", "fork", "gollum", "watch"),
        *("check_run", "check_suite", "deployment", "deployment_status", "status"),
    }
)
# Each has a lock file of its own: of a name that a workflow makes up, nothing is installed.
_EXTRAS: Final = ("mcap", "rosbags", "video")
_ENTRY: Final = re.compile(r"^[^\s#].*(?:\n[ \t].*)*", re.MULTILINE)
# A job's settings of pip say where packages come from, and must not say where they go.
_PIP_VARIABLES: Final = ("PIP_PYTHON", "PIP_TARGET", "PIP_PREFIX", "PIP_ROOT", "PIP_USER", "PIP_DRY_RUN")
_PIP_OPTIONS: Final = (
    *("--quiet", "--disable-pip-version-check", "--no-input"),
    *("--require-hashes", "--only-binary", ":all:", "--no-deps"),
)


class InstallError(Exception):
    """Dependencies that could not be installed; what ran has said why."""


@dataclass(frozen=True)
class Environment:
    """The virtual environment that a lock file describes.

    Attributes:
        lock: names every wheel with its version and hash.
        folder: a virtual environment; it is complete if it holds a copy of the lock file.
        wheels: the folder of the downloaded wheels.
    """

    lock: Path
    folder: Path
    wheels: Path

    @classmethod
    def of(cls, lock: Path, temp: Path) -> Environment:
        """Two versions of the action in one job have two environments."""
        name = f"sim-action-{_digest(lock)[:12]}"
        return cls(lock, temp / name, temp / f"{name}-wheels")

    @property
    def python(self) -> Path:
        """Its interpreter."""
        return self.folder / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")

    @property
    def key(self) -> str:
        """The cache key: everything that the wheels depend on."""
        machine = f"{os.environ['RUNNER_OS']}-{os.environ['RUNNER_ARCH']}"
        return f"sim-action-{machine}-{sys.implementation.cache_tag}-{_digest(self.lock)}"

    @property
    def ready(self) -> bool:
        """Return True if an earlier step of the job has made the environment."""
        copy = self.folder / self.lock.name
        return copy.is_file() and copy.read_bytes() == self.lock.read_bytes()

    def install(self) -> bool:
        """Makes it; returns whether wheels had to be fetched. Raises InstallError."""
        if self.wheels.is_dir():
            try:
                self._unpack()
            except InstallError:
                print("The cached wheels are not those of the lock file: fetching them.")
                shutil.rmtree(self.wheels)
            else:
                return False
        _python("pip", "download", "--dest", self.wheels, *_PIP_OPTIONS, "--requirement", self.lock)
        self._unpack()
        return True

    def _unpack(self) -> None:
        # pip serves from outside: to install it into the environment would take longer than to make it.
        _python("venv", "--clear", "--without-pip", self.folder)
        # Most of what is installed is never imported, so nothing is compiled ahead.
        where = ("--no-index", "--find-links", self.wheels, "--requirement", self.lock)
        _python("pip", "--isolated", "--python", self.python, "install", "--no-compile", *_PIP_OPTIONS, *where)
        # Last: with it, the environment is complete.
        shutil.copy(self.lock, self.folder)


def look(environment: Environment) -> dict[str, object]:
    """Return the facts that the next steps need."""
    wanted = os.environ.get("INPUT_CACHE", "false")
    if wanted not in {"true", "false"}:
        sys.exit("::error title=sim-action::the input cache must be true or false")
    cached = wanted == "true" and os.environ.get("GITHUB_EVENT_NAME") not in _NEVER_CACHED_ON
    return {
        "wheels": environment.wheels,
        "key": environment.key,
        "ready": environment.ready,
        "cache": cached and not environment.ready,
        "at": time.time(),
    }


def install(environment: Environment) -> dict[str, object]:
    """Install the environment and return the work that was done, with its times.

    READY in the environment variables states what existed before any cache was restored.
    """
    began = time.time()
    ready = os.environ.get("READY", str(environment.ready).lower()) == "true"
    fetched = not ready and environment.install()
    if not ready:
        size = sum(wheel.stat().st_size for wheel in environment.wheels.iterdir()) / 1e6
        print(f"Installed {size:.0f} MB of wheels in {time.time() - began:.0f} s.")
    return {"python": environment.python, "fetched": fetched, "began": began, "ended": time.time()}


def _python(module: str, *arguments: str | Path) -> None:
    # pip starts a second interpreter, which -I does not reach.
    foreign = {"PYTHONPATH", "PYTHONHOME", *_PIP_VARIABLES}
    variables = {name: value for name, value in os.environ.items() if name not in foreign}
    variables["PIP_REQUIRE_VIRTUALENV"] = "0"
    process = subprocess.run([sys.executable, "-I", "-m", module, *arguments], env=variables, check=False)
    if process.returncode:
        raise InstallError


def _digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


def _say(outputs: dict[str, object]) -> None:
    """Booleans as expressions compare them, times in whole milliseconds."""
    with Path(os.environ["GITHUB_OUTPUT"]).open("a", encoding="utf-8", newline="\n") as file:
        for name, value in outputs.items():
            text = str(value).lower() if isinstance(value, bool) else value
            file.write(f"{name}={text:.3f}\n" if isinstance(text, float) else f"{name}={text}\n")


def chosen_lock(temp: Path) -> Path:
    """Return the lock file to install; the locks of several extras are joined in a new folder."""
    lock = Path(os.environ["LOCK"])
    extras = sorted(set(re.split(r"[\s,]+", os.environ.get("INPUT_EXTRAS", ""))) - {""})
    if not set(extras) <= set(_EXTRAS):
        sys.exit(f"::error title=sim-action::the input extras must be empty, or some of {', '.join(_EXTRAS)}")
    locks = [lock.with_name(f"{lock.stem}-{extra}{lock.suffix}") for extra in extras] or [lock]
    if len(locks) == 1:
        return locks[0]
    joined = temp / f"{lock.stem}-{'-'.join(extras)}{lock.suffix}"
    joined.write_text(_joined(locks), encoding="utf-8", newline="\n")
    return joined


def _joined(locks: Iterable[Path]) -> str:
    """Return the lines of several lock files that agree: one per package, followed by its hashes."""
    found = (_ENTRY.findall(lock.read_text(encoding="utf-8")) for lock in locks)
    entries = (entry for those in found for entry in those)
    return "".join(f"{entry}\n" for entry in dict.fromkeys(entries))


def main() -> None:
    """Run the action that the one argument names."""
    temp = Path(os.environ["RUNNER_TEMP"])
    environment = Environment.of(chosen_lock(temp), temp)
    try:
        _say({"look": look, "install": install}[sys.argv[1]](environment))
    except InstallError:
        sys.exit("::error title=sim-action::the dependencies could not be installed; the log above says why")


if __name__ == "__main__":
    main()
