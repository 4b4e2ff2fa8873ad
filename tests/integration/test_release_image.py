"""The steps of release.yml that build and push the image, with a stand-in for Docker."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.integration.release_steps import ROOT, Machine, jobs

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
