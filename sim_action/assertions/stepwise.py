"""What only some physics steps tell, such as forces of contacts, as curves over all of the time."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from sim_action.state.trace import FloatArray

if TYPE_CHECKING:
    from sim_action.state.observation import Contact


def forces(contacts: Iterable[Contact]) -> tuple[FloatArray, FloatArray]:
    """(N,) s, each step that has a contact, and (N,) N, the force of all of that step."""
    summed: dict[float, float] = {}
    for contact in contacts:
        summed[contact.time] = summed.get(contact.time, 0.0) + contact.force
    return np.array(list(summed)), np.array(list(summed.values()))


def with_zeros(moments: FloatArray, time: FloatArray, values: FloatArray, step: float) -> tuple[FloatArray, FloatArray]:
    """Values at some steps; 0 at moments that are none of these, and one step before and after each row of them."""
    if not len(time):
        return moments, np.zeros(len(moments))
    beside = np.concatenate((moments, time - step, time + step))
    inside = beside[(beside >= moments[0]) & (beside <= moments[-1])]
    # Two ways to the same step differ by rounding alone.
    at = np.searchsorted(time, inside - step / 2)
    known = np.append(time, np.inf)[at] <= inside + step / 2
    zeros = np.unique(np.round(inside[~known] / step)) * step
    grid = np.concatenate((time, zeros))
    order = np.argsort(grid)
    return grid[order], np.concatenate((values, np.zeros(len(zeros))))[order]
