"""What stands in for the halves of actions/cache."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from tests.integration.github import CacheStore, UnsupportedFeature
from tests.integration.github.conftest import Act, Perform, printed, run, run_job, uses

CACHE = "actions/cache@27d5ce7f107fe9357f9df03efb73ab90386fccae"
RESTORE, SAVE = (CACHE.replace("@", f"/{half}@") for half in ("restore", "save"))
FILE = {"path": "file", "key": "k"}


def save(inputs: Mapping[str, str] = FILE) -> str:
    return uses(SAVE, inputs, "save")


def restore(**more: str) -> str:
    return uses(RESTORE, {**FILE, **{name.replace("_", "-"): value for name, value in more.items()}})


def test_a_cache_is_found_again_in_the_next_job(perform: Perform) -> None:
    wheels = {"path": "${{ runner.temp }}/wheels", "key": "k"}
    make = run("mkdir -p $RUNNER_TEMP/wheels/deep; echo x > $RUNNER_TEMP/wheels/deep/file")
    assert "not found" in printed(run_job(perform, uses(RESTORE, wheels), make, save(wheels)))
    second = run_job(perform, uses(RESTORE, wheels), run("cat $RUNNER_TEMP/wheels/deep/file"))
    assert (second.result, printed(second)) == ("success", "Cache restored from key: k\nx\n")


def test_an_existing_cache_is_left_alone(perform: Perform) -> None:
    assert run_job(perform, run("echo old > file"), save()).annotations == ()
    again = run_job(perform, run("echo new > file"), save())
    assert (again.result, [annotation.level for annotation in again.annotations]) == ("success", ["warning"])
    assert printed(run_job(perform, restore(), run("cat file"))).endswith("old\n")


def test_a_cache_of_another_path_is_not_found(perform: Perform) -> None:
    run_job(perform, run("touch file"), save())
    assert "restored" in printed(run_job(perform, restore()))
    assert "not found" in printed(run_job(perform, restore(path="other")))


@pytest.mark.parametrize(("key", "found"), [("times-9", "times-2"), ("other", "other-3")])
def test_the_newest_cache_with_a_prefix_is_found(perform: Perform, key: str, found: str) -> None:
    for kept in ("times-1", "times-2", "other-3"):
        run_job(perform, run(f"echo {kept} > file"), save({**FILE, "key": kept}))
    result = run_job(perform, restore(key=key, restore_keys="times-"), run("cat file"))
    assert printed(result).endswith(f"{found}\n")


def test_what_was_found_is_told(perform: Perform) -> None:
    tell = run("echo found ${{ steps.it.outputs.cache-matched-key }}.")
    assert printed(run_job(perform, restore(), tell)).endswith("found .\n")
    run_job(perform, run("touch file"), save({**FILE, "key": "k-1"}))
    assert printed(run_job(perform, restore(), tell)).endswith("found k-1.\n")


@pytest.mark.parametrize(
    "step",
    [
        restore(key="a,b"),
        restore(key="k" * 513),
        restore(restore_keys="a-\nb-"),
        restore(path="*"),
        restore(lookup_only="true"),
        save({**FILE, "key": "a,b"}),
        save({**FILE, "path": "file\nother"}),
        restore() + run("echo ${{ steps.it.outputs.cache-hit }}"),
        uses("actions/cache@27d5ce7f107fe9357f9df03efb73ab90386fccae", FILE),
    ],
)
def test_what_is_not_known_is_refused(perform: Perform, step: str) -> None:
    with pytest.raises(UnsupportedFeature):
        run_job(perform, step)


def test_nothing_to_save_is_no_failure(perform: Perform, caches: CacheStore) -> None:
    saved = run_job(perform, save())
    assert (saved.result, saved.annotations[0].level, caches.keys()) == ("success", "warning", [])


def test_links_in_a_cache_stay_links(perform: Perform) -> None:
    run_job(perform, run("mkdir file; touch file/b; ln -s b file/c"), save())
    assert run_job(perform, restore(), run("test -L file/c")).result == "success"


ACTION = f"""
name: a
runs:
  using: composite
  steps:
    - {{uses: {RESTORE}, with: {{path: "${{{{ runner.temp }}}}/made", key: k}}}}
    - {{shell: bash, run: 'ls "$RUNNER_TEMP/made" || touch "$RUNNER_TEMP/made"'}}
    - {{uses: {SAVE}, with: {{path: "${{{{ runner.temp }}}}/made", key: k}}}}
"""


def test_actions_use_the_cache_that_the_runner_has(act: Act, caches: CacheStore, tmp_path: Path) -> None:
    assert "Cache saved" in act(ACTION, cache=caches).log
    (tmp_path / "runner temp/made").unlink()
    assert "Cache restored" in act(ACTION, cache=caches).log
    assert (tmp_path / "runner temp/made").exists()


def test_without_a_cache_nothing_is_found_and_nothing_saved(act: Act) -> None:
    result = act(ACTION)
    assert (result.exit_code, result.annotations) == (0, ())
    assert result.log.count("Cache service is not available") == 2
