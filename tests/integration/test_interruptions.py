"""Real signals at any moment of a run: the reports are complete, or there are none; a killed one leaves its journal."""

from __future__ import annotations

import os
import pty
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import product
from pathlib import Path
from typing import Final

import junitparser
import pytest
import yaml

from sim_action.results.journal import read_journal
from sim_action.results.results_json import Results
from tests.integration.conftest import ACTION, interpreter, sim_action
from tests.integration.marked_processes import processes_of
from tests.patience import PATIENCE, wait_until
from tests.scenarios import driving
from tests.soak import soaked

SCRIPT: Final = """\
from pathlib import Path
def control(observation):
    Path(__file__).with_name("began").touch()
    while True:
        pass
"""

# A signal right before a module is imported; the rest is as the console script does it.
FINDER: Final = """\
import os, sys
class Finder:
    @staticmethod
    def find_spec(name, path, target=None):
        if name == module:
            os.kill(os.getpid(), int(number))
"""
AT_IMPORT: Final = f"""\
{FINDER}
number, module, *sys.argv[1:] = sys.argv[1:]
from sim_action.__main__ import main
sys.meta_path.insert(0, Finder)
main()
"""

SIGNALS: Final = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT]
ENVIRONMENT: Final = {**os.environ, "PYTHONPATH": str(ACTION), "GITHUB_ACTIONS": ""}


@pytest.fixture(autouse=True)
def _signals_are_not_ignored() -> Iterator[None]:
    """Children inherit what is ignored here, as below `nohup` and in the background of a shell."""
    ignored = [number for number in SIGNALS if signal.getsignal(number) is signal.SIG_IGN]
    for number in ignored:
        signal.signal(number, signal.SIG_DFL)
    yield
    for number in ignored:
        signal.signal(number, signal.SIG_IGN)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a scenario that passes, one that never ends, and one after it."""
    (tmp_path / "a-quick.sim.yml").write_text(driving("a-quick"))
    (tmp_path / "b-endless.sim.yml").write_text(driving("b-endless", "{script: endless.py}"))
    (tmp_path / "c-later.sim.yml").write_text(driving("c-later"))
    (tmp_path / "endless.py").write_text(SCRIPT)
    return tmp_path


@contextmanager
def running(folder: Path, *before: str, stream: int = subprocess.DEVNULL) -> Iterator[subprocess.Popen[bytes]]:
    """A run with one job; `before`: what starts it; `stream`: its standard output and standard error."""
    words = [*before, sys.executable, "-m", "sim_action", "run", ".", "--jobs", "1"]
    variables = {**ENVIRONMENT, "ROS_MARK": str(folder)}
    process = subprocess.Popen(words, cwd=folder, stdout=stream, stderr=stream, env=variables, start_new_session=True)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def await_endless(folder: Path) -> None:
    wait_until((folder / "began").exists)


def reported(folder: Path) -> Mapping[str, str]:
    """Name -> status or kind of failure in all reports, which have to agree."""
    results = folder / "sim-results"
    outcomes = Results.read(results / "results.json").outcomes
    kinds = {outcome.name: outcome.failures[0].kind if outcome.failures else outcome.status for outcome in outcomes}
    suites = list(junitparser.JUnitXml.fromfile(str(results / "junit.xml")))
    in_suites = [(suite.name, bool(suite.errors)) for suite in suites]
    assert in_suites == [(outcome.name, outcome.status == "error") for outcome in outcomes]
    assert (results / "report.html").read_text().rstrip().endswith("</html>")
    assert not [path for path in results.rglob(".*") if path.name != ".gitignore"]
    return kinds


def test_a_run_whose_parent_ignored_the_ends_of_its_children_has_its_verdicts(folder: Path) -> None:
    (folder / "b-endless.sim.yml").unlink()
    ignoring = (
        "import os, signal, sys\nsignal.signal(signal.SIGCHLD, signal.SIG_IGN)\nos.execv(sys.argv[1], sys.argv[1:])"
    )
    with running(folder, sys.executable, "-c", ignoring) as process:
        assert process.wait(PATIENCE) == 0
    assert reported(folder) == {"a-quick": "passed", "c-later": "passed"}


# SIGHUP comes with the closed terminal below.
@pytest.mark.parametrize("number", soaked(SIGNALS, short=[signal.SIGINT, signal.SIGTERM]))
def test_a_signal_leaves_reports_of_what_had_finished(folder: Path, number: signal.Signals) -> None:
    with running(folder) as process:
        await_endless(folder)
        process.send_signal(number)
        assert process.wait(PATIENCE) == 130
    assert processes_of(folder) == []
    assert reported(folder) == {"a-quick": "passed", "b-endless": "interrupted", "c-later": "interrupted"}


def test_a_run_below_nohup_goes_on_when_the_terminal_is_closed(folder: Path) -> None:
    with running(folder, "nohup") as process:
        await_endless(folder)
        (ignored,) = re.findall(r"SigIgn:\s*(\w+)", Path(f"/proc/{process.pid}/status").read_text())
        assert int(ignored, 16) & 1 << signal.SIGHUP - 1
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE) == 130
    assert reported(folder)["a-quick"] == "passed"


@pytest.mark.parametrize("hangs_up", soaked([False, True], short=[True]))
def test_a_closed_terminal_loses_no_report(folder: Path, hangs_up: bool) -> None:
    master, slave = pty.openpty()
    with running(folder, stream=slave) as process:
        os.close(slave)
        await_endless(folder)
        # From now on, each write to the terminal fails with EIO.
        os.close(master)
        process.send_signal(signal.SIGHUP if hangs_up else signal.SIGTERM)
        assert process.wait(PATIENCE) == 130
    assert reported(folder) == {"a-quick": "passed", "b-endless": "interrupted", "c-later": "interrupted"}


@pytest.mark.parametrize(
    ("closed", "arguments"),
    soaked(
        product(["terminal", "pipe"], [(), ("--verbose",), ("nowhere.sim.yml",)]),
        short=[("terminal", ("--verbose",)), ("pipe", ("nowhere.sim.yml",))],
    ),
)
def test_output_that_goes_nowhere_changes_no_verdict(folder: Path, closed: str, arguments: tuple[str, ...]) -> None:
    (folder / "b-endless.sim.yml").unlink()
    reader, writer = os.pipe() if closed == "pipe" else pty.openpty()
    os.close(reader)
    words = [sys.executable, "-m", "sim_action", "run", ".", *arguments]
    environment = {**ENVIRONMENT, "GITHUB_ACTIONS": "true"}
    ran = subprocess.run(words, cwd=folder, stdout=writer, stderr=writer, env=environment, check=False)
    os.close(writer)
    assert ran.returncode == (2 if "nowhere.sim.yml" in arguments else 0)
    assert set(reported(folder).values()) == ({"passed", "invalid"} if "nowhere.sim.yml" in arguments else {"passed"})


@pytest.mark.parametrize("number", soaked(SIGNALS, short=[signal.SIGTERM]))
@pytest.mark.parametrize(
    "module",
    soaked(
        ["sim_action.cli.main", "click", "sim_action.app.run", "pydantic", "sim_action.runner.process_pool"],
        short=["sim_action.cli.main", "sim_action.runner.process_pool"],
    ),
)
def test_a_signal_during_imports_leaves_reports(folder: Path, module: str, number: signal.Signals) -> None:
    assert at_import(folder, module, number, "run", ".") == 130
    assert reported(folder) == dict.fromkeys(("a-quick", "b-endless", "c-later"), "interrupted")


def test_a_signal_does_not_hide_an_error_of_usage(folder: Path) -> None:
    assert at_import(folder, "click", signal.SIGTERM, "run", "--jobs", "none") == 2
    assert not (folder / "sim-results").exists()


@pytest.mark.parametrize(
    ("number", "code"),
    soaked(zip(SIGNALS, (130, -15, -1, -3), strict=True), short=[(signal.SIGINT, 130), (signal.SIGTERM, -15)]),
)
def test_a_command_that_only_prints_ends_at_once(folder: Path, number: signal.Signals, code: int) -> None:
    assert at_import(folder, "click", number, "validate", ".") == code


def at_import(folder: Path, module: str, number: signal.Signals, *arguments: str) -> int:
    """Return the exit code of a command line that gets a signal right before it imports a module."""
    (folder / "at_import.py").write_text(AT_IMPORT)
    words = ("at_import.py", str(int(number)), module, *arguments)
    return interpreter(folder, *words, env=ENVIRONMENT).returncode


def test_a_cancelled_action_reports_from_its_start_on(folder: Path) -> None:
    held = f"{FINDER}number, module = {int(signal.SIGTERM)}, 'click'\nsys.meta_path.insert(0, Finder)\n"
    (folder / "sitecustomize.py").write_text(held)
    inputs = yaml.safe_load((ACTION / "action.yml").read_text())["inputs"]
    defaults = {f"INPUT_{name.upper().replace('-', '_')}": str(inputs[name]["default"]) for name in inputs}
    variables = {**ENVIRONMENT, **defaults, "PYTHONPATH": f"{folder}:{ACTION}"}
    ran = interpreter(folder, "-P", ACTION / "action/run.py", "run", env=variables)
    assert ran.returncode == 130, ran.stderr
    assert set(reported(folder).values()) == {"interrupted"}


def test_children_get_the_signals_that_their_parent_held(folder: Path) -> None:
    """Also user code: a script may be ended by SIGTERM, SIGHUP and, below it, Ctrl-C."""
    mask = "import signal\n\n\ndef control(observation):\n    print(signal.pthread_sigmask(signal.SIG_BLOCK, []))\n"
    (folder / "endless.py").write_text(mask)
    assert at_import(folder, "no_such_module", signal.SIGTERM, "run", "b-endless.sim.yml") == 1
    (outcome,) = Results.read(folder / "sim-results" / "results.json").outcomes
    assert set(outcome.output.split("\n")) == {"set()"}


DELAYS_S: Final = [step / 50 for step in range(21)]


@pytest.mark.parametrize("number", soaked(SIGNALS, short=[signal.SIGTERM]))
@pytest.mark.parametrize("delay", soaked(DELAYS_S, short=DELAYS_S[12:13]))
def test_a_signal_at_any_moment_leaves_all_reports_or_no_file(
    folder: Path, delay: float, number: signal.Signals
) -> None:
    with running(folder) as process:
        time.sleep(delay)
        process.send_signal(number)
        code = process.wait(PATIENCE)
    if (folder / "sim-results").exists():
        assert code == 130
        assert {"b-endless", "c-later"} <= {name for name, kind in reported(folder).items() if kind == "interrupted"}
    else:
        # Python was not up yet: it ends, and after Ctrl-C while it prepares itself, it returns 1.
        assert code == -number or (number, code) == (signal.SIGINT, 1)


KILLER = f"""
import os
from pathlib import Path

def control(observation):
    # This process, its supervisor, sim-action.
    supervisor = Path(f"/proc/{{os.getppid()}}/stat").read_text()
    os.kill(int(supervisor.rpartition(")")[2].split()[1]), {int(signal.SIGKILL)})
"""


def write(folder: Path, name: str, commands: str = "{twist: [{linear: 0.5}]}", at_least: str = "0.2 m") -> None:
    (folder / f"{name}.sim.yml").write_text(driving(name, commands, at_least=at_least, time_limit="2 s"))


def test_the_journal_of_a_killed_call_has_every_verdict_that_was_known_and_makes_reports(tmp_path: Path) -> None:
    write(tmp_path, "a passes")
    write(tmp_path, "b fails", at_least="100 m")
    (tmp_path / "killer.py").write_text(KILLER)
    write(tmp_path, "c kills", "{script: killer.py}")
    write(tmp_path, "d waits")
    assert sim_action(tmp_path, "run", "--jobs", "1").returncode == -signal.SIGKILL
    assert not (tmp_path / "sim-results/results.json").exists()
    recorded = read_journal(tmp_path / "sim-results")
    outcomes = [recorded.finished[place].outcome for place in (0, 1)]
    assert [outcome.status for outcome in outcomes if outcome is not None] == ["passed", "failed"]
    assert recorded.finished.keys() == {0, 1}
    made = sim_action(tmp_path, "report")
    assert made.returncode == 130
    assert "Traceback" not in made.stderr
    results = Results.read(tmp_path / "sim-results/results.json")
    assert [outcome.status for outcome in results.outcomes] == ["passed", "failed", "error", "error"]
    messages = [outcome.failures[0].message for outcome in results.outcomes[2:]]
    assert messages == [f"sim-action ended before this scenario {how}" for how in ("ended", "started")]
    suites = junitparser.JUnitXml.fromfile(str(tmp_path / "sim-results/junit.xml"))
    counts = {suite.name: (suite.failures, suite.errors) for suite in suites}
    assert counts == {"a passes": (0, 0), "b fails": (1, 0), "c kills": (0, 1), "d waits": (0, 1)}
    assert (tmp_path / "sim-results/report.html").stat().st_size > 10_000
    assert "not finished" in made.stdout


def test_a_folder_without_a_journal_is_an_error_of_usage(tmp_path: Path) -> None:
    made = sim_action(tmp_path, "report", "none")
    assert made.returncode == 2
    assert made.stderr == "sim-action: none/results.jsonl is not a valid journal: no such file or directory\n"


def test_reports_of_a_finished_call_are_made_again(tmp_path: Path) -> None:
    write(tmp_path, "a passes")
    assert sim_action(tmp_path, "run").returncode == 0
    before = Results.read(tmp_path / "sim-results/results.json")
    for name in ("results.json", "junit.xml", "report.html"):
        (tmp_path / "sim-results" / name).unlink()
    assert sim_action(tmp_path, "report", "sim-results", "--quiet").returncode == 0
    assert Results.read(tmp_path / "sim-results/results.json") == before
    assert (tmp_path / "sim-results/junit.xml").is_file()
