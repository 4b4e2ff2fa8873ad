"""From one scenario to its variations: which there are, what they are called, and where their errors stand."""

from __future__ import annotations

import json
import pickle
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.permissions import Permissions
from sim_action.results.outcome import Outcome
from sim_action.scenario.files import read_file
from sim_action.scenario.loading import load_all
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.source import Refused
from tests.scenarios import LEAST, load_refused, load_runs, refused_runs, runs

WALL = "world: {objects: [{name: wall, box: [0.1, 2, 0.5], pose: {x: 3}}]}\n"


def names(text: str, seed: int | None = None) -> list[str]:
    return [source.name.removeprefix("push") for source in runs(text, seed=seed)]


def test_lists_are_multiplied_in_the_order_of_the_file() -> None:
    text = "variations:\n  world.ground.friction: [0.4, 0.8]\n  robot.pose.x: [1 m, -20 cm, 0]\n"
    assert names(text) == [f"[friction={value},x={x}]" for value in (0.4, 0.8) for x in ("1m", "-20cm", "0")]


def test_each_is_a_scenario_with_its_values(tmp_path: Path) -> None:
    text = "variations:\n  world.ground.friction: [0.4, 0.8]\n  robot.pose: [{x: 1}, {yaw: 90 deg}]\n"
    loaded = [run for run in load_runs(tmp_path, LEAST + text) if isinstance(run, LoadedScenario)]
    first, *_, last = loaded
    assert [run.scenario.name.removeprefix("burger drives straight") for run in loaded] == [
        f"[friction={friction},pose=#{pose}]" for friction in (0.4, 0.8) for pose in (1, 2)
    ]
    assert [run.scenario.world.ground.friction for run in loaded] == [0.4, 0.4, 0.8, 0.8]
    assert [run.scenario.robot.pose.x for run in loaded] == [1.0, 0.0, 1.0, 0.0]
    assert first.model is last.model is not None
    assert last.source.group == "burger drives straight"
    values = [(value.key, value.value) for value in last.source.variation]
    assert values == [("world.ground.friction", 0.8), ("robot.pose", {"yaw": "90 deg"})]
    assert first.scenario.variations is None


def test_delays_and_losses_can_be_varied(tmp_path: Path) -> None:
    text = "sensors: [{contact: {}, name: bumper}]\nvariations: {KEY: [0, 0.2]}\n"
    sent = []
    for key in ("commands.latency", "commands.dropouts", "sensors.bumper.jitter"):
        for each in load_runs(tmp_path, LEAST + text.replace("KEY", key)):
            assert isinstance(each, LoadedScenario)
            source, mounted = each.scenario.commands[0], each.scenario.sensors[0]
            sent += [(source.latency, source.dropouts, mounted.transmission.jitter)]
    assert sent == [(0, 0, 0), (0.2, 0, 0), (0, 0, 0), (0, 0.2, 0), (0, 0, 0), (0, 0, 0.2)]


def test_samples_are_drawn_jointly_and_multiplied_with_lists() -> None:
    text = (
        "variations:\n  robot.pose.yaw: {uniform: [-0.1, 0.1], samples: 3}\n  world.ground.friction: [0.4, 0.8]\n"
        "  robot.pose.x: {normal: [0 cm, 5 cm], samples: 3}\n"
    )
    drawn = runs(text)
    assert len(drawn) == len({run.name for run in drawn}) == 6
    rows = [tuple(value.value for value in run.variation) for run in drawn]
    assert len({(yaw, x) for yaw, _, x in rows}) == 3
    assert [friction for _, friction, _ in rows] == [0.4, 0.8] * 3
    assert all(isinstance(yaw, float) and -0.1 <= yaw <= 0.1 for yaw, _, _ in rows)
    assert all(isinstance(x, str) and x.endswith(" cm") for _, _, x in rows)


def test_what_is_drawn_is_of_the_seed_and_the_key_alone() -> None:
    yaw = "variations:\n  robot.pose.yaw: {uniform: [-0.1, 0.1], samples: 4}\n"
    first = names(yaw)
    assert names(yaw) == first
    joint = names(f"{yaw}  robot.pose.x: {{normal: [0, 1], samples: 4}}\n")
    assert [name.split(",")[0] + "]" for name in joint] == first
    assert names(yaw, seed=1) != first
    assert names(f"seed: 1\n{yaw}") == names(yaw, seed=1)
    # More samples leave the first what they were.
    more = [run.variation for run in runs(yaw.replace("4}", "40}"))]
    assert more[:4] == [run.variation for run in runs(yaw)]


def seeds(text: str, seed: int | None = None) -> list[object]:
    documents = [source.document.data for source in runs(text, seed=seed)]
    return [data.get("seed") for data in documents if isinstance(data, dict)]


def test_each_sample_has_a_seed_of_its_own_that_depends_on_its_index_and_the_scenarios_seed_alone() -> None:
    yaw = "variations:\n  robot.pose.yaw: {uniform: [-0.1, 0.1], samples: 4}\n"
    first = seeds(yaw)
    assert len(set(first)) == 4
    assert all(isinstance(seed, int) and 0 <= seed < 2**53 for seed in first)
    assert seeds(yaw) == first == seeds(yaw.replace("4}", "40}"))[:4]
    assert seeds(f"{yaw}  robot.pose.x: {{normal: [0, 1], samples: 4}}\n") == first
    assert seeds(f"seed: 1\n{yaw}") == seeds(yaw, seed=1) == seeds(f"seed: 3\n{yaw}", seed=1)
    assert not set(first) & set(seeds(yaw, seed=1))
    assert {source.scenario_seed for source in runs(yaw, seed=1)} == {1}


def test_listed_values_are_compared_on_the_same_samples() -> None:
    listed = "variations:\n  world.ground.friction: [0.4, 0.8]\n"
    assert seeds(listed) == [None, None]
    assert seeds(f"seed: 5\n{listed}") == [5, 5]
    assert [source.scenario_seed for source in runs(listed)] == [None, None]
    drawn = "  robot.pose.yaw: {uniform: [-0.1, 0.1], samples: 3}\n"
    both = seeds(listed + drawn)
    assert both[:3] == both[3:] == seeds(f"variations:\n{drawn}")


def test_a_listed_seed_has_samples_of_its_own() -> None:
    drawn = "  robot.pose.yaw: {uniform: [-0.1, 0.1], samples: 3}\n"
    found = seeds(f"variations:\n  seed: [1, 2]\n{drawn}")
    assert found == [*seeds(f"seed: 1\nvariations:\n{drawn}"), *seeds(f"seed: 2\nvariations:\n{drawn}")]
    assert seeds("variations: {seed: [1, 2]}\n") == [1, 2]
    # That of the command line decides the drawn values, and not the listed seeds.
    typed = runs(f"variations:\n  seed: [1, 2]\n{drawn}", seed=7)
    assert [source.scenario_seed for source in typed] == [1] * (len(typed) // 2) + [2] * (len(typed) // 2)
    assert [source.document.data["seed"] for source in typed if isinstance(source.document.data, dict)] == found


def test_seeds_are_drawn_as_different_whole_numbers() -> None:
    drawn = "variations:\n  seed: {uniform: [0, 9], samples: 10}\n"
    found = seeds(drawn)
    assert sorted(found, key=str) == list(range(10))
    assert seeds(drawn.replace("10}", "4}")) == found[:4]
    assert names(drawn) == [f"[seed={seed}]" for seed in found]
    assert [source.scenario_seed for source in runs(drawn)] == [None] * 10
    large = "variations: {seed: {uniform: [0, 1000000000], samples: 50}}\n"
    assert names(large) == [f"[seed={seed}]" for seed in seeds(large)]
    assert seeds(large) != seeds(large, seed=1)


def test_an_invalid_seed_is_reported_although_there_are_samples(tmp_path: Path) -> None:
    text = "seed: -3\nvariations:\n  robot.pose.yaw: {uniform: [-0.1, 0.1], samples: 4}\n"
    refused = load_refused(tmp_path, LEAST + text)
    assert [problem.message.partition(":")[0] for problem in refused.problems] == ["seed"]


@pytest.mark.parametrize(
    ("bounds", "alike"),
    [
        ("uniform: [0, 90 deg]", "uniform: [0 deg, 90 deg]"),
        ("uniform: [-90 deg, 0]", "uniform: [-90 deg, 0 deg]"),
        ("normal: [0, 5 cm]", "normal: [0 cm, 5 cm]"),
        ("normal: [1 m, 5 cm]", "normal: [100 cm, 5 cm]"),
        ("uniform: [5 cm, 1 m]", "uniform: [0.05 m, 1 m]"),
    ],
)
def test_what_is_drawn_is_in_one_unit_however_the_figures_are_written(bounds: str, alike: str) -> None:
    drawn, same = (
        [source.variation for source in runs(f"variations: {{robot.pose.x: {{{written}, samples: 3}}}}\n")]
        for written in (bounds, alike)
    )
    assert drawn == same


def test_samples_are_called_with_as_many_digits_as_tell_them_apart() -> None:
    found = names("variations:\n  robot.pose.yaw: {uniform: [1, 1.0000001], samples: 20}\n")
    assert len(set(found)) == 20
    assert max(map(len, found)) < 30


@pytest.mark.parametrize(
    ("keys", "labels"),
    [
        (("robot.pose.x", "world.ground.friction"), "x,friction"),
        (("robot.pose.x", "world.objects.wall.pose.x"), "robot.pose.x,wall.pose.x"),
        (("robot.pose.x", "robot.pose.y", "world.objects.0.pose.y"), "x,robot.pose.y,0.pose.y"),
        (("commands.twist.0.linear", "time_limit"), "linear,time_limit"),
    ],
)
def test_a_key_is_called_by_the_fewest_steps_that_tell_it_from_others(keys: tuple[str, ...], labels: str) -> None:
    (name,) = names(WALL + "variations:\n" + "".join(f"  {key}: [1]\n" for key in keys))
    assert name == "[" + ",".join(f"{label}=1" for label in labels.split(",")) + "]"


@pytest.mark.parametrize(
    ("values", "texts"),
    [
        ("[true, null, 'a b', lib/x.urdf]", ["true", "null", "ab", "lib/x.urdf"]),
        ("[1, '1', 1.0]", ["#1", "#2", "1.0"]),
        ("['a,b', 'a]', '*', '|', '']", ["#1", "#2", "#3", "#4", "#5"]),
        (f"[{'x' * 41}, [1], {{}}]", ["#1", "#2", "#3"]),
    ],
)
def test_a_value_that_would_spoil_a_name_is_called_by_its_number(values: str, texts: list[str]) -> None:
    assert names(f"variations: {{robot.base: {values}}}\n") == [f"[base={text}]" for text in texts]


def test_a_name_in_a_list_leads_to_its_entry_wherever_that_stands() -> None:
    (run,) = runs(WALL + "variations: {world.objects.wall.pose.x: [1]}\n")
    assert isinstance(run.document.data, dict)
    assert run.document.data["world"]["objects"][0]["pose"] == {"x": 1}
    assert run.document.data["world"]["objects"][0]["box"] == (0.1, 2, 0.5)


@pytest.mark.parametrize(
    ("key", "box"), [("world.objects.a.b.pose.x", 0), ("world.objects.a.pose.x", 1), ("world.objects.a.b.c.pose.x", 2)]
)
def test_a_name_with_dots_leads_to_its_entry(key: str, box: int) -> None:
    objects = ", ".join(f"{{name: {name}, box: [1, 1, 1]}}" for name in ("a.b", "a", "a.b.c"))
    (run,) = runs(f"world: {{objects: [{objects}]}}\nvariations: {{{key}: [7]}}\n")
    assert isinstance(run.document.data, dict)
    assert run.document.data["world"]["objects"][box]["pose"] == {"x": 7}
    assert run.name == "push[x=7]"


@pytest.mark.parametrize(
    ("variations", "problem"),
    [
        ("{world.objects.wal.pose.x: [1]}", "world.objects is a list without 'wal'; did you mean 'wall'?"),
        ("{world.objects.1.pose.x: [1]}", "world.objects is a list without '1' (allowed: wall); one of its 1 entries"),
        ("{expect.2: [1]}", "expect is a list without '2'; one of its 1 entries by number, from 0"),
        ("{robot.model.x: [1]}", "robot.model is 'turtlebot3_burger', and has no key 'x'"),
        ("{robot..x: [1]}", "a key is a path of keys with dots"),
        ("{name: [a, b]}", "'name' is the same in all variations"),
        ("{extends: [a.base.yml, b.base.yml]}", "'extends' is the same in all variations: files are merged before"),
        ("{scenarios: [[], []]}", "'scenarios' is the same in all variations: scenarios are separated before keys"),
        ("{seed: {normal: [5, 1], samples: 2}}", "seeds are different whole numbers: draw them with 'integers' or"),
        ("{seed: {uniform: [0, 0.5], samples: 2}}", "bounds of seeds must be whole numbers from 0 to 9007199254740992"),
        ("{seed: {uniform: [0, 4], samples: 6}}", "6 different seeds do not fit between 0 and 4; choose wider bounds"),
        ("{variations.seed: [1, 2]}", "'variations' is the same in all variations: variations cannot be nested"),
        ("{backend: [pybullet]}", "'backend' is the same in all variations; use --backend all to run"),
        ("{robot.pose: [{}], robot.pose.x: [1]}", "is inside 'robot.pose', which also varies"),
        ("{robot.pose.x: []}", "expected a list of values, or a draw such as"),
        ("{robot.pose.x: 3}", "expected a list of values, or a draw such as {uniform: [0, 1], samples: 10}, found 3"),
        ("{robot.pose.x: {unifrm: [0, 1], samples: 2}}", "did you mean 'uniform'?"),
        ("{robot.pose.x: {uniform: [0, 1], normal: [0, 1], samples: 2}}", "'uniform' and 'normal' cannot be combined"),
        ("{robot.pose.x: [1, 2, 1]}", "1 occurs twice"),
        ("{robot.pose.x: {uniform: [1, 1], samples: 2}}", "uniform: both bounds are 1; choose two different ones"),
        ("{robot.pose.x: {uniform: [0.6, 0.2], samples: 2}}", "uniform: the first bound must be below the second"),
        ("{robot.pose.x: {uniform: [0 s, 5 cm], samples: 2}}", "of one dimension, or none; found '0 s' and '5 cm'"),
        ("{robot.pose.x: {uniform: [1, 5 cm], samples: 2}}", "units of one dimension, or none; found 1 and '5 cm'"),
        ("{robot.pose.x: {uniform: [-1 m, 5], samples: 2}}", "units of one dimension, or none; found '-1 m' and 5"),
        ("{robot.pose.x: {normal: [1e308 km, 1 mm], samples: 2}}", "found '1e308 km' and '1 mm'"),
        ("{robot.pose.x: {uniform: [1 m, 5 cm], samples: 2}}", "found [1 m, 5 cm]; write [5 cm, 1 m]"),
        ("{robot.pose.x: {choice: [1, 2], weights: [75 %, 25 %], samples: 2}}", "expected a number, found '75 %'"),
        ("{robot.pose.x: {uniform: [0, .inf], samples: 2}}", "expected a finite number or quantity, found inf"),
        ("{robot.pose.x: {uniform: [-1e308, 1e308], samples: 2}}", "are farther apart than any number"),
        ("{robot.pose.x: {normal: [0, 0], samples: 2}}", "the standard deviation, must be above 0; found [0, 0]"),
        ("{robot.pose.x: {normal: [0, 1]}}", "the key 'samples' is missing"),
        ("{robot.pose.x: {normal: [0, 1], samples: 0}}", "must be at least 1, found 0"),
        ("{robot.pose.x: {normal: [0], samples: 1}}", "entry 2 of the list is missing"),
        ("{robot.pose.x: {normal: [far, 1], samples: 1}}", "expected a finite number or quantity, found 'far'"),
        ("{robot.pose.x: {normal: ['1 |', '1 |'], samples: 1}}", "a finite number or quantity, found '1 |'"),
        ('{"robot.args.\\n::error::x": [1]}', "the names of the runs contain it: use plain text"),
        ("{robot.args.<b>: [1]}", "the names of the runs contain it: use plain text"),
        ("{'robot.args.a=1,b': [1]}", "without any of [],=*?"),
        (f"{{robot.args.{'x' * 200}: [1]}}", "of at most 200 characters"),
        ("[1]", "variations: expected a map of 1 to 20 keys"),
        ("{}", "variations: expected a map of 1 to 20 keys"),
        (f"{{robot.pose.x: {[*range(101)]}, robot.pose.y: {[*range(100)]}}}", "10,100 runs; a file may have 10,000"),
        (
            "{robot.pose.x: {normal: [0, 1], samples: 1}, robot.pose.y: {normal: [0, 1], samples: 2}}",
            "samples are drawn together: 'robot.pose.x' has 1, this one 2",
        ),
    ],
)
def test_variations_that_cannot_be(variations: str, problem: str) -> None:
    (found,) = refused_runs(f"{WALL}variations: {variations}\n")
    assert found.startswith("12:")
    assert ": variations" in found
    assert problem in found


def test_a_value_that_cannot_be_is_told_at_its_place_and_once(tmp_path: Path) -> None:
    text = "variations:\n  robot.pose.x: [0, 1, 2]\n  world.ground.friction:\n    - 0.4\n    - -1\n    - fast\n"
    refused = load_refused(tmp_path, LEAST + text)
    assert refused.name == "burger drives straight"
    assert [str(problem).rpartition("yml:")[2] for problem in refused.problems] == [
        "15:7: world.ground.friction: must be at least 0, found -1",
        "16:7: world.ground.friction: expected ratio such as 0.5, found 'fast'",
    ]


def test_a_key_that_is_none_is_told_where_it_stands_in_the_variations(tmp_path: Path) -> None:
    refused = load_refused(tmp_path, LEAST + "variations:\n  world.ground.fricton: [1, 2]\n")
    assert [str(problem).rpartition("yml:")[2].partition(" (")[0] for problem in refused.problems] == [
        "12:26: world.ground.fricton: unknown key; did you mean 'friction'?"
    ]


def test_what_is_long_is_not_varied_without_end() -> None:
    """Written out by aliases: 100 rows of 100 heights that stand there once."""
    rows = f"[&row [{', '.join('0' * 100)}]{', *row' * 99}]"
    world = f"world: {{objects: [{{name: hill, heightfield: {{heights: {rows}, size: [1, 1]}}}}]}}\n"
    assert len(runs(f"{world}variations: {{robot.pose.y: {{uniform: [0, 1], samples: 400}}}}\n")) == 400
    (found,) = refused_runs(f"{world}variations: {{robot.pose.y: {{uniform: [0, 1], samples: 600}}}}\n")
    assert "600 runs of 10,1" in found
    assert "values each, more than 5,000,000; move long values into a file" in found


def test_variations_share_what_is_read_for_their_worlds(tmp_path: Path) -> None:
    """Or 10,000 of them would hold as many copies of one ground."""
    ground = "{name: hill, heightfield: {heights: [[0, 1], [0, 1]], size: [1, 1]}, pose: {x: 3}}"
    missing = "{name: rock, mesh: {file: rock.stl}}"
    text = "world: {{objects: [{}]}}\nvariations: {{robot.pose.y: [0, 1, 2]}}\n"
    first, *others = load_runs(tmp_path, LEAST + text.format(ground))
    assert isinstance(first, LoadedScenario)
    assert len(others) == 2
    for other in others:
        assert isinstance(other, LoadedScenario)
        assert other.parts["hill"] is first.parts["hill"]
    assert len(load_refused(tmp_path, LEAST + text.format(missing)).problems) == 1


def several(*entries: str) -> str:
    return "".join(["scenarios:\n", *(f"  - {entry}\n" for entry in entries), LEAST.partition("\n")[2]])


def test_variations_of_one_scenario_leave_the_others_of_its_file(tmp_path: Path) -> None:
    entries = "{name: a, variations: {robot.pose.x: [1, 2]}}", "{name: b, variations: 7}", "{name: c}"
    loaded = load_runs(tmp_path, several(*entries))
    names = [run.name if isinstance(run, Refused) else run.scenario.name for run in loaded]
    assert names == ["a[x=1]", "a[x=2]", "b", "c"]
    assert [isinstance(run, Refused) for run in loaded] == [False, False, True, False]


@given(
    st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1, max_size=6, unique_by=repr),
    st.lists(st.text(st.characters(codec="utf-8", exclude_categories=["C"]), max_size=8), max_size=6, unique=True),
)
def test_no_two_variations_are_called_alike(numbers: list[float], words: list[str]) -> None:
    values = json.dumps([*numbers, *words], ensure_ascii=False)
    found = names(f"variations: {{robot.base: {values}, robot.pose.x: {{uniform: [0, 1], samples: 2}}}}\n")
    assert len(set(found)) == len(found) == 2 * (len(numbers) + len(words))


def test_what_is_drawn_stays_the_same_for_good() -> None:
    """Or a name that somebody has noted runs another variation one day."""
    text = (
        "variations:\n  robot.pose.yaw: {uniform: [-0.1, 0.1], samples: 3}\n"
        "  robot.pose.x: {normal: [0 cm, 5 cm], samples: 3}\n"
    )
    assert names(text) == ["[yaw=0.038,x=11.8cm]", "[yaw=0.016,x=-3.59cm]", "[yaw=-0.0165,x=2.34cm]"]
    text = (
        "variations:\n  robot.pose.z: {log_uniform: [1 mm, 1 m], samples: 4}\n"
        "  robot.pose.y: {sobol: [0, 1], samples: 4}\n"
        "  robot.pose.yaw: {normal: [0, 1], between: [0, 9], samples: 4}\n"
        "  robot.pose.pitch: {integers: [0, 99], samples: 4}\n"
        "  robot.base: {choice: [free, fixed], weights: [1, 2], samples: 4}\n"
    )
    assert names(text) == [
        "[z=0.6m,y=0.375,yaw=1.02,pitch=39,base=free]",
        "[z=0.0129m,y=0.818,yaw=0.806,pitch=8,base=fixed]",
        "[z=0.00546m,y=0.687,yaw=0.55,pitch=60,base=fixed]",
        "[z=0.00254m,y=0.0379,yaw=1.09,pitch=55,base=free]",
    ]


def test_samples_share_the_places_of_what_is_drawn_also_in_another_process() -> None:
    (run, _) = runs("variations:\n  world.ground.friction: [0.4, 0.8]\n")
    again = pickle.loads(pickle.dumps(run))
    assert again == run
    assert again.document.location(("world", "ground", "friction")).line == 12
    first, second = runs("variations:\n  robot.pose.yaw: {uniform: [-0.1, 0.1], samples: 2}\n")
    assert first.document.marks is second.document.marks
    one, other = runs("variations:\n  robot.pose.yaw:\n    - 0.1\n    - 0.2\n")
    path = ("robot", "pose", "yaw")
    assert other.document.marks[path].line == (one.document.marks[path].line or 0) + 1


@pytest.mark.process
def test_variations_are_drawn_where_there_is_no_numpy() -> None:
    code = (
        "import sys\nsys.modules['numpy'] = None\n"
        "from sim_action.scenario.variations.values import value_list\n"
        "draws = [{'normal': (0, 1)}, {'normal': (0, 1), 'between': (0, 1)}, {'log_uniform': (1, 2)},\n"
        "    {'sobol': (0, 1)}, {'integers': (1, 2)}, {'choice': (1, 2)}]\n"
        "print(sum(len(value_list('a', {**draw, 'samples': 2}, 0).values) for draw in draws))"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout == "12\n"


def test_a_draw_beyond_what_its_key_allows_stops_that_variation_alone(tmp_path: Path) -> None:
    text = "variations:\n  world.ground.friction: {normal: [0.2, 0.2], samples: 20}\n  robot.pose.x: [0, 1]\n"
    found = load_runs(tmp_path, LEAST + text)
    refused = [each for each in found if isinstance(each, Refused)]
    drawn = [each.source.variation[0].value for each in found if isinstance(each, LoadedScenario)]
    assert len(found) == 40
    assert 2 <= len(refused) <= 20
    assert all(isinstance(friction, float) and friction >= 0 for friction in drawn)
    for each in refused:
        assert each.name.startswith("burger drives straight[friction=-0.")
        assert (each.group, each.variation[0].key) == ("burger drives straight", "world.ground.friction")
        (problem,) = each.problems
        assert str(problem).endswith(
            f"12:3: world.ground.friction: must be at least 0, found {each.variation[0].value} "
            "(drawn from normal: [0.2, 0.2]; limit it with 'between', or use a smaller deviation)"
        )
    outcome = Outcome.of_refused(refused[0])
    assert (outcome.name, outcome.group, outcome.variation) == (refused[0].name, refused[0].group, refused[0].variation)
    assert [each.number for each in refused] == [place for place, each in enumerate(found, 1) if each in refused]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        # Of the list, as that is a mistake of whoever has written it.
        ("{world.ground.friction: {uniform: [-1, 1], samples: 9}, robot.pose.x: [0, far]}", "found 'far'"),
        # The same for every sample.
        ("{world.ground.fricton: {uniform: [0, 1], samples: 3}}", "unknown key; did you mean 'friction'?"),
    ],
)
def test_what_is_wrong_beside_what_is_drawn_stops_all_variations(tmp_path: Path, text: str, told: str) -> None:
    refused = load_refused(tmp_path, f"{LEAST}variations: {text}\n")
    assert (refused.name, refused.group, refused.number) == ("burger drives straight", None, 1)
    assert any(told in str(problem) for problem in refused.problems)


def test_a_variation_that_cannot_be_keeps_its_name_on_its_own(tmp_path: Path) -> None:
    text = "variations: {world.ground.friction: {uniform: [-1, 1], samples: 9}}\n"
    refused = next(each for each in load_runs(tmp_path, LEAST + text) if isinstance(each, Refused))
    sources = [each for each in read_file(tmp_path / "s.sim.yml", Permissions()) if each.name == refused.name]
    (alone,) = load_all(sources, Permissions())
    assert alone == replace(refused, error=alone.error) if isinstance(alone, Refused) else False


VARIED = "{name: br, variations: {robot.pose.x: [1, 2]}}"


@pytest.mark.parametrize(
    ("entries", "told"),
    [
        ((VARIED, "{name: 'br[x=1]'}"), "3:6: name: this scenario is called 'br[x=1]'"),
        (("{name: 'br[x=2]'}", VARIED), "3:6: name: a variation of 'br' is called 'br[x=2]'"),
    ],
)
def test_a_variation_has_its_name_alone(tmp_path: Path, entries: tuple[str, str], told: str) -> None:
    *_, refused = sources = load_runs(tmp_path, several(*entries))
    assert isinstance(refused, Refused)
    assert [source for source in sources if isinstance(source, Refused)] == [refused]
    assert str(refused.problems[0]).endswith(f"{told}, like another run of this file; choose another name")
