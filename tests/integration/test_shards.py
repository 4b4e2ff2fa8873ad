"""Runs of shards, joined, are one run: real processes, real files."""

from __future__ import annotations

import json
import os
import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import pytest

from tests.integration.conftest import interpreter, sim_action

ROOT = Path(__file__).parents[2]

SCENARIO = """\
name: {name}
robot: {{model: turtlebot3_burger}}
commands: {{twist: [{{linear: {speed}}}]}}
expect: [{{travel: {{at_least: {distance}}}}}, {{max_speed: {{linear: 0.2 m/s}}, severity: warning}}]
time_limit: 2 s
"""
SCENARIOS = {
    "c.sim.yml": SCENARIO.format(name="same", speed=1.0, distance="5 cm"),
    "a.sim.yml": SCENARIO.format(name="same", speed=0.5, distance="5 cm"),
    "invalid.sim.yml": "name: [",
    "deep/b.sim.yml": SCENARIO.format(name="too far", speed=0.1, distance="9 m"),
    "deep/same.sim.yml": SCENARIO.format(name="Same", speed=0.7, distance="5 cm"),
}
ASKED = (".", "nope*.sim.yml")


def outcomes(folder: Path) -> list[dict[str, Any]]:
    """Without what depends on the clock."""
    found: list[dict[str, Any]] = json.loads((folder / "results.json").read_text())["outcomes"]
    return [
        {key: value for key, value in made.items() if key not in {"wall_time", "real_time_factor"}} for made in found
    ]


def junit(folder: Path) -> str:
    """Without what depends on the clock."""
    root = ET.parse(folder / "junit.xml").getroot()
    for element in root.iter():
        element.attrib.pop("time", None)
        element.attrib.pop("timestamp", None)
        for child in [child for child in element if child.get("name") == "real_time_factor"]:
            element.remove(child)
    return ET.tostring(root, encoding="unicode")


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where everything was run at once, by `--shard` and by the matrix; each into a folder of its own."""
    folder = tmp_path_factory.mktemp("shards")
    for name, text in SCENARIOS.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    whole = sim_action(folder, "run", *ASKED, "--output-dir", "whole/out")
    assert whole.returncode == 2, whole.stderr
    for index in (1, 2, 3):
        sim_action(folder, "run", *ASKED, "--shard", f"{index}/3", "--output-dir", f"by-shard/{index}")
    planned = sim_action(folder, "matrix", *ASKED, "--shards", "3", "--durations", "whole/out/results.json")
    for entry in json.loads(planned.stdout)["include"]:
        paths = entry["scenario"].split("\n")
        sim_action(folder, "run", *paths, "--output-dir", f"by-matrix/{entry['index']}")
    return folder


def test_each_shard_has_its_part_and_says_of_what(workspace: Path) -> None:
    parts = [json.loads((workspace / f"by-shard/{index}/results.json").read_text()) for index in (1, 2, 3)]
    assert [part["shard"] for part in parts] == [{"index": index, "count": 3, "total": 6} for index in (1, 2, 3)]
    assert [[made["file"] for made in part["outcomes"]] for part in parts] == [
        ["a.sim.yml", "deep/b.sim.yml", "nope*.sim.yml"],
        ["c.sim.yml", "deep/same.sim.yml"],
        ["invalid.sim.yml"],
    ]


@pytest.mark.parametrize("kind", ["by-shard", "by-matrix"])
def test_joined_shards_are_one_run(workspace: Path, kind: str, tmp_path: Path) -> None:
    arguments = ["--scenarios", ASKED[0], "--scenarios", ASKED[1]] if kind == "by-matrix" else []
    # In an "out" of its own, so that the paths of traces in the JUnit XML are those of the one run.
    merged = sim_action(workspace, "merge", kind, *arguments, "--output-dir", f"{tmp_path}/{kind}/out")
    assert merged.returncode == 2, merged.stderr
    assert "3 passed, 1 failed, 2 errors, 3 warnings" in merged.stdout
    joined = tmp_path / kind / "out"
    assert outcomes(joined) == outcomes(workspace / "whole/out")
    assert [bool(made["digest"]) for made in outcomes(joined)] == [True, True, False, True, True, False]
    assert junit(joined).replace(f"{tmp_path}/{kind}/", "whole/") == junit(workspace / "whole/out")
    for evidence in ("traces", "replays"):
        for stored in (workspace / "whole/out" / evidence).iterdir():
            assert (joined / evidence / stored.name).read_bytes() == stored.read_bytes()
        assert len(list((joined / evidence).iterdir())) == 4


@pytest.mark.parametrize("text", [None, "", '{"version": 2}'])
def test_without_durations_the_matrix_is_balanced_by_count(workspace: Path, tmp_path: Path, text: str | None) -> None:
    durations = tmp_path / "results.json"
    if text is not None:
        durations.write_text(text)
    made = sim_action(workspace, "matrix", "--shards", "2", "--durations", str(durations))
    assert made.returncode == 0
    told = "results.json is not a valid results file: " if text is not None else "there are no earlier results at "
    assert told in made.stderr
    assert re.search(r"results\.json( .+|, as in the first run); all scenarios count as equally long", made.stderr)
    assert made.stdout == sim_action(workspace, "matrix", "--shards", "2").stdout


def test_an_empty_shard_passes_and_reads_well(tmp_path: Path) -> None:
    (tmp_path / "a.sim.yml").write_text(SCENARIOS["a.sim.yml"])
    ran = sim_action(tmp_path, "run", "--shard", "2/2", GITHUB_STEP_SUMMARY="summary.md", GITHUB_OUTPUT="outputs")
    assert ran.returncode == 0, ran.stderr
    assert re.match(r"no scenarios in \d+\.\d s; shard 2 of 2 \(1 run in total\)\n", ran.stdout)
    assert "shard 2 of 2 has no scenario: the selection has only 1" in ran.stderr
    assert "✅ No scenarios for shard 2 of 2" in (tmp_path / "summary.md").read_text()
    assert "success" in (tmp_path / "outputs").read_text()
    assert ET.parse(tmp_path / "sim-results/junit.xml").getroot().get("tests") == "0"
    assert outcomes(tmp_path / "sim-results") == []


@pytest.mark.parametrize(
    ("arguments", "absent"),
    [
        (("matrix", ".", "--shards", "2"), {"pybullet", "mujoco", "numpy"}),
        (("merge", "by-shard", "--output-dir"), {"pybullet", "mujoco"}),
    ],
)
def test_what_is_not_installed_for_an_action_is_not_imported(
    workspace: Path, tmp_path: Path, arguments: tuple[str, ...], absent: set[str]
) -> None:
    folder = [str(tmp_path / "out")] if arguments[0] == "merge" else []
    code = (
        "import sys\nfrom sim_action.cli.main import call\n"
        f"call(sys.argv[1:])\nprint(sorted({absent} & set(sys.modules)))"
    )
    ran = interpreter(workspace, "-c", code, *arguments, *folder, env={**os.environ, "PYTHONPATH": str(ROOT)})
    assert ran.stdout.splitlines()[-1] == "[]", ran.stdout + ran.stderr
    assert folder == [] or Path(folder[0], "results.json").exists()
