from __future__ import annotations

import io
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from sim_action.reports import ReportOptions, Verbosity
from sim_action.reports.terminal import print_results
from sim_action.results.results_json import Results
from tests.outcomes import like
from tests.reports.samples import SAMPLES


@pytest.fixture(autouse=True)
def plain_surroundings(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("FORCE_COLOR", "NO_COLOR", "TTY_COMPATIBLE", "GITHUB_ACTIONS"):
        monkeypatch.delenv(name, raising=False)


def printed(
    results: Results, options: ReportOptions, verbosity: Verbosity = "normal", *, encoding: str = "utf-8"
) -> str:
    stream = io.TextIOWrapper(io.BytesIO(), encoding=encoding, newline="\n")
    print_results(results, replace(options, verbosity=verbosity), stream)
    stream.seek(0)
    return stream.read()


def test_golden(kind: str, options: ReportOptions, golden: Callable[[str, str], None]) -> None:
    golden(f"{kind}.txt", printed(SAMPLES[kind], options))
    golden(f"{kind}-quiet.txt", printed(SAMPLES[kind], options, "quiet"))
    golden(f"{kind}-verbose.txt", printed(SAMPLES[kind], options, "verbose"))


def test_notes_on_the_model_are_printed_once_for_all_scenarios(options: ReportOptions) -> None:
    notes = tuple(f"robot.sdf:{line}: part {line} is not simulated" for line in range(1, 10))
    (passed,) = SAMPLES["passed"].outcomes
    made = [like(passed, name=f"drive {number}", model_notes=notes) for number in (1, 2)]
    results = like(SAMPLES["passed"], outcomes=tuple(made))
    text = printed(results, options)
    assert [text.count(f"  note: {note}\n") for note in notes] == [1] * 6 + [0] * 3
    assert text.count("3 more notes on the model: --verbose shows them") == 1
    assert printed(results, options, "verbose").count("  note: robot.sdf:") == len(notes)
    assert "note" not in printed(results, options, "quiet")


def test_streams_of_other_encodings(options: ReportOptions) -> None:
    # Ascii stream.
    text = printed(SAMPLES["failed"], options, encoding="ascii")
    assert "x no_collision: base_link touched wall" in text
    assert text.isascii()
    # Stream of another encoding takes any text.
    changed = like(SAMPLES["passed"].outcomes[0], name="größer [bold]✓[/bold] :smile:")
    text = printed(like(SAMPLES["passed"], outcomes=(changed,)), options, encoding="latin-1")
    assert "größer [bold]\\u2713[/bold] :smile:" in text


def test_colours_only_on_github_and_terminals(options: ReportOptions) -> None:
    on_github = {"GITHUB_ACTIONS": "true"}
    assert "\x1b[" not in printed(SAMPLES["failed"], options)
    assert "\x1b[32m✓" in printed(SAMPLES["failed"], replace(options, environment=on_github))
    no_color = replace(options, environment={**on_github, "NO_COLOR": "1"})
    assert "\x1b[" not in printed(SAMPLES["failed"], no_color)


def test_commands_and_control_characters_have_no_effect(options: ReportOptions) -> None:
    # Github obeys no command of a stranger.
    on_github = replace(options, environment={"GITHUB_ACTIONS": "true"})
    text = printed(SAMPLES["hostile"], on_github, "verbose")
    stopped = re.fullmatch(r"::stop-commands::([0-9a-f]{32})\n(.*)\n::\1::\n", text, re.DOTALL)
    assert stopped
    inside = stopped.group(2)
    assert not [line for line in inside.splitlines() if line.lstrip().startswith("::")]
    assert "##[" not in inside
    assert stopped.group(1) not in inside
    # Control characters do not reach the terminal.
    text = printed(SAMPLES["hostile"], options, "verbose")
    assert not set(text) & {"\x1b", "\x00", "\r", "\u202e"}


def test_long_lines_and_folders(options: ReportOptions) -> None:
    # Long lines are left to the terminal.
    changed = like(SAMPLES["passed"].outcomes[0], file="folder/" * 50)
    text = printed(like(SAMPLES["passed"], outcomes=(changed,)), options)
    assert "folder/" * 50 in text
    # The folder of recordings is told once.
    results = SAMPLES["passed"]
    assert "recordings" not in printed(results, options)
    recorded = [like(made, recordings=("recordings/a.csv", "recordings/a.tum")) for made in results.outcomes]
    text = printed(like(results, outcomes=tuple(recorded)), options)
    assert text.count(f"recordings {options.folder / 'recordings'}\n") == 1


@pytest.mark.parametrize("encoding", ["utf-8", "ascii"])
def test_json_on_standard_output_is_the_file(options: ReportOptions, tmp_path: Path, encoding: str) -> None:
    stream = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
    print_results(SAMPLES["hostile"], replace(options, verbosity="json"), stream)
    stream.seek(0)
    assert stream.buffer.read() == SAMPLES["hostile"].write(tmp_path).read_bytes()
