"""The lines for shells on the page of the command line print a script, which completes commands."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/command-line.md").read_text(encoding="utf-8")
LINES = {
    shell: line for line, shell in re.findall(r"^(.*_SIM_ACTION_COMPLETE=(\w+)_source .*?) +#", PAGE, re.MULTILINE)
}
# The environment that the script of fish sets.
ASKED = {"COMP_WORDS": "sim-action exp", "COMP_CWORD": "exp"}


@pytest.fixture
def path(tmp_path: Path) -> str:
    program = tmp_path / "sim-action"
    program.write_text(f'#!/bin/sh\nPYTHONPATH="{ROOT}" exec "{sys.executable}" -m sim_action "$@"\n')
    program.chmod(0o755)
    return os.pathsep.join([str(tmp_path), os.environ["PATH"]])


def output(command: list[str], path: str, **variables: str) -> str:
    environment = {**os.environ, "PATH": path, **variables}
    ran = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stderr) == (0, "")
    return ran.stdout


def test_there_is_a_line_for_each_shell() -> None:
    assert LINES.keys() == {"bash", "zsh", "fish"}


def test_the_program_prints_a_script_and_completes_a_command(path: str) -> None:
    script = output(["sim-action"], path, _SIM_ACTION_COMPLETE="fish_source")
    assert "_SIM_ACTION_COMPLETE=fish_complete" in script
    completed = output(["sim-action"], path, _SIM_ACTION_COMPLETE="fish_complete", **ASKED)
    assert "explain" in completed
    assert "doctor" not in completed


def test_bash_takes_its_line(path: str) -> None:
    asked = 'COMP_WORDS=(sim-action doc); COMP_CWORD=1; _sim_action_completion sim-action; echo "${COMPREPLY[@]}"'
    assert output(["bash", "-c", f"{LINES['bash']}\n{asked}"], path) == "doctor\n"
