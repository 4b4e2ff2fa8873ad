"""The environment variables that code of the repository sees: an allowlist, so that secrets of a job do not reach it.

Controllers, processes, xacro and nodes get the variables of the table here, of `environment:` in the scenario,
and of `--pass-env` from the caller. This is hygiene, not a boundary: code of the same user can read the memory of its
parent process.
"""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from functools import lru_cache
from typing import Final

from sim_action.core.records import dataclass
from sim_action.engines import ENGINES


@dataclass(frozen=True, slots=True)
class Variables:
    """Some environment variables that code of the repository sees."""

    purpose: str  # a few words for the documentation
    names: tuple[str, ...]  # names, or patterns; `*` at the end stands for any text
    is_compared: bool = True  # True if `--resume` runs a scenario with code again when one of them has changed
    may_be_set: bool = False  # True if a scenario may set them with `environment:`


PASSED: Final = (
    Variables("language and time", ("LANG", "LANGUAGE", "LC_*", "TZ", "TZDIR"), may_be_set=True),
    Variables(
        "user and programs",
        (
            *("PATH", "HOME", "USER", "LOGNAME", "SHELL", "UMASK", "SSL_CERT_FILE", "SSL_CERT_DIR"),
            *("XDG_CACHE_HOME", "XDG_CONFIG_HOME", "XDG_CONFIG_DIRS", "XDG_DATA_HOME", "XDG_DATA_DIRS"),
            *("XDG_STATE_HOME", "NIX_PATH", "NIX_PROFILES"),
        ),
    ),
    Variables(
        "Windows",
        (
            *("ALLUSERSPROFILE", "APPDATA", "COMMONPROGRAMFILES*", "COMMONPROGRAMW6432", "COMPUTERNAME", "COMSPEC"),
            *("HOMEDRIVE", "HOMEPATH", "LOCALAPPDATA", "NUMBER_OF_PROCESSORS", "OS", "PATHEXT", "PROCESSOR_*"),
            *("PROGRAMDATA", "PROGRAMFILES*", "PROGRAMW6432", "PUBLIC", "SYSTEMDRIVE", "SYSTEMROOT", "USERDOMAIN"),
            *("USERNAME", "USERPROFILE", "WINDIR"),
        ),
    ),
    Variables("Python", ("PYTHON*", "PYDANTIC_*", "VIRTUAL_ENV*", "CONDA_*", "MAMBA_*", "PIXI_*", "PYENV_*")),
    Variables(
        "other languages",
        (
            *("CARGO_HOME", "DOTNET_ROOT", "GEM_HOME", "GEM_PATH", "GOPATH", "GOROOT", "JAVA_HOME", "JULIA_DEPOT_PATH"),
            *("LUA_PATH", "NODE_PATH", "NVM_DIR", "PERL5LIB", "RUBYLIB", "RUSTUP_HOME"),
        ),
    ),
    Variables(
        "ROS and Gazebo",
        (
            *("ROS_*", "ROS2_*", "AMENT_*", "CATKIN_*", "COLCON_*", "CMAKE_PREFIX_PATH", "PKG_CONFIG_PATH", "RMW_*"),
            *("RCL_*", "RCUTILS_*", "FASTDDS_*", "FASTRTPS_*", "CYCLONEDDS_*", "GAZEBO_*", "GZ_*", "IGN_*"),
            *("SDF_PATH", "OGRE_RESOURCE_PATH"),
        ),
    ),
    # In the action, its path differs from job to job.
    Variables("Python of ROS 2", ("SIM_ACTION_ROS2_PYTHON",), is_compared=False),
    Variables("choice of a robot", ("TURTLEBOT3_MODEL", "LDS_MODEL"), may_be_set=True),
    Variables(
        "native libraries and processor",
        (
            *("LD_LIBRARY_PATH", "LD_PRELOAD", "LD_BIND_NOW", "DYLD_*", "GLIBC_TUNABLES", "MALLOC_*"),
            *("OMP_*", "GOMP_*", "KMP_*", "OPENBLAS_*", "MKL_*", "BLIS_*", "VECLIB_*", "NUMEXPR_*", "NPY_*"),
            *("CUDA_*", "NVIDIA_*", *(pattern for engine in ENGINES.values() for pattern in engine.environment)),
            *("PYOPENGL_*", "LIBGL_*", "MESA_*", "EGL_*", "GALLIUM_*", "__EGL_*"),
            *("IMAGEIO_*", "ASAN_OPTIONS", "UBSAN_OPTIONS", "LSAN_OPTIONS", "TSAN_OPTIONS"),
        ),
    ),
    Variables(
        "temporary files and terminals",
        (
            *("TMPDIR", "TEMP", "TMP", "PWD", "OLDPWD", "SHLVL", "HOSTNAME", "TERM", "COLORTERM", "COLUMNS", "LINES"),
            *("NO_COLOR", "FORCE_COLOR", "DISPLAY", "WAYLAND_DISPLAY", "XDG_RUNTIME_DIR", "XDG_SESSION_TYPE"),
        ),
        is_compared=False,
    ),
    Variables(
        "workflows",
        (
            *("CI", "GITLAB_CI", "GITHUB_ACTIONS", "GITHUB_ACTOR", "GITHUB_API_URL", "GITHUB_BASE_REF"),
            *("GITHUB_EVENT_NAME", "GITHUB_HEAD_REF", "GITHUB_JOB", "GITHUB_REF", "GITHUB_REF_NAME"),
            *("GITHUB_REF_TYPE", "GITHUB_REPOSITORY", "GITHUB_REPOSITORY_OWNER", "GITHUB_RUN_ATTEMPT"),
            *("GITHUB_RUN_ID", "GITHUB_RUN_NUMBER", "GITHUB_SERVER_URL", "GITHUB_SHA", "GITHUB_WORKFLOW"),
            *("GITHUB_WORKSPACE", "RUNNER_ARCH", "RUNNER_DEBUG", "RUNNER_ENVIRONMENT", "RUNNER_NAME", "RUNNER_OS"),
            *("RUNNER_TEMP", "RUNNER_TOOL_CACHE"),
        ),
        is_compared=False,
    ),
)
"""The variables that code of the repository sees. Names that sound like a secret match no pattern."""

SECRET_WORDS: Final = (
    *("TOKEN", "SECRET", "PASSW", "PASSPHRASE", "KEY", "CREDENTIAL", "AUTH", "PRIVATE", "COOKIE", "SIGNATURE"),
    *("BEARER", "JWT", "WEBHOOK", "LICENSE", "SESSION_ID", "CONNECTION_STRING"),
)
"""A name with one of these words matches no pattern with `*`."""

RESERVED: Final = (
    *("LD_*", "DYLD_*", "PYTHON*", "GITHUB_*", "RUNNER_*", "ACTIONS_*", "INPUT_*", "SIM_ACTION_*", "BASH_ENV", "ENV"),
    *("XDG_*", "CI"),
)
"""Names that a scenario must not set, besides the table: they change how Python, an engine or a job works."""

MAX_SET: Final = 100  # the largest number of variables that a scenario may set
MAX_VALUE_CHARS: Final = 10_000  # the longest value that a scenario may set
_NAME: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_SECRET: Final = re.compile("|".join((*SECRET_WORDS, r"(?:^|_)(?:PASS|PWD|PAT|CRED|CREDS|DSN)(?:_|$)")), re.IGNORECASE)


def _matches(name: str, patterns: Iterable[str]) -> bool:
    """Return True if a name is in a list; a name that sounds like a secret must be there in full."""
    is_secret = _SECRET.search(name) is not None
    return any(
        not is_secret and name.startswith(pattern[:-1]) if pattern.endswith("*") else name == pattern
        for pattern in patterns
    )


@lru_cache(maxsize=1000)
def _group(name: str) -> Variables | None:
    return next((group for group in PASSED if _matches(name, group.names)), None)


def passed_variables(environment: Mapping[str, str], named: Collection[str] = ()) -> dict[str, str]:
    """Return the variables that code of the repository sees; `named`: further variables from the caller."""
    return {name: value for name, value in environment.items() if name in named or _group(name) is not None}


def compared_variables(environment: Mapping[str, str], named: Collection[str] = ()) -> dict[str, str]:
    """Return the variables that code of the repository sees and that do not differ from call to call, sorted."""
    seen = passed_variables(environment, named)
    return {
        name: seen[name]
        for name in sorted(seen)
        if name in named or ((group := _group(name)) is not None and group.is_compared)
    }


def code_environment(
    environment: Mapping[str, str], named: Collection[str] = (), stated: Mapping[str, str] | None = None
) -> dict[str, str]:
    """Return all variables for code of the repository: harmless ones, variables of the scenario, and named ones."""
    by_caller = {name: environment[name] for name in named if name in environment}
    return {**passed_variables(environment), **(stated or {}), **by_caller}


def problem_of(name: str, value: str) -> str | None:
    """Return the reason why a scenario cannot set a variable; None: it can."""
    if not _NAME.fullmatch(name):
        return "is not a name of an environment variable: letters, digits and '_', and no digit at the beginning"
    refused = (*RESERVED, *(pattern for group in PASSED if not group.may_be_set for pattern in group.names))
    upper = name.upper()
    if any(upper.startswith(pattern[:-1]) if pattern.endswith("*") else upper == pattern for pattern in refused):
        return (
            "cannot be set by a scenario, because it changes how Python, the engine, ROS or the job works; set it in "
            "the environment of sim-action, or choose another name"
        )
    if "\0" in value or len(value) > MAX_VALUE_CHARS:
        return f"has a value with a NUL or with more than {MAX_VALUE_CHARS:,} characters"
    return None


# Messages of Python, of xacro and roslaunch, and of shells.
_MISSING: Final = re.compile(
    r"KeyError: ['\"](?P<python>\w+)['\"]"
    r"|environment variable:? ['\"]?(?P<ros>\w+)"
    r"|\b(?P<shell>\w+): (?:unbound variable|parameter (?:not set|null or not set))"
)


def missing_variable(text: str, named: Collection[str] = ()) -> str | None:
    """Return the variable that an error of code is about, if it exists but code does not see it."""
    return next((name for name in _missing(text) if _is_withheld(name, named)), None)


def unset_variable(text: str, named: Collection[str]) -> str | None:
    """Return the variable that an error of code is about, if the caller names it but it does not exist."""
    return next((name for name in _missing(text) if name in named and name not in os.environ), None)


def _missing(text: str) -> Iterator[str]:
    return (match[match.lastgroup] for match in _MISSING.finditer(text) if match.lastgroup)


def _is_withheld(name: str, named: Collection[str]) -> bool:
    return name in os.environ and name not in named and _group(name) is None
