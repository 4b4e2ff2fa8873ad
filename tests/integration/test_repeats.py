"""`run --repeat N` on controllers that are not the same every time, and on some that are."""

from __future__ import annotations

import re
from pathlib import Path
from subprocess import CompletedProcess
from typing import Any

import pytest

from sim_action.engines import installed
from sim_action.results.results_json import Results
from tests.integration.conftest import sim_action
from tests.soak import soaked

SCENARIO = """\
name: burger wanders
robot: {model: turtlebot3_burger}
commands: {script: controller.py, rate: 20 Hz}
expect:
  - stay_within: {x: [-10, 10]}
duration: 0.5 s
time_limit: 1 s
"""
HEAD = "from sim_action import Twist\n\n\ndef speed():\n"
TAIL = """

def control(observation):
    return Twist((speed(), 0.0, 0.0), (0.0, 0.0, 0.0))
"""


def controller(*body: str) -> str:
    return HEAD + "".join(f"    {line}\n" for line in body) + TAIL


# Speeds that the burger comes to within half a second, at 1 m/s^2.
FLAKY = {
    "random numbers of its own": controller("import random", "return random.Random().random() / 2"),
    "random numbers of the system": controller("import os", "return os.urandom(1)[0] / 510"),
    "the wall clock": controller("import time", "return time.time_ns() // 1000 % 1000 / 4000"),
    "order of a set": controller("words = {'north', 'east', 'south', 'west'}", "return len(list(words)[0]) / 10"),
    "hashes": controller("return hash('north') % 999983 / 4e6"),
    "ids": controller("return id(object()) // 4096 % 9973 / 40000"),
    "a file of an earlier run": controller(
        "import pathlib",
        "path = pathlib.Path(__file__).with_name('count.txt')",
        "count = len(path.read_text()) if path.exists() else 0",
        "path.open('a').write('.')",
        "return (count % 97) / 100",
    ),
    "threads": controller(
        "import threading, time",
        "found = []",
        "threads = [threading.Thread(target=lambda n=n: (time.sleep(time.time() % 0.003), found.append(n)))",
        "           for n in range(8)]",
        "[thread.start() for thread in threads]",
        "[thread.join() for thread in threads]",
        "return sum(n * 10.0**-place for place, n in enumerate(found)) / 10",
    ),
}
STEADY = controller(
    "import numpy, random",
    "order = len(list(dict.fromkeys(['north', 'east', 'west']))[0]) + len(sorted({'north', 'east', 'south'})[0])",
    "return (random.random() + float(numpy.random.random()) + order / 10) / 8",
)
"""The seed's own numbers, and orders that do not depend on hashes."""


def ran(
    folder: Path, script: str, *arguments: str, scenario: str = SCENARIO
) -> tuple[CompletedProcess[str], list[Any]]:
    (folder / "controller.py").write_text(script)
    (folder / "s.sim.yml").write_text(scenario)
    call = sim_action(folder, "run", ".", "--junit-strict", *arguments)
    return call, list(Results.read(folder / "sim-results/results.json").outcomes)


# Sets of few words come twice by chance.
TIMES = [(cause, 4 if cause == "order of a set" else 2) for cause in FLAKY]
SHORT = [(cause, 2) for cause in ("hashes", "a file of an earlier run")]


@pytest.mark.parametrize(("cause", "times"), soaked([*TIMES, *((cause, 10) for cause in FLAKY)], short=SHORT))
def test_what_differs_from_run_to_run_is_flaky(cause: str, times: int, tmp_path: Path) -> None:
    call, (outcome,) = ran(tmp_path, FLAKY[cause], "--repeat", f"{times}")
    assert call.returncode == 1, call.stdout + call.stderr
    assert (outcome.status, outcome.repeats.count, outcome.expectations) == ("flaky", times, ())
    assert outcome.repeats.agreed < times
    assert outcome.repeats.digests > 1
    [failure] = outcome.failures
    assert failure.kind == "flaky"
    assert re.search(r"run \d differs from run \d at 0\.\d+ s, in \S+ of \S+: \S+ and not \S+; ", failure.message)
    assert "wall clock" in failure.message
    assert "1 flaky" in call.stdout
    assert re.search(rf"\d of {times} runs identical|{times} runs, all different", call.stdout)


@pytest.mark.parametrize("times", soaked([2, 10], short=[2]))
def test_what_is_the_same_every_time_passes(times: int, tmp_path: Path) -> None:
    call, (outcome,) = ran(tmp_path, STEADY, "--repeat", f"{times}")
    assert call.returncode == 0, call.stdout + call.stderr
    repeats = outcome.repeats
    assert (outcome.status, repeats.count, repeats.agreed, repeats.digests) == ("passed", times, times, 1)
    assert f"{times} identical runs" in call.stdout
    assert outcome.provenance.cpu
    assert outcome.provenance.engine_build
    assert (outcome.seed, len(outcome.digest)) == (0, 64)
    assert [path.name for path in (tmp_path / "sim-results/traces").iterdir()] == ["burger-wanders.npz"]


def test_one_run_has_the_order_of_sets_that_it_always_had(tmp_path: Path) -> None:
    runs = [ran(tmp_path, FLAKY["order of a set"], *arguments) for arguments in ((), ("--repeat", "1"))]
    assert [(call.returncode, outcome.repeats) for call, (outcome,) in runs] == [(0, None)] * 2
    assert len({outcome.digest for _, (outcome,) in runs}) == 1


def test_a_scenario_without_code_is_the_same_in_fresh_interpreters_and_in_a_fork(tmp_path: Path) -> None:
    text = SCENARIO.replace("script: controller.py", "twist: [{linear: 0.3, angular: 0.5}]")
    runs = [ran(tmp_path, "", *arguments, scenario=text) for arguments in ((), ("--repeat", "2"))]
    assert [call.returncode for call, _ in runs] == [0, 0]
    assert len({outcome.digest for _, (outcome,) in runs}) == 1


def test_runs_that_fail_alike_have_failed(tmp_path: Path) -> None:
    text = SCENARIO.replace("[-10, 10]", "[-10, 1 mm]")
    call, (outcome,) = ran(tmp_path, controller("return 0.5"), "--repeat", "2", scenario=text)
    assert (call.returncode, outcome.status, outcome.failures, outcome.repeats.agreed) == (1, "failed", (), 2)
    assert "2 identical runs" in call.stdout


def test_judgements_that_differ_of_the_same_run_are_flaky(tmp_path: Path) -> None:
    (tmp_path / "judge.py").write_text(
        "class Judge:\n    def judge(self, run):\n        from sim_action import Verdict\n"
        "        return Verdict(True, measured=float(hash('north') % 1000))\n"
    )
    text = SCENARIO.replace("stay_within: {x: [-10, 10]}", "assertion: judge.py:Judge")
    call, (outcome,) = ran(tmp_path, controller("return 0.1"), "--repeat", "2", scenario=text)
    assert (call.returncode, outcome.status, outcome.repeats.digests) == (1, "flaky", 1), call.stdout
    message = outcome.failures[0].message
    assert "the robot moved identically, but 'assertion Judge' judged it differently" in message
    assert re.search(r"run 1 passed: holds \(measured \d+\.0\), run 2 passed", message)


def test_variations_and_engines_are_each_repeated(tmp_path: Path) -> None:
    text = SCENARIO + "variations: {world.ground.friction: [0.5]}\n"
    call, outcomes = ran(tmp_path, controller("return 0.2"), "--repeat", "2", "--backend", "all", scenario=text)
    assert call.returncode == 0, call.stdout + call.stderr
    assert [outcome.repeats.count for outcome in outcomes] == [2] * len(installed())
    assert len(list((tmp_path / "sim-results/traces").iterdir())) == len(outcomes)


def test_fail_fast_leaves_no_scenario_green_that_was_not_run_as_often(tmp_path: Path) -> None:
    (tmp_path / "a.sim.yml").write_text(SCENARIO)
    fails = SCENARIO.replace("[-10, 10]", "[-10, 1 mm]")
    words = ("--repeat", "3", "--fail-fast", "--jobs", "1")
    call, outcomes = ran(tmp_path, controller("return 0.5"), *words, scenario=fails)
    assert (call.returncode, [outcome.status for outcome in outcomes]) == (1, ["skipped", "failed"])
    assert outcomes[0].notes == ("run 1 of 3 times: another scenario did not pass (--fail-fast)",)
