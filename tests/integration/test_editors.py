"""The JSON Schemas in the tools that use them: yaml-language-server, ajv and check-jsonschema."""

from __future__ import annotations

import functools
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sim_action.app.schema import SCHEMAS, scenario_schema, schema_text
from sim_action.cli.init import write_scaffold
from sim_action.robot.built_in import BUILT_IN
from tests.app.typos import SCENARIO, TYPOS
from tests.examples import EXAMPLES
from tests.integration.language_server import LanguageServer
from tests.integration.node import ENVIRONMENT, MODULES

ROOT: Final = Path(__file__).parents[2]
BASES: Final = sorted(ROOT.glob("examples/**/*.base.yml"))


@pytest.fixture(scope="module")
def schemas(tmp_path_factory: pytest.TempPathFactory) -> dict[Path, str]:
    """The files of the schemas for scenarios and for bases -> the files that each is for."""
    folder = tmp_path_factory.mktemp("schemas")
    for name in ("scenario", "base"):
        (folder / f"{name}.json").write_text(schema_text(SCHEMAS[name]()), encoding="utf-8")
    return {folder / "scenario.json": "*.sim.yml", folder / "base.json": "*.base.yml"}


@pytest.fixture(scope="module")
def server(schemas: dict[Path, str]) -> Iterator[LanguageServer]:
    with LanguageServer(schemas) as running:
        yield running


def test_an_editor_finds_no_problem_in_the_examples(server: LanguageServer) -> None:
    texts = {path.as_uri(): path.read_text(encoding="utf-8") for path in (*EXAMPLES, *BASES)}
    assert len(texts) > 50
    by_address = server.problems({**texts, "file:///all.sim.yml": SCENARIO})
    assert {address: problems for address, problems in by_address.items() if problems} == {}


def test_an_editor_reports_typos_at_their_line_in_few_words(server: LanguageServer) -> None:
    by_address = server.problems({f"file:///{number}.sim.yml": typo.text for number, typo in enumerate(TYPOS)})
    for typo, problems in zip(TYPOS, by_address.values(), strict=True):
        is_told = any(line == typo.line and typo.message in message for line, message in problems)
        assert is_told if typo.message else not problems, (typo, problems)
        assert len(problems) <= 4, (typo, problems)
        # A pattern follows the words for people.
        assert all(len(message.partition("|^")[0]) < 120 for _, message in problems), problems


@pytest.mark.parametrize(
    ("line", "text", "meaning", "notation"),
    [
        (4, "model", "name of a built-in model, or path of a URDF, xacro, SDF or MJCF file", ""),
        (10, "gravity", "downwards", "number, or text such as 20 m/s^2; units: m/s^2, cm/s^2"),
        (19, "rate", "rate of the ticks", "number, or text such as 20 Hz; units: Hz, kHz"),
        (29, "travel", "The distance on the ground from the start position", ""),
        (29, "at_least", "a goal: must be reached", "number, or text such as 20 m; units: m, mm, cm, km"),
        (30, "before", "deadline in sim time", "number, or text such as 20 s; units: s, ms, us, min, h"),
        (40, "time_limit", "sim time at which the scenario fails", "number, or text such as 20 s"),
    ],
)
def test_an_editor_explains_keys_with_their_units(
    line: int, text: str, meaning: str, notation: str, server: LanguageServer
) -> None:
    server.open("file:///hover.sim.yml", SCENARIO)
    shown = server.hover("file:///hover.sim.yml", line, SCENARIO.splitlines()[line].index(text) + 1)
    assert meaning in shown
    assert notation in shown.replace("\\", "")


@pytest.mark.parametrize(
    ("name", "text", "offered"),
    [
        ("a.sim.yml", "", {"name", "robot", "expect", "time_limit", "extends", "scenarios"}),
        ("b.sim.yml", "expect:\n  - ", {"travel", "no_collision", "upright", "before", "severity"}),
        ("c.sim.yml", "expect:\n  - travel:\n      ", {"at_least", "at_most"}),
        ("d.sim.yml", "expect:\n  - travel: {at_least: 1}\n    severity: ", {"error", "warning"}),
        ("e.sim.yml", "commands:\n  ", {"twist", "waypoints", "script", "rate"}),
        ("f.sim.yml", "commands:\n  script: a.py\n  ", {"rate", "function", "class"}),
        ("g.sim.yml", "robot:\n  drive:\n    ", {"diff", "mecanum", "skid", "ackermann"}),
        ("k.sim.yml", "robot:\n  model: ", set(BUILT_IN)),
        ("h.sim.yml", "extends: a.base.yml\nrobot:\n  ", {"model", "pose", "drive"}),
        ("i.base.yml", "", {"robot", "world", "expect", "variations"}),
        ("j.base.yml", "world:\n  ", {"gravity", "objects"}),
    ],
)
def test_an_editor_completes_keys_and_words(name: str, text: str, offered: set[str], server: LanguageServer) -> None:
    server.open(f"file:///{name}", f"{text}\n")
    lines = text.splitlines() or [""]
    assert offered <= server.completions(f"file:///{name}", len(lines) - 1, len(lines[-1]))


def test_the_first_line_that_init_writes_names_the_schema_for_editors(tmp_path: Path) -> None:
    scenario, *_ = write_scaffold(tmp_path, schema_text(scenario_schema()), force=False)
    text = scenario.read_text(encoding="utf-8")
    with LanguageServer({}) as without_settings:
        other = scenario.with_name("other.sim.yml").as_uri()
        texts = {scenario.as_uri(): text, other: text.replace("time_limit", "time_limt")}
        right, wrong = without_settings.problems(texts).values()
    assert right == []
    assert "Property time_limt is not allowed." in [message for _, message in wrong]


def run(*command: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, cwd=ROOT, env=ENVIRONMENT, capture_output=True, text=True, check=False)


def test_check_jsonschema_accepts_the_schemas_and_the_examples(schemas: dict[Path, str], tmp_path: Path) -> None:
    check = f"{sys.prefix}/bin/check-jsonschema"
    for schema, paths in zip(schemas, (EXAMPLES, BASES), strict=True):
        accepted = run(check, "--schemafile", schema, *paths)
        assert accepted.returncode == 0, accepted.stdout
    wrong = tmp_path / "wrong.sim.yml"
    wrong.write_text(SCENARIO.replace("time_limit: 30 s", "time_limit: 30 kg"), encoding="utf-8")
    refused = run(check, "--schemafile", next(iter(schemas)), wrong)
    assert refused.returncode == 1
    assert "number, or text such as 20 s" in refused.stdout


STRICT: Final = """
const [ajv, ...schemas] = process.argv.slice(1);
const Ajv = require(ajv).default;
const logger = { log: (text) => { throw Error(text); }, warn: (text) => { throw Error(text); }, error: console.error };
for (const path of schemas) {
  new Ajv({ strict: true, logger }).compile(require(path));
}
"""


def test_ajv_compiles_the_schemas_in_its_strict_mode(schemas: dict[Path, str]) -> None:
    compiled = run("node", "-e", STRICT, MODULES / "ajv", *schemas)
    assert compiled.returncode == 0, compiled.stderr


def patterns(schema: Any) -> Iterator[str]:
    if isinstance(schema, dict) and isinstance(pattern := schema.get("pattern"), str):
        yield pattern
    for value in schema.values() if isinstance(schema, dict) else schema if isinstance(schema, list) else ():
        yield from patterns(value)


@functools.cache
def all_patterns() -> list[str]:
    """The patterns of both schemas, made when they are needed: it takes half a second."""
    return sorted({pattern for name in ("scenario", "base") for pattern in patterns(SCHEMAS[name]())})


MATCHING: Final = """
const patterns = JSON.parse(process.argv[1]).map((pattern) => new RegExp(pattern, "u"));
require("readline").createInterface({ input: process.stdin }).on("line", (line) => {
  console.log(JSON.stringify(patterns.map((pattern) => pattern.test(JSON.parse(line)))));
});
"""


@pytest.fixture(scope="module")
def matching() -> Iterator[subprocess.Popen[str]]:
    command = ["node", "-e", MATCHING, json.dumps(all_patterns())]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=ENVIRONMENT) as node:
        yield node
        node.kill()


PIECES: Final = (*"07.-+ \n\r\u2028\u00a0aé機:/_", "1.5", "e3")


def pieces() -> st.SearchStrategy[str]:
    words = {word for pattern in all_patterns() for word in re.findall(r"[A-Za-z%/^\\]+", pattern)}
    return st.lists(st.sampled_from([*PIECES, *sorted(words)]), max_size=6).map("".join)


@settings(suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture])
@given(st.text(max_size=6) | st.deferred(pieces))
def test_patterns_mean_the_same_in_python_and_in_ecmascript(matching: subprocess.Popen[str], text: str) -> None:
    assert matching.stdin is not None
    assert matching.stdout is not None
    matching.stdin.write(json.dumps(text) + "\n")
    matching.stdin.flush()
    assert json.loads(matching.stdout.readline()) == [bool(re.search(pattern, text)) for pattern in all_patterns()]
