from __future__ import annotations

import sys
from types import ModuleType

import pytest

from sim_action.cli.main import leave_out_plugins

LOADER = "pydantic.plugin._loader"


def test_pydantic_finds_no_plugins(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, LOADER, raising=False)
    leave_out_plugins()
    loader = sys.modules[LOADER]
    assert vars(loader)["get_plugins"]() == ()
    assert not hasattr(loader, "__path__")
    assert sys.modules[LOADER] is loader


def test_a_pydantic_that_needs_more_gets_its_own_loader(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, LOADER, raising=False)
    leave_out_plugins()
    loader = sys.modules[LOADER]
    assert loader.PYDANTIC_ENTRY_POINT_GROUP == "pydantic"
    assert sys.modules[LOADER] is not loader


def test_a_loader_that_is_in_use_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    used = ModuleType(LOADER)
    monkeypatch.setitem(sys.modules, LOADER, used)
    leave_out_plugins()
    assert sys.modules[LOADER] is used
