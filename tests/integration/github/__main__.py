"""Run a workflow of any repository on this machine, as GitHub would: `python -m tests.integration.github WORKFLOW`.

The checkout step fetches one commit with the files of the repository that git does not ignore, committed or not.
`sim-action/...@v0` is this checkout. Actions of others are stand-ins; an unknown one is refused.
"""

from __future__ import annotations

import fcntl
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

import click
import pytest

from tests.integration.github.commands import Annotation
from tests.integration.github.documents import mapping
from tests.integration.github.errors import UnsupportedFeature
from tests.integration.github.machine import REPOSITORY, Run
from tests.integration.github.results import WorkflowResult
from tests.integration.github.stores import CacheStore
from tests.integration.github.values import Value
from tests.integration.github.workflows import run_workflow

_PATH: Final = click.Path(path_type=Path, resolve_path=True)
_PULL_REQUEST: Final[Value] = {"number": 1, "head": {"ref": "change", "repo": {"full_name": REPOSITORY}}}
_FROM_FORK: Final[Value] = {"number": 1, "head": {"ref": "change", "repo": {"full_name": "stranger/robot"}}}


@click.command(help=__doc__.split("`")[0].rstrip(": ") + ".")
@click.argument("workflow", type=click.Path(path_type=Path, resolve_path=True, exists=True, dir_okay=False))
@click.option("--event", default="push", show_default=True, help="The event that starts the workflow.")
@click.option("--fork", is_flag=True, help="The pull request is from a fork: its token may only read.")
@click.option("--rerun", is_flag=True, help="Run the next attempt of the last run, as 'Re-run jobs' does.")
@click.option("--workspace", type=_PATH, help="The repository. Default: the folder that contains .github/workflows.")
@click.option("--folder", type=_PATH, help="The folder for logs, summaries, artifacts and caches. Default: a new one.")
@click.pass_context
def main(
    context: click.Context,
    *,
    workflow: Path,
    event: str,
    fork: bool,
    rerun: bool,
    workspace: Path | None,
    folder: Path | None,
) -> None:
    """Run the workflow, print what its author sees on GitHub, and exit with 1 if it is red, with 2 if it is refused."""
    if workspace is None and workflow.parts[-3:-1] != (".github", "workflows"):
        raise click.UsageError(f"{workflow} is not in .github/workflows: name the repository with --workspace")
    place = folder or Path(tempfile.mkdtemp(prefix="workflow-"))
    event_name = "pull_request" if fork else event
    pull_request: Value = {"number": 1, "pull_request": _FROM_FORK if fork else _PULL_REQUEST}
    try:
        with numbered(place, rerun=rerun) as number:
            run = place / (f"run-{number.number}" + (f"-attempt-{number.attempt}" if rerun else ""))
            result = run_workflow(
                workflow,
                workspace or workflow.parents[2],
                temp=run,
                event_name=event_name,
                event=mapping(pull_request, "event") if event_name == "pull_request" else {},
                cache=CacheStore(place / "caches"),
                run=number,
                work=place / "work",
            )
    except (UnsupportedFeature, pytest.skip.Exception) as error:
        click.echo(f"this workflow cannot be run here: {error}", err=True)
        context.exit(2)
    run.mkdir(exist_ok=True)
    for name, job in result.jobs.items():
        (run / f"{name}.log").write_text(job.log, encoding="utf-8")
        if job.summary:
            (run / f"{name}-summary.md").write_text(job.summary, encoding="utf-8")
    click.echo("\n".join(lines(result, run)))
    context.exit(0 if result.conclusion in {"success", "skipped"} else 1)


@contextmanager
def numbered(place: Path, *, rerun: bool) -> Iterator[Run]:
    """Counts the runs in a folder, and keeps other calls out of it. Raises UnsupportedFeature."""
    place.mkdir(parents=True, exist_ok=True)
    with (place / "last_run").open("a+", encoding="utf-8") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise UnsupportedFeature(f"another call uses {place}: wait for its end, or name another --folder") from None
        file.seek(0)
        number, attempt = (int(word) for word in (file.read() or "0 0").split())
        if rerun and not number:
            raise UnsupportedFeature(f"there is no run in {place} that --rerun could repeat")
        # Nothing is written into the folder of an earlier run, even if the file is lost.
        kept = [int(folder.name.split("-")[1]) for folder in place.glob("run-[0-9]*")]
        run = Run(number, attempt + 1) if rerun else Run(max(number, *kept, 0) + 1, 1)
        file.truncate(0)
        file.write(f"{run.number} {run.attempt}\n")
        file.flush()
        yield run


def lines(result: WorkflowResult, run: Path) -> Iterator[str]:
    """Yield jobs with their steps, annotations, reports, and the places of logs, summaries and artifacts."""
    for name, job in result.jobs.items():
        yield f"job {name}: {job.result}"
        yield from (f"  {step.outcome:9} {step.name}" for step in job.steps)
        if job.result == "failure" and not job.annotations:
            yield from ("", job.log.rstrip(), "")
        yield from (described(annotation) for annotation in job.annotations)
        # The first line of a summary is its verdict.
        yield from (line.lstrip("# ") for line in job.summary.splitlines()[:1])
    for report in result.reports:
        yield f"{report.reporter}: {report.tests} tests, {report.failures} failures, {report.errors} errors"
    yield from (f"file: {path}" for path in sorted(run.glob("*.*")))
    yield from (f"artifact: {path}" for path in sorted(result.artifacts.glob("*")))
    yield f"conclusion: {result.conclusion}"


def described(annotation: Annotation) -> str:
    """Return an annotation as one line: level, place, message."""
    place = "" if annotation.file is None else f" {annotation.file}:{annotation.line or 1}"
    return f"{annotation.level}{place}: {annotation.message}"


if __name__ == "__main__":
    main(prog_name="python -m tests.integration.github")
