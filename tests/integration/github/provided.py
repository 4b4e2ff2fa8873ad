"""What `uses:` may name: actions of the repository, sim-action's own, and stand-ins for those of others."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Final

import pytest

from sim_action import __version__
from tests.integration.github.artifacts import DOWNLOAD, UPLOAD
from tests.integration.github.caching import RESTORE, SAVE
from tests.integration.github.checkout import CHECK_OUT
from tests.integration.github.composite import Action, run_composite
from tests.integration.github.errors import StepFailed, UnsupportedFeature
from tests.integration.github.machine import Machine
from tests.integration.github.reporters import DORNY, ENRICOMI, MIKEPENZ
from tests.integration.github.scripts import Finished
from tests.integration.github.stand_in import StandIn, boolean
from tests.integration.github.steps import Use

OWN_NAME: Final = "sim-action/sim-action"
OWN_VERSION: Final = f"v{__version__.partition('.')[0]}"
OWN_FOLDER: Final = Path(__file__).parents[3]


def use(asked: Use) -> Finished:
    """Runs what a step uses. Raises StepFailed and UnsupportedFeature."""
    if action := _own(asked.machine, asked.uses):
        steps, outputs = run_composite(action, asked.machine, use, asked)
        return Finished(steps.exit_code, outputs)
    if asked.uses not in _STAND_INS:
        raise UnsupportedFeature(f"uses: {asked.uses}")
    return _STAND_INS[asked.uses].use(asked.machine, asked.inputs)


@cache
def base_python() -> Path:
    """The Python of the version that the actions ask for, outside of all virtual environments.

    It is the one below this one, or another of this machine's. Tests that need it are skipped where there is none.
    """
    for name in (sys.executable, *(f"{folder}/python3.11" for folder in os.environ["PATH"].split(os.pathsep))):
        ask = [name, "-c", "import sys; print(*sys.version_info[:2], sys.base_prefix, sep='|')"]
        try:
            said = subprocess.run(ask, capture_output=True, text=True, check=True).stdout.strip()
        except (OSError, subprocess.CalledProcessError):
            continue
        major, minor, prefix = said.split("|")
        if (major, minor) == ("3", "11"):
            return Path(prefix, "bin/python3.11")
    pytest.skip("the actions ask for Python 3.11, and there is none on this machine")


def _own(machine: Machine, uses: str) -> Action | None:
    name, _, version = uses.partition("@")
    if uses.startswith("./"):
        folder = machine.workspace / uses
        if not (folder / "action.yml").is_file():
            raise StepFailed(
                f"Can't find 'action.yml' under '{folder}'. Did you forget to run actions/checkout before?"
            )
        return Action(folder)
    if name != OWN_NAME and not name.startswith(f"{OWN_NAME}/"):
        return None
    folder = OWN_FOLDER / name.removeprefix(OWN_NAME).strip("/")
    if version != OWN_VERSION or not (folder / "action.yml").is_file():
        raise UnsupportedFeature(f"uses: {uses}")
    return Action(folder, OWN_NAME, OWN_VERSION)


def _set_up_python(machine: Machine, inputs: Mapping[str, str]) -> Mapping[str, str]:
    if inputs["python-version"] != "3.11":
        raise UnsupportedFeature(f"python-version: {inputs['python-version']}, where there is 3.11")
    if boolean(inputs["update-environment"]):
        machine.path.append(str(base_python().parent))
        location = str(base_python().parent.parent)
        machine.environment["pythonLocation"] = location
        machine.record.exported += f"pythonLocation={location}\n{base_python().parent}\n"
    return {"python-path": str(base_python())}


_SET_UP_PYTHON: Final = StandIn(_set_up_python, required=("python-version",), defaults={"update-environment": "true"})
# The versions whose behaviour was looked up; another one is to be looked at before it is named here.
_STAND_INS: Final[Mapping[str, StandIn]] = {
    "actions/setup-python@5fda3b95a4ea91299a34e894583c3862153e4b97": _SET_UP_PYTHON,
    "actions/checkout@3d3c42e5aac5ba805825da76410c181273ba90b1": CHECK_OUT,
    "actions/upload-artifact@043fb46d1a93c77aae656e7c1c64a875d1fc6a0a": UPLOAD,
    "actions/download-artifact@3e5f45b2cfb9172054b4087a40e8e0b5a5461e7c": DOWNLOAD,
    "actions/cache/restore@27d5ce7f107fe9357f9df03efb73ab90386fccae": RESTORE,
    "actions/cache/save@27d5ce7f107fe9357f9df03efb73ab90386fccae": SAVE,
    "dorny/test-reporter@a43b3a5f7366b97d083190328d2c652e1a8b6aa2": DORNY,
    "mikepenz/action-junit-report@d9f48fc87bc235f7e214acf696ca5abc0a986f16": MIKEPENZ,
    "EnricoMi/publish-unit-test-result-action@d0a4676d0e0b938bc201470d88276b7c74c712b3": ENRICOMI,
}
