"""The article of one scenario in report.html."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import replace
from html import unescape
from pathlib import Path

import pytest

from sim_action.core.errors import Location
from sim_action.recording.replay.sightings import BlindData, ObstacleData, SightingData
from sim_action.reports import ReportOptions
from sim_action.reports.html.scenario_article import direction, run_reasons, scenario_source, sightings
from sim_action.results.outcome import Failure, Outcome
from tests.outcomes import like, outcome
from tests.replays import drive


@pytest.mark.parametrize(("count", "shown", "left"), [(20, 20, ""), (23, 20, "3 more errors are in results.json.")])
def test_the_first_twenty_errors_are_shown(count: int, shown: int, left: str, options: ReportOptions) -> None:
    failures = tuple(Failure(kind="invalid", title="invalid", message=f"problem-{index};") for index in range(count))
    html = str(run_reasons(Outcome(name="a", file="a.sim.yml", status="error", failures=failures), options, {}))
    assert [index for index in range(count) if f"problem-{index};" in html] == list(range(shown))
    assert ("more errors" in html) == bool(left)
    assert left in html


@pytest.mark.parametrize(
    ("body", "words"), [("pallet", "first seen by skirt (lidar) at 1.40 s"), ("wall", ""), ("", "")]
)
def test_a_failure_names_the_sensor_that_saw_its_body_first(body: str, words: str, options: ReportOptions) -> None:
    made = outcome("a.sim.yml", holds=False)
    [expected] = made.expectations
    hit = like(expected, verdict=replace(expected.verdict, body=body))
    seen = {"pallet": SightingData(sensor="skirt", kind="lidar", time=1.4)}
    html = run_reasons(like(made, expectations=(hit,)), options, seen)
    assert ("first seen" in html) == bool(words)
    assert words in html


LINES = [f"line {number} <b>" for number in range(1, 61)]


@pytest.mark.parametrize(
    ("file", "shown", "marked"),
    [
        ("a.sim.yml", range(1, 29), [8]),
        ("folder/a.yaml", range(1, 29), [8]),
        *((f"{name}.sim.yml", [], []) for name in ("../outside", "link", "none")),
        *((name, [], []) for name in ("a.py", "binary.yml", "large.yml")),
    ],
)
def test_a_failure_shows_its_line_of_the_scenario(
    file: str, shown: Iterable[int], marked: list[int], options: ReportOptions, tmp_path: Path
) -> None:
    """Results of others may name any file: only scenarios of the workspace are shown."""
    workspace = tmp_path / "workspace"
    (workspace / "folder").mkdir(parents=True)
    texts = {name: "\n".join(LINES) for name in ("a.sim.yml", "folder/a.yaml", "a.py", "../outside.sim.yml")}
    for name, text in {**texts, "large.yml": "a" * 1_000_001}.items():
        (workspace / name).write_text(text, encoding="utf-8")
    (workspace / "binary.yml").write_bytes(b"\xff\xfe")
    (workspace / "link.sim.yml").symlink_to(tmp_path / "outside.sim.yml")
    made = outcome(str(workspace / file), holds=False)
    html = scenario_source(made, replace(options, workspace=workspace))
    lines = re.findall(r"<(mark|span)>(?:&gt;| ) *(\d+) \| line \d+ &lt;b&gt;\n</", html)
    assert [int(number) for _, number in lines] == [*shown]
    assert [int(number) for tag, number in lines if tag == "mark"] == marked
    assert scenario_source(like(made, status="passed"), options) == ""


def test_an_error_elsewhere_shows_the_scenario_without_a_mark(options: ReportOptions, tmp_path: Path) -> None:
    (tmp_path / "a.sim.yml").write_text("name: a\nrobot: {}\n", encoding="utf-8")
    failure = Failure(kind="script", title="script error", message="no", location=Location("b.py", 2))
    html = scenario_source(Outcome(name="a", file="a.sim.yml", status="error", failures=(failure,)), options)
    assert "<mark>" not in html
    assert "2 | robot: {}" in html


LIDAR = SightingData(sensor="front", kind="lidar", time=0.4, distance=1.42, angle=-0.0349)
BUMPER = SightingData(sensor="bumper", kind="contact", time=2.3)

BOTH = (
    "wall was first seen by front (lidar) at 0.40 s, 1.42 m away 2 deg to the right, then by bumper (contact) "
    "at 2.30 s; the robot touched it at 2.31 s, 1.91 s later."
)


UNSEEN = (
    "wall was not seen by any lidar or contact sensor, in the readings that are kept; the robot touched it at 2.30 s."
)


def said(*obstacles: ObstacleData, unread: tuple[str, ...] = (), body: str = "wall") -> list[str]:
    html = sightings(like(drive(body=body), obstacles=obstacles, unread=unread))
    return [unescape(re.sub("<[^>]*>", "", item)) for item in re.findall("<li>.*?</li>", html)]


@pytest.mark.parametrize(
    ("obstacle", "words"),
    [
        (ObstacleData(body=0, touched=2.31, seen=(LIDAR, BUMPER)), BOTH),
        (ObstacleData(body=0, seen=(BUMPER,)), "wall was first seen by bumper (contact) at 2.30 s."),
        (
            ObstacleData(body=0, seen=(like(BUMPER, every=8),)),
            "wall was first seen by bumper (contact, 1 of 8 readings looked at) at 2.30 s.",
        ),
        (ObstacleData(body=0, touched=2.3), UNSEEN),
        (
            ObstacleData(body=0, touched=2.3, seen=(BUMPER,)),
            "wall was first seen by bumper (contact) at 2.30 s; the robot touched it at 2.30 s.",
        ),
    ],
)
def test_the_first_sensor_is_named_with_its_time(obstacle: ObstacleData, words: str) -> None:
    assert said(obstacle) == [words]


@pytest.mark.parametrize(("every", "words"), [(1, "lidar"), (2, "lidar, 1 of 2 readings looked at")])
def test_a_lidar_that_did_not_see_a_body_is_named(every: int, words: str) -> None:
    blind = (BlindData(sensor="<mast>", every=every), BlindData(sensor="rear"))
    (told,) = said(ObstacleData(body=0, touched=2.3, seen=(LIDAR,), blind=blind))
    assert f"2 deg to the right; <mast> ({words}), rear (lidar) did not see it; the robot" in told


def test_sensors_of_a_run() -> None:
    # Sensors that nothing reads are named.
    (words,) = said(unread=("front", "<b>"))
    assert words.endswith("reads it: front, <b>. Add trace: true to a sensor to see here what it measures.")
    # Names are text.
    hostile = like(drive(body="<script>"), obstacles=(ObstacleData(body=0, seen=(LIDAR,)),))
    assert "<script>" not in sightings(hostile)
    assert sightings(drive()) == ""


@pytest.mark.parametrize(
    ("degrees", "words"),
    [
        (0.4, "straight ahead"),
        (12.4, "12 deg to the left"),
        (-90.0, "90 deg to the right"),
        (179.9, "behind"),
        (-179.9, "behind"),
    ],
)
def test_directions(degrees: float, words: str) -> None:
    assert direction(math.radians(degrees)) == words
