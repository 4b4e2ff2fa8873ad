"""Changes lines of sim_action at random, and lists the changes that no test notices: `make mutants`.

    python -m tests.mutants --sample 100 --seed 7

Each change, a mutant, is made in a copy of the repository. One run of the suite finds the tests that reach each place;
these run, the quickest first. A mutant is noticed by a test that fails, passes without the mutant, and fails
again with it. A mutant that means the same as the original is listed with its reason in `equivalent_mutants.toml`, and
is not drawn.

mutmut and cosmic-ray are not used: they draw no sample per folder, and mutmut needs tests in one process.
"""

from __future__ import annotations

import argparse
import difflib
import json
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
from itertools import count
from pathlib import Path
from queue import SimpleQueue
from threading import Event
from typing import Final

import pytest

from sim_action.ros.ros2.installation import PYTHON_VARIABLE
from tests.mutations import Mutant, mutants
from tests.reached_places import durations_s, insert_probes, reaching
from tests.ros.ros2.nodes import WHEELS

ROOT: Final = Path(__file__).parents[1]
EQUIVALENT: Final = ROOT / "tests/equivalent_mutants.toml"
LEAST_SHARE: Final = 0.92
_FAILED: Final = re.compile(r"^(?:FAILED|ERROR) (?!.*\[ *\d+%\]$).*$", re.MULTILINE)
_BEGAN: Final = re.compile(r"^(tests/\S+::.*?) *\Z", re.MULTILINE)
# No test is that long, on a busy machine either.
_SILENCE_S: Final = 300.0
_LOOK_EVERY_S: Final = 0.1
_WORKERS_PER_JOB: Final = 3
# What is noticed in a part needs no later one: processes take most of the time of the suite.
_PARTS: Final = (
    ("tests", "-m", "not process", "--ignore", "tests/integration"),
    ("tests", "-m", "process", "--ignore", "tests/integration"),
    ("tests/integration",),
)
_stopped: Final = Event()


@dataclass(frozen=True, slots=True)
class Failure:
    """A test that failed, or None if pytest failed before the first, and why."""

    test: str | None
    reason: str


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

    def first_failure(self, tests: Sequence[str], *options: str) -> Failure | None:
        """Run tests, in this order, up to the first that fails."""
        options = ("-n", "0", "-v", "-x", "-rfE", "--tb=no", "--no-header", *options)
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as scratch:
            code, printed = self.tested(Path(scratch), tests, *options)
            if code in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED):
                return None
            if code == pytest.ExitCode.USAGE_ERROR:
                raise FileNotFoundError(printed)
            names = Path(scratch) / "cache/v/cache/lastfailed"
            failed = list(json.loads(names.read_text(encoding="utf-8"))) if names.exists() else []
        reason = next(iter(_FAILED.findall(printed)), f"exit {code}: {printed[-200:].strip()}")
        if code is None:
            reason = f"no test ended for {_SILENCE_S:.0f} s"
        # A test that ends pytest, or does not end, is the last that began.
        began = _BEGAN.search(printed)
        return Failure(failed[0] if failed else began[1] if began else None, reason)

    def tested(self, scratch: Path, tests: Sequence[str], *options: str) -> tuple[int | None, str]:
        """Run pytest, and return its exit code and what it printed; None: it was silent for too long."""
        output, names = scratch / "output.txt", scratch / "tests.txt"
        names.write_text("\n".join(tests), encoding="utf-8")
        ros2 = {PYTHON_VARIABLE: str(WHEELS)} if WHEELS.exists() else {}
        own = {"PYTHONPATH": str(self.folder), "TMPDIR": str(scratch), "COLUMNS": "400"}
        options = (*options, "-o", f"cache_dir={scratch / 'cache'}", f"@{names}")
        with output.open("wb") as words:
            process = subprocess.Popen(
                [sys.executable, "-u", "-m", "pytest", *options],
                cwd=self.folder,
                env={**ros2, **os.environ, **own},
                stdout=words,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        return _exit_code(process, output), output.read_text(encoding="utf-8", errors="replace")


def _exit_code(tests: subprocess.Popen[bytes], output: Path) -> int | None:
    """Wait for tests, and end what they leave behind; None if they were silent for too long."""
    size, since = 0, time.monotonic()
    try:
        while tests.poll() is None:
            time.sleep(_LOOK_EVERY_S)
            if (now := output.stat().st_size) != size:
                size, since = now, time.monotonic()
            if _stopped.is_set():
                raise InterruptedError("a mutant that is interrupted is not decided")
            if time.monotonic() - since > _SILENCE_S:
                return None
        return tests.returncode
    finally:
        with suppress(ProcessLookupError):
            os.killpg(tests.pid, signal.SIGKILL)
        tests.wait()


class Hunt:
    """Looks for a test that notices a mutant; `fails_anyway` fail without any."""

    def __init__(self, clean: Copy) -> None:
        self._clean = clean
        self.fails_anyway: set[str] = set()

    def noticed_by(self, mutant: Mutant, groups: Iterable[Sequence[str]], copy: Copy) -> Failure | None:
        """Return the first failure that is because of a mutant; None: no test fails."""
        copy.write(mutant.file, mutant.applied())
        try:
            return next((failure for tests in groups if (failure := self._failure(copy, tests))), None)
        finally:
            copy.write(mutant.file, mutant.source)

    def _failure(self, copy: Copy, tests: Sequence[str]) -> Failure | None:
        """Return a failure that comes twice, and not without the mutant in between."""
        by_chance: set[str] = set()
        while tests := [test for test in tests if test not in self.fails_anyway | by_chance]:
            left_out = [option for test in self.fails_anyway | by_chance for option in ("--deselect", test)]
            failure = copy.first_failure(tests, *left_out)
            if failure is None:
                break
            # Without a test, pytest failed while it imported them.
            alone = [failure.test] if failure.test else [*tests, "--collect-only"]
            fails_anyway = self._clean.first_failure(alone) is not None
            if not fails_anyway and (again := copy.first_failure(alone)):
                return again
            if failure.test is None:
                break
            (self.fails_anyway if fails_anyway else by_chance).add(failure.test)
        return None


def groups_of_tests(copy: Copy, mutants: Sequence[Mutant], part: Sequence[str], workers: int) -> list[list[list[str]]]:
    """Return the tests of a part that reach each mutant, the quickest first, and then other tests of their files.

    Tests share what fixtures and caches hold: which one reaches the place is a matter of their order.
    """
    insert_probes(copy.folder, mutants)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as scratch:
        options = ("-n", str(workers), "-q", "--tb=no", "--durations=0", "--durations-min=0")
        code, printed = copy.tested(Path(scratch), part, *options)
    if code not in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED):
        raise RuntimeError(f"the tests did not end (exit {code}): {printed[-2000:]}")
    print(printed.rstrip().rpartition("\n")[2], flush=True)
    duration_s = durations_s(printed)
    groups = []
    for number, mutant in enumerate(mutants):
        names = reaching(copy.folder, number, duration_s)
        top = f"tests/{Path(mutant.file).parts[1]}"
        tests = sorted((name for name in names if "::" in name), key=lambda test: duration_s.get(test, 0.0))
        files = {name for name in names - {""} if "::" not in name}
        files |= {file for test in tests if (file := test.partition("::")[0]).startswith(f"{top}/")}
        if "" in names and part[0] == "tests" and (ROOT / top).is_dir():
            files = {top}
        groups.append([tests, [*sorted(files), *part[1:]] if files else []])
    return groups


def drawn(sample: int, seed: int, only: Sequence[str]) -> list[Mutant]:
    """Return mutants of as many lines, spread evenly over the folders; each line is as likely as another."""
    rng = random.Random(seed)
    table = equivalent()
    known = {(entry["file"], entry["line"], entry["becomes"]) for entry in table}
    files = {entry["file"] for entry in table}
    lines: list[list[Mutant]] = []
    for path in sorted((ROOT / "sim_action").rglob("*.py")):
        file = str(path.relative_to(ROOT))
        if file.startswith(tuple(only)):
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
    parser.add_argument("--only", nargs="*", default=["sim_action/"], help="beginnings of the files' names")
    parser.add_argument("--tests", nargs="*", help="look at these alone, such as tests/assertions")
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
    survivors = hunt(sample, (options.tests,) if options.tests else _PARTS, options.jobs)
    noticed = len(sample) - len(survivors)
    print(f"\nnoticed: {noticed} of {len(sample)} ({noticed / max(len(sample), 1):.0%}), seed {options.seed}")
    for mutant in sorted(survivors):
        print(f"not noticed: {mutant.file}:{mutant.line}\n{diff(mutant)}")
    return int(noticed < LEAST_SHARE * len(sample))


def hunt(sample: Sequence[Mutant], parts: Sequence[Sequence[str]], jobs: int) -> list[Mutant]:
    """Return the mutants that no test notices."""
    left = list(sample)
    with tempfile.TemporaryDirectory(prefix="mutants-") as scratch, ThreadPoolExecutor(jobs) as pool:
        copies = SimpleQueue[Copy]()
        for number in range(jobs):
            copies.put(Copy.of_repository(Path(scratch) / str(number)))
        found = Hunt(Copy.of_repository(Path(scratch) / "clean"))

        def is_noticed(mutant: Mutant, tests: list[list[str]]) -> bool:
            copy, start = copies.get(), time.monotonic()
            try:
                failure = found.noticed_by(mutant, tests, copy)
            finally:
                copies.put(copy)
            told = f"noticed by {failure.test}\n    {failure.reason}" if failure else "not noticed in this part"
            place, duration_s = f"{mutant.file}:{mutant.line}", time.monotonic() - start
            print(f"{place} {len(tests[0])} tests, {duration_s:.0f} s: {told}\n{diff(mutant)}", flush=True)
            return failure is not None

        try:
            for number, part in enumerate(parts):
                probed = Copy.of_repository(Path(scratch) / f"probed{number}")
                groups = groups_of_tests(probed, left, part, jobs * _WORKERS_PER_JOB)
                noticed = list(pool.map(is_noticed, left, groups))
                left = [mutant for mutant, is_gone in zip(left, noticed, strict=True) if not is_gone]
        except BaseException:
            signal.signal(signal.SIGTERM, signal.SIG_IGN)
            _stopped.set()
            pool.shutdown(cancel_futures=True)
            raise
    for name in sorted(found.fails_anyway):
        print(f"left out, because it fails in a copy without any change: {name}")
    return left


if __name__ == "__main__":
    sys.exit(main())
