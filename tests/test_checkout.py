"""What is in the repository is for every machine: no link leads to a place outside of it, such as somebody's .venv."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.mark.process
def test_no_link_leads_out_of_it() -> None:
    if not (ROOT / ".git").exists():
        pytest.skip("this is no checkout")
    told = subprocess.run(["git", "ls-files"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    files = [ROOT / name for name in told.splitlines()]
    assert ROOT / "pyproject.toml" in files
    links = [file for file in files if file.is_symlink()]
    assert [link.relative_to(ROOT) for link in links if not link.resolve().is_relative_to(ROOT)] == []
