"""CSV files of commands: those of other tools, and those that cannot be replayed."""

from __future__ import annotations

import io
import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.commands.logs import Content, JointColumn, csv_table
from sim_action.commands.logs.csv_table import MAX_BYTES, MAX_COLUMNS, Header, HeaderError, Table
from sim_action.core.errors import RecordingError
from sim_action.core.geometry import Twist
from tests.soak import examples

TimedContent = tuple[float, Content]


def test_a_header_is_of_twists_or_of_joints_whose_names_may_have_dots() -> None:
    header = Header.of(["time", "angular"])
    assert header.holds_twists
    assert not header.joint_names
    header = Header.of(["position.arm.elbow", "time", "velocity.wheel"])
    assert not header.holds_twists
    assert header.joint_names == {"arm.elbow", "wheel"}
    columns = [column.meaning for column in header.used]
    assert columns == [JointColumn("position", "arm.elbow"), JointColumn("velocity", "wheel")]


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (["time", "linaer"], "unknown column 'linaer'; did you mean 'linear'?"),
        (["time", "linear", "position."], "unknown column 'position.'"),
        (["time", "linear", "linear"], "2 columns have the name 'linear'"),
        (["time;linear;angular"], "separate columns by commas"),
        (["linear"], "the column 'time' is missing"),
        (["time"], "there is no command column besides 'time' (allowed: angular, effort.<joint>"),
        (["time", "linear", "position.a"], "'linear' commands the base, 'position.a' a joint"),
        (["time", *(f"position.{n}" for n in range(MAX_COLUMNS))], "1,001 columns; at most 1,000"),
    ],
)
def test_a_header_that_tells_nothing_to_replay_is_refused(columns: list[str], message: str) -> None:
    with pytest.raises(HeaderError) as raised:
        Header.of(columns)
    assert message in str(raised.value)


def log(folder: Path, text: str | bytes) -> Path:
    path = folder / "monday.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def moments(folder: Path, text: str | bytes) -> list[TimedContent]:
    return since_first(Table(log(folder, text), "logs/monday.csv"))


def since_first(table: Table) -> list[TimedContent]:
    rows = table.read().rows
    return [((time_ns - rows[0][0]) / 1e9, content) for time_ns, content in rows]


def refusal(folder: Path, text: str | bytes) -> str:
    with pytest.raises(RecordingError) as raised:
        moments(folder, text)
    return str(raised.value)


def test_rows_become_commands_at_times_since_the_first(tmp_path: Path) -> None:
    assert moments(tmp_path, "time,linear,lateral,angular\n10,1,2,3\n10.5,-.5,+0,1e-1\n") == [
        (0.0, Twist.planar(1.0, 3.0, lateral=2.0)),
        (0.5, Twist.planar(-0.5, 0.1)),
    ]
    text = "time,effort.elbow,velocity.wheel,position.elbow\n0,9,2,1\n"
    row = {("effort", "elbow"): 9.0, ("velocity", "wheel"): 2.0, ("position", "elbow"): 1.0}
    assert moments(tmp_path, text) == [(0.0, row)]
    assert moments(tmp_path, "angular,time\n2,0\n") == [(0.0, Twist.planar(0.0, 2.0))]
    assert moments(tmp_path, "time,linear\n0,1\n0,2\n") == [(0.0, Twist.planar(1.0)), (0.0, Twist.planar(2.0))]
    # A joint without a number is left out of its row.
    rows = moments(tmp_path, "time,position.a,position.b\n0,1,\n1,nan,2\n2,,\n")
    assert rows == [(0.0, {("position", "a"): 1.0}), (1.0, {("position", "b"): 2.0})]


def test_what_editors_and_spreadsheets_add_is_no_matter(tmp_path: Path) -> None:
    text = b'\xef\xbb\xbf time , linear \r\n\r\n "0" , "1.5"\r\n'.replace(b' "', b'"').replace(b'" ', b'"')
    assert moments(tmp_path, text) == [(0.0, Twist.planar(1.5))]


def test_large_numbers_and_times_keep_their_digits(tmp_path: Path) -> None:
    text = "time,linear,angular\n0,1.7e308,1.7e308\n"
    assert moments(tmp_path, text) == [(0.0, Twist.planar(1.7e308, 1.7e308))]
    text = "time,linear\n1700000000.123456789,0\n1700000000.223456789,0\n"
    assert [time for time, _ in moments(tmp_path, text)] == [0.0, 0.1]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "logs/monday.csv: the file is empty"),
        ("\n\n", "logs/monday.csv: the file is empty"),
        ("\ntime,linaer\n", "logs/monday.csv:2: unknown column 'linaer'; did you mean 'linear'?"),
        ("time,linear\n", "logs/monday.csv: there is no row after the header"),
        ("time,linear\n0,1\n\n1,fast\n", "logs/monday.csv:4: column 'linear': expected a finite number, found 'fast'"),
        ("time,linear\n0,nan\n", "logs/monday.csv: no row has a number in the columns of commands"),
        ("time,linear\n0,1e999\n", "expected a finite number, found '1e999'"),
        ("time,linear\ninf,1\n", "column 'time': expected a finite number, found 'inf'"),
        ("time,linear,angular\n0,,1\n", "column 'linear': expected a finite number, found ''"),
        ('time,linear\n0,"1,2"\n', "column 'linear': expected a finite number, found '1,2'"),
        ("time,linear\n0,1_0\n", "column 'linear': expected a finite number, found '1_0'"),
        ("time,linear\n0,٣\n", "column 'linear': expected a finite number"),
        (f"time,linear\n0,{'9' * 50_000}\n", "column 'linear': expected a finite number"),
        ("time,linear\n0,1\n2,1\n1.5,1\n", "logs/monday.csv:4: column 'time': '1.5' is earlier than the previous row,"),
        ("time,linear\n0,1,2\n", "logs/monday.csv:2: 3 cells, but the header has 2 columns"),
        ('time,linear\n0,"1\n', "logs/monday.csv:2: not valid CSV"),
        (f"time,{'x' * 200_000}\n", "not valid CSV: field larger than field limit"),
        (b"time,linear\n0,\xff\n", "logs/monday.csv: not UTF-8 text"),
        (b"time,linear\n0,1\x00\n", "logs/monday.csv:2:"),
        ("time,linear\n0,\x1b[31m1\n", r"found '\x1b[31m1'"),
    ],
)
def test_a_log_that_cannot_be_replayed_is_told_with_its_place(text: str | bytes, message: str, tmp_path: Path) -> None:
    found = refusal(tmp_path, text)
    assert message in found
    assert found.isprintable()
    assert len(found) < 2_500


def test_a_gigantic_file_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "monday.csv"
    with path.open("wb") as file:
        file.write(b"time,linear\n0,1\n")
        file.truncate(MAX_BYTES * 1_000)
    with pytest.raises(RecordingError, match="the file has 25000 MB; at most 25 MB of CSV are allowed"):
        Table(path, "monday.csv").header()


def test_more_rows_than_any_log_has_are_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(csv_table, "MAX_ROWS", 3)
    assert len(moments(tmp_path, "time,linear\n" + "0,0\n" * 3)) == 3
    assert refusal(tmp_path, "time,linear\n" + "0,0\n" * 4).startswith(
        "logs/monday.csv:5: the log has more than 3 rows"
    )


def test_what_is_no_file_holds_nobody_up(tmp_path: Path) -> None:
    pipe = tmp_path / "monday.csv"
    os.mkfifo(pipe)
    with pytest.raises(RecordingError, match=r"monday\.csv: the file cannot be read: it is not a regular file"):
        Table(pipe, "monday.csv").header()


NUMBERS = st.floats(-1e6, 1e6)
ROWS = st.lists(st.tuples(st.floats(0, 1e6), NUMBERS, NUMBERS), min_size=1).map(sorted)


@given(ROWS)
def test_what_is_written_is_what_is_read(rows: list[tuple[float, float, float]]) -> None:
    text = "time,linear,angular\n" + "".join(f"{time!r},{linear!r},{angular!r}\n" for time, linear, angular in rows)
    found = list(in_memory(text.encode()))
    assert [command for _, command in found] == [Twist.planar(linear, angular) for _, linear, angular in rows]
    assert [time for time, _ in found] == pytest.approx([time - rows[0][0] for time, _, _ in rows], abs=1e-6)


@st.composite
def files(draw: st.DrawFn) -> bytes:
    """Return anything, or a log in which a few characters may be missing, or others."""
    if draw(st.sampled_from((True, False, False))):
        return draw(st.binary() | st.text(alphabet="time,linear0123456789.-+eE\n\"' ;").map(str.encode))
    rows = draw(st.lists(st.tuples(st.integers(0, 9), st.integers(-9, 9)), min_size=1, max_size=5).map(sorted))
    text = "time,linear\n" + "".join(f"{time},{linear}\n" for time, linear in rows)
    start = draw(st.integers(0, len(text)))
    end = start + draw(st.sampled_from((0, 0, 1, 5)))
    return (text[:start] + draw(st.sampled_from(("", "", "0", "-", ".5", "\n", '"', " ", ","))) + text[end:]).encode()


@examples(100)
@given(files())
def test_whatever_a_file_holds_it_is_a_log_or_an_error_for_people(data: bytes) -> None:
    try:
        found = list(in_memory(data))
    except RecordingError as error:
        assert str(error).startswith("any.csv")  # noqa: PT017 - either is right
    else:
        assert found


def in_memory(data: bytes) -> list[TimedContent]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(csv_table, "open_regular", lambda *_, **__: io.BytesIO(data))
        return since_first(Table(Path("any.csv"), "any.csv"))


JOINTS = {("position", "elbow"): 0.5, ("velocity", "elbow"): -1.0}
OTHER_TOOLS = {
    "plotjuggler": ("__time,/battery/voltage,/cmd_vel/angular/z,/cmd_vel/linear/x\n1.5,24,0.5,0.2\n2,24,,\n", "twist"),
    "plotjuggler, stamped": ("__time,/cmd_vel/twist/linear/x,/cmd_vel/twist/angular/z\n1.5,0.2,0.5\n", "twist"),
    "plotjuggler, joints": ("__time,/joint_states/elbow/position,/joint_states/elbow/velocity\n1.5,0.5,-1\n", "joints"),
    "rostopic": ("%time,field.linear.x,field.linear.y,field.angular.z\n1500000000,0.2,0.0,0.5\n", "twist"),
    "rostopic, stamped": (
        "%time,field.header.seq,field.header.frame_id,field.twist.linear.x,field.twist.angular.z\n1500000000,3,b,0.2,0.5\n",
        "twist",
    ),
    "rostopic, joints": ("%time,field.name0,field.position0,field.velocity0\n1500000000,elbow,0.5,-1\n", "joints"),
    "pandas, with its index": (",time,linear,angular\n0,1.5,0.2,0.5\n", "twist"),
    "pandas, dates": (",linear,angular\n1970-01-01 00:00:01.500000,0.2,0.5\n", "twist"),
    "bagpy": ("Time,linear.x,linear.y,linear.z,angular.x,angular.y,angular.z\n1.5,0.2,0,0,0,0,0.5\n", "twist"),
    "recording": ("time [s],x [m],position of elbow [rad],velocity of elbow [rad/s]\n1.5,9,0.5,-1\n", "joints"),
    "units": ("time [ms],linear [cm/s],angular [deg/s]\n1500,20,28.64788975654116\n", "twist"),
}


@pytest.mark.parametrize("tool", OTHER_TOOLS)
def test_files_of_other_tools_are_read(tool: str, tmp_path: Path) -> None:
    text, kind = OTHER_TOOLS[tool]
    recorded = Table(log(tmp_path, text), "log.csv").read()
    ((time_ns, content),) = recorded.rows
    assert time_ns == 1_500_000_000
    if kind == "joints":
        assert content == JOINTS
    else:
        assert isinstance(content, Twist)
        assert (content.linear_xyz[0], content.angular_xyz[2]) == pytest.approx((0.2, 0.5))


def test_columns_are_named_with_their_units_and_others_are_ignored(tmp_path: Path) -> None:
    path = log(tmp_path, "stamp,v,yaw rate [deg/s],note\n1000000,36,0,fast\n2000000,,0,\n".replace(",,", ",72,"))
    columns = {"time": "stamp [us]", "linear": "v [km/h]", "angular": "yaw rate"}
    recorded = Table(path, "log.csv", columns).read()
    assert [time_ns for time_ns, _ in recorded.rows] == [1_000_000_000, 2_000_000_000]
    assert [content.linear_xyz[0] for _, content in recorded.rows] == [10.0, 20.0]  # type: ignore[union-attr]
    assert recorded.notes == ()


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"time": "stamp", "linear": "speed"}, "there is no column 'speed'"),
        ({"linear": "v"}, "the column 'time' is missing"),
        ({"time": "stamp", "liner": "v"}, "unknown meaning 'liner'; did you mean 'linear'?"),
        ({"time": "stamp", "linear": "v [deg]"}, "the unit 'deg' does not fit"),
    ],
)
def test_columns_that_do_not_fit_are_refused(columns: dict[str, str], message: str) -> None:
    with pytest.raises(HeaderError) as raised:
        Header.of(["stamp", "v"], columns)
    assert message in str(raised.value)


def test_one_of_several_topics_is_selected(tmp_path: Path) -> None:
    path = log(tmp_path, "__time,/a/linear/x,/b/linear/x\n0,1,2\n")
    assert since_first(Table(path, "log.csv", topic="/b")) == [(0.0, Twist.planar(2.0))]
    with pytest.raises(RecordingError, match="several topics: /a, /b; select one with 'topic'"):
        Table(path, "log.csv").read()


@pytest.mark.parametrize(
    ("times", "message"),
    [
        (["1700000000000000000", "1700000005000000000"], "would last 158 years; if its times are in ns, state it"),
        (["1700000000000", "1700000005000"], "if its times are in ms, state it: columns: {time: 'time [ms]', ...}"),
        (["0", "5000000000"], "in ns"),
        ([str(20 * n) for n in range(250)], "would last 4,980 s; if its times are in ms"),
        ([f"45000.{n:09}" for n in range(0, 9000, 1000)], "would last 8e-06 s; are its times in days?"),
        # 10 Hz for 5 minutes
        ([f"{45000 + n / 864_000:.9f}" for n in range(3_000)], "would last 0.00347106 s; are its times in days?"),
    ],
)
def test_times_in_another_unit_are_refused(times: list[str], message: str, tmp_path: Path) -> None:
    text = "time,linear\n" + "".join(f"{time},1\n" for time in times)
    assert message in refusal(tmp_path, text)
    assert len(moments(tmp_path, text.replace("time,", "time [ns],"))) == len(times)
