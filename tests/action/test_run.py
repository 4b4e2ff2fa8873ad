from __future__ import annotations

import itertools
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from action.run import SUBCOMMANDS, InputError, enter, lines, run, set_up_time
from sim_action.cli.main import program

ROOT = Path(__file__).parents[2]
INPUTS = {
    "scenario": "a.sim.yml\n\n  b *.sim.yml \r\n--help\n",
    "working-directory": ".",
    "output-directory": "what came out",
    "junit-path": "",
    "junit-strict": "false",
    "backend": "",
    "only": "",
    "exclude": "",
    "packages": "",
    "tags": "",
    "exclude-tags": "",
    "fail-fast": "false",
    "resume": "false",
    "seed": "",
    "strict": "",
    "repeat": "",
    "unexercised": "",
    "confidence": "",
    "jobs": "",
    "shard": "2/3",
    "report": "false",
    "against": "",
    "record": "tum, csv",
    "summary": "true",
    "annotations": "false",
    "fail-on-failure": "true",
    "allow-scripts": "auto",
    "pass-env": "",
}


def test_inputs_become_a_command_line() -> None:
    assert list(SUBCOMMANDS["run"].command_line({**INPUTS, "unexercised": " warn "})) == [
        "--output-dir=what came out",
        "--unexercised=warn",
        "--shard=2/3",
        "--record=tum, csv",
        "--allow-scripts=auto",
        "--no-junit-strict",
        "--no-report",
        "--summary",
        "--no-annotations",
        "--no-fail-fast",
        "--no-resume",
        "--",
        "a.sim.yml",
        "b *.sim.yml",
        "--help",
    ]


def test_inputs_of_a_proof_select_mutants() -> None:
    inputs = {**given("prove"), "mutants": "wall\nmotor-off:left", "strict": "true", "budget": "10 min"}
    told = list(SUBCOMMANDS["prove"].command_line(inputs))
    assert {"--only=wall", "--only=motor-off:left", "--strict", "--budget=10 min", "--no-report"} <= {*told}
    assert told[-2:] == ["--", "value-of-scenario"]


SWITCHES = [(name, switch) for name, subcommand in SUBCOMMANDS.items() for switch in subcommand.switches]


@pytest.mark.parametrize(("name", "switch"), SWITCHES)
def test_a_switch_overrides_the_project_both_ways_and_an_empty_one_leaves_it_alone(name: str, switch: str) -> None:
    subcommand = replace(SUBCOMMANDS[name], required=())
    inputs = dict.fromkeys((*subcommand.arguments, *subcommand.lists, *subcommand.options, *subcommand.switches), "")
    for value, expected in {"true": [f"--{switch}"], "false": [f"--no-{switch}"], "": [], " ": []}.items():
        assert list(subcommand.command_line({**inputs, switch: value})) == [*expected, "--"]


@pytest.mark.parametrize("name", SUBCOMMANDS)
def test_every_option_of_an_action_is_one_of_its_command(name: str) -> None:
    command = program.commands[name]
    known = {opt for param in command.params for opt in (*param.opts, *param.secondary_opts)}
    assert SUBCOMMANDS[name].names.keys() <= known


def given(name: str) -> dict[str, str]:
    """Return a text for each input of an action."""
    subcommand = SUBCOMMANDS[name]
    texts = {each: f"value-of-{each}" for each in (*subcommand.arguments, *subcommand.lists, *subcommand.options)}
    return {**texts, **dict.fromkeys(subcommand.switches, "false")}


@pytest.mark.parametrize("name", SUBCOMMANDS)
def test_of_every_pair_of_inputs_both_reach_the_command_line(name: str) -> None:
    subcommand, filled = SUBCOMMANDS[name], given(name)
    words = {each: word for word in subcommand.command_line(filled) for each in filled if word.endswith(f"of-{each}")}
    words |= {each: options[1] for each, options in subcommand.switches.items()}
    assert words.keys() == filled.keys()
    alone = replace(subcommand, required=())
    for pair in itertools.combinations(filled, 2):
        inputs = {each: text if each in pair else "" for each, text in filled.items()}
        assert {*alone.command_line(inputs)} == {"--", *(words[each] for each in pair)}


def test_empty_inputs() -> None:
    # An input that must have a value is refused if it is empty.
    for name in ("working-directory", "allow-scripts"):
        for value in ("", " \n"):
            with pytest.raises(InputError, match=f"the input {name} is empty"):
                run("run", {**INPUTS, name: value})
    # A switch that only the action has is not empty.
    with pytest.raises(InputError, match="input fail-on-failure must be true or false, and is empty"):
        run("run", {**INPUTS, "fail-on-failure": ""})


@pytest.mark.parametrize("name", ["output-directory", "junit-path", "backend", "shard", "jobs"])
def test_an_input_for_one_value_has_one_line(name: str) -> None:
    with pytest.raises(InputError, match=f"the input {name} must be one line, and has 2"):
        list(SUBCOMMANDS["run"].command_line({**INPUTS, name: "1\n2"}))


@pytest.mark.parametrize(
    ("subcommand", "inputs", "message"),
    [
        ("run", {"repeat": "0"}, "value for the input repeat: expected a whole number from 1 to 1000, found '0'"),
        ("run", {"jobs": "many"}, "value for the input jobs: expected a whole number from 1 to 256, found 'many'"),
        ("run", {"backend": "bullet"}, "Invalid value for the input backend: 'bullet' is not one of"),
        ("run", {"packages": "a"}, "the input packages takes NAME=FOLDER, found 'a'"),
        ("run", {"packages": "a=nowhere"}, "the input packages a=nowhere: there is no such folder (looked for "),
        ("run", {"junit-path": "."}, "the input junit-path . is a folder; name a file"),
        ("merge", {"only": "a", "tags": "b"}, "the input only, the input tags need the input scenario"),
        ("merge", {"exclude": "a"}, "the input exclude needs the input scenario"),
    ],
)
def test_an_error_names_the_input_and_not_the_option(
    subcommand: str, inputs: dict[str, str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    given = {**INPUTS, "results": "x", "shard": "", "scenario": "action" if subcommand == "run" else ""}
    assert run(subcommand, {**given, **inputs}) == 2
    captured = capsys.readouterr()
    assert message in captured.err
    assert "--help" not in captured.err


def test_defaults_are_those_of_the_project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "suite").mkdir()
    for name in ("suite/a", "b"):
        (tmp_path / f"{name}.sim.yml").write_text("name: a\nexpect: []\n", encoding="utf-8")
    table = '[tool.sim-action]\npaths = ["suite"]\noutput-dir = "out"\njunit = "out/tests.xml"\nreport = false\n'
    (tmp_path / "pyproject.toml").write_text(table, encoding="utf-8")
    outputs = tmp_path / "outputs"
    monkeypatch.setenv("GITHUB_OUTPUT", str(outputs))
    switches = ("junit-strict", "report", "summary", "annotations", "fail-fast", "resume")
    empty = dict.fromkeys((*switches, "scenario", "output-directory", "shard", "record"), "")
    assert run("run", {**INPUTS, **empty}) == 2
    stated = outputs.read_text(encoding="utf-8").splitlines()
    assert {str(tmp_path / "out"), str(tmp_path / "out/tests.xml"), str(tmp_path / "out/results.json")} <= set(stated)
    assert not list(tmp_path.rglob("report.html"))
    [outcome] = json.loads((tmp_path / "out/results.json").read_text(encoding="utf-8"))["outcomes"]
    assert outcome["file"] == "suite/a.sim.yml"
    assert run("run", {**INPUTS, **empty, "output-directory": "other", "report": "true"}) == 2
    assert (tmp_path / "other/report.html").is_file()


@pytest.mark.parametrize("of_project", ["", "out"])
def test_each_use_of_a_job_has_a_folder_of_its_own(
    of_project: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("RUNNER_TEMP", str(tmp_path))
    (tmp_path / "a.sim.yml").write_text("name: a\nexpect: []\n", encoding="utf-8")
    if of_project:
        table = f'[tool.sim-action]\noutput-dir = "{of_project}"\njunit = "{of_project}/tests.xml"\n'
        (tmp_path / "pyproject.toml").write_text(table, encoding="utf-8")
    first = of_project or "sim-results"
    empty = {**INPUTS, "scenario": "", "output-directory": "", "shard": "", "record": ""}
    for folder in (first, f"{first}-2", f"{first}-3"):
        assert run("run", empty) == 2
        assert (tmp_path / folder / "results.json").is_file()
    assert (tmp_path / f"{first}-2/junit.xml").is_file()
    told = capsys.readouterr().err
    assert f"sim-action: '{first}' has the results of an earlier use in this job, so those of this one go to" in told
    # On purpose.
    for stated in ({"output-directory": first}, {"resume": "true"}):
        before = (tmp_path / first / "results.json").stat().st_mtime_ns
        assert run("run", {**empty, **stated}) == 2
        assert (tmp_path / first / "results.json").stat().st_mtime_ns > before
    assert not (tmp_path / f"{first}-4").exists()


def test_what_is_selected_is_an_option_for_each_line() -> None:
    inputs = {**INPUTS, "only": "push[a=1, b=2]\n--x\n", "exclude": "a*", "tags": "x\ny", "exclude-tags": "z"}
    line = list(SUBCOMMANDS["run"].command_line({**inputs, "fail-fast": "true"}))
    selecting = [argument for argument in line if argument.startswith(("--only", "--ex", "--tag", "--fail"))]
    assert selecting == [
        "--fail-fast",
        "--only=push[a=1, b=2]",
        "--only=--x",
        "--exclude=a*",
        "--tag=x",
        "--tag=y",
        "--exclude-tag=z",
    ]
    # Packages and variables are an option for each line.
    inputs = {**INPUTS, "packages": "a=../a b\n\n c=d\n", "pass-env": "X\nY"}
    line = list(SUBCOMMANDS["run"].command_line(inputs))
    passed = [argument for argument in line if argument.startswith(("--package", "--pass"))]
    assert passed == ["--package=a=../a b", "--package=c=d", "--pass-env=X", "--pass-env=Y"]
    # Merge names each scenario that must be there.
    inputs = {**INPUTS, "results": "shards", "scenario": "a b\nc"}
    line = list(SUBCOMMANDS["merge"].command_line(inputs))
    assert [argument for argument in line if "scenarios" in argument] == ["--scenarios=a b", "--scenarios=c"]
    assert line[-2:] == ["--", "shards"]


def test_compare_names_the_earlier_results_first() -> None:
    given = {"old": "before", "new": "--after", "margin": "0.3", "slower": "", "strict": "true", "markdown": "a.md"}
    given["allow-removed"] = "true"
    assert list(SUBCOMMANDS["compare"].command_line({**given, "summary": "false"})) == [
        "--margin=0.3",
        "--markdown=a.md",
        "--strict",
        "--allow-removed",
        "--no-summary",
        "--",
        "before",
        "--after",
    ]


@pytest.mark.parametrize(
    "name", ["report", "summary", "annotations", "junit-strict", "fail-on-failure", "fail-fast", "resume"]
)
@pytest.mark.parametrize("value", ["yes", "True", "TRUE", "1", "true\nfalse"])
def test_switches_are_true_or_false(name: str, value: str) -> None:
    with pytest.raises(InputError, match=f"input {name} must be true or false, and is '{value}'"):
        run("run", {**INPUTS, name: value})


@pytest.mark.parametrize("folder", ["missing", "a.txt", "x" * 5000, "nul\0", "loop", "loop/a"])
def test_working_directory_is_a_folder(folder: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("GITHUB_WORKSPACE", str(tmp_path))
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "a.txt").touch()
    with pytest.raises(InputError, match="working-directory") as raised:
        enter(folder)
    assert "Errno" not in str(raised.value)


@pytest.mark.parametrize(
    ("folder", "reason"),
    [
        ("sim", "there is no folder 'sim'; did you mean 'simu'?"),
        ("elsewhere", "there is no folder 'elsewhere'; name a folder that is checked out, from its top"),
        ("a.txt", "'a.txt' is a file; name a folder"),
    ],
)
def test_a_missing_working_directory_is_reported_with_the_nearest_folder(
    folder: str, reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "simu").mkdir()
    (tmp_path / "a.txt").touch()
    with pytest.raises(InputError) as raised:
        enter(folder)
    assert str(raised.value) == f"the input working-directory: {reason}"


@pytest.mark.parametrize("is_named_through_a_link", [False, True])
@pytest.mark.parametrize("form", ["{}", "./{}", "{workspace}/{}", "deep/../{}", "{way}/{}"])
@pytest.mark.parametrize("name", ["link", "deep/link", "link/inner", "chain", "link/../outside/inner"])
def test_a_working_directory_behind_a_link_out_of_the_workspace_is_refused(
    name: str, form: str, is_named_through_a_link: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    workspace, outside, way = tmp_path / "workspace", tmp_path / "outside", tmp_path / "way"
    (workspace / "deep").mkdir(parents=True)
    (outside / "inner").mkdir(parents=True)
    (workspace / "link").symlink_to(outside)
    (workspace / "deep/link").symlink_to("../../outside")
    (workspace / "chain").symlink_to("deep/link")
    way.symlink_to(workspace)
    monkeypatch.chdir(workspace)
    monkeypatch.setenv("GITHUB_WORKSPACE", str(way if is_named_through_a_link else workspace))
    named = form.format(name, workspace=workspace, way=way)
    with pytest.raises(InputError) as caught:
        enter(named)
    assert str(caught.value).startswith("the input working-directory leads through a link to ")
    assert f"outside the workspace {workspace}; name" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert Path.cwd() == workspace


@pytest.mark.parametrize(
    "named", ["{outside}", "../outside", "{workspace}/../outside", "{outside}/link", "inner", "deep/.."]
)
def test_a_working_directory_may_be_outside_on_purpose_and_behind_a_link_inside(
    named: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    workspace, outside = tmp_path / "workspace", tmp_path / "outside"
    (workspace / "deep").mkdir(parents=True)
    outside.mkdir()
    (workspace / "inner").symlink_to("deep")
    (outside / "link").symlink_to(workspace)
    monkeypatch.chdir(workspace)
    monkeypatch.setenv("GITHUB_WORKSPACE", str(workspace))
    enter(named.format(outside=outside, workspace=workspace))
    expected = {"inner": workspace / "deep", "deep/..": workspace, "{outside}/link": workspace}
    assert Path.cwd() == expected.get(named, outside)


def test_lines_of_inputs_and_set_up_times(monkeypatch: pytest.MonkeyPatch) -> None:
    assert lines("a\u2028b\r\n\n \n c\x0bd\n") == ["a\u2028b", "c\x0bd"]
    # Set up time is split.
    now = 1000.0
    monkeypatch.setattr("time.time", lambda: now)
    text = set_up_time(f"{now - 30} {now - 27} {now - 20} {now - 6}")
    assert text == "Set-up took 30 s: Python 3 s, install 14 s, other steps 13 s"
    text = set_up_time(f"{now - 30} {now - 27} {now - 20} {now - 10} {now - 9} {now - 3}")
    assert text == "Set-up took 30 s: Python 3 s, install 10 s, ROS 2 6 s, other steps 11 s"


@pytest.mark.process
def test_a_runner_gets_utf_8_whatever_the_code_page_of_the_console_is(tmp_path: Path) -> None:
    (tmp_path / "✓.sim.yml").write_text("name: ✓\nexpect: []\n", encoding="utf-8")
    inputs = {f"INPUT_{name.upper().replace('-', '_')}": value for name, value in {**INPUTS, "shard": ""}.items()}
    ran = subprocess.run(
        [sys.executable, "-P", ROOT / "action/run.py", "run"],
        cwd=tmp_path,
        env={**os.environ, **inputs, "INPUT_SCENARIO": ".", "PYTHONPATH": str(ROOT), "PYTHONIOENCODING": "cp1252"},
        capture_output=True,
        check=False,
    )
    assert ran.returncode == 2
    assert "‼ ✓  ✓.sim.yml" in ran.stdout.decode("utf-8")
    assert b"\r" not in ran.stdout + ran.stderr


ROSTEST = {
    **{name: INPUTS[name] for name in ("working-directory", "output-directory", "junit-path", "junit-strict")},
    **{name: INPUTS[name] for name in ("backend", "report", "summary", "annotations", "allow-scripts")},
    "package": " robot\n",
    "file": "moves.test",
    "arguments": "side:=left\n\n --help;$(x) \n",
    "seed": "3",
    "sim-time-limit": "9",
    "allow-losses": "false",
    "strict": "true",
    "pass-env": "",
}


def test_inputs_of_a_rostest_are_arguments_and_never_options() -> None:
    assert list(SUBCOMMANDS["rostest"].command_line(ROSTEST)) == [
        "--output-dir=what came out",
        "--seed=3",
        "--sim-time-limit=9",
        "--allow-scripts=auto",
        "--no-junit-strict",
        "--no-report",
        "--summary",
        "--no-annotations",
        "--no-allow-losses",
        "--strict",
        "--",
        *("robot", "moves.test", "side:=left", "--help;$(x)"),
    ]


@pytest.mark.parametrize("name", ["package", "file"])
@pytest.mark.parametrize(
    ("value", "problem"), [("", "is empty"), (" \n", "is empty"), ("a\nb", "must be one line, and has 2")]
)
def test_one_use_of_the_action_is_one_rostest(name: str, value: str, problem: str) -> None:
    with pytest.raises(InputError, match=f"the input {name} .*{problem}"):
        list(SUBCOMMANDS["rostest"].command_line({**ROSTEST, name: value}))


@pytest.mark.parametrize("name", ["rostest", "sim-time-limit", "allow-losses"])
def test_a_removed_input_names_the_action_that_has_it(name: str) -> None:
    removed = f"the input {name} was removed: .* sim-action/sim-action/rostest@v0, with the inputs package, file and"
    with pytest.raises(InputError, match=removed):
        run("run", {**INPUTS, name: "false"})


def test_the_input_margins_varies_factors_in_place_of_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[Sequence[str]] = []

    def called(words: Sequence[str], names: object) -> int:
        del names
        calls.append(words)
        return 0

    monkeypatch.setattr("action.run.call", called)
    factors = "friction=20%\nlatency=0 s:2 s\nnoise:scan\nmass=0.1"
    stated = {"scenario": "a.sim.yml", "margins": factors, "jobs": "1", "resume": "true", "record": ""}
    inputs = {**INPUTS, **stated}
    assert run("run", inputs) == 0
    options = ["--at-least=friction=20%", "--factor=latency=0 s:2 s", "--factor=noise:scan", "--at-least=mass=0.1"]
    [words] = calls
    assert words[:5] == ["margins", *options]
    assert {"--jobs=1", "--resume"} <= {*words}
    assert words[-2:] == ["--", "a.sim.yml"]
    assert run("run", {**inputs, "margins": "all"}) == 0
    assert calls[-1][:2] == ["margins", words[5]]
    with pytest.raises(InputError, match="the input repeat cannot be combined with margins"):
        run("run", {**inputs, "repeat": "2"})
    with pytest.raises(InputError, match="has 'all' and other lines"):
        run("run", {**inputs, "margins": "all\nfriction=20%"})


@pytest.mark.parametrize(("code", "forgiven"), [(0, 0), (1, 0), (2, 2), (3, 3), (5, 5), (130, 130)])
def test_only_failures_can_be_forgiven(monkeypatch: pytest.MonkeyPatch, code: int, forgiven: int) -> None:
    monkeypatch.setattr("action.run.call", lambda *_: code)
    assert (run("run", INPUTS), run("run", {**INPUTS, "fail-on-failure": "false"})) == (code, forgiven)
