"""The installation of ROS 1 starts programs of the system, never those of the repository."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from action import ros1


@pytest.mark.parametrize("user", [0, 1000])
def test_only_programs_of_the_system_are_started(user: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    workspace, system = tmp_path / "workspace", tmp_path / "system"
    for folder in (workspace, system):
        folder.mkdir()
        for name in ("sudo", "env", "apt-get"):
            (folder / name).touch(mode=0o755)
    monkeypatch.chdir(workspace)
    monkeypatch.setenv("PATH", os.pathsep.join(("", ".", str(workspace), str(system))))
    monkeypatch.setenv("INPUT_ROS1", "true")
    monkeypatch.setattr(os, "geteuid", lambda: user, raising=False)
    monkeypatch.setattr(ros1, "_is_here", lambda: False)
    started: list[list[str]] = []

    def run(command: list[str], *, check: bool) -> subprocess.CompletedProcess[bytes]:
        assert not check
        started.append(command)
        return subprocess.CompletedProcess(command, 0)

    monkeypatch.setattr(subprocess, "run", run)
    ros1.main()
    rights = [str(system / "sudo")] if user else []
    options = [str(system / "env"), "DEBIAN_FRONTEND=noninteractive", str(system / "apt-get"), "--quiet", "--yes"]
    assert [command[: len(rights) + 6] for command in started] == [
        [*rights, *options, "update"],
        [*rights, *options, "install"],
    ]


def test_apt_may_be_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "sudo").touch(mode=0o755)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("INPUT_ROS1", "true")
    monkeypatch.setattr(ros1, "_is_here", lambda: False)
    with pytest.raises(SystemExit) as caught:
        ros1.main()
    assert caught.value.code == 2
    [line] = capsys.readouterr().err.splitlines()
    assert "ROS 1 cannot be installed here" in line
