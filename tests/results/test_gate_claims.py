"""The claims of a gate that demand less than before."""

from __future__ import annotations

from typing import Any

import pytest

from sim_action.results.gate_claims import ClaimChange, claim_changes
from sim_action.scenario.variations.gate import Gate

FAR = {"of": "travel.measured", "q": "5 %", "at_least": "1.4 m"}
NEAR = {"of": "travel.measured", "q": "95 %", "at_most": "1.4 m"}
NINETY_FIVE = {"passes": {"at_least": "95 %"}}
EARLY = {"stop_early": {"reject": "85 %", "accept": "95 %"}}


def early(reject: str, accept: str) -> dict[str, Any]:
    return {"stop_early": {"reject": reject, "accept": accept}}


def changes(old: dict[str, Any], new: dict[str, Any]) -> tuple[ClaimChange, ...]:
    return claim_changes(Gate.model_validate(old), Gate.model_validate(new))


@pytest.mark.parametrize(
    ("old", "new", "kind", "claim", "texts"),
    [
        (NINETY_FIVE, {"passes": {"at_least": "90 %"}}, "limit", "passes", ("at least 95 %", "at least 90 %")),
        (
            {"passes": {"at_least": "99.9999 %"}},
            {"passes": {"at_least": "99.9998 %"}},
            *("limit", "passes", ("at least 99.9999 %", "at least 99.9998 %")),
        ),
        (
            NINETY_FIVE,
            {"passes": {"at_least": "95 %", "confidence": "60 %"}},
            *("confidence", "passes", ("95 %", "60 %")),
        ),
        (
            NINETY_FIVE,
            early("30 %", "60 %"),
            *("limit", "passes", ("at least 95 %", "stop_early reject 30 %, accept 60 %")),
        ),
        (NINETY_FIVE, {"quantile": FAR}, "removed", "passes", ("at least 95 %", "")),
        (
            EARLY,
            early("30 %", "60 %"),
            *("limit", "stop_early", ("reject 85 %, accept 95 %", "reject 30 %, accept 60 %")),
        ),
        (
            EARLY,
            early("85 %", "90 %"),
            *("limit", "stop_early", ("reject 85 %, accept 95 %", "reject 85 %, accept 90 %")),
        ),
        (
            EARLY,
            {"passes": {"at_least": "80 %"}},
            *("limit", "stop_early", ("reject 85 %, accept 95 %", "passes at least 80 %")),
        ),
        (EARLY, {"quantile": FAR}, "removed", "stop_early", ("reject 85 %, accept 95 %", "")),
        (
            NINETY_FIVE,
            {**NINETY_FIVE, "errors": {"at_most": 10}},
            *("limit", "errors", ("at most 0 runs without a verdict", "at most 10 runs without a verdict")),
        ),
        (
            {"quantile": FAR},
            {"quantile": {**FAR, "q": "20 %"}},
            *("limit", "quantile of travel.measured"),
            ("5 % quantile at least 1.4 m", "20 % quantile at least 1.4 m"),
        ),
        (
            {"quantile": FAR},
            {"quantile": {**FAR, "at_least": "139 cm"}},
            *("limit", "quantile of travel.measured"),
            ("5 % quantile at least 1.4 m", "5 % quantile at least 139 cm"),
        ),
        (
            {"quantile": NEAR},
            {"quantile": {**NEAR, "at_most": "1.5 m"}},
            *("limit", "quantile of travel.measured"),
            ("95 % quantile at most 1.4 m", "95 % quantile at most 1.5 m"),
        ),
        (
            {"quantile": NEAR},
            {"quantile": {**NEAR, "q": "90 %"}},
            *("limit", "quantile of travel.measured"),
            ("95 % quantile at most 1.4 m", "90 % quantile at most 1.4 m"),
        ),
        (
            {**NINETY_FIVE, "quantile": {**FAR, "confidence": "99 %"}},
            {**NINETY_FIVE, "quantile": {**FAR, "confidence": "50 %"}},
            *("confidence", "quantile of travel.measured", ("99 %", "50 %")),
        ),
        (
            {**NINETY_FIVE, "quantile": FAR},
            NINETY_FIVE,
            *("removed", "quantile of travel.measured", ("5 % quantile at least 1.4 m", "")),
        ),
        (
            {"quantile": FAR},
            {"quantile": NEAR},
            *("removed", "quantile of travel.measured", ("5 % quantile at least 1.4 m", "")),
        ),
        (
            {"quantile": FAR},
            {"quantile": {**FAR, "at_least": "1.4 s"}},
            *("removed", "quantile of travel.measured", ("5 % quantile at least 1.4 m", "")),
        ),
    ],
)
def test_a_claim_that_demands_less(
    old: dict[str, Any], new: dict[str, Any], kind: str, claim: str, texts: tuple[str, str]
) -> None:
    weaker = [each for each in changes(old, new) if each.is_weaker]
    assert [(each.kind, each.claim, (each.old, each.new)) for each in weaker] == [(kind, claim, texts)]
    back = changes(new, old)
    assert not [each for each in back if each.is_weaker and each.kind != "removed"]
    if kind != "removed":
        assert [(each.kind, each.old, each.new) for each in back] == [(kind, *reversed(texts))]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ({**NINETY_FIVE, "runs": 200}, {**NINETY_FIVE, "runs": 59}),
        (EARLY, {"passes": {"at_least": "85 %"}}),
        ({"passes": {"at_least": "85 %"}}, EARLY),
        (NINETY_FIVE, {**NINETY_FIVE, "quantile": FAR}),
        ({"quantile": FAR}, {"quantile": {**FAR, "at_least": 1.4}}),
        ({"quantile": [FAR, {**FAR, "q": "20 %"}]}, {"quantile": [{**FAR, "q": "20 %"}, FAR]}),
        ({"quantile": {**FAR, "q": "20 %"}}, {"quantile": [{**FAR, "q": "30 %"}, {**FAR, "q": "20 %"}]}),
    ],
    ids=["fewer runs", "test to rate", "rate to test", "one more", "no unit", "another order", "one of two"],
)
def test_claims_that_demand_as_much(old: dict[str, Any], new: dict[str, Any]) -> None:
    assert [each for each in changes(old, new) if each.is_weaker] == []
