"""The refusal of a scenario of which some variations are invalid: its problems, each once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from collections.abc import Set as AbstractSet

from sim_action.core.errors import InternalError, InvalidScenario, Location, Problem
from sim_action.core.records import replace
from sim_action.core.wording import counted
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.source import Refused, Source


def together(
    sources: Sequence[Source | Refused], scenarios: Sequence[LoadedScenario | Refused]
) -> Sequence[LoadedScenario | Refused]:
    """Return all variations of a scenario of which some are refused; all are, unless only drawn values are wrong."""
    refused = [scenario for scenario in scenarios if isinstance(scenario, Refused)]
    alike = len(scenarios) == len(refused) > 1 and len({scenario.problems for scenario in refused}) == 1
    pairs = list(zip(sources, scenarios, strict=True))
    if refused and not alike and any(each.gate is not None for each in sources):
        # A gate without some of its runs has no verdict, so none of them is worth its time.
        told = [_told(source, each) for source, each in pairs if isinstance(each, Refused)]
        drawn = {place for source in sources if isinstance(source, Source) for place, _ in source.draws}
        return [_of_samples(_as_one(told, sources[0].number), told, drawn, len(sources))]
    if alike or any(isinstance(scenario, Refused) and not _is_of_draws(source, scenario) for source, scenario in pairs):
        return [_as_one(refused, sources[0].number)]
    return [
        source.refused_alone(scenario) if isinstance(source, Source) and isinstance(scenario, Refused) else scenario
        for source, scenario in pairs
    ]


def _told(source: Source | Refused, refused: Refused) -> Refused:
    """Return a refusal, with advice for values that were drawn."""
    if not isinstance(source, Source) or not source.is_of_draws(refused):
        return refused
    told = source.refused_alone(refused)
    return replace(told, name=refused.name, group=None, variation=(), gate=None)


def _of_samples(whole: Refused, refused: Sequence[Refused], drawn: AbstractSet[Location], samples: int) -> Refused:
    """Return a refusal with one problem for each drawn value: the first one, and the number of samples that have one.

    Args:
        whole: with all problems.
        refused: the samples that cannot run.
        drawn: the places of drawn values.
        samples: the number of samples.
    """
    if isinstance(whole.error, InternalError):
        return whole
    counts = Counter(place for each in refused for place in {problem.location for problem in each.problems} & drawn)
    found: dict[object, Problem] = {}
    for problem in whole.problems:
        place = problem.location
        if place not in drawn:
            found[problem] = problem
        elif place not in found:
            text = f"{problem.message}; {counts[place]:,} of {counted(samples, 'sample')} have a problem here"
            found[place] = Problem(place, text)
    return replace(whole, error=InvalidScenario(found.values()))


def _is_of_draws(source: Source | Refused, refused: Refused) -> bool:
    return isinstance(source, Source) and source.is_of_draws(refused)


def _as_one(refused: Sequence[Refused], number: int) -> Refused:
    """Return one refusal with the problems of all variations, each once.

    A fault of sim-action is reported alone, as it may hide other problems. `number` is that of the first variation,
    where the refusal is reported.
    """
    if fault := next((each for each in refused if isinstance(each.error, InternalError)), None):
        return replace(fault, number=number)
    told: list[Problem] = []
    known: set[str] = set()
    for each in refused:
        told += [problem for problem in each.problems if problem.message not in known]
        known.update(problem.message for problem in each.problems)
    return replace(refused[0], error=InvalidScenario(told), number=number)
