"""The job of a fresh interpreter, which comes on standard input."""

from __future__ import annotations

import os
import pickle
import sys

from sim_action.core.errors import InternalError, PackageFault
from sim_action.runner.child_files import ChildFiles
from sim_action.runner.job import Job
from sim_action.runner.observed_inputs import hear_early


def received_job() -> tuple[Job, ChildFiles]:
    """Return the job and its files from standard input.

    This imports the assertions and sensors of installed packages. The process ends if it fails.
    """
    hear_early()
    try:
        received: tuple[Job, ChildFiles] = pickle.load(sys.stdin.buffer)  # noqa: S301 - from the parent
    except Exception as error:
        fault = InternalError.of(error)
        if not isinstance(fault, PackageFault):
            raise
        # The last words of this process are in the outcome.
        sys.stderr.write(f"{fault}\n")
        sys.stderr.flush()
        os._exit(1)
    return received
