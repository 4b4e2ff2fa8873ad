"""The page of one run for a frame in a notebook: only its player, and no list of scenarios."""

from __future__ import annotations

import platform

from sim_action.core.provenance import platform_name
from sim_action.core.records import replace
from sim_action.core.version import __version__
from sim_action.reports import ReportOptions
from sim_action.reports.html.document import Page
from sim_action.reports.html.report import page
from sim_action.results.outcome import Outcome
from sim_action.results.results_json import Results


def outcome_page(outcome: Outcome, options: ReportOptions) -> Page | None:
    """Return the page of a run; None if it has no replay."""
    results = Results(
        sim_action=__version__,
        python=platform.python_version(),
        platform=platform_name(),
        wall_time=outcome.wall_time,
        # Without its gate and its other variations, a run counts by itself.
        outcomes=(outcome.model_copy(update={"gate": None, "group": None}),),
    )
    made = page(results, options)
    return replace(made, is_embedded=True) if made.has_replays else None
