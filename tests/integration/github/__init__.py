"""Runs the actions and workflows of this repository as GitHub's runner would.

It knows what is documented of the features that are used here, and refuses everything else (UnsupportedFeature), so
that a green test never rests on something that was skipped.
"""

from tests.integration.github.commands import Annotation, parse_annotations, parse_outputs
from tests.integration.github.errors import UnsupportedFeature
from tests.integration.github.expressions import Status, evaluate, evaluate_value, holds
from tests.integration.github.machine import Report, Run
from tests.integration.github.provided import base_python
from tests.integration.github.results import JobResult, JobRun, StepResult, WorkflowResult
from tests.integration.github.runner import ActionResult, Runner
from tests.integration.github.stores import ArtifactStore, CacheStore
from tests.integration.github.workflows import run_workflow

__all__ = [
    "ActionResult",
    "Annotation",
    "ArtifactStore",
    "CacheStore",
    "JobResult",
    "JobRun",
    "Report",
    "Run",
    "Runner",
    "Status",
    "StepResult",
    "UnsupportedFeature",
    "WorkflowResult",
    "base_python",
    "evaluate",
    "evaluate_value",
    "holds",
    "parse_annotations",
    "parse_outputs",
    "run_workflow",
]
