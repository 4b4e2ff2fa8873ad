"""Secrets of a job do not reach code of the repository, and values that the caller passes do not reach reports."""

from __future__ import annotations

import gzip
import zipfile
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Final

import pytest

from sim_action.results.results_json import Results
from tests.integration.conftest import fresh_sim_action
from tests.integration.test_permission_gate import case as scenario_case
from tests.ros.ros1.launches import needs_ros, package

PLANTED: Final = "planted-4711-"
NAMES: Final = (
    *("GITHUB_TOKEN", "GH_TOKEN", "ACTIONS_RUNTIME_TOKEN", "INPUT_TOKEN", "AWS_SECRET_ACCESS_KEY", "DATABASE_URL"),
    *("NPM_CONFIG", "ROS_TOKEN", "ROS_API_KEY", "PYTHON_PASSWORD", "CONDA_TOKEN", "MY_SETTING", "lower_case", "PIP_X"),
    *("SIM_ACTION_THING", "GITHUB_UNKNOWN", "LC_SECRET", "XDG_CREDENTIALS", "STATE_x", "CI_JOB_TOKEN"),
)
PASSED: Final = {
    "PASSED": "passed-4711 'quoted'\nsecond-line-4711",
    "ROS_PASSED_TOKEN": "passed-4711-token",
    "SHORT": "abc",
}
"""Variables that the caller names."""

TWIST: Final = "commands: {rate: 10 Hz, twist: [{linear: 0.1}]}"
SCRIPT: Final = """\
import os, sys
print("sees", os.environ["STATED"], len(os.environ["PASSED"]), dict(os.environ))
for name, value in os.environ.items():
    print(name, value, file=sys.stderr)
def control(observation):
    raise ValueError(str(dict(os.environ)))
"""
PROCESS: Final = """\
import json, os, sys
print("sees", os.environ["STATED"], len(os.environ["PASSED"]), dict(os.environ), file=sys.stderr)
print(json.dumps(dict(os.environ)), flush=True)
sys.exit(json.dumps(dict(os.environ)))
"""
ASSERTION: Final = """\
import os
from sim_action import Verdict
class Nosy:
    unit = "m"
    def judge(self, trace):
        print("sees", os.environ["STATED"], len(os.environ["PASSED"]))
        return Verdict(passed=False, measured=1.0, limit=2.0, unit=os.environ["PASSED"], message=str(dict(os.environ)))
"""
XACRO: Final = """\
<robot name="nosy" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:property name="names" value="PASSED ROS_PASSED_TOKEN {names}"/>
  <link name="base-$(optenv STATED none)-$(optenv ROS_PASSED_TOKEN none)-{optenvs}">
    <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><box size="1 1 1"/></geometry></collision>
  </link>
  ${{xacro.warning("sees $(optenv STATED none) $(optenv ROS_PASSED_TOKEN none)")}}
</robot>
"""
NODE: Final = """\
#!/usr/bin/env python
import os, sys
print("sees", os.environ["STATED"], len(os.environ["PASSED"]), dict(os.environ))
sys.stdout.flush()
sys.exit(str(dict(os.environ)))
"""


def call(folder: Path, *words: str) -> tuple[str, str]:
    """The output and everything that the files of the call hold."""
    (folder / "github").mkdir()
    files = {name: folder / "github" / name for name in ("GITHUB_STEP_SUMMARY", "GITHUB_OUTPUT")}
    for file in files.values():
        file.touch()
    variables = {
        **{name: PLANTED + name for name in NAMES},
        **PASSED,
        **{name: str(file) for name, file in files.items()},
        "GITHUB_ACTIONS": "true",
        "GITHUB_EVENT_NAME": "pull_request",
    }
    options = [word for name in PASSED for word in ("--pass-env", name)]
    done = fresh_sim_action(folder, words[0], *options, "--verbose", *words[1:], **variables)
    written = "\n".join(
        text_of(path.read_bytes())
        for place in ("sim-results", "github")
        for path in sorted((folder / place).rglob("*"))
        if path.is_file()
    )
    return done.stdout + done.stderr, written


def text_of(data: bytes) -> str:
    """Everything that a file holds as text, also in archives, and in the archives of a page."""
    if data.startswith(b"\x1f\x8b"):
        data = gzip.decompress(data)
    elif data.startswith(b"PK"):
        with zipfile.ZipFile(BytesIO(data)) as archive:
            data = b"\n".join(archive.read(name) for name in archive.namelist())
    # numpy stores text as UTF-32: without the zeros, ASCII is left.
    return data.decode("utf-8", errors="replace") + data.replace(b"\0", b"").decode("utf-8", errors="replace")


def assert_no_secret(*texts: str) -> None:
    for text in texts:
        for secret in (PLANTED, "passed-4711", "second-line-4711"):
            place = text.find(secret)
            assert place < 0, text[max(0, place - 300) : place + 100]


@pytest.fixture
def suite(tmp_path: Path) -> Path:
    """Scenarios whose code prints and returns its whole environment."""
    optenvs = "-".join(f"$(optenv {name} none)" for name in NAMES)
    files: Mapping[str, str] = {
        "nosy.py": SCRIPT,
        "ctl.py": PROCESS,
        "judge.py": ASSERTION,
        "nosy.urdf.xacro": XACRO.format(names=" ".join(NAMES), optenvs=optenvs),
        "script.sim.yml": case("script", commands="commands: {rate: 10 Hz, script: nosy.py}"),
        "process.sim.yml": case("process", commands="commands: {rate: 10 Hz, process: python3 ctl.py}"),
        "judged.sim.yml": case("judged", commands=TWIST, expect="assertion: judge.py:Nosy"),
        "xacro.sim.yml": case("xacro", model="nosy.urdf.xacro", expect="upright: {max_tilt: 20 deg}"),
    }
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    return tmp_path


def case(name: str, **keys: str) -> str:
    return f"{scenario_case(name, **keys)}environment: {{STATED: by the scenario}}\n"


def test_no_secret_is_in_any_file_or_output(suite: Path) -> None:
    printed, written = call(suite, "run", ".")
    outcomes = {each.name: each for each in Results.read(suite / "sim-results/results.json").outcomes}
    told = {name: f"{each.output} {each.notes} {each.failures} {each.expectations}" for name, each in outcomes.items()}
    # Code ran, saw the variables that it should see, and its text is in the reports.
    assert set(outcomes) == {"script", "process", "judged", "xacro"}
    for name in ("script", "process", "judged"):
        assert f"sees by the scenario {len(PASSED['PASSED'])}" in told[name], told[name]
        assert "***" in told[name]
        assert "by the scenario" in told[name]
    assert outcomes["xacro"].status == "passed", told["xacro"]
    assert "base-by the scenario-***-none" in written
    assert "SHORT" in written
    assert_no_secret(printed, written)


MISSING: Final = {
    "script": 'import os\nos.environ["MY_SETTING"]\ndef control(observation): ...\n',
    "process": 'import os\nos.environ["MY_SETTING"]\n',
}


def test_a_missing_variable_that_exists_in_the_job_is_explained(suite: Path) -> None:
    (suite / "nosy.py").write_text(MISSING["script"])
    (suite / "ctl.py").write_text(MISSING["process"])
    (suite / "judge.py").write_text('import os\nos.environ["NOWHERE_AT_ALL"]\n' + ASSERTION)
    text = (suite / "nosy.urdf.xacro").read_text()
    (suite / "nosy.urdf.xacro").write_text(text.replace("$(optenv STATED none)", "$(env MY_SETTING)"))
    call(suite, "run", ".")
    outcomes = {each.name: each for each in Results.read(suite / "sim-results/results.json").outcomes}
    for name in ("script", "process", "xacro"):
        (failure,) = outcomes[name].failures
        assert "the variable MY_SETTING exists, but code of the repository does not see it" in failure.message, failure
        assert "--pass-env MY_SETTING" in failure.message
        assert "'environment:'" in failure.message
    (failure,) = outcomes["judged"].failures
    assert "NOWHERE_AT_ALL" in failure.message
    assert "--pass-env" not in failure.message


@needs_ros
def test_a_node_sees_no_secret(tmp_path: Path) -> None:
    package(tmp_path, "nosy", {"scripts/nosy.py": NODE})
    node = "commands: {rate: 10 Hz, ros1: {nodes: [nosy/nosy.py]}}"
    (tmp_path / "node.sim.yml").write_text(case("node", commands=node))
    printed, written = call(tmp_path, "run", "node.sim.yml")
    (outcome,) = Results.read(tmp_path / "sim-results/results.json").outcomes
    assert f"sees by the scenario {len(PASSED['PASSED'])}" in f"{outcome.output}{outcome.failures}", outcome
    assert "***" in written
    assert_no_secret(printed, written)


LAUNCH: Final = """\
<launch>
  <include file="$(find turtlebot3_gazebo)/launch/turtlebot3_empty_world.launch"/>
  <node pkg="nosy" type="nosy.py" name="nosy" output="screen"/>
</launch>
"""


@pytest.mark.soak
@needs_ros
def test_a_launch_sees_no_secret(tmp_path: Path) -> None:
    node = NODE.replace('os.environ["STATED"]', '"by the scenario"')
    package(tmp_path, "nosy", {"scripts/nosy.py": node, "launch/nosy.launch": LAUNCH})
    printed, written = call(tmp_path, "roslaunch", "--sim-time-limit", "1", "nosy", "nosy.launch")
    assert f"sees by the scenario {len(PASSED['PASSED'])}" in written, printed
    assert_no_secret(printed, written)
