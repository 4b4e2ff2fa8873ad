"""Runs of programs in which each opened file is noted: see `tracer.c`."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from tests.integration.faults.injection import COMPILER, ROOT
from tests.patience import PATIENCE

_SOURCE: Final = Path(__file__).parent / "tracer.c"


@dataclass(frozen=True)
class Traced:
    """A finished program; `opened`: the absolute paths of all files that it or a child process opened."""

    code: int
    printed: str
    opened: frozenset[str]


def compiled(folder: Path) -> Path:
    """Compile the library, and return its path."""
    library = folder / "tracer.so"
    options = ["-Wall", "-Wextra", "-Werror", "-O1", "-U_FORTIFY_SOURCE", "-shared", "-fPIC"]
    subprocess.run([str(COMPILER), *options, "-o", str(library), str(_SOURCE), "-ldl"], check=True)
    return library


def traced(folder: Path, library: Path, variables: Mapping[str, str], *words: str) -> Traced:
    """Run Python in a folder with these words."""
    log = library.with_name(f"{folder.name}.log")
    log.write_text("")
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("GITHUB_", "SIM_ACTION_"))}
    preloaded = {"LD_PRELOAD": str(library), "OPENED_FILES": str(log), "PYTHONPATH": str(ROOT)}
    run = subprocess.run(
        [sys.executable, *words],
        cwd=folder,
        env={**kept, **preloaded, **variables},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        check=False,
        timeout=PATIENCE,
    )
    printed = (run.stdout + run.stderr).decode(errors="replace")
    return Traced(run.returncode, printed, frozenset(log.read_text(errors="replace").splitlines()))
