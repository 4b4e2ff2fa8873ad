"""What `[tool.sim-action]` may say, where it is looked for, and that it can do no harm."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import click
import pytest

from sim_action.cli import SUBCOMMANDS
from sim_action.cli.main import call, program
from sim_action.cli.pyproject import default_map
from sim_action.cli.pyproject_keys import Defaults
from sim_action.core.errors import UsageError
from tests.scenarios import LEAST


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / ".git").mkdir()
    (tmp_path / "suite/deep").mkdir(parents=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def stated(folder: Path, table: str, subcommand: str = "run", here: str = ".") -> dict[str, Any]:
    (folder / "pyproject.toml").write_text(
        f"[project]\nname = 'x'\n\n[tool.sim-action]\n{table}\n[tool.ruff]\njobs = 7\n"
    )
    found = default_map(subcommand, folder / here).get(subcommand, {})
    return {key: value for key, value in found.items() if key != "paths_location"}


def told(folder: Path, table: str) -> list[str]:
    with pytest.raises(UsageError) as refused:
        stated(folder, table)
    return str(refused.value).split("\n")


def test_each_subcommand_gets_what_it_takes(folder: Path) -> None:
    table = 'backend = "mujoco"\nseed = 3\njobs = 2\npaths = ["suite"]\nsummary = false\nfail-fast = true\n'
    assert stated(folder, table) == {
        "backend": "mujoco",
        "seed": 3,
        "jobs": 2,
        "paths": ("suite",),
        "summary": False,
        "fail_fast": True,
    }
    assert stated(folder, table, "validate") == {"paths": ("suite",)}
    assert stated(folder, table, "merge") == {"summary": False}
    assert stated(folder, table + 'output-dir = "out"\n', "compare") == {"output_dir": "out", "summary": False}
    assert stated(folder, table, "rostest") == stated(folder, table, "roslaunch") == {"summary": False}
    assert stated(folder, table, "schema") == {}
    assert stated(folder, 'unexercised = "warn"') == {"unexercised": "warn"}
    assert stated(folder, 'unexercised = "warn"', "merge") == {}
    for command in ("run", "validate", "prove", "compare"):
        has_it = command in ("run", "validate")
        assert stated(folder, "strict = true", command) == ({"strict": True} if has_it else {})
    # A file that has but the name is not read.
    (folder / "pyproject.toml").write_text('[project]\nname = "sim-action"\n[tool.ruff]\nthis is no TOML')
    assert default_map("run", folder) == {}


@pytest.mark.parametrize(
    "text",
    [
        "[tool.sim-action]\nseed = 3",
        "[tool]\nsim-action.seed = 3",
        "[ tool ] # ours\nsim-action = {seed = 3}",
        "tool.sim-action.seed = 3",
        "tool . 'sim-action' . seed = 3",
        "tool = {sim-action = {seed = 3}}",
        "[ 'tool' . \"sim-action\" ]\nseed = 3",
        '["t\\u006fol".sim-action]\nseed = 3',
        "[tool.ruff]\n[tool.sim-action]\nseed = 3",
    ],
)
def test_the_table_may_be_written_in_any_way_that_toml_has(folder: Path, text: str) -> None:
    (folder / "pyproject.toml").write_text(text)
    assert default_map("run", folder) == {"run": {"seed": 3}}


def test_every_key_is_an_option_that_a_subcommand_has() -> None:
    keys = {name: set(subcommand.keys) for name, subcommand in SUBCOMMANDS.items()}
    assert set().union(*keys.values()) == set(Defaults.model_fields)
    # None of them permits anything.
    assert not {"allow_scripts", "pass_env", "allow_outside", "shard", "force"} & set(Defaults.model_fields)
    for subcommand, names in keys.items():
        parameters = {parameter.name: parameter for parameter in program.commands[subcommand].params}
        assert names <= set(parameters)
        for name in names - {"paths"}:
            parameter = parameters[name]
            assert isinstance(parameter, click.Option)
            key = Defaults.model_fields[name].alias or name
            assert f"--{key}" in parameter.opts
            assert parameter.envvar == f"SIM_ACTION_{name.upper()}"


def test_a_path_that_does_not_exist_is_an_error_at_its_line(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "simulation").mkdir()
    stated(folder, "jobs = 1\npaths = ['simulations']")
    monkeypatch.chdir(folder)
    assert call(["validate"]) == 2
    assert capsys.readouterr().out == (
        "pyproject.toml:6:1: there is no file or folder 'simulations'; did you mean 'simulation'? Correct the path\n"
    )
    assert call(["validate", "nowhere"]) == 2
    assert capsys.readouterr().out.startswith("nowhere: there is no file or folder 'nowhere'; correct the path on the")


def test_the_nearest_table_counts_and_paths_start_from_its_folder(folder: Path) -> None:
    table = 'output-dir = "out/sim"\njunit = "out/j.xml"\npaths = ["suite", "*.sim.yml"]\n'
    found = {"output_dir": "../../out/sim", "junit": "../../out/j.xml", "paths": ("..", "../../*.sim.yml")}
    assert stated(folder, table, here="suite/deep") == found
    # One without the table is passed over, one with it is nearer.
    (folder / "suite/deep/pyproject.toml").write_text("[project]\n")
    assert stated(folder, table, here="suite/deep") == found
    (folder / "suite/pyproject.toml").write_text("[tool.sim-action]\njobs = 5\n")
    assert stated(folder, table, here="suite/deep") == {"jobs": 5}


def test_nothing_above_the_workspace_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "w/.git").mkdir(parents=True)
    (tmp_path / "pyproject.toml").write_text("[tool.sim-action]\njobs = 5\n")
    assert default_map("run", tmp_path / "w") == {}
    (tmp_path / "w/pyproject.toml").symlink_to(tmp_path / "pyproject.toml")
    assert default_map("run", tmp_path / "w") == {}
    # Without git only the current folder counts.
    (tmp_path / "suite").mkdir()
    (tmp_path / "pyproject.toml").write_text("[tool.sim-action]\njobs = 5\n")
    monkeypatch.chdir(tmp_path / "suite")
    assert default_map("run", tmp_path / "suite") == {}
    monkeypatch.chdir(tmp_path)
    assert default_map("run", tmp_path) == {"run": {"jobs": 5}}


@pytest.mark.parametrize(
    ("table", "problem"),
    [
        ("\nbckend = 'all'", "6:1: bckend: unknown key; did you mean 'backend'? (allowed: annotations, backend"),
        ("allow-scripts = true", "5:1: allow-scripts: cannot be set in this file, which a pull request can change; "),
        ("allow-outside = true", "5:1: allow-outside: cannot be set in this file"),
        ("pass-env = ['A']", "5:1: pass-env: cannot be set in this file"),
        ("packages = ['a=b']", "5:1: packages: cannot be set in this file"),
        ("backend = 'bullet'", "5:1: backend: expected 'pybullet', 'mujoco' or 'all', found 'bullet'"),
        ("unexercised = 'ignore'", "5:1: unexercised: expected 'error' or 'warn', found 'ignore'"),
        ("jobs = 0", "5:1: jobs: must be at least 1, found 0"),
        ("jobs = '2'", "5:1: jobs: expected a whole number, found '2'"),
        ("paths = 'a'", "5:1: paths: expected a list, found 'a'"),
        ("output-dir = '../x'", "5:1: output-dir: '../x' must be below the folder of pyproject.toml"),
        ("output-dir = '/tmp/x'", "5:1: output-dir: '/tmp/x' must be below"),
        ("output-dir = 'a/../../x'", "5:1: output-dir: 'a/../../x' must be below"),
        ("junit = '.git/hooks/x'", "5:1: junit: '.git/hooks/x' must be below"),
        ("junit = 'a/.Git/x'", "5:1: junit: 'a/.Git/x' must be below"),
        ("output-dir = '.GIT/x'", "5:1: output-dir: '.GIT/x' must be below"),
        ("paths = ['.giT']", "5:1: paths: '.giT' must be below"),
        ("output-dir = 'link/x'", "5:1: output-dir: 'link/x' must be below"),
        ("paths = ['suite', '..']", "5:1: paths: '..' must be below"),
        ('junit = "a\\u0000b"', "5:1: junit: 'a\\x00b' must be below"),
    ],
)
def test_what_cannot_be_said_there_is_told_with_its_line(folder: Path, table: str, problem: str) -> None:
    (folder / "link").symlink_to("/tmp")
    (found,) = told(folder, table)
    assert found.startswith(f"pyproject.toml:{problem}")


@pytest.mark.parametrize(
    ("key", "option"), [("allow-scripts", "--allow-scripts"), ("packages", "--package"), ("resume", "--resume")]
)
def test_a_key_that_only_the_caller_may_set_names_the_option(folder: Path, key: str, option: str) -> None:
    (found,) = told(folder, f"{key} = true")
    assert found.endswith(f"; remove it here, and use {option} instead")


def test_what_is_no_toml_is_told_if_it_is_about_us(folder: Path) -> None:
    (found,) = told(folder, "jobs = = 2")
    assert found.startswith("pyproject.toml is not valid TOML: ")
    (folder / "pyproject.toml").write_text("= =")
    assert default_map("run", folder) == {}
    (folder / "pyproject.toml").write_text("tool.sim-action = 3")
    with pytest.raises(UsageError, match="expected a map of keys, found 3"):
        default_map("run", folder)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (f"a = {'[' * 5000}{']' * 5000}", "cannot be read: its lists or tables are nested too deeply"),
        (f"a = {'1' * 5000}", "cannot be read: it has a number of more than 4300 digits; shorten it"),
        (f"a{' . a' * 100_000} = 1", "cannot be read: it has a key of more than 100 steps"),
        ("'a'" + '."a"' * 100_000 + " = 1", "cannot be read: it has a key of more than 100 steps"),
    ],
)
def test_what_would_take_the_reader_down_is_refused(folder: Path, text: str, message: str) -> None:
    (folder / "pyproject.toml").write_text(f"{text}\n[tool.sim-action]\n")
    with pytest.raises(UsageError, match=re.escape(f"pyproject.toml {message}")):
        default_map("run", folder)


def seeds(folder: Path, *arguments: str) -> list[int | None]:
    """Of the outcomes of a call."""
    call(["run", "--quiet", *arguments])
    (results,) = folder.glob("**/results.json")
    outcomes = json.loads(results.read_text())["outcomes"]
    results.unlink()
    return [outcome["seed"] for outcome in outcomes]


@pytest.mark.process
def test_flags_come_before_variables_file_and_scenario(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / "suite/a.sim.yml").write_text(LEAST + "seed: 1\n")
    (folder / "suite/deep/b.sim.yml").write_text(LEAST + "seed: 1\n")
    assert seeds(folder) == [1, 1]
    stated(folder, "seed = 2\noutput-dir = 'out'\npaths = ['suite/deep']")
    assert seeds(folder) == [2]
    assert (folder / "out/junit.xml").exists()
    assert seeds(folder, "suite") == [2, 2]
    monkeypatch.setenv("SIM_ACTION_SEED", "3")
    assert seeds(folder) == [3]
    assert seeds(folder, "--seed", "4") == [4]
    monkeypatch.setenv("SIM_ACTION_SEED", "")
    assert seeds(folder) == [2]


def test_a_call_with_a_wrong_table_is_refused_with_its_place(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "suite/a.sim.yml").write_text(LEAST)
    (folder / "pyproject.toml").write_text("[tool.sim-action]\njobs = 0\n")
    assert call(["run"]) == 2
    assert capsys.readouterr().err == "sim-action: pyproject.toml:2:1: jobs: must be at least 1, found 0\n"


def test_what_a_variable_says_amiss_is_not_told_of_an_option(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("SIM_ACTION_BACKEND", "gazebo")
    assert call(["run"]) == 2
    told = capsys.readouterr().err
    assert told.startswith("sim-action: Invalid value for the variable SIM_ACTION_BACKEND: 'gazebo' is not one of")
    assert call(["run", "--backend", "gazebo"]) == 2
    assert "Invalid value for '--backend': 'gazebo'" in capsys.readouterr().err


def test_of_many_unknown_keys_few_are_told_and_a_large_file_is_not_read(folder: Path) -> None:
    keys = [f"key{number} = 1" for number in range(5_000)]
    found = told(folder, "\n".join(["bakcend = 'mujoco'", *keys]))
    assert found[0].startswith("pyproject.toml:5:1: bakcend: unknown key; did you mean 'backend'?")
    assert found[50] == "pyproject.toml:55:1: key49: unknown key"
    assert found[-1] == "pyproject.toml: and 4,901 more problems"
    assert len(found) == 101
    assert told(folder, "jobs = 1\n" + "#" * 1_000_000) == ["pyproject.toml cannot be read: it is larger than 1 MB"]
