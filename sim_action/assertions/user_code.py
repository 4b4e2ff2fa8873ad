"""`assertion: checks/stays_level.py:StaysLevel`: a class of the user's."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from pydantic import Field, model_validator

from sim_action.assertions import Assertion, Monitor
from sim_action.core.field_types import NamesFile
from sim_action.core.messages import did_you_mean, shown
from sim_action.core.user_scripts import ANYTHING, ScriptProblem, read_script
from sim_action.core.workspace import PathError, Workspace
from sim_action.core.yaml_errors import SpecProblems
from sim_action.state.trace_channels import Channels
from sim_action.state.verdict import Signal
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.observation import Observation
    from sim_action.state.trace import Trace


class UserAssertion(Assertion):
    """A class of yours judges the run: `assertion: checks/stays_level.py:StaysLevel`.

    It is made with the settings below `with`. Its one method `judge(self, trace)` is given a `sim_action.Trace`
    of every physics step so far, as numpy columns (`time`, `base_position_xyz`, `speed`, `tilt`,
    `joint_position`, `contacts`, ...) that cannot be written to. It returns a `sim_action.Verdict(passed,
    measured, limit, margin, unit, time, message)`, of which all but `passed` may be left out. It may be called
    for any length of the same run, in any order: it must depend on the trace and the settings alone.

    The class attribute `kind` says when it is asked. "end", which it is when left out: once, when the run is
    over. "invariant": every half second of sim time, too, and the run ends when it has not passed. "goal": as
    often, and the run waits until it has passed. It is a script: refused where scripts are, and in a process of
    its own.
    """

    key: ClassVar[str] = "assertion"
    bare_value: ClassVar[str | None] = "class"
    runs_user_code: ClassVar[bool] = True

    path: Annotated[
        str,
        NamesFile(),
        Field(alias="class", pattern=r"^[^:].*:[^\W\d]\w*$", description="FILE.py:CLASS; may stand alone"),
    ]
    settings: Annotated[
        Mapping[str, Any], Field(alias="with", description="what the class is made with; numbers without units")
    ] = {}

    @model_validator(mode="before")
    @classmethod
    def _takes_path_alone(cls, data: Any) -> Any:
        if isinstance(data, str):
            data = {"class": data}
        path = data.get("class") if isinstance(data, dict) else None
        if isinstance(path, str) and not all(path.rpartition(":")[::2]):
            raise ValueError(
                f"expected a file and a class, such as checks/stays_level.py:StaysLevel, found {shown(path)}"
            )
        return data

    @property
    def file(self) -> str:
        """Path of the Python file, from the scenario."""
        return self.path.rpartition(":")[0]

    @property
    def python_file(self) -> str:
        """See Assertion.python_file."""
        return self.file

    @property
    def class_name(self) -> str:
        """The class in that file."""
        return self.path.rpartition(":")[2]

    @property
    def reads_file(self) -> bool:
        """See Assertion.reads_file."""
        return True

    @property
    def channels(self) -> Channels:
        """See Assertion.channels: what a stranger's class looks at cannot be known before it runs."""
        return Channels(contacts=True)

    @property
    def title(self) -> str:
        """See Assertion.title."""
        return f"{self.key} {self.class_name}"

    def file_problems(self, workspace: Workspace) -> SpecProblems:
        """A file that is not there, is no Python, or has no such class. Reads it; does not run it."""
        try:
            script = read_script(workspace.file(self.file))
        except PathError as error:
            yield (), str(error)
        except OSError as error:
            yield (), f"{self.file}: cannot be read: {error.strerror}"
        except ScriptProblem as error:
            yield (), f"{self.file}{error}"
        else:
            if self.class_name not in script.names and ANYTHING not in script.names:
                hint = did_you_mean(self.class_name, [found.name for found in script.classes] or script.names)
                yield (), f"{self.file} defines no class '{self.class_name}'{hint}"

    def signals(
        self, scene: Scene, start: Observation, trace: Trace, after: float = 0.0, before: float = math.inf
    ) -> tuple[Signal, ...]:
        """None: nobody knows what it looks at, and to ask would run it again."""
        return ()

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor. Raises ScriptError."""
        from sim_action.assertions.user_monitor import UserMonitor

        return UserMonitor.opened(scene.workspace.file(self.file), self.class_name, self.settings)
