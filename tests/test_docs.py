"""The documents are up to date: generated parts, links, files, scenarios and commands in README.md and docs/."""

from __future__ import annotations

import functools
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml
from pygments.styles import get_style_by_name  # type: ignore[import-untyped]  # it has no types
from pygments.token import Error, Generic  # type: ignore[import-untyped]  # it has no types

from sim_action.assertions import ASSERTIONS
from sim_action.cli.main import program as sim_action
from sim_action.robot.model.findings import RULES
from sim_action.scenario.loading import load_scenario
from tests.examples import EXAMPLES
from tools.docs.generate import pages
from tools.docs.generators.scenario import FAMILIES, example
from tools.docs.robots import without_figures

ROOT = Path(__file__).parents[1]
PAGES = {page.relative_to(ROOT).as_posix(): page.read_text(encoding="utf-8") for page in pages()}
TEXTS = PAGES | {name: (ROOT / name).read_text(encoding="utf-8") for name in ("SECURITY.md", "CONTRIBUTING.md")}
README = PAGES["README.md"]
REFERENCE = "\n".join(text for name, text in PAGES.items() if name.startswith("docs/scenario/"))
ROBOTS = PAGES["docs/models/robots.md"]
MAX_README_BYTES = 12_500
MAX_PAGE_LINES = 600
MAX_WORDS = 60_000


def with_marker(path: Path, *parameters: Any) -> Any:
    """Parameters of a test that loads a scenario: where nodes of ROS drive, a process looks for them."""
    drives = re.search(r"  ros[12]:", path.read_text(encoding="utf-8")) is not None
    return pytest.param(*parameters, marks=[pytest.mark.process] if drives else [], id="-".join(map(str, parameters)))


in_each_page = pytest.mark.parametrize("name", TEXTS)


def blocks(language: str, page: str = README) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", page, re.DOTALL)


@pytest.mark.process
@pytest.mark.parametrize("tool", ["generate", pytest.param("robots", marks=pytest.mark.pybullet)])
def test_tables_and_schema_are_fresh(tool: str) -> None:
    command = [sys.executable, "-m", f"tools.docs.{tool}", "--check"]
    checked = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stderr


ROW = "| husky<br>`husky.urdf` | none | 44 kg | 10, 4 move | none | {} |\n"


def test_figures_of_time_may_differ_and_must_be_there() -> None:
    for figures in ("52 / 49 | 1.07", "1234 / 1 | 1234.00"):
        assert without_figures(ROW.format(figures)) == ROW.format("# / # | #")
    for figures in (" | ", "52 / 49 | ", " | 1.07", "52 | 1.07", "a / b | 1.07", "52 / 49 | 1"):
        assert without_figures(ROW.format(figures)) != ROW.format("# / # | #")


def test_what_was_found_of_a_robot_is_explained() -> None:
    head, _, explained = ROBOTS.partition("## What to do about a finding")
    _, _, found = head.partition("<!-- generated: robots -->")
    table, _, _ = found.partition("<!-- end -->")
    rules = set(re.findall(r"[`\[]([a-z]+(?:-[a-z]+)+)[`\]]", table))
    assert {"bad-xml", "massless-base"} <= rules <= set(RULES)
    assert rules <= set(re.findall(r"^\| `([a-z-]+)` \|", explained, re.MULTILINE)) <= set(RULES)


def test_the_readme_is_short_and_all_pages_together() -> None:
    assert len(README.encode()) <= MAX_README_BYTES
    words = sum(len(text.split()) for text in PAGES.values())
    assert words <= MAX_WORDS, f"{words} words; shorten a page by as much as you add"


@in_each_page
def test_a_page_is_not_too_long_and_a_section_stands_once(name: str) -> None:
    assert len(TEXTS[name].splitlines()) <= MAX_PAGE_LINES
    text = re.sub(r"```.*?```", "", TEXTS[name], flags=re.DOTALL)
    sections = re.findall(r"^## (.+)$", text, re.MULTILINE)
    assert sorted(sections) == sorted(set(sections))


def test_an_entry_of_the_changelog_stands_once_and_is_whole() -> None:
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    entries = re.findall(r"^- .*(?:\n  .*)*", changelog, re.MULTILINE)
    lines = [line for entry in entries for line in entry.splitlines() if len(line) > 30]
    assert [line for line in lines if lines.count(line) > 1] == []
    assert [entry for entry in entries if not entry.endswith((".", ":", "`"))] == []


# Its assertion is not in the product; tests/integration/test_new_assertion.py adds it.
NEW_ASSERTION = "docs/contributing/new-assertion.md"


@in_each_page
def test_yaml_in_pages_is_read_and_scenarios_load(name: str, tmp_path: Path) -> None:
    for text in blocks("yaml", TEXTS[name]):
        assert yaml.safe_load(text) is not None
        if text in examples_shown() or name == NEW_ASSERTION:
            continue
        if re.search("^time_limit:", text, re.MULTILINE):
            path = tmp_path / "page.sim.yml"
            path.write_text(text)
            assert load_scenario(path).warnings == ()


@functools.cache
def examples_shown() -> frozenset[str]:
    """The text of all example scenarios: other tests load and run them, with the files next to them."""
    return frozenset(path.read_text(encoding="utf-8") for path in ROOT.glob("examples/**/*.yml"))


@pytest.mark.parametrize(
    ("family", "key"),
    [
        with_marker(example(family, key), family, key)
        for family, table in FAMILIES.items()
        if family != "worlds"
        for key in table
    ],
)
def test_each_section_of_the_reference_has_an_example_of_it(family: str, key: str) -> None:
    path = example(family, key)
    scenario = load_scenario(path).scenario
    named: dict[str, list[type]] = {
        "drives": [type(scenario.robot.drive)],
        "commands": [type(source) for source in scenario.commands],
        "sensors": [type(mounted.sensor) for mounted in scenario.sensors],
        "assertions": [type(expected.assertion) for expected in scenario.expect],
    }
    assert FAMILIES[family].load(key) in named[family]
    assert f"](../../{path.relative_to(ROOT).as_posix()})" in REFERENCE
    assert re.search(rf"^## `{key}`$", REFERENCE, re.MULTILINE)


SINGLE_EXAMPLES = [
    with_marker(path, path.relative_to(ROOT))
    for path in EXAMPLES
    if not re.search("^(extends|scenarios|variations):", path.read_text(encoding="utf-8"), re.MULTILINE)
]


@pytest.mark.parametrize("name", SINGLE_EXAMPLES)
def test_examples_check_what_their_names_say(name: Path) -> None:
    scenario = load_scenario(ROOT / name).scenario
    keys = {expected.assertion.key for expected in scenario.expect}
    if "stops in front of" in scenario.name:
        assert "stops_before" in keys
        assert scenario.duration is not None, "it must also stay there"
    if keys & {"no_collision", "clearance"}:
        assert scenario.world.objects or scenario.world.actors, "nothing to collide with"


@pytest.mark.parametrize("name", list(ASSERTIONS))
def test_the_page_of_each_assertion_says_when_it_passes(name: str) -> None:
    reference = ASSERTIONS.load(name).reference
    page = PAGES[f"docs/scenario/assertions-{reference.page}.md"]
    assert f"\n## `{name}`\n" in page
    assert reference.kind == "invariant" or f": {reference.passed}\n" in page


def test_the_first_scenario_of_the_reference_loads(tmp_path: Path) -> None:
    (tmp_path / "first.sim.yml").write_text(blocks("yaml", PAGES["docs/scenario/index.md"])[0])
    load_scenario(tmp_path / "first.sim.yml")


def anchors(text: str) -> set[str]:
    """The anchors of a page's headings, as GitHub and the site make them."""
    heads = re.findall(r"^#+ (.+)$", re.sub(r"```.*?```", "", text, flags=re.DOTALL), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", head.lower()).replace(" ", "-") for head in heads}


@in_each_page
def test_links_lead_somewhere(name: str) -> None:
    text = re.sub(r"```.*?```", "", TEXTS[name], flags=re.DOTALL)
    targets = [*re.findall(r"\]\(([^)\s]+)\)", text), *re.findall(r'<img src="([^"]+)"', text)]
    for target in targets:
        if target.startswith("https://"):
            continue
        path, _, anchor = target.partition("#")
        found = (ROOT / name).parent / path if path else ROOT / name
        assert found.is_file(), target
        assert ROOT in found.resolve().parents, target
        assert not anchor or anchor in anchors(found.read_text(encoding="utf-8")), target


def test_the_readme_has_its_scenarios_and_the_least_one_is_the_example() -> None:
    assert len([text for text in blocks("yaml") if "time_limit:" in text]) == 2
    example = (ROOT / "examples/turtlebot3/straight_line.sim.yml").read_text()
    assert example in blocks("yaml")[0]
    assert example in PAGES["docs/index.md"]


def test_the_readmes_controller_is_valid(tmp_path: Path) -> None:
    (tmp_path / "controller.py").write_text(blocks("python")[0])
    path = tmp_path / "readme.sim.yml"
    path.write_text(
        "name: n\nrobot: {model: turtlebot3_burger}\ncommands: {script: controller.py}\n"
        "expect: [no_collision]\ntime_limit: 1 s\n"
    )
    load_scenario(path)


@in_each_page
def test_files_that_pages_name_are_there(name: str) -> None:
    for path in re.findall(r"`((?:docs|tests|examples|sim_action|tools)/[\w./-]*)`", TEXTS[name]):
        is_made = (
            "NAME" in path
            or path == "docs/_site"
            or path.endswith(".schema.json")
            or (name == NEW_ASSERTION and "max_jerk" in path)
        )
        assert is_made or (ROOT / path).exists(), path


def commands_in(text: str) -> list[list[str]]:
    """The words of each line of a shell block, without its comment."""
    lines = [line for block in blocks("sh", text) for line in block.splitlines()]
    return [words for line in lines if (words := shlex.split(line, comments=True))]


@in_each_page
def test_commands_in_pages_exist(name: str) -> None:
    makefile = (ROOT / "Makefile").read_text()
    targets, used = set(re.findall(r"^([\w-]+):", makefile, re.MULTILINE)), set(re.findall(r"\$\(([A-Z]+)\)", makefile))
    used |= set(re.findall(r"\$\(or \$\(([A-Z]+)\)", makefile))
    for program, *words in commands_in(TEXTS[name]):
        if program == "make":
            variables = {name for name, given, _ in (word.partition("=") for word in words) if given}
            assert variables <= used, words
            assert {word for word in words if "=" not in word} <= targets, words
        if program == "sim-action":
            sim_action.commands[words[0]].make_context(words[0], words[1:])


@in_each_page
def test_options_in_the_text_exist(name: str) -> None:
    known = {
        option
        for command in sim_action.commands.values()
        for each in command.params
        for option in (*each.opts, *each.secondary_opts)
    }
    for words in re.findall(r"`sim-action ((?:[^`\n]|\n(?!\n))+)`", TEXTS[name]):
        command, *rest = words.split()
        assert command in {*sim_action.commands, "COMMAND"}, words
        assert {word for word in rest if word.startswith("--")} <= {*known, "--help"}, words


def test_code_in_the_documents_has_enough_contrast() -> None:
    def luminance(colour: str) -> float:
        shares = [int(colour[place : place + 2], 16) / 255 for place in (0, 2, 4)]
        linear = [share / 12.92 if share <= 0.03928 else ((share + 0.055) / 1.055) ** 2.4 for share in shares]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    styles = re.findall(r'pygments_(?:dark_)?style = "(.*)"', (ROOT / "docs/conf.py").read_text(encoding="utf-8"))
    assert len(styles) == 2
    for style in map(get_style_by_name, styles):
        ground = luminance(style.background_color.removeprefix("#"))
        for token, look in style:
            if look["color"] and token not in Generic and token not in Error:
                dark, bright = sorted((ground, luminance(look["color"])))
                # The least contrast of text of WCAG 2, level AA.
                assert (bright + 0.05) / (dark + 0.05) >= 4.5, (style, token)
