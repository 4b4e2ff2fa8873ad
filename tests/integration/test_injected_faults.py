"""Under each fault of the system in a table, no finished verdict is lost. The faults are in `faults/sites.py`."""

from __future__ import annotations

import os
import sys

import pytest

from tests.integration.faults.harness import Injector
from tests.integration.faults.injection import COMPILER, Fault
from tests.integration.faults.sites import FAULTS

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="LD_PRELOAD is for Linux"),
    # `.ci/run` installs one. On GitHub, a missing one is an error.
    pytest.mark.skipif(COMPILER is None and not os.environ.get("CI"), reason="there is no C compiler"),
]


@pytest.fixture(scope="session")
def injector(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Injector:
    session = tmp_path_factory.getbasetemp()
    shared = (session if worker_id == "master" else session.parent) / "undisturbed"
    shared.mkdir(exist_ok=True)
    return Injector(tmp_path_factory.mktemp("faults"), shared)


ONE_OF_EACH = {each.name: pytest.param(each, each.short[0], id=f"{each}") for each in FAULTS[::-1] if each.short}


@pytest.mark.parametrize(("fault", "nth"), ONE_OF_EACH.values())
def test_a_fault_costs_no_finished_verdict(injector: Injector, fault: Fault, nth: int) -> None:
    found = injector.inject(fault, nth)
    sys.stdout.write(f"{found}\n")
    assert found.fired, f"the call was not reached: {found}"
    assert found.broken == ()


@pytest.mark.soak
@pytest.mark.parametrize("fault", [pytest.param(each, id=str(each)) for each in FAULTS])
def test_a_fault_at_any_call_costs_no_finished_verdict(injector: Injector, fault: Fault) -> None:
    found = list(injector.inject_everywhere(fault))
    sys.stdout.write("\n".join(map(str, found)))
    assert found, "the call was not reached"
    assert [str(one) for one in found if one.broken] == []
