"""Runs single steps of release.yml, with stand-ins for the programs that reach other machines."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import yaml

from tests.integration.github.expressions import evaluate
from tests.integration.github.values import Known

ROOT: Final = Path(__file__).parents[2]
DATE: Final = "2026-11-30T12:00:00+01:00"
# It comes before the caller's variables of git, which name another person or repository.
_GIT: Final = {"GIT_CONFIG_GLOBAL": os.devnull, "GIT_CONFIG_NOSYSTEM": "1", "HOME": os.devnull}


@dataclass(frozen=True, slots=True)
class Machine:
    """A machine that runs steps, below one folder.

    `server`: what `github.server_url` is: a folder with bare repositories.
    """

    folder: Path
    version: str = "0.9.0"
    programs: dict[str, str] = field(default_factory=dict)  # stand-ins, which come first in PATH

    @property
    def server(self) -> Path:
        return self.folder / "server"

    @property
    def temp(self) -> Path:
        return self.folder / "temp"

    def called(self, program: str) -> list[str]:
        """The arguments of each call of a stand-in."""
        log = self.folder / f"{program}.log"
        return log.read_text(encoding="utf-8").splitlines() if log.exists() else []

    def run(self, job: str, step: str, cwd: Path, /, **variables: str) -> subprocess.CompletedProcess[str]:
        """Runs the step of that name as a runner does; variables are added to those of the step."""
        found = named_step(job, step)
        programs = self.folder / "programs"
        for folder in (programs, self.temp):
            folder.mkdir(exist_ok=True)
        for name, body in self.programs.items():
            script = programs / name
            script.write_text(f'#!/bin/bash\necho "$*" >> "{self.folder}/{name}.log"\n{body}\n', encoding="utf-8")
            script.chmod(0o755)
        files = {name: str(self.temp / name) for name in ("GITHUB_OUTPUT", "GITHUB_STEP_SUMMARY")}
        runner = {"RUNNER_TEMP": str(self.temp), "GITHUB_SHA": "c0ffee", "GITHUB_REPOSITORY": "octocat/robots"}
        environment = {
            "PATH": os.pathsep.join([str(programs), str(Path(sys.executable).parent), os.environ["PATH"]]),
            **_GIT,
            **files,
            **runner,
            **self._evaluated(found.get("env", {})),
            **variables,
        }
        command = ["bash", "-e", "-c", found["run"]]
        return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, check=False)

    def _evaluated(self, given: Mapping[str, Any]) -> dict[str, str]:
        contexts = {
            "inputs": Known({"version": self.version}),
            "github": Known(
                {"server_url": str(self.server), "repository": "octocat/robots", "token": "secret", "actor": "octocat"}
            ),
            "needs": Known({"check": Known({"outputs": Known({"date": DATE})})}),
            "steps": Known({"simulation": Known({"outputs": Known({"conclusion": "success"})})}),
        }
        return {name: evaluate(str(text), contexts) for name, text in given.items()}


def jobs() -> dict[str, Any]:
    """The jobs of release.yml."""
    text = (ROOT / ".github/workflows/release.yml").read_text(encoding="utf-8")
    loaded: dict[str, Any] = yaml.safe_load(text)["jobs"]
    return loaded


def named_step(job: str, start: str) -> dict[str, Any]:
    """The step of a job whose name starts so."""
    (found,) = [step for step in jobs()[job]["steps"] if step.get("name", "").startswith(start)]
    return dict(found)


def git(folder: Path, *arguments: str) -> str:
    """What git prints, without the configuration of the user."""
    who = {f"GIT_{role}_{key}": "a@b" for role in ("AUTHOR", "COMMITTER") for key in ("NAME", "EMAIL")}
    environment = {**os.environ, **_GIT, **who, "GIT_COMMITTER_DATE": DATE, "GIT_AUTHOR_DATE": DATE}
    command = ["git", "-C", str(folder), *arguments]
    ran = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    return ran.stdout.strip()
