"""The sensors of a run: each is read at its own rate, for controllers, assertions and the trace."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping

from sim_action.core.errors import ScriptError
from sim_action.core.records import dataclass, field, replace
from sim_action.core.wording import shown
from sim_action.drives import recognise
from sim_action.engines.engine import RobotQueries
from sim_action.scenario.model import Scenario
from sim_action.scenario.mutation import UNTOUCHED, Seams
from sim_action.sensors import Measure, Mount, MountedSensor, ReadingLog, Sensor, Sight
from sim_action.state.observation import ByName, Observation
from sim_action.state.readings import Reading, WheelMotion
from sim_action.state.timeline import TimeMark
from sim_action.state.trace import Trace
from sim_action.state.trace_records import SensorRecord
from sim_action.state.transmission import Line
from sim_action.world.scene import Scene


@dataclass(slots=True)
class _Running:
    """A sensor during the run."""

    mounted: MountedSensor
    measure: Measure
    period: int  # physics steps between two readings
    line: Line[Reading] | None = None  # the readings that are on their way; None if all arrive at once
    kept: list[Reading] = field(default_factory=list)  # readings that are not yet in the trace
    log: ReadingLog | None = None  # the readings for the replay; None if there is none


class Sensing:
    """The open sensors of a scenario, and the observations of controllers."""

    def __init__(
        self,
        scenario: Scenario,
        scene: Scene,
        backend: RobotQueries,
        *,
        heard: bool,
        judged: Collection[str] = (),
        more: Iterable[MountedSensor] = (),
        seams: Seams = UNTOUCHED,
        logs: dict[str, ReadingLog] | None = None,
    ) -> None:
        """Open the sensors that are needed.

        `heard`: True if a controller reads sensors; `judged`: the names of sensors that assertions read; `more`:
        sensors of controllers besides the scenario's sensors; `logs`: gets a log of each open sensor by name.
        """
        self._backend, self._rate, self._is_heard = backend, scenario.physics.rate, heard
        self._judged, self._seams = judged, seams
        self._readings: dict[str, Reading] = {}
        self._sensors = [
            _open(mounted, scenario, scene, seams)
            for mounted in (*scenario.sensors, *more)
            if heard or self._keeps(mounted)
        ]
        if logs is not None:
            for running in self._sensors:
                running.log = logs[running.mounted.name] = ReadingLog.of(running.mounted)
        self._late = [(running, running.line) for running in self._sensors if running.line is not None]
        self._contacts = heard or any(running.mounted.sensor.watches_contacts for running in self._sensors)

    def look(self, step: int) -> Observation:
        """Return the present observation, with the latest reading of each sensor that has arrived."""
        self._receive(step)
        observation = self._backend.observe(step, contacts=self._contacts)
        return replace(observation, sensors=ByName(self._readings)) if self._readings else observation

    def time_marks(self) -> Iterator[TimeMark]:
        """Yield the marks of the first readings that were lost."""
        for running, line in self._late:
            yield from line.time_marks(f"sensor '{running.mounted.name}'")

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on lost readings, and on delays without an effect, for people."""
        lossy = ((running.mounted.name, line) for running, line in self._late if line.lost)
        lost = (f"{line.lost} of {line.sent} readings of sensor '{name}' were lost" for name, line in lossy)
        if self._is_heard:
            return tuple(lost)
        sent = ((running.mounted.name, running.mounted.transmission) for running, _ in self._late)
        delayed = (name for name, keys in sent if keys.latency or keys.jitter)
        return (*lost, *(f"sensor '{name}' has a delay, but no controller reads sensors" for name in delayed))

    def next_tick(self, step: int, end: int) -> int:
        """Return the next step at which a sensor is read, or `end` if that is earlier."""
        # Called at every tick.
        if not self._sensors:
            return end
        return min([end, *(step - step % running.period + running.period for running in self._sensors)])

    def read(self, step: int) -> None:
        """Read the sensors that are due at this step.

        The readings at t = 0 arrive at once: the sensors ran before, and the robot was at rest. So a controller has a
        reading of each sensor from the start.
        """
        due = [running for running in self._sensors if step % running.period == 0] if self._sensors else ()
        if not due:
            return
        sight = Sight(step / self._rate, self._backend, lambda: self.look(step))
        self._receive(step)
        for running in due:
            reading = running.measure(sight)
            if not self._seams.delivers(running.mounted.name, sight.time):
                continue
            if running.line is None or step == 0:
                self._readings[running.mounted.name] = reading
            elif not running.line.send(step, reading):
                continue
            if self._keeps(running.mounted):
                running.kept.append(reading)
            if running.log is not None:
                running.log.add(reading)

    def _receive(self, step: int) -> None:
        for running, line in self._late:
            for reading in line.arrived(step):
                self._readings[running.mounted.name] = reading

    def _keeps(self, mounted: MountedSensor) -> bool:
        return mounted.trace or mounted.name in self._judged

    def stored(self, trace: Trace) -> Trace:
        """Return a trace without the readings that only assertions need."""
        unwanted = {running.mounted.name for running in self._sensors if not running.mounted.trace}
        sensors = {name: record for name, record in trace.sensors.items() if name not in unwanted}
        return trace if len(sensors) == len(trace.sensors) else replace(trace, sensors=sensors)

    def collect(self) -> Mapping[str, SensorRecord]:
        """Return the readings since the last call that assertions or the trace need, by sensor name."""
        records = {
            running.mounted.name: SensorRecord.of_readings(running.mounted.sensor.key, running.kept)
            for running in self._sensors
            if running.kept
        }
        for running in self._sensors:
            running.kept.clear()
        return records


def _open(mounted: MountedSensor, scenario: Scenario, scene: Scene, seams: Seams) -> _Running:
    measure = mounted.sensor.open(_mount(mounted, scenario, scene))
    if mounted.sensor.runs_user_code:
        measure = _checked(measure, mounted.sensor)
    measure = seams.measure(mounted.name, measure)
    sent = mounted.transmission
    random = None if sent.is_perfect else scene.generator(f"transmission of sensor {mounted.name}")
    line: Line[Reading] | None = None if random is None else Line(sent, scenario.physics.rate, random)
    return _Running(mounted, measure, scenario.steps_between_ticks(mounted.rate), line)


def _checked(measure: Measure, sensor: Sensor) -> Measure:
    """Return the function of a sensor of an installed package, with a check of its readings. It raises ScriptError."""
    names = set(sensor.columns)

    def checked(sight: Sight) -> Reading:
        reading = measure(sight)
        if not hasattr(reading, "time") or not callable(getattr(reading, "columns", None)):
            raise ScriptError(f"sensor '{sensor.key}' gave {shown(reading)}, which is no sim_action.extending.Values")
        if (columns := set(reading.columns())) != names:
            mismatch = (
                f"has the columns {', '.join(sorted(columns)) or 'none'}; its class states {', '.join(sorted(names))}"
            )
            raise ScriptError(f"a reading of sensor '{sensor.key}' {mismatch}")
        return reading

    return checked


def _mount(mounted: MountedSensor, scenario: Scenario, scene: Scene) -> Mount:
    link = scene.model.root if mounted.link is None else mounted.link
    wheels = _wheels(scenario, scene) if mounted.sensor.reads_wheels else None
    return Mount(scene, link, mounted.pose, mounted.rate, scene.generator(f"sensor {mounted.name}"), wheels)


def _wheels(scenario: Scenario, scene: Scene) -> WheelMotion | None:
    drive = scenario.robot.drive or recognise(scene.model)
    return drive.wheel_motion(scene.model) if drive else None
