"""What a run leaves behind that never came to its first step."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from typing import ClassVar

import pytest

from sim_action.core.geometry import Pose
from sim_action.scenario.loading import build_scene
from sim_action.scenario.model import LoadedScenario
from sim_action.sensors import Measure, Mount, MountedSensor, Sensor
from sim_action.simulation.loop import simulate
from tests.scenarios import LEAST, load

# Answers until its input ends, as programs do.
PROGRAM = """\
import os, sys
open("number", "w").write(str(os.getpid()))
for line in sys.stdin:
    print("{}", flush=True)
print("farewell", flush=True)
"""


class Faulty(Sensor):
    """A sensor that cannot be opened, though nothing was wrong with it before."""

    key: ClassVar[str] = "faulty"

    def open(self, mount: Mount) -> Measure:
        raise KeyError("nowhere")


def driven_by_a_program(folder: Path) -> LoadedScenario:
    program = folder / "ctl.py"
    program.write_text(f"#!{sys.executable}\n{PROGRAM}")
    program.chmod(0o700)
    drives = "commands:\n  process: ./ctl.py\n"
    text = LEAST.replace("commands:\n  rate: 10 Hz\n  twist:\n    - {linear: 1.0}\n", drives)
    assert text != LEAST
    return load(folder, text)


def is_there(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.process
def test_programs_are_ended_when_a_sensor_cannot_be_opened(tmp_path: Path) -> None:
    loaded = driven_by_a_program(tmp_path)
    sensor = MountedSensor(Faulty(), "eye", None, Pose(), 10.0, trace=True)
    scenario = loaded.scenario.model_copy(update={"sensors": (sensor,)})
    with pytest.raises(KeyError, match="nowhere"):
        simulate(scenario, build_scene(loaded), lambda _: None)
    program = int((tmp_path / "number").read_text())
    deadline = time.monotonic() + 10
    while is_there(program) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not is_there(program)


@pytest.mark.process
def test_what_a_program_says_at_the_end_is_noted(tmp_path: Path) -> None:
    loaded = driven_by_a_program(tmp_path)
    scenario = loaded.scenario.model_copy(update={"time_limit": 0.2})
    notes = simulate(scenario, build_scene(loaded), lambda _: None).notes
    assert "the process './ctl.py' wrote more lines than it received, such as 'farewell'; if " in notes[-1]
