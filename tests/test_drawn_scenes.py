"""A few of the drawn scenes of `make soak`, and scenes that the oracles must find at fault."""

from __future__ import annotations

import random
from dataclasses import replace

import numpy as np
import pytest

from sim_action.engines import ENGINES
from sim_action.state.trace import Trace
from tests import drawn_scenes
from tests.drawn_scenes import DrawnScene, Solid, drawn_scene, failures, run
from tests.integration.engines import on_every_engine

BOX = Solid("robot", "box", (0.1, 0.2, 0.1), 2.0, 0.5, (0, 0, 0.4), (0, 0, 0))
TABLE = Solid("b1", "box", (0.3, 0.3, 0.1), None, 0.5, (0, 0, 0.1), (0, 0, 0))
STACK = DrawnScene(BOX, (TABLE,), 1.0, 500.0, 0.6)


def at_fault(engine: str, drawn: DrawnScene) -> set[str]:
    pytest.importorskip(ENGINES[engine].package, reason=f"{engine} is not installed")
    return {text.split(":")[0] for text in failures(engine, drawn)}


@on_every_engine
@pytest.mark.parametrize("number", range(4))
def test_drawn_scenes_hold(engine: str, number: int) -> None:
    assert at_fault(engine, drawn_scene(random.Random(f"7-{number}"))) == set()


def test_a_body_without_a_place_between_the_others_stands_beside_them() -> None:
    drawn = drawn_scene(random.Random("1-1651"))
    assert max(abs(at) for body in drawn.bodies for at in body.position[:2]) > 0.5


def heavier(trace: Trace) -> Trace:
    record = trace.link_contacts["it"]
    return replace(trace, link_contacts={"it": replace(record, force=1.5 * record.force)})


def without_contacts(trace: Trace) -> Trace:
    state = trace.state.copy()
    state[-40:, 3] -= 0.02
    return replace(trace, state=state, contacts=())


def moved_contacts(trace: Trace) -> Trace:
    return replace(trace, contacts=tuple(contact._replace(position_xyz=(0, 0, 1)) for contact in trace.contacts))


def faster(trace: Trace) -> Trace:
    state = trace.state.copy()
    state[:, 3] = state[0, 3] + 1.1 * (state[:, 3] - state[0, 3])
    return replace(trace, state=state)


def rising(trace: Trace) -> Trace:
    state = trace.state.copy()
    state[-40:, 3] += np.linspace(0, 0.5, 40)
    return replace(trace, state=state)


@on_every_engine
@pytest.mark.parametrize(
    ("damage", "oracle"),
    [
        (heavier, "impulses"),
        (without_contacts, "contacts"),
        (moved_contacts, "contacts"),
        (faster, "energy"),
        (rising, "energy"),
        (heavier, "repetition"),
    ],
)
def test_an_oracle_notices_a_wrong_trace(
    engine: str, damage: object, oracle: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert at_fault(engine, STACK) == set()
    traces = [damage(run(engine, STACK)), run(engine, STACK)]  # type: ignore[operator]
    if oracle == "repetition":
        traces[0] = faster(traces[0])
    monkeypatch.setattr(drawn_scenes, "run", lambda *_: traces.pop(0))
    assert oracle in at_fault(engine, STACK)
