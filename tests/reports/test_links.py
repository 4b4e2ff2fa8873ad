"""How to see again what a report tells of."""

from __future__ import annotations

import json
import shlex
from dataclasses import replace
from pathlib import Path
from urllib.parse import parse_qs

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from sim_action.core.errors import Location
from sim_action.core.permissions import Permissions
from sim_action.reports import ReportOptions
from sim_action.reports.html.report import page
from sim_action.reports.links import file_and_line, relative_path, replay_link, rerun_command, source_url
from sim_action.results.outcome import Outcome
from sim_action.scenario.source import Varied
from tests.outcomes import like
from tests.reports.samples import SAMPLES
from tests.soak import examples


def of(**changed: object) -> Outcome:
    return like(SAMPLES["passed"].outcomes[0], **changed)


def test_what_the_call_has_permitted_is_permitted_again(options: ReportOptions, tmp_path: Path) -> None:
    packages = (("a", str(tmp_path.resolve().parent / "my a")), ("b", str(tmp_path.resolve() / "b")))
    permissions = Permissions(outside=True, pass_env=("TOKEN",), packages=packages)
    words = shlex.split(rerun_command(of(seed=0), replace(options, permissions=permissions)))
    assert words[words.index("--package") :] == [
        *("--package", "a=../my a", "--package", "b=b", "--pass-env", "TOKEN", "--allow-outside")
    ]


def test_seeds_and_engines_of_a_command(options: ReportOptions, tmp_path: Path) -> None:
    # A seed is named unless it is the one that everything begins with.
    command = 'sim-action run scenarios/straight.sim.yml --only "burger drives straight" --backend pybullet'
    assert rerun_command(of(seed=0), options) == command
    assert rerun_command(of(seed=7, engine="MuJoCo 4.0.0"), options).endswith(" --seed 7 --backend mujoco")
    # A variation of the seed is found by its name.
    varied = of(name="push[seed=7]", seed=7, variation=(Varied("seed", 7),))
    assert rerun_command(varied, options).endswith('--only "push[seed=7]" --backend pybullet')
    # A sample is drawn again from the seed of its scenario.
    variation = (Varied("robot.pose.yaw", 0.1),)
    sample = of(name="push[yaw=0.1]", seed=81, scenario_seed=0, variation=variation)
    assert rerun_command(sample, options).endswith('--only "push[yaw=0.1]" --backend pybullet')
    again = rerun_command(like(sample, scenario_seed=7), options)
    assert again.endswith('--only "push[yaw=0.1]" --seed 7 --backend pybullet')
    # A run that is held against another engine needs both.
    pushed = rerun_command(of(name="push [pybullet]"), options)
    assert pushed == "sim-action run scenarios/straight.sim.yml --only push"
    # Files are seen from the workspace.
    outcome = of(file=str(tmp_path / "robot" / "a b.sim.yml"))
    assert rerun_command(outcome, options).startswith('sim-action run "robot/a b.sim.yml" ')


def test_runs_without_a_command_and_of_another_one(options: ReportOptions) -> None:
    assert rerun_command(SAMPLES["invalid"].outcomes[0], options) == "sim-action validate scenarios/broken.sim.yml"
    assert [rerun_command(outcome, options) for outcome in SAMPLES["missing"].outcomes[1:]] == ["", ""]
    # What is no scenario is called as it was.
    words = ("sim-action", "rostest", "my robot", "a.test", "side:=left")
    assert rerun_command(of(call=words), options) == 'sim-action rostest "my robot" a.test side:=left'


@settings(examples(40), suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture])
@example(name="a  wide  gap")
@given(name=st.text(min_size=1).filter(str.isprintable))
def test_a_shell_reads_the_name_as_it_is(name: str, options: ReportOptions) -> None:
    words = shlex.split(rerun_command(of(name=name), options))
    assert words[words.index("--only") + 1] == name


@pytest.mark.parametrize("name", ["burger drives straight", "a&t=9#b %20 +c?", "Größe/😀"])
def test_a_link_leads_to_the_moment(name: str, options: ReportOptions) -> None:
    link = replay_link(of(name=name, replay="replays/a.json.gz"), options, 4.504166)
    file, _, fragment = link.partition("#")
    assert file == "report.html"
    assert parse_qs(fragment) == {"scenario": [name], "t": ["4.5"]}


@pytest.mark.parametrize("name", ["a  wide  gap", "a\u202eb", "a\ud800b"])
def test_a_link_has_the_name_that_the_page_has(name: str, options: ReportOptions) -> None:
    told = like(SAMPLES["passed"], outcomes=(of(name=name, replay="replays/a.json.gz"),))
    entry = json.loads(page(told, options).index)["scenarios"][0]
    link = replay_link(told.outcomes[0], options)
    assert parse_qs(link.partition("#")[2])["scenario"] == [entry["name"]]


def test_links_without_a_moment_a_replay_or_a_report(options: ReportOptions) -> None:
    assert replay_link(of(name="a", replay="replays/a.json.gz"), options) == "report.html#scenario=a"
    # Without a replay or a report there is no link.
    assert replay_link(of(), options, 1.0) == ""
    unasked = replace(options, silenced=frozenset({"report"}))
    assert replay_link(of(replay="replays/a.json.gz"), unasked, 1.0) == ""


def test_relative_paths_and_places(options: ReportOptions, tmp_path: Path) -> None:
    assert relative_path(tmp_path.parent, "a/b.yml") == f"{tmp_path.name}/a/b.yml"
    assert relative_path(tmp_path, tmp_path / "a" / ".." / "b.yml") == "b.yml"
    assert relative_path(tmp_path, "../b.yml") == (tmp_path.parent / "b.yml").as_posix()
    # Workspace behind a link.
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to("real")
    assert relative_path(tmp_path / "link", tmp_path / "real" / "b.yml") == "b.yml"
    # A link inside keeps its name.
    (tmp_path / "link.yml").symlink_to("/dev/null")
    assert relative_path(tmp_path, "link.yml") == "link.yml"
    # Place.
    assert file_and_line(tmp_path, Location("a.yml", 3, 7)) == "a.yml:3"
    assert file_and_line(tmp_path, Location("a.yml")) == "a.yml"


def test_a_file_outside_the_workspace_is_seen_from_the_current_folder_and_has_no_url(
    options: ReportOptions, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("workspace", "elsewhere/deep"):
        (tmp_path / name).mkdir(parents=True)
    assert relative_path(tmp_path, "b.yml") == "b.yml"
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert relative_path(tmp_path, "b.yml") == "elsewhere/b.yml"
    assert relative_path(tmp_path / "workspace", "deep/a.sim.yml") == "deep/a.sim.yml"
    assert relative_path(tmp_path / "workspace", tmp_path / "workspace/a.sim.yml") == "a.sim.yml"
    assert relative_path(tmp_path / "workspace", tmp_path / "b.sim.yml") == str(tmp_path / "b.sim.yml")
    assert relative_path(tmp_path / "workspace", "nul\0") == "nul\0"
    foreign = replace(options, workspace=tmp_path / "workspace")
    assert source_url(Location("deep/a.sim.yml", 3), foreign) == ""
