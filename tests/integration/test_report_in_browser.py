"""`report.html` in a real browser: Chromium, driven by tools/viewer/tests/check.mjs."""

from __future__ import annotations

import atexit
import json
import os
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_action.app.live import Answer, LivePages
from sim_action.recording.replay.columns import Column
from sim_action.recording.replay.replay_data import Replay, SignalData
from sim_action.reports.html import document
from sim_action.reports.html.notebook import outcome_page, player_frame, report_frame
from sim_action.reports.html.report import page, write_html
from sim_action.results.journal import Finished, Header, Journal, Planned
from sim_action.results.outcome import Outcome, Repetition
from sim_action.results.results_json import Results
from sim_action.results.shard_results import EarlierRun
from sim_action.state.verdict import Verdict
from tests.integration.test_bolted_contacts import ARM, BASE, INERTIAL
from tests.integration.test_examples import sim_action
from tests.integration.test_live import serving
from tests.outcomes import outcome, report_options, results
from tests.patience import PATIENCE
from tests.replays import drive, kept, passed_by, seen
from tests.reports.html.gates import grid_of_runs, inconclusive_gate

ROOT = Path(__file__).parents[2]
WEB = ROOT / "tools/viewer"
# `make test` brings Node.js along where the machine has none.
NODE = shutil.which("node", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}")
BROWSER = shutil.which("chromium") or shutil.which("google-chrome")

missing = next(
    (
        words
        for there, words in (
            (NODE, "there is no Node.js"),
            (BROWSER, "there is neither chromium nor google-chrome"),
            ((WEB / "node_modules").exists(), "`npm ci` has not been run in tools/viewer/"),
            (document.viewer(), "the viewer has not been built: `make viewer`"),
        )
        if not there
    ),
    None,
)
pytestmark = pytest.mark.skipif(missing is not None, reason=str(missing))

WALL = """\
name: {name}
robot: {{model: turtlebot3_burger}}
world:
  objects:
    - {{name: wall, box: [0.1, 2.0, 0.5], pose: {{x: 1.0}}}}
commands:
  twist: [{{linear: 1.0}}]
expect:
  - travel: {{at_least: 1.5 m}}
{more}time_limit: {limit}
"""
FAR_TIMES = Column(scale=1e-7, first=2**53 - 1000, deltas=(1,) * 60)
HOSTILE = '</script><img src=x onerror="globalThis.pwned=1"> \u2028\u202e \'"`<!-- <b>'


@pytest.fixture(scope="session")
def broken(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of two real runs into a wall, of which one ends there."""
    folder = tmp_path_factory.mktemp("broken")
    ends = WALL.format(name="burger drives straight", more="  - no_collision\n", limit="30 s")
    goes_on = WALL.format(name="burger pushes on", more="", limit="30 s")
    (folder / "a.sim.yml").write_text(ends, encoding="utf-8")
    (folder / "b.sim.yml").write_text(goes_on, encoding="utf-8")
    ran = sim_action(folder, "run", ".")
    assert ran.returncode == 1, ran.stdout + ran.stderr
    return folder / "sim-results/report.html"


@cache
def browser() -> subprocess.Popen[str]:
    """The one browser of this process, at its first page."""
    command = [str(NODE), str(WEB / "tests/check.mjs"), str(BROWSER)]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    atexit.register(process.communicate)
    return process


def look(report: Path | str, *checks: str) -> None:
    """Ask the browser for the error of each check: there is none."""
    process = browser()
    assert process.stdin is not None
    assert process.stdout is not None
    watchdog = threading.Timer(PATIENCE * len(checks), process.kill)
    watchdog.start()
    try:
        process.stdin.write(json.dumps([str(report), *checks]) + "\n")
        process.stdin.flush()
        errors = dict(json.loads(process.stdout.readline()) for _ in checks)
    finally:
        watchdog.cancel()
    assert errors == dict.fromkeys(checks, "")


def filmed(
    folder: Path, name: str, motion: Replay | None = None, *, file: str = "", holds: bool = True, **more: Any
) -> Outcome:
    stored = kept(motion or drive(), folder, file or name)
    return outcome(f"{file or name}.sim.yml", holds=holds).model_copy(update={"name": name, "replay": stored, **more})


def show(folder: Path, *ran: Outcome) -> Path:
    write_html(results(*ran), report_options(folder))
    return folder / "report.html"


def show_against(folder: Path, before: Sequence[Outcome], *now: Outcome) -> Path:
    """Write the report, in `new`, of some outcomes against those of an earlier run, in `old`."""
    against = EarlierRun("old", tuple(before), {id(each): folder / "old" for each in before})
    write_html(results(*now), replace(report_options(folder / "new"), against=against))
    return folder / "new/report.html"


ACCESSIBLE = "axe finds nothing"
CHECKS = [
    "loads",
    "opens where it failed",
    "play moves the robot",
    "scrubbing moves the cursor",
    "a moving picture follows, and is sharp at rest",
    "a link opens at its time",
    "the address tells what is seen",
    "keys do what buttons do",
    "every button has the focus in turn, and shows it",
    "without WebGL it is seen from above",
    "with scripts blocked verdict and drawing are there",
    "a phone has no sideways scroll",
    "from above distances are measured",
    "the address tells the camera",
    "a chosen link has a path and a frame",
    "signals are chosen by mouse",
    "signals are chosen by keys alone",
    "a drag zooms all plots, and the address restores them",
    "embedded there is only the player",
    "embedded the picture begins below the name",
    "each key stays with its word",
]


def test_a_broken_run(broken: Path) -> None:
    look(broken, *CHECKS)


def test_a_proof(tmp_path: Path) -> None:
    slowly = "robot: {model: turtlebot3_burger}\ncommands: {twist: [{linear: 0.2}]}\ntime_limit: 20 s\n"
    text = f"name: burger\n{slowly}expect: [{{travel: {{at_least: 1.5}}}}]\n"
    (tmp_path / "a.sim.yml").write_text(text, encoding="utf-8")
    ran = sim_action(tmp_path, "prove", "--only", "scaled:x2", ".")
    assert ran.returncode == 0, ran.stdout + ran.stderr
    look(
        tmp_path / "sim-results/proof/report.html",
        "a survivor plays with the run without a fault as a ghost",
        "a phone has no sideways scroll",
        "a phone has room for a finding",
        ACCESSIBLE,
    )


def test_a_base_run(tmp_path: Path) -> None:
    before = filmed(tmp_path / "old", "burger moves", drive(distance=1.5))
    now = filmed(tmp_path / "new", "burger moves", drive(distance=1.0), holds=False)
    look(
        show_against(tmp_path, [before], now),
        "the base run is a ghost, by mouse",
        "the ghost of an address is drawn, by keys",
        "files have the ghost, too",
    )


def test_repetitions(tmp_path: Path) -> None:
    again = tuple(
        Repetition(cause=name, status="passed", ending="passed", replay=kept(drive(distance=distance), tmp_path, name))
        for name, distance in (("half", 0.5), ("moved", 1.5))
    )
    scene = drive().scene
    links = tuple(link.model_copy(update={"shapes": ()}) for link in scene.links)
    shapeless = drive().model_copy(update={"scene": scene.model_copy(update={"links": links})})
    ran = (
        filmed(tmp_path, "alone"),
        filmed(tmp_path, "bare", shapeless),
        filmed(tmp_path, "burger", repetitions=again),
    )
    checks = ("repetitions are thin lines in views and bands in plots", "a robot without shapes has a path")
    look(show(tmp_path, *ran), *checks)


@pytest.mark.soak
def test_a_base_run_that_ended_earlier(tmp_path: Path) -> None:
    before = filmed(tmp_path / "old", "burger goes on", drive(seconds=1.5))
    now = filmed(tmp_path / "new", "burger goes on", drive(seconds=3.0, distance=1.5))
    look(show_against(tmp_path, [before], now), "a ghost that ended earlier is said to")


def test_a_report_in_a_notebook(broken: Path, tmp_path: Path) -> None:
    (tmp_path / "notebook.html").write_text(report_frame(broken.read_text(encoding="utf-8")), encoding="utf-8")
    look(tmp_path / "notebook.html", "links in the frame of a notebook stay in it")


@pytest.mark.soak
def test_an_outcome_in_a_notebook(tmp_path: Path) -> None:
    made = outcome_page(filmed(tmp_path, "cart"), report_options(tmp_path))
    assert made is not None
    # A frame of a page that trusts nothing: it has no origin.
    frame = player_frame(made.text()).replace("<iframe", '<iframe sandbox="allow-scripts"')
    (tmp_path / "notebook.html").write_text(frame, encoding="utf-8")
    look(tmp_path / "notebook.html", "a frame without rights plays")


def test_a_run_that_goes_on(tmp_path: Path) -> None:
    ran = [filmed(tmp_path, name) for name in ("cart", "van")]
    header = Header.of_call([Planned.of(each) for each in ran], ())
    journal = Journal(tmp_path, header, pytest.fail, time.monotonic())
    journal(Finished(0, ran[0]))
    pages = LivePages(tmp_path)
    asked: list[str] = []

    def answering(page: str, query: str) -> Answer | None:
        """Answer; once the report has been opened, the call goes on and ends."""
        answer = pages(page, query)
        if page == "report" and page not in asked:
            journal(Finished(1, ran[1]))
            journal.close()
        asked.append(page)
        return answer

    with serving(answering) as server:
        look(server.address, "progress leads to a report that offers what is new")


@pytest.mark.soak
@pytest.mark.parametrize(
    ("control", "options", "printed", "check"),
    [
        (
            "    return Twist.planar((time.time_ns() % 1000) / 1e4 if seen.time > 0.4 else 0.1)\n",
            ("--repeat", "3"),
            "flaky",
            "opens where runs parted",
        ),
        ("    if seen.time > 1.05:\n        raise ValueError('no scan')\n", (), "no scan", "opens where it broke off"),
    ],
)
def test_a_run_that_parts_or_breaks_off(
    control: str, options: tuple[str, ...], printed: str, check: str, tmp_path: Path
) -> None:
    text = WALL.format(name="burger", more="", limit="2 s").replace("twist: [{linear: 1.0}]", "script: steers.py")
    (tmp_path / "a.sim.yml").write_text(text, encoding="utf-8")
    script = f"import time\nfrom sim_action import Twist\n\ndef control(seen):\n{control}"
    (tmp_path / "steers.py").write_text(script, encoding="utf-8")
    ran = sim_action(tmp_path, "run", ".", *options)
    assert printed in ran.stdout, ran.stdout + ran.stderr
    look(tmp_path / "sim-results/report.html", check)


@pytest.mark.soak
def test_a_contact_without_a_force(tmp_path: Path) -> None:
    (tmp_path / "robot.urdf").write_text(ARM.format(inertial=INERTIAL, base=BASE), encoding="utf-8")
    scenario = """\
name: a cart drives through the foot of an arm
robot: {model: robot.urdf, base: fixed}
world:
  objects:
    - {name: agv, box: [0.6, 0.6, 0.06], pose: {x: 1}, path: [{at: 0 s, x: 1}, {at: 2 s, x: -1}]}
expect: [no_collision]
time_limit: 2 s
"""
    (tmp_path / "a.sim.yml").write_text(scenario, encoding="utf-8")
    ran = sim_action(tmp_path, "run", ".")
    assert "with no computed force (neither gives way)" in ran.stdout, ran.stdout + ran.stderr
    look(tmp_path / "sim-results/report.html", "names a contact without a force")


def test_without_the_viewer(broken: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(broken.parent, tmp_path / "results")
    monkeypatch.setattr(document, "viewer", lambda: None)
    write_html(Results.read(broken.parent / "results.json"), report_options(tmp_path / "results"))
    look(tmp_path / "results/report.html", "without the viewer it is seen from above")


def test_hostile_names(tmp_path: Path) -> None:
    of_sensors = {key: getattr(seen(HOSTILE), key) for key in ("scans", "cameras", "obstacles", "unread")}
    replay = drive(body=HOSTILE, robot=HOSTILE).model_copy(update=of_sensors)
    replay = replay.model_copy(
        update={"signals": (replay.signals[0].model_copy(update={"name": HOSTILE, "unit": HOSTILE}),)}
    )
    name = kept(replay, tmp_path, "hostile")
    failed = Verdict(passed=False, measured=1.0, limit=1.5, margin=-0.5, unit="m", time=2.0, message=HOSTILE)
    ran = outcome("a.sim.yml", holds=False)
    [expected] = ran.expectations
    hostile = ran.model_copy(
        update={
            "name": HOSTILE,
            "file": f"{HOSTILE}.sim.yml",
            "group": HOSTILE,
            "expectations": (expected.model_copy(update={"name": HOSTILE, "verdict": failed}),),
            "notes": (HOSTILE,),
            "output": HOSTILE,
            "digest": HOSTILE,
            "engine": HOSTILE,
            "replay": name,
        }
    )
    frames = replay.frames.model_copy(
        update={"base": (Column(scale=1.0, first=2**53), *replay.frames.base[1:]), "time": FAR_TIMES}
    )
    far = filmed(tmp_path, "far", replay.model_copy(update={"frames": frames}))
    look(show(tmp_path, hostile, far), "hostile names stay text", "places and times far from zero stop nothing")


def test_what_the_robot_saw(tmp_path: Path) -> None:
    look(
        show(tmp_path, filmed(tmp_path, "a", seen(), holds=False)),
        "layers are chosen by keys, and the address keeps them",
        "sensors are in step with the clock",
        "with scripts blocked an article says which sensor saw what",
        "a phone has no sideways scroll",
    )


def test_bodies_that_come_from_aside(tmp_path: Path) -> None:
    look(show(tmp_path, filmed(tmp_path, "a", passed_by())), "a body that comes from aside is in view")


def test_runs_of_one_name(tmp_path: Path) -> None:
    """The second one failed, so it stands first."""
    ran = [
        filmed(tmp_path, "burger", file=file, holds=holds, replay=kept(drive(), tmp_path, stem))
        for file, holds, stem in (("first", True, "burger"), ("second", False, "burger-2"))
    ]
    look(show(tmp_path, *ran), "a link tells runs of one name apart", "a joint is plotted with its command")


@pytest.mark.soak
def test_words_of_plots(tmp_path: Path) -> None:
    """Limits near each other at the bottom and at the top, and small numbers with a sign."""
    replay = drive()
    falls, rises = (Column.encoded(np.linspace(first, last, 61), 1e-4) for first, last in ((3, 0.45), (0, 3)))
    gap = SignalData(expectation=0, name="gap", unit="m", values=falls, lower=0.4, upper=0.55)
    height = SignalData(expectation=0, name="height", unit="m", values=rises, lower=2.9, upper=3.0)
    drift = Column.encoded(np.linspace(0, -6e-4, 61), 1e-5)
    frames = replay.frames.model_copy(update={"base": (replay.frames.base[0], drift, *replay.frames.base[2:])})
    moved = replay.model_copy(update={"signals": (gap, height), "frames": frames})
    look(show(tmp_path, filmed(tmp_path, "burger", moved)), "words of plots do not overlap, and time axes agree")


def test_a_gate(tmp_path: Path) -> None:
    gate = inconclusive_gate()
    replay = kept(drive(), tmp_path, "push")
    runs = [each.model_copy(update={"replay": replay}) if "yaw=-8deg" in each.name else each for each in gate.outcomes]
    write_html(gate.model_copy(update={"outcomes": tuple(runs)}), report_options(tmp_path))
    look(
        tmp_path / "report.html",
        "a point of a sweep opens its run",
        "a sweep is used by keys alone",
        "with scripts blocked a gate has its verdict and runs",
        "a gate fits on a phone",
        ACCESSIBLE,
    )


@pytest.mark.soak
def test_folded_runs(tmp_path: Path) -> None:
    gate = inconclusive_gate()
    scenarios = [outcome(f"{name}.sim.yml") for name in ("first", "second")]
    ran = gate.model_copy(update={"outcomes": (*gate.outcomes, *grid_of_runs(), *scenarios)})
    write_html(ran, report_options(tmp_path))
    look(
        tmp_path / "report.html",
        "keys go past folded rows, and back",
        "keys go into a group that is open",
        "a heat map has a cell for each listed value",
        "a link to a scenario that is not there says so",
        "the filter of the list covers what scrolls below it",
    )


def test_a_suite(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A suite of thousands has its articles as text, and so has this one."""
    monkeypatch.setattr("sim_action.reports.html.report.MAX_PARSED_ARTICLES", 10)

    def ran(folder: str, number: int, *, holds: bool) -> Outcome:
        # The runs of the base went on.
        replay = drive(seconds=10.0, distance=number / 20 + (0.5 if holds else 0.2))
        name, file = f"number {number}", f"{'odd' if number % 2 else 'even'}/{number}"
        tags = ("slow",) if number % 3 else ("slow", "dock-2")
        time_s = None if number == 5 else 1.0 + number
        return filmed(tmp_path / folder, name, replay, file=file, holds=holds, tags=tags, sim_time=time_s)

    bad = range(0, 66, 21)
    before = [ran("old", number, holds=True) for number in bad]
    report = show_against(tmp_path, before, *(ran("new", number, holds=number not in bad) for number in range(66)))
    assert report.stat().st_size < 3_000_000
    look(
        report,
        "from all scenarios to one moment, by mouse",
        "from all scenarios to one moment, by keys alone",
        "many are filtered, and open quickly",
        "many are sorted and grouped, and the address keeps it",
        "with scripts blocked each of many has its article",
        ACCESSIBLE,
    )


def test_one_scenario_fits_its_budget(broken: Path) -> None:
    [longest] = [one for one in Results.read(broken.parent / "results.json").outcomes if one.name == "burger pushes on"]
    alone = page(results(longest), report_options(broken.parent))
    assert longest.sim_time == 30.0
    built = document.viewer()
    assert built is not None
    scripts = len(document.page_script().encode()) + len(built.packed)
    assert scripts < 400_000
    assert len(alone.text().encode()) - scripts < 60_000
