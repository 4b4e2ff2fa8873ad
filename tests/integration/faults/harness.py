"""The harness: it runs a suite with one fault, and compares the run with an undisturbed one."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from functools import cache
from itertools import count
from pathlib import Path

from tests.integration.conftest import locked
from tests.integration.faults.checks import Undisturbed, broken_promises, kept, undisturbed
from tests.integration.faults.injection import Fault, Run, compiled, run_suite
from tests.integration.faults.suite import NAMES, write_suite


@dataclass(frozen=True)
class Injection:
    """A fault at the n-th call, and the promises that the run has broken."""

    fault: Fault
    nth: int
    reached: int
    fired: int
    code: int
    kept: int
    of: int
    broken: tuple[str, ...]

    def __str__(self) -> str:
        verdict = "; ".join(self.broken) or "ok"
        figures = f"reached {self.reached}, fired {self.fired}, exit {self.code}, kept {self.kept} of {self.of}"
        return f"{self.fault}, call {self.nth}: {figures}: {verdict}"


class Injector:
    """Runs suites below a folder, each in a new one; `shared`: a folder for all workers of a test session."""

    def __init__(self, folder: Path, shared: Path | None = None) -> None:
        self._folder = folder
        self._shared = shared or folder
        self._numbers = count()
        self._usual = cache(self._undisturbed)
        with locked(self._shared / "lock"):
            self._library = compiled(self._shared)

    def inject(self, fault: Fault, nth: int) -> Injection:
        """Run a suite with the fault at its n-th call."""
        # The exit code of one suite shows verdicts that are lost; the other one has all kinds of verdicts.
        suite = fault.suite or tuple(NAMES)[nth % 2]
        usual = self._usual(suite)
        run = self._run(suite, fault, nth)
        broken = tuple(broken_promises(run, fault, usual)) if run.fired else ()
        found = Injection(fault, nth, run.reached, run.fired, run.code, kept(run, usual), len(usual.outcomes), broken)
        if broken:
            (run.folder / "printed").write_text(f"{found}\n{run.printed}\n{run.errors}")
        return found

    def inject_everywhere(self, fault: Fault) -> Iterator[Injection]:
        """Inject a fault at one call after the other, in one suite and the other, until it is not reached any more."""
        suites = [fault.suite] if fault.suite else list(NAMES)
        for index in count():
            if not suites:
                return
            suite = suites[index % len(suites)]
            found = self.inject(replace(fault, suite=suite), 1 + index * fault.stride)
            if found.fired:
                yield found
            else:
                suites.remove(suite)

    def _run(self, suite: str, fault: Fault | None, nth: int) -> Run:
        folder = self._folder / f"{next(self._numbers)}"
        write_suite(folder / "suite", suite)
        return run_suite(folder, self._shared / "cache", self._library, fault, nth)

    def _undisturbed(self, suite: str) -> Undisturbed:
        """Return the results without a fault, from the worker that was the first to need them."""
        file, meshes = self._shared / f"{suite}.json", self._shared / "cache"
        with locked(self._shared / "lock"):
            if not file.exists():
                run = self._run(suite, None, 1)
                assert run.code == (suite == "mixed"), run.printed + run.errors
                file.write_text(json.dumps(asdict(undisturbed(run, meshes)), default=str))
            found = json.loads(file.read_text())
        return Undisturbed(found["code"], found["outcomes"], meshes)
