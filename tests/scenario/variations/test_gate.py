"""The gate of a scenario: what it may say, and which runs it has."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.errors import InvalidScenario
from sim_action.core.permissions import Permissions
from sim_action.scenario.files import read_file
from sim_action.scenario.loading import checked
from sim_action.scenario.source import Refused, Source
from sim_action.scenario.variations.gate import Gate, percent, percents_apart
from tests.scenarios import LEAST, load_refused, refused_runs, runs

DRAWN = "variations: {robot.pose.x: {uniform: [0 m, 1 m]}}\n"
LINE = LEAST.count("\n") + 1


def test_all_samples_share_one_gate() -> None:
    found = runs(f"{DRAWN}gate: {{passes: {{at_least: 90 %}}, runs: 29}}\n")
    gates = {id(run.gate): run.gate for run in found}
    (gate,) = gates.values()
    assert gate is not None
    assert (len(found), gate.runs, gate.name, gate.group, gate.file) == (29, 29, "push", "push", "s.sim.yml")
    assert gate.gate.passes is not None
    assert (gate.gate.passes.at_least, gate.gate.passes.confidence) == (0.9, 0.95)
    assert gate.location.line == LINE + 1
    # The draws may state the number of runs.
    drawn = DRAWN.replace("m]", "m], samples: 29")
    assert len(runs(f"{drawn}gate: {{passes: {{at_least: 90 %}}}}\n")) == 29


def test_listed_values_have_a_gate_each_whose_runs_follow_each_other() -> None:
    keys = "variations: {robot.pose.x: {uniform: [0 m, 1 m]}, time_limit: [10 s, 20 s]}\n"
    found = runs(f"{keys}gate: {{passes: {{at_least: 50 %}}, runs: 5}}\n")
    assert [run.gate and run.gate.name for run in found] == ["push[time_limit=10s]"] * 5 + ["push[time_limit=20s]"] * 5
    assert {run.gate.runs for run in found if run.gate is not None} == {5}


def test_samples_without_a_drawn_key_differ_by_their_seed() -> None:
    found = runs("gate: {passes: {at_least: 50 %}, runs: 5}\n")
    assert [run.name for run in found] == [f"push[sample={number}]" for number in range(1, 6)]
    seeds = {run.document.data["seed"] for run in found if isinstance(run.document.data, dict)}
    assert len(seeds) == 5
    assert all(run.variation == () and run.differs_by_seed for run in found)


def test_a_gate_does_not_reach_its_runs() -> None:
    """Another claim must not change the key of a run, from which `--resume` takes its outcome."""
    first, second = (runs(f"{DRAWN}gate: {{passes: {{at_least: {rate} %}}, runs: 29}}\n") for rate in (50, 90))
    assert [run.document.data for run in first] == [run.document.data for run in second]


@pytest.mark.parametrize(
    ("gate", "problem"),
    [
        ("{}", "gate: must have 'passes', 'stop_early' or 'quantile'; such as passes: {at_least: 90 %}"),
        ("{passes: {at_least: 100 %}}", "gate.passes.at_least: a rate lies between 0 % and 100 %"),
        ("{passes: {at_least: 90 %, confidence: 100 %}}", "no number of runs gives 100 %; found 100 %; use 95 %"),
        ("{passes: {at_least: 90 %, confidence: 10 %}}", "a confidence lies between 50 % and 100 %"),
        ("{passes: {at_least: 90 %, confidence: 99.99999999999999 %}}", "found 99.99999999999999 %; use 95 %"),
        ("{passes: {at_least: 90 %, confidence: 97}}", "found 97, which is 9700 %; write '97 %'"),
        ("{passes: {at_least: 1e-15}}", "a rate lies between 0 % and 100 %"),
        ("{passes: {at_least: 120 %}}", "a rate lies between 0 % and 100 %, both excluded; found 120 %"),
        ("{passes: {at_least: often}}", "expected a share such as 90 %, found 'often'"),
        ("{passes: {at_least: 1}}", "both excluded; found 100 %"),
        ("{passes: {at_least: 90 %, confidence: 120 %}}", "gives 100 %; found 120 %; use 95 %"),
        ("{quantile: {of: travel.measured, q: 0, at_least: 1 m}}", "a quantile lies between 0 % and 100 %, both"),
        ("{stop_early: {reject: 95.00001 %, accept: 95 %}}", "must be below 'accept'; found 95.00001 % and 95 %"),
        ("{passes: {at_least: 90}}", "found 90, which is 9000 %; write '90 %'"),
        ("{passes: {at_least: 90 %, most: 1}}", "gate.passes.most: unknown key"),
        ("{quantile: {of: a.margin, q: 5 %, at_least: 1 m, x: 1}}", "gate.quantile.x: unknown key"),
        ("{stop_early: {reject: 95 %, accept: 85 %}}", "'reject' must be below 'accept'; found 95 % and 85 %"),
        ("{stop_early: {reject: 85 %, accept: 95 %, confidence: 50 %}}", "needs a confidence above 50 %; use 95 %"),
        (
            "{passes: {at_least: 90 %}, stop_early: {reject: 85 %, accept: 95 %}}",
            "and shows no rate of 'at_least'; keep one of them; 'passes: null' removes that of a base file",
        ),
        (
            "{stop_early: {reject: 85 %, accept: 95 %}, quantile: {of: travel.measured, q: 5 %, at_least: 1 m}}",
            "a quantile needs all runs, and 'stop_early' leaves some out",
        ),
        ("{quantile: {of: travel.measured, q: 5 %}}", "must have either 'at_least' or 'at_most'"),
        ("{quantile: {of: travel, q: 5 %, at_least: 1 m}}", "'of' ends with .measured or .margin"),
        ("{quantile: {of: travel.measured, q: 5 %, at_least: 1 mile}}", "'1 mile' is no quantity; write a number and"),
        ("{quantile: {of: travle.measured, q: 5 %, at_least: 1 m}, runs: 99}", "'travle'; did you mean 'travel'?"),
        ("{passes: {at_least: 90 %}, errors: {at_most: -1}}", "gate.errors.at_most: must be at least 0"),
        (
            "{passes: {at_least: 50 %}, errors: {at_most: 9}, runs: 9}",
            "gate.errors.at_most: all of the 9 runs may be without a verdict; allow fewer",
        ),
    ],
)
def test_a_gate_that_makes_no_sense_is_refused(gate: str, problem: str) -> None:
    (found,) = refused_runs(f"{DRAWN}gate: {gate}\n")
    assert found.startswith(f"{LINE + 1}:")
    assert problem in found


@pytest.mark.parametrize(
    ("gate", "needed"),
    [
        ("passes: {at_least: 90 %}", 29),
        ("passes: {at_least: 99 %}", 299),
        ("stop_early: {reject: 85 %, accept: 95 %}", 27),
        ("quantile: {of: travel.measured, q: 5 %, at_least: 1 m}", 59),
        ("quantile: {of: travel.measured, q: 95 %, at_most: 1 m}", 59),
    ],
)
def test_a_gate_that_no_result_passes_is_refused_with_the_runs_it_needs(gate: str, needed: int) -> None:
    (found,) = refused_runs(f"{DRAWN}gate: {{{gate}, runs: {needed - 1}}}\n")
    assert f"{needed - 1} runs cannot show" in found
    assert f"write 'runs: {needed}' or more" in found
    assert len(runs(f"{DRAWN}gate: {{{gate}, runs: {needed}}}\n")) == needed


@pytest.mark.parametrize("gate", ["passes: {at_least: 99.99 %}", "stop_early: {reject: 94.99 %, accept: 95 %}"])
def test_a_gate_that_no_number_of_runs_passes_is_refused(gate: str) -> None:
    (problem,) = refused_runs(f"{DRAWN}gate: {{{gate}, runs: 10000}}\n")
    assert "it needs more than 10,000, the most that a gate may have: claim less" in problem


def test_a_gate_of_a_base_file_belongs_to_the_scenario(tmp_path: Path) -> None:
    """By its file, its runs find it; one that does not fit names the scenario."""
    (tmp_path / "base.yml").write_text("gate: {passes: {at_least: 50 %}, runs: 5}\n")
    (tmp_path / "s.sim.yml").write_text(f"extends: base.yml\n{LEAST}{DRAWN}")
    (run, *_) = read_file(tmp_path / "s.sim.yml", Permissions())
    assert isinstance(run, Source)
    assert run.gate is not None
    assert run.gate.file == run.document.file
    assert run.gate.file.endswith("s.sim.yml")
    assert run.gate.location.file.endswith("base.yml")
    (tmp_path / "base.yml").write_text("gate: {passes: {at_least: 90 %}, runs: 5}\n")
    (refused,) = read_file(tmp_path / "s.sim.yml", Permissions())
    assert isinstance(refused, Refused)
    assert "s.sim.yml: 5 runs cannot show a rate of 90 %" in refused.problems[0].message
    assert refused.problems[0].location.file.endswith("base.yml")


def test_samples_that_would_all_be_the_same_are_refused(tmp_path: Path) -> None:
    gate = "gate: {passes: {at_least: 50 %}, runs: 5}\n"
    assert runs(gate)[0].differs_by_seed
    (same,) = told_of_first(tmp_path, gate)
    assert same.startswith(f"{LINE}:1: gate: all 5 runs would be the same: nothing is drawn and nothing is noisy; draw")
    (without,) = refused_runs("gate: {passes: {at_least: 50 %}}\n")
    assert "'runs' is missing" in without


@pytest.mark.parametrize(
    "draw",
    [
        "{choice: [0.5, 0.6], weights: [1, 0]}",
        "{csv: equal.csv, column: friction}",
        "{choice: [0.5, 0.6], weights: [0, 1]}, seed: {integers: [0, 99]}",
    ],
)
def test_equal_samples_that_are_known_before_any_run_are_refused(tmp_path: Path, draw: str) -> None:
    (tmp_path / "equal.csv").write_text("friction\n" + "0.5\n" * 5)
    text = f"variations: {{world.ground.friction: {draw}}}\ngate: {{passes: {{at_least: 50 %}}, runs: 5}}\n"
    (same,) = told_of_first(tmp_path, text)
    assert "all 5 runs would be the same: all samples of 'world.ground.friction' have one value and nothing" in same
    noisy = "sensors: [{name: imu, imu: {gyro_noise: 0.1}, rate: 10 Hz}]\n"
    assert told_of_first(tmp_path, f"{noisy}{text}") == []


@pytest.mark.parametrize(
    ("gate", "place", "problem"),
    [
        ("{passes: {at_least: 0.9 %}, runs: 9}", ".passes.at_least", "a rate of 0.9 % allows most of the runs to fail"),
        ("{passes: {at_least: 0.49}, runs: 29}", ".passes.at_least", "a rate of 49 % allows"),
        ("{stop_early: {reject: 10 %, accept: 40 %}, runs: 29}", ".stop_early.accept", "a rate of 40 % allows"),
        ("{quantile: {of: travel.measured, q: 99 %, at_least: 1 cm}, runs: 29}", ".quantile", "a share of 1 % allows"),
        ("{quantile: [{of: travel.margin, q: 5 %, at_most: 9 m}], runs: 59}", ".quantile.0", "a share of 5 % allows"),
    ],
)
def test_a_gate_that_most_runs_may_fail_needs_permission(gate: str, place: str, problem: str) -> None:
    (found,) = refused_runs(f"{DRAWN}gate: {gate}\n")
    assert f"gate{place}: {problem}" in found
    assert found.endswith("allow: [low-gate] [low-gate]")
    assert ("write '90 %' if that is meant, or" in found) == ("0.9 %" in gate)
    (first, *_) = runs(f"{DRAWN}gate: {gate}\nallow: [low-gate]\n")
    assert first.gate is not None
    assert first.gate.may_be_low


def test_an_expectation_that_is_a_name_alone_is_found() -> None:
    gate = f"{DRAWN}gate: {{quantile: {{of: no_collision.measured, q: 50 %, at_most: 0}}, runs: 9}}\n"
    once = LEAST.replace("expect:\n", "expect:\n  - no_collision\n")
    assert len(runs(gate, least=once)) == 9
    twice = once.replace("  - no_collision\n", "  - no_collision\n  - no_collision: {allow: [wall]}\n")
    with pytest.raises(InvalidScenario, match="2 expectations are 'no_collision'; give the one that is meant a 'name'"):
        runs(gate, least=twice)


@pytest.mark.parametrize(
    ("expect", "of", "bound", "problem"),
    [
        ("travel: {at_least: 1 m}", "travel", "0.5 kg", "travel.measured is in m, and the limit is 0.5 kg; write it"),
        ("travel: {at_least: 1 m}, name: far", "far", "0.5 kg", "far.measured is in m, and the limit is 0.5 kg"),
        ("upright: {max_tilt: 9 deg}", "upright", "2 m", "upright.measured is in rad, and the limit is 2 m"),
        ("no_collision", "no_collision", "1 m", "no_collision.measured is in contacts, and the limit is 1 m"),
        ("travel: {at_least: 1 m}", "travel", "50 cm", ""),
        ("travel: {at_least: 1 m}", "travel", "0.5", ""),
        ("travel: {at_least: 1 m}, for: 1 s", "travel", "0.5 s", ""),
        ("upright: {max_tilt: 9 deg}", "upright", "2 deg", ""),
        ("settled: {for: 1 s}", "settled", "2 m", ""),
    ],
)
def test_a_limit_of_a_quantile_in_another_unit_is_refused(
    tmp_path: Path, expect: str, of: str, bound: str, problem: str
) -> None:
    entry = expect if ":" not in expect else f"{{{expect}}}"
    least = LEAST.replace("- travel: {at_least: 1.5 m}", f"- {entry}")
    gate = f"{{quantile: {{of: {of}.measured, q: 50 %, at_most: {bound}}}, runs: 9}}"
    found = told_of_first(tmp_path, f"{DRAWN}gate: {gate}\n", least)
    assert (len(found) == 1 and f"gate.quantile: {problem}" in found[0]) if problem else found == []


@pytest.mark.parametrize(
    ("sensor", "is_noisy"),
    [
        ("imu: {gyro_noise: 0.1}", True),
        ("imu: {}, dropouts: 10 %", True),
        ("odometry: {noise: 0.1}", True),
        ("imu: {}, latency: 0.1 s", False),
    ],
)
def test_samples_with_noise_differ(tmp_path: Path, sensor: str, *, is_noisy: bool) -> None:
    sensors = f"sensors: [{{name: one, {sensor}, rate: 10 Hz}}]\n"
    found = told_of_first(tmp_path, f"{sensors}gate: {{passes: {{at_least: 50 %}}, runs: 5}}\n")
    assert ["would be the same" in problem for problem in found] == ([] if is_noisy else [True])


def told_of_first(folder: Path, text: str, least: str = LEAST) -> list[str]:
    """The problems of the first sample, checked as a whole."""
    try:
        checked(runs(text, folder, least=least)[0], Permissions())
    except InvalidScenario as error:
        return [str(problem).removeprefix("s.sim.yml:") for problem in error.problems]
    return []


def test_a_stored_gate_is_read_again() -> None:
    gate = Gate.model_validate({"passes": {"at_least": "90 %"}, "quantile": {"of": "a.margin", "q": 0.1, "at_most": 1}})
    assert Gate.model_validate_json(gate.model_dump_json()) == gate


def test_a_sample_that_cannot_run_refuses_the_gate(tmp_path: Path) -> None:
    """Its other runs would be for nothing."""
    drawn = "variations: {time_limit: {uniform: [-20 s, 30 s]}}\n"
    refused = load_refused(tmp_path, f"{LEAST}{drawn}gate: {{passes: {{at_least: 50 %}}, runs: 7}}\n")
    assert (refused.name, refused.group, refused.gate) == ("burger drives straight", None, None)
    (problem,) = refused.problems
    assert "choose bounds within the allowed range); 4 of 7 samples have a problem here" in str(problem)


@pytest.mark.parametrize("key", ["world.ground.frction", "world.ground.friction"])
def test_a_draw_of_which_no_sample_can_run_has_no_advice_about_bounds(tmp_path: Path, key: str) -> None:
    text = f"{LEAST}variations: {{{key}: {{uniform: [0.1 m, 0.9 m]}}}}\ngate: {{passes: {{at_least: 50 %}}, runs: 7}}\n"
    (problem,) = load_refused(tmp_path, text).problems
    assert ("unknown key" if key.endswith("frction") else "no unit") in problem.message
    assert "drawn from" not in problem.message


def test_a_problem_of_one_of_several_quantiles_is_at_its_entry() -> None:
    good, bad = (f"{{of: {name}.measured, q: 50 %, at_least: 1 m}}" for name in ("travel", "travle"))
    (found,) = refused_runs(f"{DRAWN}gate:\n  runs: 5\n  quantile:\n    - {good}\n    - {bad}\n")
    assert found.startswith(f"{LINE + 5}:7: gate.quantile.1: no expectation is 'travle'")
    few = good.replace("50 %", "1 %")
    (found,) = refused_runs(f"{DRAWN}gate:\n  runs: 5\n  quantile:\n    - {good}\n    - {few}\n")
    assert found.startswith(f"{LINE + 5}:7: gate.quantile.1: 5 runs cannot show")


@pytest.mark.parametrize(
    ("shares", "texts"),
    [
        ((0.9,), ("90 %",)),
        ((0.95082,), ("95.08 %",)),
        ((1.0,), ("100 %",)),
        ((0.99999,), ("99.999 %",)),
        ((0.9999999999999999,), ("99.99999999999999 %",)),
        ((0.899996, 0.9), ("89.9996 %", "90 %")),
        ((0.9, 0.9), ("90 %", "90 %")),
        ((0.9901, 0.990123, 1.0), ("99.01 %", "99.012 %", "100 %")),
    ],
)
def test_shares_that_differ_are_shown_differently(shares: tuple[float, ...], texts: tuple[str, ...]) -> None:
    assert percents_apart(*shares) == texts
    assert len(shares) > 1 or percent(*shares) == texts[0]


@pytest.mark.parametrize(("key", "value"), [("after", "1 s"), ("before", "9 s"), ("severity", "warning")])
def test_a_key_next_to_an_assertion_is_no_expectation(key: str, value: str, tmp_path: Path) -> None:
    gate = f"gate: {{runs: 5, quantile: {{of: {key}.measured, q: 50 %, at_least: 1 m}}}}\n"
    text = LEAST.replace("1.5 m}\n", f"1.5 m}}\n    {key}: {value}\n")
    (problem,) = load_refused(tmp_path, f"{text}{DRAWN}{gate}").problems
    assert f"no expectation is '{key}'" in problem.message
