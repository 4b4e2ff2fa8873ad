"""What a run leaves behind that never came to its first step."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from typing import ClassVar

import pytest

from sim_action.commands import ClosedLoop
from sim_action.commands.twist import TwistCommands
from sim_action.core.geometry import Pose, Twist
from sim_action.scenario.loading import build_scene
from sim_action.scenario.model import LoadedScenario
from sim_action.sensors import Measure, Mount, MountedSensor, Sensor
from sim_action.simulation import monitors
from sim_action.simulation.loop import SimulationRun, simulate
from sim_action.state.observation import Observation
from sim_action.state.reproducibility import Transcript
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


@pytest.mark.parametrize(
    ("expect", "end"),
    [
        ("[{travel: {at_least: 30 cm}}]", "goals met"),
        ("[{max_speed: {linear: 50 cm/s}}]", "expectation failed"),
        ("[{max_speed: {linear: 20 m/s}}]", "time limit"),
    ],
)
def test_the_length_of_a_period_changes_no_result(
    expect: str, end: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The monitors see many steps at once. The end of a run may lie anywhere within such a period.
    loaded = load(tmp_path, LEAST.partition("expect:")[0] + f"expect: {expect}\ntime_limit: 2.6 s\n")

    def run() -> SimulationRun:
        return simulate(loaded.scenario, build_scene(loaded), lambda _: None)

    usual = run()
    monkeypatch.setattr(monitors, "_PERIOD_S", 1.7)
    monkeypatch.setattr(monitors, "_PERIOD_WITHOUT_GOALS_S", 0.3)
    other = run()
    assert usual.end == other.end == end
    assert (usual.digest, usual.verdicts, usual.findings) == (other.digest, other.verdicts, other.findings)
    assert usual.trace.time.tolist() == other.trace.time.tolist()


@pytest.mark.parametrize("allowed", [False, True])
def test_messages_of_nodes_and_reasons_why_they_may_differ(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, allowed: bool
) -> None:
    runs = list[SimulationRun]()
    for message in (None, b"1", b"1", b"2"):
        transcript, reasons = Transcript(), list[str]()

        def command(seen: Observation, transcript: Transcript = transcript, message: bytes | None = message) -> Twist:
            if message is not None:
                transcript.add(seen.time, "/cmd_vel", message)
            return Twist.planar(1.0)

        driven = ClosedLoop(command, transcript=transcript, not_reproducible=reasons)
        monkeypatch.setattr(TwistCommands, "open", lambda *_, driven=driven: driven)
        loaded = load(tmp_path, LEAST + ("allow: [not-reproducible]\n" if allowed else ""))
        reasons.append("a node was never quiet")
        runs.append(simulate(loaded.scenario, build_scene(loaded), lambda _: None))
    without, first, same, other = (run.digest for run in runs)
    assert first == same
    assert len({without, first, other}) == 3
    found = [(finding.rule, finding.message) for finding in runs[0].findings]
    told = ("not-reproducible", "the run is not reproducible: a node was never quiet")
    assert found == ([] if allowed else [told])


@pytest.mark.parametrize("allowed", [False, True])
def test_errors_that_nodes_logged_are_findings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, allowed: bool
) -> None:
    errors = list[str]()

    def command(_: Observation) -> Twist:
        errors[:] = ["the node 'mover' logged an error: no plan"]
        return Twist.planar(1.0)

    driven = ClosedLoop(command, logged_errors=errors)
    monkeypatch.setattr(TwistCommands, "open", lambda *_: driven)
    loaded = load(tmp_path, LEAST + ("allow: [logged-error]\n" if allowed else ""))
    run = simulate(loaded.scenario, build_scene(loaded), lambda _: None)
    found = [(finding.rule, finding.message) for finding in run.findings]
    assert found == ([] if allowed else [("logged-error", errors[0])])
