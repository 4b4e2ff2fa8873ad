from __future__ import annotations

import platform
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from sim_action.core import provenance as provenance_module
from sim_action.core.provenance import cpu_model, named_in_cpu_info, platform_name, provenance
from sim_action.engines import ENGINES, installed

AMD = "processor\t: 0\nvendor_id\t: AuthenticAMD\nmodel name\t: AMD EPYC 7763 64-Core Processor\n\nprocessor\t: 1\n"
ARM = "processor\t: 0\nBogoMIPS\t: 50.00\nCPU implementer\t: 0x41\nCPU part\t: 0xd0c\n\nprocessor\t: 1\n"


def test_processors_have_names_or_numbers() -> None:
    assert named_in_cpu_info(AMD) == "AMD EPYC 7763 64-Core Processor"
    assert named_in_cpu_info(ARM) == f"{platform.machine()}, implementer 0x41, part 0xd0c"
    assert cpu_model()


@pytest.mark.parametrize("text", ["", "processor\t: 0\n", "no colon"])
def test_what_says_nothing_has_no_name(text: str) -> None:
    assert named_in_cpu_info(text) == ""


@pytest.mark.parametrize("engine", installed())
def test_builds_and_versions_are_told(engine: str) -> None:
    told = provenance(ENGINES[engine].distribution, "1.2.3")
    assert told.engine_build
    assert re.fullmatch(rf"{ENGINES[engine].distribution} \d\S+, cp\S+, libraries [0-9a-f]{{12}}", told.engine_build)
    versions = (told.sim_action, told.python, told.numpy, told.platform)
    assert versions == ("1.2.3", platform.python_version(), np.__version__, platform_name())


def test_engines_have_builds_of_their_own_if_installed() -> None:
    assert len({provenance(ENGINES[engine].distribution, "1").engine_build for engine in installed()}) == len(
        installed()
    )
    assert provenance("no-such-engine", "1").engine_build is None


@pytest.mark.process  # `platform.platform` starts `uname`
def test_the_name_of_the_system_starts_no_program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = platform.platform()
    if sys.platform == "linux":
        assert platform_name() == expected

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("a program was started")

    platform._uname_cache = None  # type: ignore[attr-defined] # private: the module keeps the name after its first use
    monkeypatch.setattr(subprocess, "Popen", refuse)
    monkeypatch.setattr(provenance_module, "_CPU_INFO", tmp_path / "missing")
    assert platform_name()
    if sys.platform == "linux":
        assert cpu_model() == platform.machine()
