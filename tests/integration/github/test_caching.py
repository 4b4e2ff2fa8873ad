"""What stands in for actions/cache and its halves."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from tests.integration.github import CacheStore
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
    look = run("echo '<${{ steps.it.outputs.cache-hit }}> <${{ steps.it.outputs.cache-primary-key }}>'")
    make = run("mkdir -p $RUNNER_TEMP/wheels/deep; echo x > $RUNNER_TEMP/wheels/deep/file")
    assert "<> <k>" in printed(run_job(perform, uses(RESTORE, wheels), look, make, save(wheels)))
    second = run_job(perform, uses(RESTORE, wheels), look, run("cat $RUNNER_TEMP/wheels/deep/file"))
    assert "<true> <k>" in printed(second)
    assert second.result == "success"


def test_an_existing_cache_is_left_alone(perform: Perform) -> None:
    assert run_job(perform, run("echo old > file"), save()).annotations == ()
    again = run_job(perform, run("echo new > file"), save())
    assert (again.result, [annotation.level for annotation in again.annotations]) == ("success", ["warning"])
    assert printed(run_job(perform, restore(), run("cat file"))).endswith("old\n")


def test_a_cache_of_other_paths_is_not_found(perform: Perform) -> None:
    run_job(perform, run("touch file other"), save())
    assert run_job(perform, restore(fail_on_cache_miss="true")).result == "success"
    assert run_job(perform, restore(path="other", fail_on_cache_miss="true")).result == "failure"


def test_the_newest_cache_with_a_prefix_is_found(perform: Perform) -> None:
    for key in ("times-1", "times-2", "other-3"):
        run_job(perform, run(f"echo {key} > file"), save({**FILE, "key": key}))
    step = restore(key="times-9", restore_keys="none-\n\n  times-\nother-")
    result = run_job(perform, step, run("cat file; echo ${{ steps.it.outputs.cache-hit }}"))
    assert printed(result).endswith("times-2\nfalse\n")


def test_looking_up_restores_nothing(perform: Perform) -> None:
    run_job(perform, run("touch file"), save())
    result = run_job(
        perform, restore(lookup_only="true"), run("test ! -e file; echo ${{ steps.it.outputs.cache-hit }}")
    )
    assert printed(result).endswith("true\n")


@pytest.mark.parametrize("key", ["a,b", "k" * 513])
def test_keys_that_are_not_valid_fail_what_restores_and_not_what_saves(perform: Perform, key: str) -> None:
    assert run_job(perform, restore(key=key)).result == "failure"
    saved = run_job(perform, run("touch file"), save({**FILE, "key": key}))
    assert saved.result == "success"
    assert [annotation.message for annotation in saved.annotations] == ["Cache save failed."]


def test_nothing_to_save_is_no_failure(perform: Perform, caches: CacheStore) -> None:
    saved = run_job(perform, save())
    assert (saved.result, saved.annotations[0].level, caches.keys()) == ("success", "warning", [])


def test_links_in_a_cache_stay_links(perform: Perform) -> None:
    run_job(perform, run("mkdir file; touch file/b; ln -s b file/c"), save())
    assert run_job(perform, restore(), run("test -L file/c")).result == "success"


@pytest.mark.parametrize(("script", "keys"), [("touch file", ["k"]), ("touch file; exit 1", [])])
def test_cache_saves_at_the_end_of_a_job_that_succeeds(
    perform: Perform, caches: CacheStore, script: str, keys: list[str]
) -> None:
    run_job(perform, uses(CACHE, FILE), run(script))
    assert caches.keys() == keys


def test_cache_saves_nothing_that_it_has_found(perform: Perform) -> None:
    run_job(perform, run("touch file"), save())
    result = run_job(perform, uses(CACHE, FILE))
    assert result.annotations == ()
    assert "Cache restored" in printed(result)


ACTION = f"""
name: a
outputs: {{hit: {{value: "${{{{ steps.it.outputs.cache-hit }}}}"}}}}
runs:
  using: composite
  steps:
    - {{name: restore, id: it, uses: {RESTORE}, with: {{path: "${{{{ runner.temp }}}}/made", key: k}}}}
    - name: make
      if: ${{{{ steps.it.outputs.cache-hit != 'true' }}}}
      shell: bash
      run: touch "$RUNNER_TEMP/made"
    - name: save
      if: ${{{{ steps.it.outputs.cache-hit != 'true' }}}}
      uses: {SAVE}
      with: {{path: "${{{{ runner.temp }}}}/made", key: k}}
"""


def test_actions_use_the_caches_that_the_runner_has(act: Act, caches: CacheStore) -> None:
    first, second = act(ACTION, cache=caches), act(ACTION, cache=caches)
    assert (first.steps, first.outputs) == (("restore", "make", "save"), {"hit": ""})
    assert (second.steps, second.outputs) == (("restore",), {"hit": "true"})


@pytest.mark.parametrize(("script", "keys"), [("touch file", ["k"]), ("touch file; exit 1", [])])
def test_actions_save_at_their_end_if_they_succeed(act: Act, caches: CacheStore, script: str, keys: list[str]) -> None:
    steps = f"[{{uses: {CACHE}, with: {{path: file, key: k}}}}, {{shell: bash, run: {script}}}]"
    act(f"name: a\nruns: {{using: composite, steps: {steps}}}", cache=caches)
    assert caches.keys() == keys


def test_without_a_cache_nothing_is_found_and_nothing_saved(act: Act) -> None:
    for _ in range(2):
        result = act(ACTION)
        assert (result.exit_code, result.outputs, result.annotations) == (0, {"hit": "false"}, ())
