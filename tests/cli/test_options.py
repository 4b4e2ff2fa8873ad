"""Options that several subcommands share, and options that cannot be combined."""

from __future__ import annotations

from pathlib import Path

import click
import pytest

from sim_action.cli.main import call
from sim_action.cli.options import SEED, Bounded, asked_model, code_permissions, named_packages
from sim_action.cli.run import _ON_LISTS, _ON_PLANS, run
from sim_action.core.errors import UsageError
from sim_action.reports import ReportRequest
from sim_action.robot.model.robot_spec import Robot
from tests.integration.conftest import BOX


def flags(*args: str, packages: tuple[str, ...] = ()) -> dict[str, object]:
    return {"args": args, "packages": packages, "allow_outside": True, "allow_scripts": "auto", "pass_env": ()}


def test_pairs_become_what_a_scenario_would_say(tmp_path: Path) -> None:
    packages = (f"meshes={tmp_path}",)
    robot, workspace = asked_model("a.xacro", flags("lidar=true", "pose=x=1", "none=", packages=packages))
    args: dict[str, str | bool | int | float] = {"lidar": "true", "pose": "x=1", "none": ""}
    assert robot == Robot(model="a.xacro", args=args, packages={"meshes": str(tmp_path)})
    assert workspace.packages == (("meshes", str(tmp_path.resolve())),)
    assert workspace.allow_outside


@pytest.mark.parametrize("text", ["lidar", "=true", ""])
def test_what_is_no_pair_is_refused(text: str) -> None:
    with pytest.raises(UsageError, match="--arg takes NAME=VALUE, found"):
        asked_model("a.xacro", flags(text))
    with pytest.raises(UsageError, match="--package takes NAME=FOLDER, found"):
        asked_model("a.xacro", flags(packages=(text,)))


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        (("a=missing",), r"--package a=missing: there is no such folder \(looked for /.*/missing\); name a"),
        (("a=file",), r"--package a=file: there is no such folder"),
        (("a=",), r"--package a=: there is no such folder \(it is empty\)"),
        (("a=nul\0",), r"--package a=nul\\x00: there is no such folder"),
        (("a/b=folder",), r"--package a/b=folder: the name of a package has no slash"),
        (("a=folder", "a=."), r"--package names 'a' twice; remove one"),
        (("folder",), r"--package takes NAME=FOLDER, found 'folder'"),
    ],
)
def test_a_package_without_a_folder_is_an_error(
    texts: tuple[str, ...], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").touch()
    with pytest.raises(UsageError, match=message):
        named_packages(texts)
    assert named_packages(("a=folder", "b=..")) == (
        ("a", str(tmp_path.resolve() / "folder")),
        ("b", str(tmp_path.resolve().parent)),
    )


@pytest.mark.process
def test_a_package_outside_the_workspace_is_found_if_the_caller_names_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "outside").mkdir()
    (tmp_path / "outside/box.urdf").write_text(BOX, encoding="utf-8")
    (tmp_path / "repository/.git").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "repository")
    text = "name: a\nrobot: {model: package://box/box.urdf}\nexpect: [no_collision]\ntime_limit: 1 s\n"
    Path("a.sim.yml").write_text(text, encoding="utf-8")
    assert call(["validate"]) == 2
    assert "or name a folder outside the repository: --package box=FOLDER" in capsys.readouterr().out
    assert call(["validate", "--package", "box=../outside"]) == 0
    assert call(["run", "--no-report", "--package", "box=../outside"]) == 0
    inside = text.replace("{model", "{packages: {box: ../outside}, model")
    Path("a.sim.yml").write_text(inside, encoding="utf-8")
    assert call(["validate"]) == 2
    assert "is outside the workspace" in capsys.readouterr().out
    assert call(["matrix", "--shards", "1"]) == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["run", "--list", "--jobs", "3", "--no-report"],
            "--list runs nothing, and cannot be combined with --no-report, --jobs",
        ),
        (["run", "--list", "--resume"], "--list runs nothing, and cannot be combined with --resume"),
        (["run", "--list", "--watch"], "--list runs nothing, and cannot be combined with --watch"),
        (["run", "--resume", "--watch"], "--resume cannot be combined with --update-golden or --watch"),
        (["run", "--repeat", "2", "--confidence"], "--confidence cannot be combined with --repeat or --update-golden"),
        (["run", "--repeat", "2", "--update-golden"], "--update-golden cannot be combined with --repeat"),
        (["run", "--force"], "--force needs --update-golden"),
        (["run", "--live"], "--live needs --watch"),
        (["run", "--watch", "--shard", "1/2"], "cannot be combined with --shard"),
        (["run", "--watch", "--port", "1"], "--port needs --live"),
        (["view", "--port", "1"], "--port needs --live"),
        (["view", "--live", "--only", "a"], "--live cannot be combined with --only"),
        (["run", "--verbose", "--quiet"], "--verbose and --quiet cannot be combined"),
        (["run", "--json", "--quiet"], "--json prints nothing else, and cannot be combined with --quiet"),
        (["merge", "x", "--only", "a"], "--only needs --scenarios, the scenarios to select from"),
        (["merge", "x", "--only", "a", "--exclude-tag", "b"], "--only, --exclude-tag need --scenarios"),
        (["compare", "a", "b", "--output-dir", "c"], "NEW cannot be combined with --output-dir"),
        (["view", "a", "--output-dir", "c"], "REPORT cannot be combined with --output-dir"),
        (["report", "a", "--output-dir", "c"], "FOLDER cannot be combined with --output-dir"),
        (["run", "--jobs", "0"], "expected a whole number from 1 to 256, found '0'"),
        (["run", "--nope"], "--nope"),
        (["run", "a.sim.yml::3-1"], "found '3-1'"),
        (["run", "--junit", "."], "--junit . is a folder; name a file"),
        (["run", "--shard", "4/3"], "sim-action: --shard 4/3: must be I/N with 1 <= I <= N <= 256, such as 1/3"),
        (["nope"], "'nope'"),
        (["matrix", "--shards", "257"], "expected a whole number from 1 to 256, found '257'"),
        (["matrix"], "Missing option '--shards'"),
        (["merge"], "Missing argument 'RESULTS...'"),
        (["merge", "."], "sim-action: no results.json found at '.'"),
        (["merge", ".", "--scenarios", "nope*"], "sim-action: --scenarios finds no scenario"),
        (["merge", "loop"], "loop is not a valid results file: Too many levels of symbolic links"),
        (["inspect", "a.urdf", "--arg", "a=1", "--arg", "a=2"], "--arg names 'a' twice"),
        (["inspect", "turtlebot3_burger", "--arg", "a=1"], "--arg needs a xacro file, and 'turtlebot3_burger' is not"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_a_wrong_call_is_exit_code_2(
    arguments: list[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.sim.yml").touch()
    (tmp_path / "loop").symlink_to("loop")
    assert call(arguments) == 2
    printed = capsys.readouterr()
    assert message in printed.err
    assert "Traceback" not in printed.err
    assert printed.out == ""


def test_options_with_an_effect_on_what_runs_nothing_exist() -> None:
    assert {param.name for param in run.params} > {*_ON_LISTS, *_ON_PLANS}


@pytest.mark.parametrize(
    "arguments",
    [
        *(
            ["run", f"--{name}="]
            for name in ("only", "exclude", "tag", "exclude-tag", "shard", "record", "junit", "output-dir")
        ),
        ["matrix", "--shards=2", "--durations="],
        ["merge", "x", "--scenarios="],
        ["compare", "a", "b", "--markdown="],
    ],
    ids=lambda arguments: arguments[-1],
)
def test_an_option_with_an_empty_text_is_an_error(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert call(arguments) == 2
    option = arguments[-1].removesuffix("=")
    assert f"Invalid value for '{option}'" in (printed := capsys.readouterr().err)
    assert "it is empty; leave the option out, or give it a value" in printed


@pytest.mark.parametrize(("option", "verbosity"), [("--quiet", "quiet"), ("--verbose", "verbose"), ("--json", "json")])
def test_the_command_line_is_stronger_than_the_project(
    option: str, verbosity: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "pyproject.toml").write_text("[tool.sim-action]\nverbose = true\nquiet = true\n", encoding="utf-8")
    asked: list[ReportRequest] = []
    monkeypatch.setattr("sim_action.cli.report.report_journal", asked.append)
    assert call(["report", option]) == 0
    assert asked[0].verbosity == verbosity


def test_a_model_that_is_code_is_refused_where_code_is() -> None:
    with pytest.raises(UsageError, match=r"'a.xacro' is xacro, which runs code: scripts are not allowed"):
        asked_model("a.xacro", {**flags(), "allow_scripts": "false"})
    assert asked_model("a.urdf", {**flags(), "allow_scripts": "false"})[1].pass_env == ()
    assert asked_model("a.xacro", {**flags(), "pass_env": ("B", "A")})[1].pass_env == ("A", "B")


def test_a_passed_variable_that_is_not_set_is_a_warning(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("ROBOT_MAP_URL", "the value")
    for name in ("ROBOT_MAP_URI", "QQ_XX"):
        monkeypatch.delenv(name, raising=False)
    names = ("ROBOT_MAP_URL", "ROBOT_MAP_URI", "QQ_XX")
    assert code_permissions({"allow_scripts": "true", "pass_env": names}).pass_env == tuple(sorted(names))
    assert capsys.readouterr().err == (
        "sim-action: warning: --pass-env QQ_XX: this variable is not set; set it, on GitHub with 'env:' of the step\n"
        "sim-action: warning: --pass-env ROBOT_MAP_URI: this variable is not set; did you mean 'ROBOT_MAP_URL'? "
        "Otherwise set it, on GitHub with 'env:' of the step\n"
    )


@pytest.mark.parametrize(
    ("type_", "text", "message"),
    [
        (Bounded(click.IntRange(1, 256)), "0", "expected a whole number from 1 to 256, found '0'"),
        (Bounded(click.IntRange(1, 256)), "twice", "expected a whole number from 1 to 256, found 'twice'"),
        (Bounded(click.IntRange(1, 256)), "1.5", "expected a whole number from 1 to 256, found '1.5'"),
        (Bounded(click.IntRange(1, 256)), "a\nb", r"expected a whole number from 1 to 256, found 'a\nb'"),
        (Bounded(click.FloatRange(0, 1)), "2", "expected a number from 0 to 1, found '2'"),
        (Bounded(click.FloatRange(min=0)), "-1", "expected a number of at least 0, found '-1'"),
        (
            Bounded(click.FloatRange(min=0, min_open=True, max=1e9)),
            "0",
            "expected a number greater than 0 and at most 1,000,000,000, found '0'",
        ),
        (SEED, "-1", "expected a whole number from 0 to 9223372036854775807, found '-1'"),
    ],
)
def test_an_error_names_the_allowed_numbers_and_the_found_value(type_: Bounded, text: str, message: str) -> None:
    with pytest.raises(click.BadParameter) as raised:
        type_.convert(text, None, None)
    assert raised.value.message == message
    assert Bounded(click.IntRange(1, 256)).convert("256", None, None) == 256


@pytest.mark.parametrize(
    ("words", "confidence", "plan_gate"),
    [
        (["--confidence", "a.sim.yml"], "numerical", None),
        (["--confidence", "suite"], "numerical", None),
        (["--confidence", "full", "a.sim.yml"], "full", None),
        (["a.sim.yml", "--confidence"], "numerical", None),
        (["--confidence=full", "a" * 5000], "full", None),
        (["--plan-gate", "a.sim.yml"], None, "97%"),
        (["--plan-gate", "suite/*"], None, "97%"),
        (["--plan-gate", "99.5%", "a.sim.yml"], None, "99.5%"),
    ],
)
def test_a_path_is_not_the_value_of_an_option_without_one(
    words: list[str], confidence: str | None, plan_gate: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "suite").mkdir()
    monkeypatch.chdir(tmp_path)
    with run.make_context("run", words) as context:
        assert (context.params["confidence"], context.params["plan_gate"]) == (confidence, plan_gate)
        assert len(context.params["paths"]) == 1
    with pytest.raises(click.BadParameter, match="'numerical', 'full'"):
        run.make_context("run", ["--confidence", "ful"])
