"""Parts that are made of parts: assertions inside of others, and what is said of them where they stand."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.assertions import Assertion
from sim_action.assertions.combined import AllOf, AnyOf, Negation
from sim_action.assertions.distance import Travel
from sim_action.assertions.no_collision import NoCollision
from sim_action.assertions.temporal_logic.stl_assertion import Stl
from sim_action.assertions.user_assertion import UserAssertion
from sim_action.commands.external_program import ProcessCommands
from sim_action.commands.script import ScriptCommands
from sim_action.core.errors import InvalidScenario
from sim_action.core.permissions import Permissions
from sim_action.core.yaml_document import Document
from sim_action.robot.built_in import STANDARD_SENSORS
from sim_action.scenario.loading import load_scenario
from sim_action.scenario.model import LoadedScenario, Scenario
from sim_action.scenario.part_reader import with_roles
from sim_action.sensors.lidar import Lidar
from sim_action.state.trace_records import Channels
from tests.scenarios import COMMANDS, LEAST, expecting, load, load_refused, load_runs, told

JUDGE = "class Mine:\n    def __init__(self, **settings): ...\n    def judge(self, trace): ...\n"


def read(folder: Path, *entries: str) -> Scenario:
    (folder / "mine.py").write_text(JUDGE)
    return load(folder, expecting(*entries)).scenario


@pytest.mark.parametrize(
    ("entry", "spec"),
    [
        ("any_of: [{travel: {at_least: 1 m}}, no_collision]", AnyOf(parts=(Travel(at_least=1.0), NoCollision()))),
        (
            "all_of:\n    - no_collision\n    - not: {any_of: [{stl: speed < 1}]}",
            AllOf(parts=(NoCollision(), Negation(part=AnyOf(parts=(Stl(formula="speed < 1"),))))),
        ),
        ("not: no_collision", Negation(part=NoCollision())),
        ("not:\n      no_collision:", Negation(part=NoCollision())),
        ("stl: always[0 s, 2 s] (speed < 0.5 m/s)", Stl(formula="always[0 s, 2 s] (speed < 0.5 m/s)")),
        ("stl: {formula: speed < 1}", Stl(formula="speed < 1")),
        ("assertion: mine.py:Mine", UserAssertion.model_validate("mine.py:Mine")),
        (
            "assertion: {class: mine.py:Mine, with: {limit: 3, names: [a, b]}}",
            UserAssertion.model_validate({"class": "mine.py:Mine", "with": {"limit": 3, "names": ("a", "b")}}),
        ),
    ],
)
def test_how_they_are_written(entry: str, spec: Assertion, tmp_path: Path) -> None:
    (expected,) = read(tmp_path, entry).expect
    assert expected.assertion == spec


def test_options_stand_beside_the_outermost(tmp_path: Path) -> None:
    entry = "not: {reach: {x: 1, y: 2}}\n    name: away\n    after: 1 s\n    severity: warning"
    expected, _ = read(tmp_path, entry, "upright").expect
    assert (expected.name, expected.after, expected.severity) == ("away", 1.0, "warning")


def test_problems_inside_have_their_own_place(tmp_path: Path) -> None:
    text = expecting(
        "any_of:\n      - travel: {at_lest: 1 m}\n      - no_colision\n      - {reach: {x: 1, y: 2}, before: 2 s}",
        "not:\n      all_of:\n        - no_collision\n        - joint: {name: elbow}",
        "all_of: []",
        "any_of: {travel: {at_least: 1}}",
        "not: [no_collision]",
    )
    names = "(allowed: at_least, at_most, frame, link)"
    found = told(tmp_path, text)
    assert found[0] == f"10:18: expect.0.any_of.0.travel.at_lest: unknown key; did you mean 'at_least'? {names}"
    assert found[1].startswith("11:9: expect.0.any_of.1.no_colision: unknown assertion 'no_colision'; did you mean")
    assert found[2] == "12:31: expect.0.any_of.2.before: 'before' belongs to the outermost assertion, not into 'any_of'"
    assert found[3].startswith("16:11: expect.1.not.all_of.1.joint: give 'at_least'")
    assert found[4].endswith("starting with '- ', found an empty list")
    assert found[5].endswith("starting with '- ', found a map of keys")
    assert "expected a map with one assertion" in found[6]
    assert len(found) == 7


def test_problems_with_the_robot_have_their_own_place(tmp_path: Path) -> None:
    text = expecting(
        "any_of:\n      - no_collision: {allow: [wall]}\n      - stl: position(wheel_lft_joint) < 1",
        "not: {joint: {name: elbow, at_most: 1}}",
    )
    found = told(tmp_path, text)
    assert found[0].startswith("10:32: expect.0.any_of.0.no_collision.allow.0: 'wall' is neither")
    assert found[1].startswith("11:9: expect.0.any_of.1.stl: the model has no moving joint 'wheel_lft_joint'; did you")
    assert found[2].startswith("12:19: expect.1.not.joint.name: the model has no moving joint 'elbow'")


def test_what_is_wrong_in_a_formula_is_shown_by_an_arrow(tmp_path: Path) -> None:
    (found,) = told(tmp_path, expecting("stl: always (speed < 0.5 m/s or sped < 1)"))
    assert found.startswith("9:5: expect.0.stl: unknown signal 'sped'; did you mean 'speed'?")
    assert found.endswith("at character 28, the arrow: always (speed < 0.5 m/s or -> sped < 1)")


@pytest.mark.parametrize("entry", ["assertion: mine.py:Mine", "not: {any_of: [{assertion: mine.py:Mine}]}"])
def test_a_class_of_the_users_is_a_script_wherever_it_stands(entry: str, tmp_path: Path) -> None:
    scenario = read(tmp_path, entry)
    assert scenario.runs_user_code
    assert not read(tmp_path, "not: no_collision").runs_user_code
    (tmp_path / "s.sim.yml").write_text(expecting(entry))
    with pytest.raises(InvalidScenario) as raised:
        load_scenario(tmp_path / "s.sim.yml", Permissions(scripts_refused="no scripts here"))
    (problem,) = raised.value.problems
    assert problem.message.endswith(".assertion: no scripts here")


def test_a_file_that_is_not_there_is_told_where_it_is_named(tmp_path: Path) -> None:
    (found,) = told(tmp_path, expecting("any_of:\n      - no_collision\n      - assertion: {class: no.py:Mine}"))
    assert found.startswith("11:9: expect.0.any_of.1.assertion: 'no.py' does not exist")


def test_what_parts_watch_is_watched(tmp_path: Path) -> None:
    (expected,) = read(tmp_path, "not: {all_of: [no_collision, upright]}").expect
    assert expected.channels == Channels(contacts=True, openings=frozenset({0.0}))
    (expected,) = read(tmp_path, "not: {all_of: [upright, travel: {at_least: 1 m}]}").expect
    assert not expected.channels.contacts


def test_assertions_as_deep_as_yaml_goes_are_read(tmp_path: Path) -> None:
    entry = "{not: " * 30 + "no_collision" + "}" * 30
    assert len(read(tmp_path, entry).assertions) == 1


def test_of_very_many_sources_the_files_are_not_read(tmp_path: Path) -> None:
    entry = "\n  - replay: absent.csv"
    lines = told(tmp_path, commanding(entry * 51))
    assert sum("'absent.csv' does not exist" in line for line in lines) == 1
    assert any("commands: 51 sources; at most 50 are read" in line for line in lines)
    assert len(told(tmp_path, commanding(entry * 50))) == 50


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        (["upright"] * 1_001, "expect: 1,001 expectations; at most 1,000 are read"),
        (["any_of: [upright, no_collision]"] * 500, "expect: more than 1,000 assertions including nested ones"),
        (["assertion: mine.py:Mine"] * 51, "expect: more than 50 assertions with a file of their own; split the sce"),
        (
            ["any_of: [no_collision, {follow_path: {file: path.csv, rms: 1 m}}]"] * 51,
            "expect: more than 50 assertions with a file of their own; split the scenario",
        ),
    ],
    ids=["expectations", "parts", "classes", "paths"],
)
def test_there_are_not_more_than_can_be_read_soon(entries: list[str], message: str, tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(JUDGE)
    (tmp_path / "path.csv").write_text("x,y\n0,0\n1,0\n")
    (problem,) = told(tmp_path, expecting(*entries))
    assert problem.partition(": ")[2].startswith(message)


def test_as_many_as_there_may_be_are_read(tmp_path: Path) -> None:
    entries = ["any_of: [upright, no_collision]"] * 300 + ["assertion: mine.py:Mine"] * 50
    names = [expected.name for expected in read(tmp_path, *entries, "upright").expect]
    assert len(set(names)) == 351


def test_there_are_not_more_sensors_than_can_be_read_soon(tmp_path: Path) -> None:
    sensors = "".join(f"  - {{imu: {{}}, name: imu{number}}}\n" for number in range(101))
    (problem,) = told(tmp_path, f"{LEAST}sensors:\n{sensors}")
    assert problem == "11:1: sensors: 101 sensors; at most 100 are read"


FOLLOW = "class Follower:\n    def __init__(self, kp, ki=0): ...\n    def step(self, seen): ...\n"


def commanding(commands: str) -> str:
    """A scenario whose commands begin in line 4."""
    return LEAST.replace(COMMANDS, f"commands:{commands}\n")


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
        ("\n  script: {fil: follow.py}", "5:12: commands.script.fil: unknown key; did you mean 'file'? (allowed: cla"),
        ("\n  script: {}", "5:3: commands.script: the key 'file' is missing"),
        ("\n  script: {class: Follower}", "5:3: commands.script: the key 'file' is missing"),
        (
            "\n  script: {file: follow.py, class: A}\n  class: B",
            "5:29: commands.script.class: 'class' is also given next to 'script'; remove one of the two",
        ),
        ("\n  script: {file: {a: 1}}", "5:12: commands.script.file: expected text, found a map of keys"),
        ("\n  script: {file: follow.py, with: 3}", "5:29: commands.script.with: expected a map of keys, found 3"),
        ("\n  script: {file: follow.py, rate: 7 kHz, class: Follower, with: {kp: 1}}", "5:29: commands.script.rate: "),
        ("\n  script: {script: follow.py, file: follow.py}", "5:12: commands.script.script: unknown key"),
        ("\n  script: {file: follow.py, twist: []}", "5:29: commands.script.twist: unknown key"),
        ("\n  process: {command: [], with: {a: 1}}", "5:13: commands.process.command: must not be empty"),
        ("\n  process: {command: [python3], with: {-a: 1}}", "5:33: commands.process.with: '-a' cannot be the name"),
        ('\n  process: {command: [python3], with: {a: "\\0"}}', "5:33: commands.process.with: an argument cannot"),
    ],
)
def test_problems_have_the_place_where_they_are_written(commands: str, problem: str, folder: Path) -> None:
    first, *others = told(folder, commanding(commands))
    assert first.startswith(problem)
    assert all("the key" not in line for line in others)


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
    listed = load_runs(folder, f"{commanding(commands)}variations: {{{key}: [0.5, 2]}}\n")
    names = [run.scenario.name for run in listed if isinstance(run, LoadedScenario)]
    assert names == [f"burger drives straight[kp={kp}]" for kp in ("0.5", "2")]
    sampled = load_runs(folder, f"{commanding(commands)}variations: {{{key}: {{uniform: [0, 1], samples: 3}}}}\n")
    sources = [run.scenario.commands[0] for run in sampled if isinstance(run, LoadedScenario)]
    gains = [source.settings["kp"] for source in sources if isinstance(source, ScriptCommands)]
    assert len(set(gains)) == 3
    assert all(0 <= gain <= 1 for gain in gains)


def test_a_misspelt_parameter_of_a_variation_is_told_on_its_line(folder: Path) -> None:
    text = commanding(" {script: {file: follow.py, class: Follower, with: {kp: 1}}}")
    (problem,) = load_refused(folder, f"{text}variations:\n  commands.script.with.kl: [1, 2]\n").problems
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


@pytest.mark.parametrize("model", STANDARD_SENSORS)
@pytest.mark.parametrize("more", ["", "sensors: [{lidar: {rays: 3}, name: own}]\n"])
def test_standard_sensors_follow_those_of_the_scenario(model: str, more: str, tmp_path: Path) -> None:
    text = f"{more}{LEAST}".replace("model: turtlebot3_burger", f"model: {model}\n  sensors: standard")
    sensors = load(tmp_path, text).scenario.sensors
    names = [str(entry["name"]) for entry in STANDARD_SENSORS[model]]
    assert [sensor.name for sensor in sensors] == [*(["own"] if more else []), *names]
    laser = next(sensor for sensor in sensors if sensor.name == "scan")
    assert isinstance(laser.sensor, Lidar)
    assert (laser.sensor.rays, laser.sensor.angle_min) == (360, 0)
    assert (laser.sensor.min_range, laser.sensor.range) == (0.12, 3.5)
    assert (laser.link, laser.rate) == ("base_scan", 5)


@pytest.mark.parametrize(
    ("model", "sensors", "message"),
    [
        ("husky_a200", "", "standard ones are known of turtlebot3_burger"),
        ("turtlebot3_burger", "sensors: [{lidar: {}, name: scan}]\n", "a second sensor named 'scan'"),
    ],
)
def test_standard_sensors_that_do_not_fit_are_refused(model: str, sensors: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidScenario, match=message):
        load(tmp_path, LEAST.replace("turtlebot3_burger\n", f"{model}\n  sensors: standard\n") + sensors)


def test_ego_exchanges_robots_with_their_standard_sensors() -> None:
    robot, other = {"model": "x.urdf", "sensors": "standard"}, {"model": "y.urdf", "sensors": "standard"}
    data = {"ego": "b", "robot": robot, "commands": (), "world": {"actors": ({"name": "b", **other},)}}
    turned, problems = with_roles(Document("a.sim.yml", data, {}))
    actors = ({"name": "b", **robot, "commands": ()},)
    assert (turned.data, problems) == ({"ego": "b", "robot": other, "world": {"actors": actors}}, ())
