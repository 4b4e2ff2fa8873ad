"""docs/contributing/new-assertion.md, followed word for word in a copy of the repository, adds an assertion."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from sim_action.assertions import ASSERTIONS
from sim_action.engines import installed
from tests.integration.test_examples import in_failing_form, in_unexercised_form

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/contributing/new-assertion.md").read_text(encoding="utf-8")
FENCED = r"(?:(?!```).)*?```\w+\n(.*?)```"
NOT_COPIED = shutil.ignore_patterns(".*", "_site", "node_modules", "__pycache__", "sim-results")
# The tests that have a case for each assertion, and those that ask that none is missing.
TESTS = (
    "tests/assertions/test_max_jerk.py",
    "tests/assertions/test_assertions.py",
    "tests/assertions/test_cuts.py",
    "tests/assertions/test_signals.py",
    "tests/assertions/test_verdict_properties.py",
    "tests/app/test_catalogue.py",
    "tests/core/test_registry.py",
    "tests/test_docs.py",
    "tests/test_parts.py",
)
CASES = "max_jerk or among_those or missing or of_the_table or fresh or every_part or all_pages"


def written(root: Path) -> set[str]:
    """Do what the page says, and return the files that it names on the way."""
    new = {match[1]: match[2] for match in re.finditer(rf"Write `(\S+)`[:.]{FENCED}", PAGE, re.DOTALL)}
    rows = list(re.finditer(rf"In `(\S+)`, below `([^`]+)`:{FENCED}", PAGE, re.DOTALL))
    for name, text in new.items():
        assert not (root / name).exists()
        (root / name).write_text(text, encoding="utf-8")
    for name, above, row in (match.groups() for match in rows):
        path = root / name
        lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
        (place,) = (index for index, line in enumerate(lines) if line.lstrip().startswith(above))
        path.write_text("".join([*lines[: place + 1], row, *lines[place + 1 :]]), encoding="utf-8")
    return {*new, *(match[1] for match in rows)}


def ran(root: Path, *arguments: str, code: int = 0) -> str:
    done = subprocess.run([sys.executable, "-m", *arguments], cwd=root, capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stdout + done.stderr
    return done.stdout


@pytest.mark.soak
def test_the_page_names_every_file_that_a_new_assertion_takes(tmp_path: Path) -> None:
    root = tmp_path / "copy"
    shutil.copytree(ROOT, root, ignore=NOT_COPIED, symlinks=True)
    assert "max_jerk" not in ASSERTIONS
    files = written(root)
    assert files == {name.replace("NAME", "max_jerk") for name in re.findall(r"^\| `(\S+)` \|", PAGE, re.MULTILINE)}
    assert len(files) <= 5
    ran(root, "tools.docs.generate")
    ran(root, "pytest", "-q", "-x", "-n", "0", "-p", "no:cacheprovider", "-k", CASES, *TESTS)
    assert "m/s^3" in ran(root, "sim_action", "explain", "max_jerk")
    example = root / "examples/assertions/max_jerk.sim.yml"
    text = example.read_text(encoding="utf-8")
    for engine in installed():
        for form, code in ((text, 0), (in_failing_form(text)[0], 1), (in_unexercised_form(text), 1)):
            example.write_text(form, encoding="utf-8")
            ran(
                root, "sim_action", "run", "--no-report", "--backend", engine, str(example.relative_to(root)), code=code
            )
