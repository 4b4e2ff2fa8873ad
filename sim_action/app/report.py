"""The use case `report`: make the results and every report from the journal of a call, also of one that was killed."""

from __future__ import annotations

from sim_action.core.errors import ExitCode
from sim_action.reports import ReportRequest
from sim_action.reports.writing import open_reports, write_reports
from sim_action.results.journal import read_journal


def report_journal(request: ReportRequest) -> ExitCode:
    """Write every report into the folder of the journal, and return the exit code. Raises UsageError."""
    results = read_journal(request.folder).results()
    with open_reports(request, keeps_earlier=True) as options:
        return write_reports(results, options)
