"""The steps of release.yml do what they should, once and when they are repeated; no other machine is reached."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.integration.release_steps import DATE, ROOT, Machine, git, jobs

VIEWER = "sim_action/reports/viewer/viewer3d.json"
PACKAGE = "sim_action/core/version.py"


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    """A machine, and the repository on its server: a commit on main with what the steps read."""
    machine = Machine(tmp_path)
    source = tmp_path / "source"
    for name, text in {
        PACKAGE: '__version__ = "0.9.0"\n',
        "CHANGELOG.md": "# Changelog\n\n## Unreleased\n\n## 0.9.0 (2026-11-30)\n\nThe first one.\n",
        ".gitignore": (ROOT / ".gitignore").read_text(encoding="utf-8"),
        "sim_action/reports/viewer/page.js": "",
    }.items():
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        (source / name).write_text(text, encoding="utf-8")
    (source / "tools/release").mkdir(parents=True)
    shutil.copy(ROOT / "tools/release/__main__.py", source / "tools/release")
    git(tmp_path, "init", "--quiet", "--initial-branch=main", "source")
    git(source, "add", ".")
    git(source, "commit", "--quiet", "--message", "The tree of main")
    machine.server.mkdir()
    git(machine.server, "clone", "--quiet", "--bare", str(source), "octocat/robots")
    return machine


def checkout(machine: Machine, name: str, ref: str = "main") -> Path:
    """A checkout as the action of that name makes it: one commit, and no credentials."""
    address = f"file://{machine.server}/octocat/robots"
    git(machine.folder, "clone", "--quiet", "--depth=1", f"--branch={ref}", address, name)
    return machine.folder / name


def tags(machine: Machine) -> dict[str, str]:
    lines = git(
        machine.server / "octocat/robots", "for-each-ref", "refs/tags", "--format=%(refname:short) %(objectname)"
    )
    return dict(line.split() for line in lines.splitlines())


def tag(machine: Machine, name: str, viewer: str = "{}") -> int:
    """Runs the job `tag` in a fresh checkout, and returns the exit code of its push."""
    folder = checkout(machine, name)
    (folder / VIEWER).write_text(viewer, encoding="utf-8")
    committed = machine.run("tag", "Commit and tag", folder)
    assert committed.returncode == 0, committed.stderr
    return machine.run("tag", "Push the tag", folder).returncode


def test_the_version_is_checked_before_anything_else(machine: Machine) -> None:
    folder = checkout(machine, "work")
    ran = machine.run("check", "Check that everything agrees", folder)
    assert (ran.returncode, ran.stdout) == (0, "release: everything agrees on version 0.9.0\n")
    other = Machine(machine.folder, version="0.9.1; true")
    ran = other.run("check", "Check that everything agrees", folder)
    assert (ran.returncode, ran.stdout) == (1, f'{PACKAGE}:1: __version__ is "0.9.0", but the tag is v0.9.1; true\n')


@pytest.mark.parametrize(
    ("program", "code", "message"),
    [
        ("echo success", 0, ""),
        ("echo failure", 1, "::error::CI has not passed for c0ffee (failure): "),
        ("echo", 1, "::error::CI has not passed for c0ffee (no result yet): "),
        ("exit 4", 4, ""),
    ],
    ids=["passed", "failed", "no result", "no answer"],
)
def test_a_commit_without_a_pass_of_ci_is_refused(tmp_path: Path, program: str, code: int, message: str) -> None:
    machine = Machine(tmp_path, programs={"gh": program})
    ran = machine.run("check", "Check that CI", tmp_path)
    assert ran.returncode == code
    assert ran.stdout.startswith(message)
    (call,) = machine.called("gh")
    assert call.startswith("run list --repo octocat/robots --workflow ci.yml --event push --commit c0ffee --limit 1 ")


def test_the_tag_is_main_with_the_viewer_and_the_same_commit_when_repeated(machine: Machine) -> None:
    folder = checkout(machine, "work")
    assert machine.run("check", "Read the date", folder).returncode == 0
    assert (machine.temp / "GITHUB_OUTPUT").read_text(encoding="utf-8") == f"date={DATE}\n"
    assert tag(machine, "first") == 0
    assert tags(machine).keys() == {"v0.9.0"}
    first = tags(machine)
    server = machine.server / "octocat/robots"
    assert git(server, "rev-parse", "v0.9.0^") == git(server, "rev-parse", "main")
    assert git(server, "diff", "--name-status", "main", "v0.9.0") == f"A\t{VIEWER}"
    assert tag(machine, "again") == 0
    assert tags(machine) == first
    assert tag(machine, "other", viewer="[]") != 0
    assert tags(machine) == first


def test_the_tag_of_the_major_version_moves_to_the_new_release(machine: Machine) -> None:
    assert tag(machine, "first") == 0
    work = checkout(machine, "work", "v0.9.0")
    for _ in range(2):
        assert machine.run("move", "Push the tag", work).returncode == 0
        assert tags(machine)["v0"] == tags(machine)["v0.9.0"]
    later = Machine(machine.folder, version="0.10.0")
    (later.folder / "source/new").write_text("")
    source = later.folder / "source"
    git(source, "add", ".")
    git(source, "commit", "--quiet", "--message", "More")
    git(source, "push", "--quiet", str(later.server / "octocat/robots"), "main")
    assert tag(later, "second") == 0
    assert later.run("move", "Push the tag", checkout(later, "moved", "v0.10.0")).returncode == 0
    assert tags(later)["v0"] == tags(later)["v0.10.0"] != tags(later)["v0.9.0"]
    assert Machine(machine.folder, version="1.2.3").run("move", "Push the tag", work).returncode == 0
    assert tags(machine).keys() == {"v0", "v0.9.0", "v0.10.0", "v1"}


# As `gh` does: a release is there as soon as it has been made, also as a draft.
RELEASES = """
case "$1 $2" in
  "release view") test -e released ;;
  "release create") touch released ;;
esac
"""


def test_a_release_is_made_once_and_completed_when_repeated(tmp_path: Path) -> None:
    for name in ("dist/a.whl", "plugin/b.whl", "release/notes.md", "release/sim-action-0.9.0.cdx.json"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(name)
    machine = Machine(tmp_path, programs={"gh": RELEASES})
    assert machine.run("github", "Make the release", tmp_path).returncode == 0
    create = "release create v0.9.0 --draft --verify-tag --title v0.9.0 --notes-file release/notes.md"
    upload = "release upload v0.9.0 dist/a.whl plugin/b.whl release/sim-action-0.9.0.cdx.json --clobber"
    publish = "release edit v0.9.0 --draft=false --latest --notes-file release/notes.md"
    assert machine.called("gh") == ["release view v0.9.0", create, upload, publish]
    assert machine.run("github", "Make the release", tmp_path).returncode == 0
    assert machine.called("gh")[4:] == ["release view v0.9.0", upload, publish]


def test_a_release_stays_a_draft_if_a_file_is_missing_from_it(tmp_path: Path) -> None:
    machine = Machine(tmp_path, programs={"gh": RELEASES + 'test "$2" != upload'})
    assert machine.run("github", "Make the release", tmp_path).returncode != 0
    assert not any("--draft=false" in call for call in machine.called("gh"))


# As it does; test_examples.py runs the tutorial with the real one.
SIM_ACTION = """
file=hello/simulation/drive_straight.sim.yml
case "$1" in
  --version) echo "sim-action, version 0.9.0" ;;
  init) mkdir -p hello/simulation; echo "pose: {x: 3.0}" > $file ;;
  run) grep -q "x: 3.0" $file ;;
esac
"""


def test_the_published_package_is_awaited_and_runs_the_tutorial(tmp_path: Path) -> None:
    (tmp_path / "work").mkdir()
    programs = {
        # The index lags: the third attempt finds the version.
        "python": f'test "$(wc -l < "{tmp_path}/python.log")" -ge 3',
        "sleep": "",
        "sim-action": SIM_ACTION,
        "pytest": "",
    }
    machine = Machine(tmp_path, programs=programs)
    installed = machine.run("install", "Install", tmp_path / "work")
    assert installed.returncode == 0, installed.stderr
    packages = "sim-action==0.9.0 pytest-sim-action==0.9.0"
    assert machine.called("python") == [f"-m pip install --quiet --no-cache-dir {packages}"] * 3
    assert machine.called("sleep") == ["30"] * 2
    ran = machine.run("install", "Run the first steps", tmp_path / "work")
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert machine.called("sim-action") == ["--version", "init hello", "run hello", "run hello"]
    assert machine.called("pytest") == ["hello"]


@pytest.mark.parametrize(
    "printed", ["sim-action, version 0.8.0", "sim-action, version 0.9.0.dev1", ""], ids=["older", "other", "none"]
)
def test_another_version_on_the_index_fails(tmp_path: Path, printed: str) -> None:
    programs = {"python": "exit 1", "sleep": "", "sim-action": f"echo '{printed}'"}
    assert Machine(tmp_path, programs=programs).run("install", "Install", tmp_path).returncode == 1


def test_the_tutorial_fails_if_the_wall_is_not_noticed(tmp_path: Path) -> None:
    (tmp_path / "hello/simulation").mkdir(parents=True)
    (tmp_path / "hello/simulation/drive_straight.sim.yml").write_text("")
    machine = Machine(tmp_path, programs={"sim-action": "", "pytest": ""})
    assert machine.run("install", "Run the first steps", tmp_path).returncode == 1


def test_the_action_at_the_moved_tag_is_the_released_one(tmp_path: Path) -> None:
    (tmp_path / "sim-results").mkdir()
    for version, passes in (("0.9.0", True), ("0.9.01", False), ("0x9y0", False)):
        (tmp_path / "sim-results/results.json").write_text(f'{{\n  "version": 4,\n  "sim_action": "{version}",\n')
        ran = Machine(tmp_path).run("action", "Check the verdict", tmp_path)
        assert (ran.returncode == 0) is passes
    (tmp_path / "sim-results/results.json").write_text('  "sim_action": "0.9.0",\n')
    ran = Machine(tmp_path).run("action", "Check the verdict", tmp_path, CONCLUSION="failure")
    assert ran.returncode == 1


def test_the_tag_of_the_major_version_moves_after_everything_else() -> None:
    listed = jobs()
    awaited: set[str] = set()
    waiting = ["move"]
    while waiting:
        needs = listed[waiting.pop()].get("needs", [])
        fresh = {needs} if isinstance(needs, str) else set(needs)
        awaited |= fresh
        waiting += fresh
    assert awaited == listed.keys() - {"move", "action"}
    assert listed["action"]["needs"] == "move"


def test_only_the_jobs_that_need_a_right_have_it() -> None:
    writers = {
        name: sorted(right for right, level in job["permissions"].items() if level == "write")
        for name, job in jobs().items()
    }
    assert {name: rights for name, rights in writers.items() if rights} == {
        "tag": ["contents"],
        "attest": ["attestations", "id-token"],
        "pypi": ["id-token"],
        "pypi-plugin": ["id-token"],
        "registry": ["attestations", "id-token", "packages"],
        "github": ["contents"],
        "move": ["contents"],
    }
    assert [name for name, job in jobs().items() if "environment" in job] == ["pypi", "pypi-plugin"]


IMAGE = "ghcr.io/octocat/robots"
DIGEST = f"sha256:{64 * 'a'}"


def docker(inspected: str) -> dict[str, str]:
    return {
        "docker": f'case "$1 $2" in "image inspect") echo "{inspected}" ;; login*) read -r && echo "$REPLY" ;; esac'
    }


def test_the_image_is_built_on_the_digest_of_its_base(tmp_path: Path) -> None:
    machine = Machine(tmp_path, programs=docker(f"python@{DIGEST}"))
    ran = machine.run("image", "Build on the digest", ROOT, IMAGE=f"{IMAGE}:0.9.0")
    assert ran.returncode == 0, ran.stderr
    pull, inspect, build = machine.called("docker")
    assert pull == "pull --quiet python:3.11-slim"
    assert inspect.endswith(" python:3.11-slim")
    assert build.startswith(f"build --quiet --tag {IMAGE}:0.9.0 --build-arg BASE=python@{DIGEST} --label ")
    assert f"org.opencontainers.image.base.digest={DIGEST} " in build
    summary = (machine.temp / "GITHUB_STEP_SUMMARY").read_text(encoding="utf-8")
    assert summary == f"base of the image: python@{DIGEST}\n"


@pytest.mark.parametrize("inspected", ["", "python:3.11-slim", f"python@{DIGEST[:-1]}", f"python@{DIGEST} --push"])
def test_no_image_is_built_on_a_base_without_a_digest(tmp_path: Path, inspected: str) -> None:
    machine = Machine(tmp_path, programs=docker(inspected))
    assert machine.run("image", "Build on the digest", ROOT, IMAGE=f"{IMAGE}:0.9.0").returncode != 0
    assert [call.split()[0] for call in machine.called("docker")] == ["pull", "image"]


def test_the_image_runs_the_demo_before_it_is_saved(tmp_path: Path) -> None:
    machine = Machine(tmp_path, programs=docker(""))
    names = [step.get("name", "") for step in jobs()["image"]["steps"]]
    assert names.index("Save it") > next(at for at, name in enumerate(names) if name.startswith("Run the demo"))
    assert machine.run("image", "Run the demo", tmp_path, IMAGE=f"{IMAGE}:0.9.0").returncode == 0
    (call,) = machine.called("docker")
    assert call.endswith(f" --volume {tmp_path}/examples/demo:/work {IMAGE}:0.9.0 run .")
    failing = Machine(tmp_path, programs={"docker": "exit 1"})
    assert failing.run("image", "Run the demo", tmp_path, IMAGE=f"{IMAGE}:0.9.0").returncode == 1


def test_the_image_is_pushed_with_the_token_on_standard_input(tmp_path: Path) -> None:
    machine = Machine(tmp_path, programs=docker(f"digest={DIGEST}"))
    ran = machine.run("registry", "Push the image", tmp_path)
    assert (ran.returncode, ran.stdout) == (0, "secret\n")
    load, tag, login, *pushed, inspect = machine.called("docker")
    assert load == "load --quiet --input image/image.tar"
    assert tag == f"tag {IMAGE}:0.9.0 {IMAGE}:0"
    assert login == "login ghcr.io --username octocat --password-stdin"
    assert pushed == [f"push --quiet {IMAGE}:0.9.0", f"push --quiet {IMAGE}:0"]
    assert inspect.endswith(f" {IMAGE}:0.9.0")
    assert (machine.temp / "GITHUB_OUTPUT").read_text(encoding="utf-8") == f"digest={DIGEST}\n"
