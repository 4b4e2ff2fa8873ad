"""The parts of installed packages: their names, their import, and what can be wrong with them."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from sim_action.app import catalogue
from sim_action.app.catalogue import explanation, names
from sim_action.app.schema import scenario_schema, schema_here
from sim_action.assertions import ASSERTIONS, Assertion
from sim_action.cli.doctor import _package_parts
from sim_action.commands import COMMANDS
from sim_action.core.errors import InternalError, InvalidScenario, PackageFault, UsageError
from sim_action.core.permissions import Permissions
from sim_action.core.registry import PackageProblem, installed_parts
from sim_action.scenario.loading import build_scene, load_scenario
from sim_action.sensors import SENSORS
from sim_action.simulation.loop import simulate
from tests.installed_packages import ASSERTION, install, install_assertion, install_wobble

TEXT = """\
name: burger
robot: {{model: turtlebot3_burger}}
expect: [{expect}]
time_limit: 1 s
"""


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder for packages; the modules that a test imports from it are forgotten."""
    folder = tmp_path / "site"
    folder.mkdir()
    monkeypatch.syspath_prepend(folder)
    before = set(sys.modules)
    yield folder
    for name in set(sys.modules) - before:
        if str(folder) in str(getattr(sys.modules[name], "__file__", "")):
            del sys.modules[name]


def problems(folder: Path, expect: str, permissions: Permissions | None = None) -> list[str]:
    path = folder / "a.sim.yml"
    path.write_text(TEXT.format(expect=expect))
    with pytest.raises(InvalidScenario) as refused:
        load_scenario(path, permissions or Permissions())
    return [str(problem).partition(": ")[2] for problem in refused.value.problems]


def test_its_names_come_after_ours_which_win(site: Path) -> None:
    own = tuple(ASSERTIONS)
    install_assertion(site, "a-still")
    assert ASSERTIONS.all_names() == (*own, "still")
    assert tuple(ASSERTIONS) == own
    assert "still" not in ASSERTIONS
    kind = ASSERTIONS.load("still")
    assert issubclass(kind, Assertion)
    assert kind.runs_user_code
    install_assertion(site, "a-travel", key="travel")
    assert "travel" not in ASSERTIONS.installed()
    assert ASSERTIONS.load("travel").__module__ == "sim_action.assertions.distance"


def test_a_scenario_that_uses_it_runs_user_code(site: Path, tmp_path: Path) -> None:
    install_wobble(site)
    path = tmp_path / "a.sim.yml"
    for expect in ("{wobble: {at_most: 5 deg}}", "{any_of: [upright, wobble]}"):
        path.write_text(TEXT.format(expect=expect))
        assert load_scenario(path).scenario.runs_user_code
    path.write_text(TEXT.format(expect="upright") + "sensors: [inclinometer]\n")
    assert load_scenario(path).scenario.runs_user_code
    path.write_text(TEXT.format(expect="upright") + "sensors: [imu]\n")
    assert not load_scenario(path).scenario.runs_user_code


def test_two_packages_with_one_name_are_both_named(site: Path, tmp_path: Path) -> None:
    install_assertion(site, "a-still")
    install_assertion(site, "b-still")
    told = "expect.0.still: 'still' is in a-still 1.0 and in b-still 1.0; uninstall one of them"
    assert problems(tmp_path, "still") == [told]


def test_a_package_that_is_found_twice_counts_once(site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install_assertion(site, "a-still")
    monkeypatch.syspath_prepend(install_assertion(tmp_path / "again", "a-still"))
    assert ASSERTIONS.installed()["still"].packages == ("a-still 1.0",)


@pytest.mark.parametrize(
    ("code", "told"),
    [
        ("import nothing_of_this_name", "'still' of a-still 1.0 cannot be imported: ModuleNotFoundError: No module"),
        ("raise ValueError('two\\nlines')", "cannot be imported: ValueError: two\\nlines (a_still.py:1)"),
        ("import sys; sys.exit(3)", "cannot be imported: SystemExit: 3 (a_still.py:1)"),
        ("def broken(:", "cannot be imported: SyntaxError: "),
        ("Other = 1", "cannot be imported: AttributeError: module 'a_still' has no attribute 'Still'"),
        ("Still = 1", "a_still:Still is not a subclass of sim_action.extending.Assertion"),
        ("class Still: key = 'still'", "a_still:Still is not a subclass of sim_action.extending.Assertion"),
        (ASSERTION.replace('"still"', '"other"'), "has the key 'other'; it must be 'still', as the entry point is"),
        (ASSERTION.replace("def monitor", "def other"), "a_still:Still has no monitor"),
    ],
)
def test_a_class_that_is_wrong_is_a_problem_at_its_place(code: str, told: str, site: Path, tmp_path: Path) -> None:
    install_assertion(site, "a-still", code)
    (problem,) = problems(tmp_path, "{still: {}}")
    assert problem.startswith("expect.0.still: 'still' of a-still 1.0")
    assert told in problem
    # Scenarios that do not use it are valid.
    (tmp_path / "b.sim.yml").write_text(TEXT.format(expect="upright"))
    load_scenario(tmp_path / "b.sim.yml")
    assert [found.state for found in _package_parts()] == ["missing"]


def test_it_is_not_imported_where_scripts_are_refused(site: Path, tmp_path: Path) -> None:
    install_assertion(site, "a-still", "raise AssertionError('imported')")
    for permissions in (Permissions(scripts_refused="no scripts here"), Permissions(imports_refused="no scripts here")):
        told = "expect.0.still: 'still' of a-still 1.0 is not imported: no scripts here"
        assert problems(tmp_path, "still", permissions) == [told]
    assert "a_still" not in sys.modules


def test_its_names_and_keys_are_in_messages(site: Path, tmp_path: Path) -> None:
    install_wobble(site)
    (unknown,) = problems(tmp_path, "{wobbel: {at_most: 1 deg}}")
    assert unknown.startswith("expect.0.wobbel: unknown assertion 'wobbel'; did you mean 'wobble'?")
    assert problems(tmp_path, "{wobble: {at_mst: 1 deg}}") == [
        "expect.0.wobble.at_mst: unknown key; did you mean 'at_most'? (allowed: at_most)"
    ]
    (two,) = problems(tmp_path, "{upright: {}, wobble: {}}")
    assert two == "expect.0.wobble: 'upright' and 'wobble' in one entry; begin each with '- '"


@pytest.mark.parametrize("hook", ["title", "problems"])
def test_an_exception_of_a_spec_is_a_problem_of_the_scenario(hook: str, site: Path, tmp_path: Path) -> None:
    code = ASSERTION.replace("def monitor", f"def {hook}(self, *_):\n        raise OSError('oh')\n\n    def monitor", 1)
    if hook == "title":
        code = ASSERTION.replace('return "still"', "raise OSError('oh')")
    install_assertion(site, "a-still", code)
    path = tmp_path / "a.sim.yml"
    path.write_text(TEXT.format(expect="{still: {}}"))
    with pytest.raises(OSError, match="oh") as raised:
        load_scenario(path)
    fault = InternalError.of(raised.value)
    assert isinstance(fault, PackageFault)
    assert str(fault).startswith("'still' of a-still 1.0 raised OSError: oh (a_still.py:")
    assert fault.part == "still"


def test_lists_explanations_and_the_schema_have_it(site: Path) -> None:
    plain = scenario_schema()
    install_wobble(site)
    (entry,) = catalogue.of_packages(ASSERTIONS)
    assert (entry.name, [field.name for field in entry.fields]) == ("wobble", ["at_most"])
    assert entry.summary.endswith("(of sim-action-wobble 0.1.0)")
    assert [entry.name for table in (COMMANDS, SENSORS) for entry in catalogue.of_packages(table)] == [
        "sway",
        "inclinometer",
    ]
    assert explanation("wobble", 100).splitlines()[0].endswith(": assertion of sim-action-wobble 0.1.0, below expect")
    assert {"wobble", "sway", "inclinometer"} <= set(names())
    assert scenario_schema() == plain
    here = schema_here("scenario")
    added = here["definitions"].keys() - plain["definitions"].keys()
    assert {"wobble.Wobble", "sway.Sway", "inclinometer.Inclinometer"} <= added
    assert here["definitions"]["sway.Sway"]["required"] == ["sway"]
    assert here["definitions"]["wobble.Wobble"]["properties"]["at_most"]["description"].startswith("an invariant")
    assert schema_here("results") != schema_here("base")


SOURCE = """\
from typing import ClassVar

from sim_action.extending import CommandSource, OpenLoop


class Sway(CommandSource):
    key: ClassVar[str] = "sway"

    {field}: float = 1.0

    def open(self, scene):
        return OpenLoop(lambda time: 1 / 0)
"""


def install_source(site: Path, field: str) -> None:
    install(site, "a-sway", SOURCE.format(field=field), "[sim_action.commands]\nsway = a_sway:Sway\n")


def test_a_command_source_has_keys_of_its_own_beside_those_of_all(site: Path, tmp_path: Path) -> None:
    install_source(site, "sway")
    path = tmp_path / "a.sim.yml"
    path.write_text(f"{TEXT.format(expect='no_collision')}commands: {{sway: 2.0, rate: 20 Hz}}\n")
    loaded = load_scenario(path, Permissions())
    assert loaded.scenario.runs_user_code
    with pytest.raises(ZeroDivisionError) as raised:
        simulate(loaded.scenario, build_scene(loaded), lambda _: None)
    assert str(InternalError.of(raised.value)).startswith("'sway' of a-sway 1.0 raised ZeroDivisionError: ")


@pytest.mark.parametrize(
    ("field", "commands", "message"),
    [
        ("speed", "sway: 1.0", "TypeError: Sway has no field 'sway', which holds the value of its key in a scenario"),
        (
            "sway",
            "sway: 1.0, speed: 2",
            "commands.speed: unknown key (allowed: dropouts, jitter, latency, name, rate, ",
        ),
        ("sway", "sway: 1.0, twist: []", "'twist' and 'sway' in one entry; begin each with '- '"),
        ("sway", "swy: 1.0", "unknown command 'swy'; did you mean 'sway'?"),
    ],
)
def test_a_wrong_command_source_is_refused(site: Path, tmp_path: Path, field: str, commands: str, message: str) -> None:
    install_source(site, field)
    (problem, *_) = problems(tmp_path, f"no_collision]\ncommands: {{{commands}}}\nsensors: [", Permissions())
    assert message in problem


def test_a_class_of_the_name_of_one_of_ours_has_a_definition_of_its_own(site: Path) -> None:
    code = ASSERTION.replace("class Still", "class Travel").replace("class Watch", "Still = Travel\nclass Watch")
    install_assertion(site, "a-still", code)
    definitions = schema_here("scenario")["definitions"]
    assert {"Travel", "still.Travel"} <= definitions.keys()


def test_a_class_without_a_schema_is_left_out_of_the_schema(site: Path) -> None:
    code = ASSERTION.replace('"still"\n', '"still"\n\n    unit: Callable = print\n', 1)
    install_assertion(site, "a-still", f"from collections.abc import Callable\n{code}")
    assert "still.Still" not in schema_here("scenario")["definitions"]


def test_one_that_cannot_be_imported_is_told_in_lists_and_explanations(site: Path) -> None:
    install_assertion(site, "a-still", "raise ValueError('oh')")
    told = "'still' of a-still 1.0 cannot be imported: ValueError: oh (a_still.py:1)"
    (entry,) = catalogue.of_packages(ASSERTIONS)
    assert entry.summary == told
    with pytest.raises(UsageError) as refused:
        explanation("still", 100)
    assert str(refused.value) == told
    assert "still.Still" not in schema_here("scenario")["definitions"]


def test_lists_import_nothing_where_scripts_are_refused(site: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install_assertion(site, "a-still", "raise AssertionError('imported')")
    monkeypatch.setenv("GITHUB_EVENT_NAME", "issue_comment")
    (entry,) = catalogue.of_packages(ASSERTIONS)
    assert entry.summary.startswith("'still' of a-still 1.0 is not imported: scripts are not run on issue_comment")


def test_a_damaged_package_is_left_out(site: Path) -> None:
    install_assertion(site, "a-still")
    install(site, "b-damaged", "", "no section = here\n[[[\n")
    (site / "c_damaged-1.0.dist-info").mkdir()
    assert list(installed_parts("sim_action.assertions")) == ["still"]


def test_an_import_that_failed_is_not_repeated(site: Path) -> None:
    install_assertion(site, "a-still", "import sys\nsys.tried = getattr(sys, 'tried', 0) + 1\nraise ValueError\n")
    for _ in range(3):
        with pytest.raises(PackageProblem):
            ASSERTIONS.load("still")
    assert sys.__dict__.pop("tried") == 1


@pytest.mark.process
def test_a_valid_scenario_of_our_own_names_reads_no_metadata(tmp_path: Path) -> None:
    (tmp_path / "a.sim.yml").write_text(TEXT.format(expect="{upright: {}, after: 0.5 s}") + "sensors: [{imu: {}}]\n")
    code = (
        "import sys\nfrom sim_action.scenario.loading import load_scenario\nfrom pathlib import Path\n"
        "load_scenario(Path('a.sim.yml'))\n"
        "from sim_action.core import registry\nprint(registry._parts_on.cache_info().misses)"
    )
    ran = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert ran.stdout == "0\n"
