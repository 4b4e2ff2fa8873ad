"""All bad models and meshes as scenarios of one suite, beside good ones."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import pytest

from sim_action.engines import installed
from sim_action.results.outcome import Outcome
from sim_action.results.results_json import Results
from sim_action.robot.model.findings import RULES
from tests.integration.conftest import sim_action
from tests.meshes.test_bad_meshes import BAD as BAD_MESHES
from tests.robot.bad_models import BAD_MODELS, GOOD

SPHERE: Final = '<sphere radius="0.5"/>'
GOOD_ONES: Final = 8
_WEIGHTLESS: Final = ("massless-base", "massless-model")


@dataclass(frozen=True, slots=True)
class Case:
    """A scenario whose model has something wrong: the rule and line that say so, if it is refused."""

    name: str
    rule: str
    line: int | None
    text: str
    files: tuple[tuple[str, bytes], ...] = ()

    @property
    def is_refused(self) -> bool:
        return RULES[self.rule].level != "warning"


# PyBullet alone refuses a model with many joints.
CASES: Final = [
    *(
        Case(f"model {number}", bad.rule, bad.line, bad.text)
        for number, bad in enumerate(BAD_MODELS)
        if bad.rule != "many-joints"
    ),
    *(
        Case(f"mesh {number}", rule, 10, GOOD.replace(SPHERE, f'<mesh filename="{file}"/>'), ((file, data),))
        for number, (file, data, rule, _) in enumerate(BAD_MESHES.values())
    ),
]


def write(folder: Path, name: str, text: str, files: tuple[tuple[str, bytes], ...] = ()) -> None:
    """A scenario in a folder of its own."""
    folder = folder / name.replace(" ", "_")
    folder.mkdir(parents=True)
    (folder / "robot.urdf").write_text(text, encoding="utf-8")
    for file, data in files:
        (folder / file).write_bytes(data)
    # These need a base that cannot move.
    bolted = {"base": "fixed"} if any(text == bad.text for bad in BAD_MODELS if bad.rule in _WEIGHTLESS) else {}
    scenario = {
        "name": name,
        "robot": {"model": "robot.urdf", **bolted},
        "allow": ["fixed-base"] if bolted else [],
        "physics": {"settle": 0},
        "expect": ["upright"],
        "time_limit": "0.1 s",
    }
    (folder / "it.sim.yml").write_text(json.dumps(scenario, indent=1))


def outcomes(folder: Path) -> dict[str, Outcome]:
    """By the folders of their scenarios."""
    results = Results.read(folder / "sim-results/results.json")
    return {Path(outcome.file).parent.name.replace("_", " "): outcome for outcome in results.outcomes}


@pytest.fixture(scope="module")
def suite(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which all cases have run, two at a time."""
    folder = tmp_path_factory.mktemp("suite")
    for case in CASES:
        write(folder, case.name, case.text, case.files)
    for number in range(GOOD_ONES):
        write(folder, f"good {number}", GOOD)
    ran = sim_action(folder, "run", ".", "--jobs", "2", "--backend", installed()[0])
    assert ran.returncode == 2, ran.stdout + ran.stderr
    assert "Traceback" not in ran.stdout + ran.stderr
    return folder


def test_every_bad_model_is_an_error_of_its_rule_on_its_line(suite: Path) -> None:
    found = outcomes(suite)
    for case in CASES:
        outcome = found[case.name]
        if not case.is_refused:
            assert outcome.status == "passed", case
            assert any(note.endswith(f"[{case.rule}]") for note in (*outcome.notes, *outcome.model_notes)), case
            continue
        failure = outcome.failures[0]
        assert (outcome.status, failure.kind) == ("error", "invalid"), case
        assert failure.message.endswith(f"[{case.rule}]"), case
        assert failure.location is not None, case
        place = (failure.location.file, failure.location.line)
        assert place == (f"{case.name.replace(' ', '_')}/robot.urdf", case.line), case


def test_every_good_model_passes_beside_them(suite: Path) -> None:
    found = outcomes(suite)
    assert len(found) == len(CASES) + GOOD_ONES
    assert {found[f"good {number}"].status for number in range(GOOD_ONES)} == {"passed"}
