"""The random seed of a run; no other module decides it.

A typed seed, such as that of `--seed`, overrides `seed:` of the scenario. It does not override a seed that variations
list, or draw. Each sample has a seed of its own, which is derived from that of its scenario.
"""

from __future__ import annotations

from random import Random

from sim_action.core.records import replace
from sim_action.core.yaml_document import Document
from sim_action.scenario.source import Source, varies_seed
from sim_action.scenario.variations.dotted_keys import placed
from sim_action.scenario.variations.values import DRAWN_SEED_BITS, MAX_SEED, SEED


def seed_of_draws(document: Document, typed: int | None) -> int:
    """Return the seed that draws the values of variations; an invalid one is refused later, with the scenario."""
    return (_stated(document) or 0) if typed is None else typed


def sampled(run: Source, sample: int, typed: int | None) -> Source:
    """Return a run with the seed of its sample, which follows from the seed of its scenario and this number alone."""
    stated = _stated(run.document)
    if stated is None:
        return run
    seed = stated if typed is None or varies_seed(run.variation) else typed
    own = Random(f"sample {sample} of seed {seed}").getrandbits(DRAWN_SEED_BITS)
    data, _ = placed(run.document.data, (SEED,), own)
    return replace(run, document=replace(run.document, data=data), scenario_seed=seed)


def overriding_seed(run: Source, typed: int | None) -> int | None:
    """Return the typed seed if it overrides that of the run, which is complete otherwise."""
    return None if run.scenario_seed is not None or varies_seed(run.variation) else typed


def _stated(document: Document) -> int | None:
    seed = document.data.get(SEED, 0) if isinstance(document.data, dict) else 0
    return seed if isinstance(seed, int) and not isinstance(seed, bool) and 0 <= seed <= MAX_SEED else None
