"""Actions, workflows, templates: pinned, with few rights, no expression in a shell."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from action.run import SUBCOMMANDS
from tools.release.__main__ import moving_tag, read_version

ROOT = Path(__file__).parent.parent
LOCKS = ROOT / "action/locks"
VENV = sys.prefix
ACTIONS = [ROOT / "action.yml", *sorted(ROOT.glob("*/action.yml"))]
TEMPLATES = sorted((ROOT / "examples/workflows").glob("*.yml"))
WORKFLOWS = sorted((ROOT / ".github/workflows").glob("*.yml")) + TEMPLATES
WORKFLOWS += sorted((ROOT / "examples/demo/.github/workflows").glob("*.yml"))
LEAST = ROOT / "examples/workflows/simulation.yml"  # to be read at a glance

PUBLISHING = {
    # To push tags and make a release, to attest and publish, and to read what came of CI.
    "release.yml": {("contents", "write"), ("id-token", "write"), ("attestations", "write"), ("actions", "read")}
    | {("packages", "write")},  # to push the image
    "docs.yml": {("pages", "write"), ("id-token", "write")},  # to publish on GitHub Pages
}

# They start no container.
MOVES_IMAGES = tuple(f"docker {verb} " for verb in ("load", "login", "push", "tag", "image inspect"))

OWN = re.compile(rf"(?:\./|sim-action/sim-action/?)(?P<folder>[\w-]*)(?:@{moving_tag(read_version())})?")
USES = re.compile(r"^\s*(?:- )?uses: (?P<action>\S+)(?P<comment>.*)$", re.MULTILINE)
REUSABLE = "./.github/workflows/"
PINNED = re.compile(r"[\w.-]+/[\w./-]+@[0-9a-f]{40}")
VERSION_COMMENT = re.compile(r" # v\d+\.\d+\.\d+")
OUTPUT = re.compile(r"steps\.([\w-]+)\.outputs\.([\w-]+)")


def name(file: Path) -> str:
    return str(file.relative_to(ROOT))


every_file = pytest.mark.parametrize("file", ACTIONS + WORKFLOWS, ids=name)
every_action = pytest.mark.parametrize("file", ACTIONS, ids=name)
every_workflow = pytest.mark.parametrize("file", WORKFLOWS, ids=name)
every_template = pytest.mark.parametrize("file", TEMPLATES, ids=name)


def load(file: Path) -> Any:
    return yaml.safe_load(file.read_text(encoding="utf-8"))


def step_lists(file: Path) -> Iterator[list[dict[str, Any]]]:
    """The steps of the action, or those of each job."""
    document = load(file)
    if "runs" in document:
        yield document["runs"]["steps"]
    for job in document.get("jobs", {}).values():
        yield job.get("steps", [])


def steps(file: Path) -> list[dict[str, Any]]:
    return [step for listed in step_lists(file) for step in listed]


def own_action(step: dict[str, Any]) -> Any:
    """What action.yml says, if the step uses an action of this repository's."""
    found = OWN.fullmatch(step.get("uses", ""))
    return load(ROOT / found["folder"] / "action.yml") if found else None


@every_file
def test_parses_and_every_step_does_something(file: Path) -> None:
    assert steps(file) or file.name == "reusable-caller.yml"
    assert all(("run" in step) != ("uses" in step) for step in steps(file))


@every_file
def test_third_parties_are_pinned_by_sha_with_their_version_beside_it(file: Path) -> None:
    uses = [use for use in USES.finditer(file.read_text(encoding="utf-8")) if not use["action"].startswith(REUSABLE)]
    assert len(uses) == sum("uses" in step for step in steps(file))
    for use in uses:
        if not OWN.fullmatch(use["action"]):
            assert PINNED.fullmatch(use["action"]), use["action"]
            assert VERSION_COMMENT.fullmatch(use["comment"]), use["action"]


@every_file
def test_no_expression_is_pasted_into_a_shell(file: Path) -> None:
    for step in steps(file):
        assert "${{" not in str(step.get("run", ""))


@every_action
def test_every_step_of_an_action_names_its_shell(file: Path) -> None:
    assert all(step["shell"] == "bash" for step in steps(file) if "run" in step)


@every_workflow
def test_workflows_may_only_read_and_single_jobs_may_report(file: Path) -> None:
    document = load(file)
    assert document["permissions"] in ({"contents": "read"}, {})
    for job in document["jobs"].values():
        rights = job.get("permissions", {}).items()
        publishing = PUBLISHING.get(file.name, set())
        assert set(rights) <= {("contents", "read"), ("checks", "write"), ("pull-requests", "write")} | publishing


@every_workflow
def test_where_a_job_may_write_no_code_of_the_repository_runs(file: Path) -> None:
    for job in load(file)["jobs"].values():
        if "write" in job.get("permissions", {}).values():
            assert not any(own_action(step) for step in job["steps"])
            commands = [line for step in job["steps"] for line in step.get("run", "").splitlines()]
            assert all(command.startswith(("git ", "gh ", *MOVES_IMAGES)) for command in commands)


@every_workflow
def test_jobs_end_by_themselves_and_leave_no_token_on_disk(file: Path) -> None:
    if file != LEAST:
        assert all("timeout-minutes" in job for job in load(file)["jobs"].values() if "steps" in job)
        checkouts = [step for step in steps(file) if step.get("uses", "").startswith("actions/checkout@")]
        assert all(step["with"]["persist-credentials"] is False for step in checkouts)


@every_workflow
def test_our_actions_get_inputs_that_they_have(file: Path) -> None:
    for step in steps(file):
        if action := own_action(step):
            inputs = {key: value for key, value in action["inputs"].items() if "deprecationMessage" not in value}
            required = {key for key, value in inputs.items() if value.get("required")}
            assert required <= set(step.get("with", {})) <= set(inputs)


@every_workflow
def test_our_actions_are_asked_for_outputs_that_they_have(file: Path) -> None:
    for job in load(file)["jobs"].values():
        actions = {step["id"]: own_action(step) for step in job.get("steps", []) if "id" in step}
        for step, output in OUTPUT.findall(json.dumps(job)):
            assert not actions[step] or output in actions[step]["outputs"]


@every_template
def test_a_template_says_first_where_it_goes(file: Path) -> None:
    assert re.match(r"# Copy to \.github/workflows/[\w-]+\.yml[:,] ", file.read_text(encoding="utf-8"))


def test_the_least_workflow_is_short_and_keeps_the_report() -> None:
    assert len(LEAST.read_text(encoding="utf-8").splitlines()) == 15
    assert steps(LEAST)[-1]["with"]["path"] == "${{ steps.simulation.outputs.output-directory }}"


def test_the_gate_waits_for_every_other_job_and_runs_also_when_one_was_skipped() -> None:
    jobs = load(ROOT / ".github/workflows/ci.yml")["jobs"]
    assert set(jobs["gate"]["needs"]) == jobs.keys() - {"gate"}
    assert jobs["gate"]["if"] == "${{ always() }}"


@pytest.mark.process
@pytest.mark.parametrize("results", ["success skipped", "failure success", "success cancelled"])
def test_the_gate_lets_nothing_but_success_pass(results: str) -> None:
    (step,) = load(ROOT / ".github/workflows/ci.yml")["jobs"]["gate"]["steps"]
    for given, passes in ((results, False), ("success success", True)):
        ran = subprocess.run(
            ["bash", "-e", "-c", step["run"]], env={"RESULTS": given}, capture_output=True, check=False
        )
        assert (ran.returncode == 0) is passes


def test_the_pre_commit_example_names_our_hook_which_sees_scenarios_alone() -> None:
    (hook,) = load(ROOT / ".pre-commit-hooks.yaml")
    (used,) = load(ROOT / "examples/pre-commit/.pre-commit-config.yaml")["repos"]
    assert used["hooks"] == [{"id": hook["id"]}]
    found = [path for path in ("a.sim.yml", "b/c.sim.yaml", "ci.yml", "sim.yml") if re.search(hook["files"], path)]
    assert found == ["a.sim.yml", "b/c.sim.yaml"]


EXTRAS = ("rosbags", "mcap", "video", "policy")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def pins(lock: str) -> set[str]:
    return set(re.findall(r"^([\w-]+==[\w.]+)", (LOCKS / lock).read_text(encoding="utf-8"), re.MULTILINE))


def packages(requirements: list[str]) -> set[str]:
    return {re.split(r"[^\w-]", requirement)[0] for requirement in requirements}


@pytest.mark.parametrize("name", ["requirements.lock", *(f"requirements-{extra}.lock" for extra in EXTRAS)])
def test_lock_file_has_every_dependency_and_leaves_the_index_to_the_user(name: str) -> None:
    lock = (LOCKS / name).read_text(encoding="utf-8")
    assert packages(PROJECT["dependencies"]) <= set(re.findall(r"^([\w-]+)==", lock, re.MULTILINE))
    assert not re.search(r"://|index|find-links| @ |[\w.-]/", lock)


@pytest.mark.parametrize("extra", EXTRAS)
def test_the_lock_file_of_an_extra_has_the_same_versions_and_what_it_needs_beside_them(extra: str) -> None:
    plain, more = pins("requirements.lock"), pins(f"requirements-{extra}.lock")
    assert plain < more
    needed = packages(PROJECT["optional-dependencies"][extra])
    assert needed <= {line.partition("==")[0] for line in more - plain}


@pytest.mark.parametrize(
    ("name", "absent"),
    [
        ("requirements-core.lock", {"numpy", "pybullet", "mujoco-core"}),
        ("requirements-reports.lock", {"pybullet", "mujoco-core"}),
    ],
)
def test_actions_that_simulate_nothing_install_the_same_without_engines(name: str, absent: set[str]) -> None:
    whole, part = pins("requirements.lock"), pins(name)
    assert whole - part == {line for line in whole if line.partition("==")[0] in absent}
    assert part < whole


def test_the_lock_file_of_the_checks_has_hashes_and_no_addresses() -> None:
    locked = json.loads((ROOT / "tools/workflows/package-lock.json").read_text(encoding="utf-8"))["packages"]
    assert all("integrity" in package and "resolved" not in package for path, package in locked.items() if path)


def check_workflows(*files: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["node", "tools/workflows/check.mjs", *files],
        cwd=ROOT,
        env={**os.environ, "PATH": f"{VENV}/bin:{os.environ['PATH']}"},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.process
def test_findings_of_actionlint_are_shown_where_github_complains_first(tmp_path: Path) -> None:
    no_yaml, workflow = tmp_path / "no_yaml.yml", tmp_path / "workflow.yml"
    no_yaml.write_text("name: one\non: push\njobs: a: b\n", encoding="utf-8")
    workflow.write_text(
        "on: push\njobs:\n  a:\n    runs-on: ubuntu-lastest\n    steps:\n      - run: echo\n        shel: bash\n",
        encoding="utf-8",
    )
    checked = check_workflows(no_yaml, workflow)
    assert checked.returncode == 1
    assert checked.stdout.startswith(f"{no_yaml}:3:7: ")
    assert f"{no_yaml}:1:1: actionlint cannot read this file: " in checked.stdout
    assert f"{workflow}:7:9: Unexpected value 'shel'" in checked.stdout
    assert f'{workflow}:4:14: label "ubuntu-lastest" is unknown' in checked.stdout
    assert f'{workflow}:7:9: unexpected key "shel" for "step" section' in checked.stdout


def test_dependabot_proposes_all_actions_and_packages_and_waits_a_week() -> None:
    updates = load(ROOT / ".github/dependabot.yml")["updates"]
    assert all(update["cooldown"] == {"default-days": 7} for update in updates)
    watched = {
        (update["package-ecosystem"], folder)
        for update in updates
        for folder in update.get("directories", [update.get("directory")])
    }
    actions = {f"/{file.parent.relative_to(ROOT).as_posix()}".removesuffix("/.") or "/" for file in ACTIONS}
    assert {folder for ecosystem, folder in watched if ecosystem == "github-actions"} == {
        *("/", "/examples/workflows", "/examples/demo/.github/workflows"),
        *(folder for folder in actions if folder != "/"),
    }
    npm = {f"/{file.parent.relative_to(ROOT).as_posix()}" for file in ROOT.glob("tools/*/package.json")}
    assert {folder for ecosystem, folder in watched if ecosystem == "npm"} == npm
    assert {folder for ecosystem, folder in watched if ecosystem == "pip"} == {"/", "/tools/release"}


def test_the_marketplace_takes_the_root_action() -> None:
    action = load(ROOT / "action.yml")
    assert len(action["description"]) <= 125
    assert action["branding"] == {"icon": "play-circle", "color": "blue"}
    names = [load(file)["name"] for file in ACTIONS]
    assert len(set(names)) == len(names)


@every_action
def test_an_input_of_an_earlier_version_is_declared_so_that_its_value_is_seen_and_refused(file: Path) -> None:
    removed = {name: entry for name, entry in load(file)["inputs"].items() if "deprecationMessage" in entry}
    subcommand = SUBCOMMANDS["run" if file.parent == ROOT else file.parent.name]
    assert removed.keys() == subcommand.moved.keys()
    for name, entry in removed.items():
        assert entry["default"] == ""
        replacement = entry["deprecationMessage"].removeprefix("use ")
        assert replacement in subcommand.moved[name]
        assert own_action({"uses": replacement})


@every_action
def test_an_input_without_a_default_is_empty_and_each_other_one_refused_if_empty(file: Path) -> None:
    subcommand = SUBCOMMANDS["run" if file.parent == ROOT else file.parent.name]
    inputs = load(file)["inputs"].items()
    filled = {name for name, entry in inputs if entry.get("required") or entry["default"]}
    decided_before = {"cache", "ros1", "ros2", "working-directory", "fail-on-failure"}
    assert filled - decided_before == set(subcommand.required)


@every_action
def test_every_input_reaches_the_command_and_every_output_comes_back(file: Path) -> None:
    action = load(file)
    last = action["runs"]["steps"][-1]
    passed = {name: value for name, value in last["env"].items() if name.startswith("INPUT_")}
    # What is installed, and whether wheels are kept, is decided before.
    inputs = action["inputs"].keys() - {"cache", "extras", "ros1", "ros2"}
    assert passed == {f"INPUT_{name.upper().replace('-', '_')}": f"${{{{ inputs.{name} }}}}" for name in inputs}
    outputs = {name: output["value"] for name, output in action["outputs"].items()}
    assert outputs == {name: f"${{{{ steps.{last['id']}.outputs.{name} }}}}" for name in outputs}
