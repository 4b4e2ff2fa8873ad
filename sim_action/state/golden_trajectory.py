"""Golden trajectories: the poses of a robot over sim time, in a small text file that people read, commit and compare.

The first line is a comment with the version of the format and the name of the robot. The second line names the columns
with their units. Values are rounded, so that runs without a visible difference give the same file.

Scenarios are checked without numpy: it is imported where numbers are computed.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final, NoReturn, Self

from sim_action.core.files import read_at_most, whole_file
from sim_action.core.lazy_numpy import FloatArray, np
from sim_action.core.records import dataclass
from sim_action.core.wording import escaped_line, shown
from sim_action.state.trace import Trace

RESOLUTION: Final = 1e-4  # the resolution of values, in m and rad
TITLE: Final = "# sim-action golden trajectory "
"""The beginning of the first line; the version of the format and the robot follow."""

VERSION: Final = "1"
_FORCED: Final = "; forced although "
_BASE: Final = ("time_s", "x_m", "y_m", "z_m", "yaw_rad")


class GoldenError(ValueError):
    """A file that is not a golden trajectory of this robot; the message begins with a line number."""


@dataclass(frozen=True, slots=True)
class GoldenForm:
    """The header of a golden trajectory: the name of the robot, and the recorded joints with their units."""

    robot: str
    joints: tuple[tuple[str, str], ...] = ()

    @property
    def columns(self) -> tuple[str, ...]:
        """The names of the columns, such as time_s, x_m, ..., elbow_rad."""
        return (*_BASE, *(f"{name}_{unit}" for name, unit in self.joints))

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The names of the joints, in the order of their columns."""
        return tuple(name for name, _ in self.joints)

    @property
    def title(self) -> str:
        """The first line of a file."""
        return f"{TITLE}{VERSION}: {escaped_line(self.robot)}"


_DECIMALS: Final = 4
_TIME_DECIMALS: Final = 3
_MAX_BYTES: Final = 20_000_000


@dataclass(frozen=True, eq=False)
class Golden:
    """A golden trajectory."""

    form: GoldenForm
    # (T, 5 + J) time in s, rising; x, y, z in m and yaw in rad of the base link, in the world frame; positions of
    # joints in rad, or m
    rows: FloatArray
    forced: str = ""  # why the run did not pass from which it was written all the same; empty for a run that passed

    @property
    def time(self) -> FloatArray:
        """The sim times of the rows, (T,) s."""
        return self.rows[:, 0]

    @classmethod
    def of_trace(cls, form: GoldenForm, trace: Trace, rate: float) -> Self:
        """Return the trajectory of a run, from its first to its last moment; `rate`: rows per second, in Hz."""
        rows = rows_of(trace, form.joint_names)
        resolution = 10.0**-_TIME_DECIMALS
        first = math.ceil(rows[0, 0] / resolution - resolution) * resolution
        last = max(first, math.floor(rows[-1, 0] / resolution + resolution) * resolution)
        ticks = np.arange(math.ceil(first * rate), math.floor(last * rate) + 1) / rate
        times: FloatArray = np.unique(np.concatenate(([first], ticks, [last])).round(_TIME_DECIMALS))
        sampled = interpolated(rows, times)
        # Yaw without jumps from pi to -pi; a start at either of them becomes pi.
        turned = np.unwrap(sampled[:, 4])
        sampled[:, 4] = turned + 2 * np.pi if turned[0] < -np.pi + 10 * RESOLUTION else turned
        # Rounding can give -0.0; adding 0.0 removes the sign.
        return cls(form, np.column_stack((times, np.round(sampled[:, 1:], _DECIMALS) + 0.0)))

    @classmethod
    def read(cls, path: Path, form: GoldenForm) -> Self:
        """Read a file. Raise OSError, and GoldenError for a file that is damaged or of another robot."""
        data = read_at_most(path, _MAX_BYTES)
        if data is None:
            raise GoldenError(f"1: the file is larger than {_MAX_BYTES // 1_000_000} MB, the maximum")
        lines = data.decode("utf-8-sig", errors="replace").splitlines()
        _check_title(lines[0] if lines else "", form)
        return cls(form, np.array(list(_read_rows(lines, form)), dtype=np.float64))

    def text(self) -> str:
        """Return the content of the file."""
        written = io.StringIO()
        remark = f"{_FORCED}{escaped_line(self.forced)}" if self.forced else ""
        written.write(f"{self.form.title}{remark}\n")
        writer = csv.writer(written, lineterminator="\n")
        writer.writerow(self.form.columns)
        for time, *values in self.rows.tolist():
            writer.writerow((f"{time:.{_TIME_DECIMALS}f}", *(f"{value:.{_DECIMALS}f}" for value in values)))
        return written.getvalue()

    def write(self, path: Path) -> bool:
        """Write the file and its folders; return True if its content changed. Raise OSError, ValueError."""
        data = self.text().encode()
        if len(data) > _MAX_BYTES:
            raise ValueError(f"the file would be larger than {_MAX_BYTES // 1_000_000} MB; use a lower 'rate'")
        if path.is_file() and path.read_bytes() == data:
            return False
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as file:
            file.write(data)
        return True


def is_golden(start: bytes) -> bool:
    """Return True if a file with this beginning is a golden trajectory, of any version and robot."""
    return start.decode("utf-8-sig", errors="replace").startswith(TITLE)


def rows_of(trace: Trace, joints: Sequence[str]) -> FloatArray:
    """Return the rows (T, 5 + J) of a golden trajectory for all moments of a trace; yaw in (-pi, pi]."""
    columns = [trace.joint_position[:, trace.joint_names.index(name)] for name in joints]
    return np.column_stack((trace.time, trace.base_position_xyz, trace.yaw, *columns))


def interpolated(rows: FloatArray, times: FloatArray) -> FloatArray:
    """Return rows (N, 5 + J) at N times: linear, yaw on the short way; constant before the first and after the last."""
    after = np.clip(np.searchsorted(rows[:, 0], times), 0, len(rows) - 1)
    before = np.maximum(after - 1, 0)
    step = rows[after] - rows[before]
    step[:, 4] = wrapped(step[:, 4])
    # A time that equals a row's time gives exactly that row.
    lead = np.divide(times - rows[after, 0], step[:, 0], out=np.zeros(len(times)), where=step[:, 0] > 0)
    rows_at_times = rows[after] + np.minimum(lead, 0.0)[:, None] * step
    rows_at_times[:, 0] = times
    return np.asarray(rows_at_times, dtype=np.float64)


def wrapped(angle: FloatArray) -> FloatArray:
    """Return angles in rad, wrapped to [-pi, pi)."""
    return np.asarray(np.remainder(angle + np.pi, 2 * np.pi) - np.pi, dtype=np.float64)


def _check_title(line: str, form: GoldenForm) -> None:
    if not line.startswith(TITLE):
        _refuse(1, f"expected '{form.title}', found {shown(line)}")
    version, _, robot = line.removeprefix(TITLE).partition(": ")
    if version != VERSION:
        _refuse(1, f"the file has format version {shown(version)}; this sim-action reads version {VERSION}")
    name = escaped_line(form.robot)
    if robot != name and not robot.startswith(f"{name}{_FORCED}"):
        _refuse(1, f"the file belongs to the robot {shown(robot)}; the robot of this scenario is {shown(form.robot)}")


def _read_rows(lines: Sequence[str], form: GoldenForm) -> Iterator[tuple[float, ...]]:
    table = csv.reader(lines[1:])
    try:
        columns = tuple(next(table, ()))
        if columns != form.columns:
            _refuse(2, f"expected the columns {','.join(form.columns)}, found {shown(','.join(columns))}")
        earlier = -math.inf
        for row in table:
            numbers = _numbers(row, len(columns), table.line_num + 1)
            if not numbers[0] > earlier:
                _refuse(table.line_num + 1, f"the time {row[0]} s is not later than in the line before")
            earlier = numbers[0]
            yield numbers
    except csv.Error as error:
        _refuse(table.line_num + 1, str(error))
    if earlier == -math.inf:
        _refuse(3, "expected a row of numbers, found the end of the file")


def _numbers(row: Sequence[str], count: int, line: int) -> tuple[float, ...]:
    if len(row) != count:
        _refuse(line, f"expected {count} numbers, found {len(row)}")
    try:
        numbers = tuple(map(float, row))
    except ValueError:
        numbers = (math.nan,)
    if not all(map(math.isfinite, numbers)):
        _refuse(line, f"expected {count} numbers, found {shown(','.join(row))}")
    return numbers


def _refuse(line: int, message: str) -> NoReturn:
    raise GoldenError(f"{line}: {message}")
