"""Speed is kept: what calls do is counted, and one per cent more than stated fails."""

from __future__ import annotations

import sys
import tomllib

import pytest

from tools.bench.budgets import BUDGETS, figures

MORE = 1.01
LESS = 0.95  # a budget far above the figure would let the next change spend what this one saved


@pytest.mark.process
@pytest.mark.skipif(
    (sys.platform, *sys.version_info[:2]) != ("linux", 3, 11), reason="another system or Python makes other calls"
)
def test_nothing_does_more_than_its_budget() -> None:
    budgets = tomllib.loads(BUDGETS.read_text(encoding="utf-8"))
    counted = dict(figures())
    assert counted.keys() == budgets.keys()
    over = {name: (figure, budgets[name]) for name, figure in counted.items() if figure > MORE * budgets[name]}
    assert over == {}, "more than the budget: find what each call does now, or raise the budget and say why"
    under = {name: (figure, budgets[name]) for name, figure in counted.items() if figure < LESS * budgets[name]}
    assert under == {}, "less than the budget: lower it, so that nothing else spends what was saved"
