"""Names that no system accepts are errors of the command line, and no internal ones."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.cli.main import call

LONG = "x" * 5000
DEEP = "x/" * 3000


@pytest.mark.parametrize("name", [LONG, DEEP])
@pytest.mark.parametrize(
    "arguments",
    ["run -q", "validate", "matrix --shards 2", "merge -q", "compare old", "inspect", "view --print", "init"],
)
def test_a_name_that_is_too_long_is_no_internal_error(
    arguments: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    code = call([*arguments.split(), name])
    printed = capsys.readouterr()
    assert "Traceback" not in printed.out + printed.err
    assert code in ((0, 2) if arguments.startswith("matrix") else (2, 5))
