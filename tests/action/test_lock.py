from __future__ import annotations

import ast
import re
from itertools import product
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from packaging.markers import Marker

from action.lock import (
    ENGINES,
    EXTRAS,
    LockError,
    chosen_locks,
    digest,
    engines_of,
    entries,
    entries_here,
    text_of,
    this_system,
    wheels_of,
    without_engines,
)
from sim_action import engines

ROOT = Path(__file__).parents[2]
LOCKS = sorted(ROOT.glob("action/locks/requirements*.lock"))
SYSTEMS = [
    {"sys_platform": platform, "platform_machine": machine, "python_full_version": version}
    for (platform, machine), version in product(
        [("linux", "x86_64"), ("linux", "aarch64"), ("darwin", "arm64"), ("win32", "AMD64")],
        ["3.11.0", "3.11.14", "3.12.0", "3.13.2"],
    )
]


@pytest.mark.parametrize("lock", LOCKS, ids=lambda lock: lock.name)
def test_every_line_of_our_lock_files_is_an_entry_with_hashes(lock: Path) -> None:
    text = lock.read_text(encoding="utf-8")
    found = entries(text)
    assert len(found) == len(re.findall(r"^[a-z][\w-]*==", text, re.MULTILINE)) > 7
    assert sum(len(entry.hashes) for entry in found) == text.count("--hash=sha256:")
    assert entries(text_of(found)) == found


@pytest.mark.parametrize("name", ["build", "dev", "node"])
def test_make_installs_what_the_action_installs_and_all_of_it_with_hashes(name: str) -> None:
    text = (ROOT / f"tools/locks/{name}.lock").read_text(encoding="utf-8")
    found = entries(text)
    assert all(entry.hashes for entry in found)
    assert len(found) == len(re.findall(r"^[a-z][\w-]*==", text, re.MULTILINE)) > 1
    ours = entries((ROOT / "action/locks/requirements-dask.lock").read_text(encoding="utf-8"))
    shared = {entry.name for entry in ours} & {entry.name for entry in found}
    for system in SYSTEMS:
        several = [
            {each.name: each.version for each in lock if not each.marker or Marker(each.marker).evaluate(system)}
            for lock in (ours, found)
        ]
        assert all(several[0].get(each) in (None, several[1].get(each)) for each in shared)


def test_every_target_of_make_installs_from_a_lock() -> None:
    installs = re.findall(r"pip install(.*)", (ROOT / "Makefile").read_text(encoding="utf-8"))
    # `make engines` is there to try what no lock has yet.
    assert [one for one in installs if "$(VENV)/engines" not in one] == [" --quiet --disable-pip-version-check"]


@pytest.mark.parametrize("lock", LOCKS, ids=lambda lock: lock.name)
def test_markers_mean_what_they_mean_to_pip(lock: Path) -> None:
    for entry in entries(lock.read_text(encoding="utf-8")):
        for system in SYSTEMS:
            assert entry.holds(system) == (not entry.marker or Marker(entry.marker).evaluate(system)), entry.marker


@given(
    st.sampled_from(["==", "!=", "<", "<=", ">", ">="]),
    st.sampled_from(["3.10", "3.11", "3.11.7", "3.12"]),
    st.sampled_from(["and", "or"]),
    st.sampled_from(SYSTEMS),
)
def test_markers_compare_as_those_of_pip_do(comparison: str, version: str, word: str, system: dict[str, str]) -> None:
    marker = f"python_full_version {comparison} '{version}.0' {word} (sys_platform == 'linux')"
    ast.parse(marker.strip(), mode="eval")
    [entry] = entries(f"a==1 ; {marker} \\\n    --hash=sha256:{'0' * 64}\n")
    padded = {**system, "python_full_version": system["python_full_version"]}
    if version.count(".") == 1:
        assert entry.holds(padded) == Marker(marker).evaluate(padded)


@pytest.mark.parametrize("marker", ["extra == 'a'", "'3' < python_full_version", "os.system('x')", "1"])
def test_a_marker_that_is_not_known_is_refused(marker: str) -> None:
    with pytest.raises(LockError, match="marker that is not known"):
        entries(f"a==1 ; {marker}\n")[0].holds(this_system())


@pytest.mark.parametrize("line", ["click>=8", "./click", "-r other.txt", "click @ https://example.com"])
def test_a_line_without_a_version_is_refused(line: str) -> None:
    with pytest.raises(LockError, match="no package with a version"):
        entries(f"{line}\n")


@pytest.mark.parametrize(
    ("extras", "names"),
    [
        ("", ["some.lock"]),
        ("rosbags\n", ["some-rosbags.lock"]),
        (" mcap,mcap", ["some-mcap.lock"]),
        ("video, mcap", ["some-mcap.lock", "some-video.lock"]),
    ],
)
def test_extras_have_a_lock_file_of_their_own(extras: str, names: list[str], tmp_path: Path) -> None:
    assert chosen_locks(tmp_path / "some.lock", extras) == [tmp_path / name for name in names]


@pytest.mark.parametrize("extras", ["video, mcap", "mcap\nvideo\n", "mcap video mcap"])
def test_several_extras_have_the_packages_of_each_of_them(extras: str) -> None:
    joined = entries_here(chosen_locks(ROOT / "action/locks/requirements.lock", extras))
    parts = [entries_here(chosen_locks(ROOT / "action/locks/requirements.lock", extra)) for extra in ("mcap", "video")]
    assert set(joined) == {*parts[0], *parts[1]}
    names = [entry.name for entry in joined]
    assert len(names) == len(set(names)), "each once, in one version"


@pytest.mark.parametrize("extras", ["../../other", "rosbags mujoco", "ROSBAGS", "*"])
def test_extras_without_a_lock_file_are_refused(extras: str) -> None:
    with pytest.raises(LockError, match="extras must be empty, or some of mcap, policy, rosbags, video; found '"):
        chosen_locks(Path("some.lock"), extras)


def test_extras_and_their_lock_files() -> None:
    # Only the extras that do not exist are named.
    with pytest.raises(LockError, match=r"video; found 'videos'$"):
        chosen_locks(Path("some.lock"), "mcap videos")
    assert all((ROOT / f"action/locks/requirements-{extra}.lock").is_file() for extra in EXTRAS)


def test_engines_are_those_of_the_package() -> None:
    assert {name: engine.distribution for name, engine in engines.ENGINES.items()} == ENGINES
    [linux, *others] = [
        [
            entry
            for entry in entries((ROOT / "action/locks/requirements.lock").read_text(encoding="utf-8"))
            if entry.holds(system)
        ]
        for system in SYSTEMS
    ]
    assert engines_of(linux) == ("pybullet", "mujoco")
    assert all("mujoco" in engines_of(packages) for packages in others)
    assert engines_of(without_engines(linux, ["mujoco"])) == ("pybullet",)
    assert engines_of(without_engines(linux, ["pybullet"])) == ("mujoco",)
    assert digest(linux) != digest(without_engines(linux, ["mujoco"]))


def test_wheels_are_found_by_normalized_names(tmp_path: Path) -> None:
    for name in ("Ruamel.Yaml-1.0-py3-none-any.whl", "a_b-2-py3-none-any.whl", "a_b-2-cp311.whl", "x.txt", "odd.whl"):
        (tmp_path / name).touch()
    found = wheels_of(tmp_path)
    counts = {pair: len(paths) for pair, paths in found.items()}
    assert counts == {("ruamel-yaml", "1.0"): 1, ("a-b", "2"): 2, ("odd-whl", ""): 1}
    assert wheels_of(tmp_path / "missing") == {}
