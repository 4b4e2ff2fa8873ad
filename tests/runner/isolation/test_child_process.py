"""The scratch folder of a child process, on a disk that is full and without one."""

from __future__ import annotations

import errno
import os
import tempfile
from pathlib import Path
from unittest.mock import Mock

import pytest

from sim_action.runner.isolation.child_process import job_environment, remove, scratch_folder


def use(monkeypatch: pytest.MonkeyPatch, folder: Path, *full: Path) -> None:
    """Let `tempfile` use a folder; nothing can be written below those that are full."""
    write = Path.write_bytes

    def written(path: Path, data: bytes) -> int:
        if any(path.is_relative_to(each) for each in full):
            raise OSError(errno.ENOSPC, "No space left on device")
        return write(path, data)

    monkeypatch.setattr(Path, "write_bytes", written)
    monkeypatch.setattr(tempfile, "tempdir", str(folder))


@pytest.mark.parametrize("is_full", [True, False])
def test_a_folder_that_is_full_or_missing_is_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_full: bool
) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    second.mkdir()
    if is_full:
        first.mkdir()
    use(monkeypatch, first, first)
    monkeypatch.setenv("TMPDIR", str(second))
    scratch = scratch_folder()
    assert Path(scratch.name).parent == second
    assert not is_full or list(first.iterdir()) == []
    remove(scratch)
    assert list(second.iterdir()) == []


def test_without_any_usable_folder_the_first_reason_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    use(monkeypatch, tmp_path, Path(tmp_path.anchor))
    with pytest.raises(OSError, match="No space left on device"):
        scratch_folder()
    assert tempfile.gettempdir() == str(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_gone_is_removed_without_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    use(monkeypatch, tmp_path)
    scratch = scratch_folder()
    Path(scratch.name).rmdir()
    remove(scratch)


def test_an_empty_folder_is_removed_without_a_free_descriptor(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    use(monkeypatch, tmp_path)
    scratch = scratch_folder()
    too_many = OSError(errno.EMFILE, os.strerror(errno.EMFILE))
    with monkeypatch.context() as patch:
        patch.setattr(scratch, "cleanup", Mock(side_effect=too_many))
        remove(scratch)
    assert list(tmp_path.iterdir()) == []
    scratch.cleanup()


@pytest.mark.parametrize(("runs_code", "value"), [(True, "ssl.cnf"), (False, None)])
def test_libraries_of_a_child_without_code_see_no_variable_of_the_scenario(runs_code: bool, value: str | None) -> None:
    scenario = Mock(environment={"OPENSSL_CONF": "ssl.cnf"}, runs_user_code=runs_code)
    job = Mock(loaded=Mock(scenario=scenario, workspace=Mock(pass_env=())), hash_seed=None)
    assert job_environment(job).get("OPENSSL_CONF") == value
