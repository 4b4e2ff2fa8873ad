from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

from action.environment import Environment, InstallError, chosen_lock, install, look

ROOT = Path(__file__).parents[2]


@pytest.fixture
def lock(tmp_path: Path) -> Path:
    path = tmp_path / "requirements.lock"
    path.write_text("click==8.1.8 --hash=sha256:0\n")
    return path


@pytest.fixture(autouse=True)
def runner(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RUNNER_OS", "Linux")
    monkeypatch.setenv("RUNNER_ARCH", "X64")
    monkeypatch.setenv("INPUT_CACHE", "true")
    monkeypatch.setenv("GITHUB_EVENT_NAME", "pull_request")


@pytest.mark.parametrize(
    ("extras", "name"),
    [(None, "some.lock"), ("", "some.lock"), ("rosbags\n", "some-rosbags.lock"), (" mcap,mcap", "some-mcap.lock")],
)
def test_extras_have_a_lock_file_of_their_own(
    extras: str | None, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LOCK", str(tmp_path / "some.lock"))
    if extras is not None:
        monkeypatch.setenv("INPUT_EXTRAS", extras)
    assert chosen_lock(tmp_path / "temp") == tmp_path / name


@pytest.mark.parametrize("extras", ["video, mcap", "mcap\nvideo\n", "mcap video mcap"])
def test_several_extras_have_what_each_of_them_needs(
    extras: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LOCK", str(ROOT / "requirements.lock"))
    monkeypatch.setenv("INPUT_EXTRAS", extras)
    lock = chosen_lock(tmp_path)
    assert lock == tmp_path / "requirements-mcap-video.lock"
    joined = lock.read_text(encoding="utf-8")
    parts = [(ROOT / f"requirements-{extra}.lock").read_text(encoding="utf-8") for extra in ("mcap", "video")]
    packages = [re.findall(r"^[\w-]+==[\w.]+", text, re.MULTILINE) for text in (joined, *parts)]
    assert sorted(packages[0]) == sorted({*packages[1], *packages[2]}), "each once, in one version"
    hashes = [set(re.findall(r"--hash=\S+", text)) for text in (joined, *parts)]
    assert hashes[0] == hashes[1] | hashes[2]


@pytest.mark.parametrize("extras", ["../../other", "rosbags mujoco", "ROSBAGS", "*"])
def test_extras_that_nobody_has_locked_are_refused(extras: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LOCK", "some.lock")
    monkeypatch.setenv("INPUT_EXTRAS", extras)
    with pytest.raises(SystemExit, match="extras must be empty, or some of mcap, rosbags, video"):
        chosen_lock(Path())


def test_each_lock_file_has_its_own_environment(lock: Path, tmp_path: Path) -> None:
    before = Environment.of(lock, tmp_path)
    key = before.key
    lock.write_text("click==8.1.9 --hash=sha256:0\n")
    after = Environment.of(lock, tmp_path)
    assert len({before.folder, before.wheels, after.folder, after.wheels}) == 4
    assert key != after.key


def test_key_has_everything_that_wheels_depend_on(lock: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    environment = Environment.of(lock, tmp_path)
    key = environment.key
    assert f"Linux-X64-{sys.implementation.cache_tag}" in key
    monkeypatch.setenv("RUNNER_ARCH", "ARM64")
    assert environment.key != key


def test_it_is_ready_when_the_copy_of_the_lock_file_is_there(lock: Path, tmp_path: Path) -> None:
    environment = Environment.of(lock, tmp_path)
    environment.folder.mkdir()
    assert not environment.ready
    copy = environment.folder / lock.name
    copy.write_text("click")
    assert not environment.ready
    copy.write_bytes(lock.read_bytes())
    assert environment.ready
    assert not look(environment)["cache"]


@pytest.mark.parametrize(
    ("wanted", "event", "cached"),
    [
        ("true", "push", True),
        ("true", "pull_request", True),
        ("false", "push", False),
        ("true", "pull_request_target", False),
        ("true", "workflow_run", False),
    ],
)
def test_when_wheels_are_kept(
    wanted: str, event: str, cached: bool, lock: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("INPUT_CACHE", wanted)
    monkeypatch.setenv("GITHUB_EVENT_NAME", event)
    assert look(Environment.of(lock, lock.parent))["cache"] is cached


def test_cache_is_true_or_false(lock: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("INPUT_CACHE", "maybe")
    with pytest.raises(SystemExit, match="cache must be true or false"):
        look(Environment.of(lock, tmp_path))


@pytest.mark.process
def test_an_environment_that_came_out_of_a_cache_counts_for_nothing(
    lock: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    environment = Environment.of(lock, tmp_path)
    assert not look(environment)["ready"]
    monkeypatch.setenv("READY", "false")
    environment.folder.mkdir()
    (environment.folder / lock.name).write_bytes(lock.read_bytes())
    with pytest.raises(InstallError):
        install(environment)
    monkeypatch.setenv("READY", "true")
    assert not install(environment)["fetched"]
