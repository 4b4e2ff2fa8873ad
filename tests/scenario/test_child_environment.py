"""The variables that code of the repository sees."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.scenario import child_environment

HARMLESS = [
    *("PATH", "HOME", "LANG", "LC_ALL", "TMPDIR", "TZ", "PYTHONPATH", "VIRTUAL_ENV", "CONDA_PREFIX", "ROS_DISTRO"),
    *("AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH", "COLCON_HOME", "GAZEBO_MODEL_PATH", "GZ_SIM_RESOURCE_PATH", "IGN_IP"),
    *("LD_LIBRARY_PATH", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "CUDA_VISIBLE_DEVICES", "XDG_CACHE_HOME", "CI"),
    *("GITHUB_SHA", "GITHUB_WORKSPACE", "RUNNER_TEMP", "SYSTEMROOT", "PYDANTIC_DISABLE_PLUGINS", "TURTLEBOT3_MODEL"),
]
SECRET = [
    *("GITHUB_TOKEN", "GH_TOKEN", "GITHUB_ENV", "GITHUB_OUTPUT", "GITHUB_PATH", "GITHUB_STATE", "GITHUB_STEP_SUMMARY"),
    *("ACTIONS_RUNTIME_TOKEN", "ACTIONS_ID_TOKEN_REQUEST_URL", "INPUT_SCENARIO", "SET_UP_INSTANTS", "AWS_SECRET_KEY"),
    *("CI_JOB_TOKEN", "CI_REPOSITORY_URL", "DATABASE_URL", "HTTPS_PROXY", "PIP_INDEX_URL", "UV_INDEX_URL"),
    *("ROS_TOKEN", "PYTHON_KEYRING_PASSWORD", "CONDA_TOKEN", "LC_API_KEY", "GZ_PASS", "GZ_PAT", "ros_password"),
    *("PYTHON_SECRET", "CUDA_CREDENTIALS", "XDG_COOKIE", "GITHUB_EVENT_PATH", "MY_ROBOT", "SSH_AUTH_SOCK"),
]


@pytest.mark.parametrize("name", HARMLESS)
def test_harmless_variables_are_seen(name: str) -> None:
    assert child_environment.code_environment({name: "x"}) == {name: "x"}


@pytest.mark.parametrize("name", SECRET)
def test_other_variables_are_seen_only_if_the_caller_names_them(name: str) -> None:
    assert child_environment.code_environment({name: "x"}) == {}
    assert child_environment.code_environment({name: "x"}, [name]) == {name: "x"}
    assert child_environment.compared_variables({name: "x"}, [name]) == {name: "x"}


def test_the_last_source_counts() -> None:
    job = {"TZ": "job", "ROUTE": "job", "PATH": "/bin"}
    stated = {"TZ": "scenario", "ROUTE": "scenario"}
    assert child_environment.code_environment(job, (), stated) == {**stated, "PATH": "/bin"}
    assert child_environment.code_environment(job, ["ROUTE"], {"ROUTE": "scenario"})["ROUTE"] == "job"


def test_variables_that_differ_from_call_to_call_are_not_compared() -> None:
    kept = {"PATH": "/b", "HOME": "/"}
    assert child_environment.compared_variables({"GITHUB_SHA": "1", "TMPDIR": "/t", **kept}) == kept


@pytest.mark.parametrize(
    "name",
    [
        *("LD_PRELOAD", "LD_LIBRARY_PATH", "ld_preload", "PYTHONPATH", "PYTHONSTARTUP", "PYTHON", "GITHUB_TOKEN"),
        *("GITHUB_ANYTHING", "RUNNER_TEMP", "INPUT_X", "ACTIONS_X", "SIM_ACTION_BACKEND", "HOME", "TMPDIR", "BASH_ENV"),
        *(
            "ROS_PACKAGE_PATH",
            "AMENT_PREFIX_PATH",
            "GAZEBO_MODEL_PATH",
            "GZ_SIM_RESOURCE_PATH",
            "XDG_CACHE_HOME",
            "PATH",
        ),
        *("ROS_SECURITY_KEYSTORE", "MUJOCO_GL", "OMP_NUM_THREADS", "GLIBC_TUNABLES", "PYDANTIC_X", "CMAKE_PREFIX_PATH"),
    ],
)
def test_a_scenario_does_not_change_how_anything_starts_or_where_files_may_be(name: str) -> None:
    assert "cannot be set by a scenario" in (child_environment.problem_of(name, "x") or "")


@pytest.mark.parametrize("name", ["ROUTE", "TZ", "LANG", "TURTLEBOT3_MODEL", "_x1", "MAP_URL", "PYTHO"])
def test_a_scenario_can_set_others(name: str) -> None:
    assert child_environment.problem_of(name, "x") is None
    assert child_environment.problem_of(name, "x" * (child_environment.MAX_VALUE_CHARS + 1)) is not None
    assert child_environment.problem_of(name, "a\0b") is not None


@pytest.mark.parametrize("name", ["", "1A", "A=B", "A B", "A-B", "Ä", "A\n"])
def test_names_are_names(name: str) -> None:
    assert "is not a name" in (child_environment.problem_of(name, "x") or "")


def test_patterns_end_with_their_star() -> None:
    for pattern in (*child_environment.RESERVED, *(name for group in child_environment.PASSED for name in group.names)):
        assert "*" not in pattern[:-1]


@given(st.text("ABCXYZ_", max_size=8), st.sampled_from(child_environment.SECRET_WORDS), st.booleans())
def test_no_wildcard_matches_a_secret(text: str, word: str, lower: bool) -> None:
    for pattern in (name for each in child_environment.PASSED for name in each.names if name.endswith("*")):
        name = pattern[:-1] + text + (word.lower() if lower else word)
        assert child_environment.passed_variables({name: "x"}) == {}


@given(st.dictionaries(st.text(min_size=1), st.text()))
def test_seen_variables_are_some_of_all(variables: dict[str, str]) -> None:
    seen = child_environment.passed_variables(variables)
    assert seen.items() <= variables.items()
    compared = child_environment.compared_variables(variables)
    assert compared.items() <= seen.items()
    assert list(compared) == sorted(compared)
