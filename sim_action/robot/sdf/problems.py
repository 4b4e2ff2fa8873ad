"""What is wrong or odd about an SDF, found while it is converted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar
from xml.etree.ElementTree import Element

from sim_action.core.errors import Location
from sim_action.robot.findings import finding
from sim_action.robot.robot_model import Finding

Subject = TypeVar("Subject")
Result = TypeVar("Result")


class SdfProblem(Exception):
    """A rule of the audit that an element breaks, and that leaves nothing to go on with."""

    def __init__(self, rule: str, element: Element, message: str) -> None:
        self.rule = rule
        self.element = element
        super().__init__(message)


@dataclass
class Notes:
    """What was found so far.

    Attributes:
        places: where each element of all files was written.
    """

    places: dict[Element, Location] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)
    _told: set[SdfProblem] = field(default_factory=set)

    @property
    def hopeless(self) -> bool:
        """Whether there can be no robot."""
        return any(finding.level == "fatal" for finding in self.findings)

    def tell(self, rule: str, element: Element, message: str) -> None:
        """Notes a finding."""
        self.findings.append(finding(rule, message, self.places[element]))

    def attempt(self, step: Callable[[Subject], Result], subject: Subject) -> Result | None:
        """What a step makes of something; what makes it impossible is noted once, and the next one may find more."""
        try:
            return step(subject)
        except SdfProblem as problem:
            if problem not in self._told:
                self._told.add(problem)
                self.tell(problem.rule, problem.element, str(problem))
            return None
