"""Command sources whose keys are written in a map below their name."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.commands.external_program import ProcessCommands
from sim_action.commands.script import ScriptCommands
from sim_action.core.errors import InvalidScenario
from sim_action.core.permissions import Permissions
from sim_action.scenario.files import read_file
from sim_action.scenario.loading import load_all, load_scenario
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.source import Refused
from tests.scenarios import LEAST, load, told

FOLLOW = "class Follower:\n    def __init__(self, kp, ki=0): ...\n    def step(self, seen): ...\n"


def commanding(commands: str) -> str:
    """A scenario whose commands begin in line 4."""
    begin, end = LEAST.index("commands:"), LEAST.index("expect:")
    return f"{LEAST[:begin]}commands:{commands}\n{LEAST[end:]}"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "follow.py").write_text(FOLLOW)
    return tmp_path


SPEC = ScriptCommands.model_validate(
    {"script": "follow.py", "class": "Follower", "with": {"kp": 1.2, "ki": (1, {"a": None})}, "rate": 20.0}
)


@pytest.mark.parametrize(
    "commands",
    [
        " {script: follow.py, class: Follower, with: {kp: 1.2, ki: [1, {a: null}]}, rate: 20 Hz}",
        " {script: {file: follow.py, class: Follower, with: {kp: 1.2, ki: [1, {a: null}]}, rate: 20 Hz}}",
        " {script: {file: follow.py, with: {kp: 1.2, ki: [1, {a: null}]}}, class: Follower, rate: 20 Hz}",
        "\n  - script:\n      {file: follow.py, class: Follower, with: {kp: 1.2, ki: [1, {a: null}]}}\n    rate: 20 Hz",
    ],
)
def test_both_forms_are_one_spec(commands: str, folder: Path) -> None:
    assert load(folder, commanding(commands)).scenario.commands == (SPEC,)


def test_a_program_has_its_words_below_command(folder: Path) -> None:
    loaded = load(folder, commanding(" {process: {command: python3 a.py, with: {kp: 1}}}"))
    (source,) = loaded.scenario.commands
    assert source == ProcessCommands.model_validate({"process": ("python3", "a.py"), "with": {"kp": 1}})


@pytest.mark.parametrize(
    ("commands", "problem"),
    [
        (
            "\n  script: {file: follow.py, class: Folower, with: {kp: 1}}",
            "5:29: commands.script.class: follow.py defines no class 'Folower'; did you mean 'Follower'?",
        ),
        (
            "\n  - script: {file: follow.py, class: Follower, with: {kp: 1, kj: 2}}",
            "5:62: commands.0.script.with.kj: follow.py:2: class 'Follower' has no parameter 'kj' (allowed: ki, kp)",
        ),
        (
            "\n  script: {file: follow.py, class: Follower, with: {ki: 1}}",
            "5:46: commands.script.with: follow.py:2: class 'Follower' requires 'kp'; add it to 'with'",
        ),
        (
            "\n  script: follow.py\n  class: Follower\n  with: {kb: 1, kp: 1}",
            "7:10: commands.with.kb: follow.py:2: class 'Follower' has no parameter 'kb' (allowed: ki, kp)",
        ),
        ("\n  script: {file: absent.py}", "5:12: commands.script.file: 'absent.py' does not exist"),
        (
            "\n  script: {fil: follow.py}",
            "5:12: commands.script.fil: unknown key; did you mean 'file'? (allowed: class",
        ),
        ("\n  script: {}", "5:3: commands.script: the key 'file' is missing"),
        ("\n  script: {class: Follower}", "5:3: commands.script: the key 'file' is missing"),
        (
            "\n  script: {file: follow.py, class: A}\n  class: B",
            "5:29: commands.script.class: 'class' is also given next to 'script'; remove one of the two",
        ),
        ("\n  script: {file: {a: 1}}", "5:12: commands.script.file: expected text, found a map of keys"),
        ("\n  script: {file: follow.py, with: 3}", "5:29: commands.script.with: expected a map of keys, found 3"),
        ("\n  script: {file: follow.py, rate: 7 Hz, class: Follower, with: {kp: 1}}", "5:29: commands.script.rate: "),
        ("\n  script: {script: follow.py, file: follow.py}", "5:12: commands.script.script: unknown key"),
        ("\n  script: {file: follow.py, twist: []}", "5:29: commands.script.twist: unknown key"),
        ("\n  process: {command: [], with: {a: 1}}", "5:13: commands.process.command: must not be empty"),
        (
            "\n  process: {command: [python3], with: {-a: 1}}",
            "5:33: commands.process.with: '-a' cannot be the name of an argu",
        ),
        ('\n  process: {command: [python3], with: {a: "\\0"}}', "5:33: commands.process.with: an argument cannot"),
    ],
)
def test_problems_have_the_place_where_they_are_written(commands: str, problem: str, folder: Path) -> None:
    found = told(folder, commanding(commands))
    assert found[0].startswith(problem), found
    assert all("the key" not in each for each in found[1:])


def variations(folder: Path, commands: str, varied: str) -> list[LoadedScenario | Refused]:
    file = folder / "s.sim.yml"
    file.write_text(commanding(commands) + f"variations:\n  {varied}\n")
    return load_all(read_file(file, Permissions()), Permissions())


@pytest.mark.parametrize(
    ("commands", "key"),
    [
        (" {script: {file: follow.py, class: Follower, with: {kp: 0}}}", "commands.script.with.kp"),
        (" {script: {file: follow.py, class: Follower}}", "commands.script.with.kp"),
        (" {script: follow.py, class: Follower}", "commands.with.kp"),
        ("\n  - {script: follow.py, class: Follower, with: {kp: 0}}", "commands.0.with.kp"),
        ("\n  - script: {file: follow.py, class: Follower, with: {kp: 0}}", "commands.0.script.with.kp"),
    ],
)
def test_variations_lead_into_them(commands: str, key: str, folder: Path) -> None:
    listed = variations(folder, commands, f"{key}: [0.5, 2]")
    assert [each.scenario.name for each in listed if isinstance(each, LoadedScenario)] == [
        "burger drives straight[kp=0.5]",
        "burger drives straight[kp=2]",
    ]
    sampled = variations(folder, commands, f"{key}: {{uniform: [0, 1], samples: 3}}")
    sources = [each.scenario.commands[0] for each in sampled if isinstance(each, LoadedScenario)]
    gains = [source.settings["kp"] for source in sources if isinstance(source, ScriptCommands)]
    assert len(set(gains)) == 3
    assert all(0 <= gain <= 1 for gain in gains)


def test_a_misspelt_parameter_of_a_variation_is_told_on_its_line(folder: Path) -> None:
    (found,) = variations(
        folder, " {script: {file: follow.py, class: Follower, with: {kp: 1}}}", "commands.script.with.kl: [1, 2]"
    )
    assert isinstance(found, Refused)
    (problem,) = found.problems
    assert problem.location.line == 9
    assert "has no parameter 'kl' (allowed: ki, kp)" in problem.message


def test_a_map_in_a_base_names_files_of_its_own_folder(folder: Path) -> None:
    (folder / "shared").mkdir()
    (folder / "follow.py").rename(folder / "shared/follow.py")
    (folder / "shared/program.py").write_text("")
    base = "commands:\n  - script: {file: follow.py, class: Follower, with: {kp: 1}}\n  - process:\n"
    (folder / "shared/b.yml").write_text(base + "      command: python3 program.py\n")
    text = LEAST[: LEAST.index("commands:")] + "extends: shared/b.yml\n" + LEAST[LEAST.index("expect:") :]
    script, process = load(folder, text).scenario.commands
    assert isinstance(script, ScriptCommands)
    assert script.script == "shared/follow.py"
    assert isinstance(process, ProcessCommands)
    assert process.process == ("python3", "shared/program.py")


def test_a_map_is_a_script_for_the_gate(folder: Path) -> None:
    (folder / "s.sim.yml").write_text(commanding("\n  script: {file: follow.py, class: Follower, with: {kp: 1}}"))
    with pytest.raises(InvalidScenario) as raised:
        load_scenario(folder / "s.sim.yml", Permissions(scripts_refused="no scripts here"))
    (problem,) = raised.value.problems
    assert problem.message == "commands.script.file: no scripts here"
    assert (problem.location.line, problem.location.column) == (5, 12)
