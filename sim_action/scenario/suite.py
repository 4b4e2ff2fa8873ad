"""What the command line names: files, numbers of scenarios in some of them, and which of all these are meant."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from sim_action.core.discovery import file_name
from sim_action.core.errors import UsageError
from sim_action.core.messages import escaped_line
from sim_action.core.workspace import Permissions
from sim_action.scenario.files import read_file
from sim_action.scenario.numbering import numbered
from sim_action.scenario.selection import Scenarios, Selection, selected
from sim_action.scenario.source import Refused, Source


@dataclass(frozen=True, slots=True)
class Suite:
    """Scenarios, before anybody has read them.

    Attributes:
        files: in order.
        empty: what was named but holds no scenario.
        numbers: of a file of which only some scenarios are meant, their numbers, by what reports call it.
        selection: which are meant of those.
    """

    files: Sequence[Path]
    empty: Sequence[str] = ()
    numbers: Mapping[str, frozenset[int]] = field(default_factory=dict)
    selection: Selection = field(default_factory=Selection)

    def read(self, permissions: Permissions, seed: int | None = None) -> dict[Path, Scenarios]:
        """What is selected of each file, whatever its number; only files of which something is. Raises UsageError.

        `seed`: of what variations draw; None: as each scenario says.
        """
        every = [self._scenarios(path, permissions, seed) for path in self.files]
        chosen = zip(self.files, selected(every, self.selection), strict=True)
        return {path: scenarios for path, scenarios in chosen if scenarios}

    def numbered(self, scenario: Source | Refused) -> bool:
        """Whether a scenario is meant by its number."""
        file = scenario.file if isinstance(scenario, Refused) else scenario.document.file
        return file not in self.numbers or scenario.number in self.numbers[file]

    def scenarios(self, permissions: Permissions) -> list[Source | Refused]:
        """All that is meant. Raises UsageError."""
        return [each for several in self.read(permissions).values() for each in several if self.numbered(each)]

    def _scenarios(self, path: Path, permissions: Permissions, seed: int | None) -> Scenarios:
        scenarios = read_file(path, permissions, seed)
        name = file_name(path)
        beyond = [number for number in self.numbers.get(name, ()) if not 1 <= number <= len(scenarios)]
        if beyond:
            raise UsageError(escaped_line(f"{numbered(name, beyond)}: the file holds {len(scenarios)}, counted from 1"))
        return scenarios
