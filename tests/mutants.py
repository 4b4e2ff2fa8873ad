"""Changes lines of sim_action at random, and lists the changes that no test notices: `make mutants`.

    python -m tests.mutants --sample 100 --seed 7

Each change, a mutant, is made in a copy of the repository. Tests of the same module run first, then those of its
folder, and so on. The first that fails twice ends the search. A test that also fails without the mutant is left out. A
mutant that means the same as the original is listed with its reason in `equivalent_mutants.toml`, and is not drawn.

mutmut and cosmic-ray are not used: they draw no sample per folder, and mutmut needs tests in one process.
"""

from __future__ import annotations

import argparse
import difflib
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import count, islice
from pathlib import Path
from queue import SimpleQueue
from threading import Event
from typing import Final

import pytest

from tests.mutations import Mutant, mutants

ROOT: Final = Path(__file__).parents[1]
EQUIVALENT: Final = ROOT / "tests/equivalent_mutants.toml"
LEAST_SHARE: Final = 0.92
_FAILED: Final = re.compile(r"^(?:FAILED|ERROR) (\S+?::.*?|\S+)(?: - .*)?$", re.MULTILINE)
# No test is that long, on a busy machine either.
_SILENCE_S: Final = 300.0
_LOOK_EVERY_S: Final = 0.1
_stopped: Final = Event()
_WHOLE: Final = ("tests", "-m", "not process", "--ignore", "tests/integration")
# Files of tests/integration that look at a folder; those of ROS take minutes.
INTEGRATION: Final = {
    "app": "cli suites inspect templates shards watch",
    "assertions": "temporal_logic signals driven_worlds suites selecting_nothing still_green verdicts_of_runs",
    "cli": "cli suites shards inspect",
    "commands": "probe motor_work joint_trajectories moving_worlds stated_faults robots",
    "core": "cli bad_models execution probe",
    "drives": "drives moving_worlds odometry wheel_limits robots",
    "engines": "backends joint_physics physics pybullet clearances rays worlds moving_worlds meshes "
    "engine_tables motor_work driven_worlds sensors_of_robots camera native_robots bolted_contacts "
    "contact_limits joint_damping engine_differences",
    "meshes": "meshes mesh_cache",
    "networks": "policies",
    "recording": "recordings replay replayed_links filming report_in_browser",
    "reports": "cli suites report_in_browser replay",
    "results": "cli suites shards repeats verdicts_of_runs kept_verdicts resume",
    "robot": "robots bad_models sdf native_robots meshes inspect templates",
    "ros": "ros1_processes ros1_launches ros1_scenarios ros1",
    "runner": "execution processes repeats golden_runs killers resource_guards shards inspection_process "
    "kept_verdicts resume interruptions injected_faults",
    "scenario": "cli suites worlds moving_worlds watch selecting_nothing",
    "sensors": "sensors_of_robots camera odometry rays",
    "simulation": "execution physics stated_faults driven_worlds odometry templates golden_runs tunnelling "
    "pinned_robots accuracy_notes jumps verdicts_of_runs preloading",
    "state": "repeats golden_runs signals recordings",
    "world": "worlds moving_worlds meshes",
}


@dataclass(slots=True)
class Copy:
    """A copy of the repository, in which one mutant at a time is made."""

    folder: Path
    _clock: Iterator[int] = field(default_factory=lambda: count(1_000_000_000, 10))

    @classmethod
    def of_repository(cls, folder: Path) -> Copy:
        listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
        viewer = "sim_action/reports/viewer/viewer3d.json"
        for name in {*listed.split("\0"), viewer}:
            if name and (ROOT / name).is_file():
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(ROOT / name, folder / name)
        return cls(folder)

    def write(self, file: str, text: str) -> None:
        """Write a file with a time of its own: Python knows its bytecode by seconds and size."""
        path = self.folder / file
        path.write_text(text, encoding="utf-8")
        os.utime(path, (now := next(self._clock), now))

    def first_failure(self, *arguments: str) -> str | None:
        """Run tests up to the first that fails, and return its name; None: none fails."""
        options = ("-n", "0", "-q", "-x", "-p", "no:cacheprovider", "-rfE", "--tb=no", "--no-header")
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as scratch:
            environment = {**os.environ, "PYTHONPATH": str(self.folder), "TMPDIR": scratch}
            output = Path(scratch) / "output.txt"
            with output.open("wb") as words:
                tests = subprocess.Popen(
                    [sys.executable, "-u", "-m", "pytest", *options, *arguments],
                    cwd=self.folder,
                    env=environment,
                    stdout=words,
                    stderr=subprocess.STDOUT,
                    start_new_session=True,
                )
            code = _exit_code(tests, output)
            printed = output.read_text(encoding="utf-8", errors="replace")
        if code is None:
            return f"no test ended for {_SILENCE_S:.0f} s"
        if code in (0, 5):
            return None
        if code == pytest.ExitCode.USAGE_ERROR:
            raise FileNotFoundError(printed)
        found = _FAILED.search(printed)
        return found[1] if found else f"exit {code}: {printed[-200:].strip()}"


def _exit_code(tests: subprocess.Popen[bytes], output: Path) -> int | None:
    """Wait for tests, and end what they leave behind; None if they were silent for too long."""
    size, since = 0, time.monotonic()
    try:
        while tests.poll() is None:
            time.sleep(_LOOK_EVERY_S)
            if (now := output.stat().st_size) != size:
                size, since = now, time.monotonic()
            if _stopped.is_set() or time.monotonic() - since > _SILENCE_S:
                return None
        return tests.returncode
    finally:
        with suppress(ProcessLookupError):
            os.killpg(tests.pid, signal.SIGKILL)
        tests.wait()


class Hunt:
    """Looks for a test that notices a mutant; `fails_anyway` fail without any."""

    def __init__(self, clean: Copy, most_stages: int = 4) -> None:
        self._clean = clean
        self._most_stages = most_stages
        self._sound: set[str] = set()
        self.fails_anyway: set[str] = set()

    def noticed_by(self, mutant: Mutant, copy: Copy) -> str | None:
        """Return the first test that fails because of a mutant; None: no test fails."""
        copy.write(mutant.file, mutant.applied())
        try:
            near = islice(stages(mutant.file), self._most_stages)
            return next((found for tests in near if (found := self._failure(copy, tests))), None)
        finally:
            copy.write(mutant.file, mutant.source)

    def _failure(self, copy: Copy, tests: Sequence[str]) -> str | None:
        by_chance: set[str] = set()
        while True:
            left_out = [argument for name in {*self.fails_anyway, *by_chance} for argument in ("--deselect", name)]
            failed = copy.first_failure(*tests, *left_out)
            if failed is None or "::" not in failed:
                return failed
            if not self._passes_otherwise(failed):
                self.fails_anyway.add(failed)
            elif copy.first_failure(failed) is None:
                by_chance.add(failed)
            else:
                return failed

    def _passes_otherwise(self, test: str) -> bool:
        if test not in self._sound and self._clean.first_failure(test) is None:
            self._sound.add(test)
        return test in self._sound


def stages(file: str) -> Iterator[tuple[str, ...]]:
    """Yield arguments for pytest, from the tests nearest to a module to those far away; none runs twice in vain."""
    top, *_ = parts = Path(file).relative_to("sim_action").with_suffix("").parts
    if parts[-1] == "__init__":
        parts = parts[:-1]
    module = r"\.".join(("sim_action", *parts))
    folder, name = "/".join(parts[:-1]), parts[-1] if parts else ""
    near = {str(path.relative_to(ROOT)) for path in (ROOT / "tests" / folder).glob(f"test_{name}*.py")}
    imports = re.compile(rf"\b{module}\b(?!\.)|from {module.rpartition(chr(92))[0]} import [^\n]*\b{name}\b")
    for path in (ROOT / "tests").rglob("test_*.py"):
        if "integration" not in path.parts and imports.search(path.read_text(encoding="utf-8")):
            near.add(str(path.relative_to(ROOT)))
    if near:
        yield tuple(sorted(near, key=lambda test: (not test.startswith(f"tests/{folder}"), test)))
    if (ROOT / "tests" / top).is_dir():
        yield (f"tests/{top}", *(argument for test in sorted(near) for argument in ("--ignore", test)))
    if integration := [f"tests/integration/test_{name}.py" for name in INTEGRATION.get(top, "cli").split()]:
        yield tuple(integration)
    yield (*_WHOLE, "--ignore", f"tests/{top}")


def drawn(sample: int, seed: int, only: str) -> list[Mutant]:
    """Return mutants of as many lines, spread evenly over the folders; each line is as likely as another."""
    rng = random.Random(seed)
    table = equivalent()
    known = {(entry["file"], entry["line"], entry["becomes"]) for entry in table}
    files = {entry["file"] for entry in table}
    lines: list[list[Mutant]] = []
    for path in sorted((ROOT / "sim_action").rglob("*.py")):
        file = str(path.relative_to(ROOT))
        if file.startswith(only):
            text = path.read_text(encoding="utf-8")
            by_line: dict[int, list[Mutant]] = {}
            for mutant in mutants(file, text):
                if file not in files or (file, *mutant.difference()) not in known:
                    by_line.setdefault(mutant.line, []).append(mutant)
            lines += by_line.values()
    # By folder, in a random order within each one: every n-th is an even spread.
    lines.sort(key=lambda found: (found[0].file.split("/")[1], rng.random()))
    sample = min(sample, len(lines))
    first = rng.random()
    chosen = [lines[int((number + first) * len(lines) / sample)] for number in range(sample)]
    rng.shuffle(chosen)
    return [rng.choice(found) for found in chosen]


def equivalent() -> list[dict[str, str]]:
    """Return the table of mutants that mean the same as the original."""
    table: list[dict[str, str]] = tomllib.loads(EQUIVALENT.read_text(encoding="utf-8")).get("mutant", [])
    return table


def diff(mutant: Mutant) -> str:
    """Return what a mutant changes, as lines of a diff."""
    lines = difflib.unified_diff(mutant.source.splitlines(), mutant.applied().splitlines(), lineterm="", n=0)
    return "\n".join(f"    {line}" for line in lines if not line.startswith(("---", "+++", "@@")))


def main(arguments: Sequence[str] | None = None) -> int:
    """Return 1 if fewer than `LEAST_SHARE` of the sample were noticed."""
    parser = argparse.ArgumentParser(description="list changes of sim_action that no test notices")
    parser.add_argument("--sample", type=int, default=10)
    parser.add_argument("--seed", type=int, default=random.SystemRandom().randrange(1_000_000))
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--stages", type=int, default=4, help="1: only the tests of the module itself, and so on")
    parser.add_argument("--only", default="sim_action/", help="beginning of the files' names")
    parser.add_argument("--list", action="store_true", help="show the sample, and run no test")
    options = parser.parse_args(arguments)
    # As Ctrl-C: no test goes on without this process.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    sample = drawn(options.sample, options.seed, options.only)
    print(f"{len(sample)} mutants, seed {options.seed}", flush=True)
    if options.list:
        for mutant in sample:
            print(f"{mutant.file}:{mutant.line}\n{diff(mutant)}")
        return 0
    survivors = hunt(sample, options.jobs, options.stages)
    noticed = len(sample) - len(survivors)
    print(f"\nnoticed: {noticed} of {len(sample)} ({noticed / max(len(sample), 1):.0%}), seed {options.seed}")
    for mutant in sorted(survivors):
        print(f"not noticed: {mutant.file}:{mutant.line}\n{diff(mutant)}")
    return int(noticed < LEAST_SHARE * len(sample))


def hunt(sample: Iterable[Mutant], jobs: int, most_stages: int) -> list[Mutant]:
    """Return the mutants that no test notices."""
    survivors: list[Mutant] = []
    with tempfile.TemporaryDirectory(prefix="mutants-") as scratch:
        copies = SimpleQueue[Copy]()
        for number in range(jobs):
            copies.put(Copy.of_repository(Path(scratch) / str(number)))
        found = Hunt(Copy.of_repository(Path(scratch) / "clean"), most_stages)

        def examine(mutant: Mutant) -> None:
            copy, start = copies.get(), time.monotonic()
            try:
                test = found.noticed_by(mutant, copy)
            finally:
                copies.put(copy)
            if test is None:
                survivors.append(mutant)
            told = f"noticed by {test}" if test else f"NOT NOTICED\n{diff(mutant)}"
            print(f"{mutant.file}:{mutant.line} {time.monotonic() - start:.0f} s: {told}", flush=True)

        with ThreadPoolExecutor(jobs) as pool:
            try:
                list(pool.map(examine, sample))
            except BaseException:
                signal.signal(signal.SIGTERM, signal.SIG_IGN)
                _stopped.set()
                pool.shutdown(cancel_futures=True)
                raise
        for name in sorted(found.fails_anyway):
            print(f"left out, because it fails in a copy without any change: {name}")
    return survivors


if __name__ == "__main__":
    sys.exit(main())
