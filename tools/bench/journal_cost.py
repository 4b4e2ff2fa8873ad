"""A suite of short scenarios with a journal and without."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

COUNT = 300
SCENARIO = f"""\
name: burger drives
robot: {{model: turtlebot3_burger}}
commands: {{rate: 10 Hz, twist: [{{linear: 1.0}}]}}
expect: [{{travel: {{at_least: 0.5 m}}}}]
time_limit: 4 s
variations:
  world.ground.friction: {{uniform: [0.4, 1.2], samples: {COUNT}}}
"""


def journal_calls(folder: Path) -> tuple[Callable[[], object], Callable[[], object]]:
    """Return two calls that run the suite: with a journal in `folder`, and without."""
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # as the command line does
    from sim_action.core.permissions import Permissions
    from sim_action.core.process import Interruption
    from sim_action.results.journal import Event, Finished, Header, Journal, Listener, Planned, RunEnded
    from sim_action.runner.process_pool import Pool, PoolOptions
    from sim_action.runner.run_plan import Runs
    from sim_action.scenario.files import read_file
    from sim_action.scenario.loading import load_all
    from sim_action.scenario.model import LoadedScenario

    folder.mkdir()
    path = folder / "0.sim.yml"
    path.write_text(SCENARIO)
    found = load_all(read_file(path, Permissions()), Permissions())
    runs = [run for run in found if isinstance(run, LoadedScenario)]
    planned = [Planned(name=run.scenario.name, file=run.file) for run in runs]

    def run_suite(listener: Listener) -> None:
        with Interruption() as interruption:
            options = PoolOptions(len(os.sched_getaffinity(0)))
            outcomes = Pool(Runs(runs, folder), listener, interruption, options).outcomes()
        assert {outcome.status for outcome in outcomes} == {"passed"}

    def refuse(message: str) -> None:
        raise RuntimeError(message)

    def with_journal() -> None:
        journal = Journal(folder, Header.of_call(planned, ()), refuse, time.monotonic())

        def listen(event: Event) -> None:
            journal(event)
            if isinstance(event, RunEnded):
                journal(Finished(event.place, event.outcome))

        run_suite(listen)
        journal.close()

    return with_journal, lambda: run_suite(lambda _: None)
