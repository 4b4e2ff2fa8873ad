"""The names for packages that bring assertions, command sources and sensors of their own.

An assertion derives from `Assertion`; its monitor may be a `SignalMonitor`, which compares a signal with `Bounds`. A
sensor derives from `Sensor`; a reading is a `Values`. A command source derives from `CommandSource`; its controller
depends only on the time (`OpenLoop`), or on observations (`ClosedLoop`). A package names its classes in the groups of
entry points `sim_action.assertions`, `sim_action.commands` and `sim_action.sensors`. `sim_action.testing` tests them.
"""

from sim_action.assertions import Assertion as Assertion
from sim_action.assertions.monitors import Monitor as Monitor
from sim_action.assertions.monitors import State as State
from sim_action.assertions.monitors import Truth as Truth
from sim_action.assertions.monitors.bounds import Bounds as Bounds
from sim_action.assertions.monitors.bounds import Goal as Goal
from sim_action.assertions.monitors.bounds import Invariant as Invariant
from sim_action.assertions.monitors.bounds import SignalMonitor as SignalMonitor
from sim_action.assertions.monitors.bounds import check_bounds as check_bounds
from sim_action.commands import ClosedLoop as ClosedLoop
from sim_action.commands import CommandSource as CommandSource
from sim_action.commands import Controller as Controller
from sim_action.commands import OpenLoop as OpenLoop
from sim_action.core.field_types import Metres as Metres
from sim_action.core.field_types import MetresPerSecond as MetresPerSecond
from sim_action.core.field_types import NonNegativeSeconds as NonNegativeSeconds
from sim_action.core.field_types import PositiveMetres as PositiveMetres
from sim_action.core.field_types import PositiveMetresPerSecond as PositiveMetresPerSecond
from sim_action.core.field_types import PositiveNewtons as PositiveNewtons
from sim_action.core.field_types import PositiveRadians as PositiveRadians
from sim_action.core.field_types import PositiveRadiansPerSecond as PositiveRadiansPerSecond
from sim_action.core.field_types import PositiveRatio as PositiveRatio
from sim_action.core.field_types import PositiveSeconds as PositiveSeconds
from sim_action.core.field_types import Radians as Radians
from sim_action.core.field_types import RadiansPerSecond as RadiansPerSecond
from sim_action.core.field_types import Ratio as Ratio
from sim_action.core.units import ACCELERATION as ACCELERATION
from sim_action.core.units import ANGULAR_SPEED as ANGULAR_SPEED
from sim_action.core.units import FORCE as FORCE
from sim_action.core.units import LENGTH as LENGTH
from sim_action.core.units import RATIO as RATIO
from sim_action.core.units import SPEED as SPEED
from sim_action.core.units import display as display
from sim_action.sensors import Measure as Measure
from sim_action.sensors import Mount as Mount
from sim_action.sensors import Sensor as Sensor
from sim_action.sensors import Sight as Sight
from sim_action.state.observation import Observation as Observation
from sim_action.state.readings import ReadingColumn as ReadingColumn
from sim_action.state.readings import Values as Values
from sim_action.state.trace_records import Channels as Channels
from sim_action.state.trace_records import ClearanceWatch as ClearanceWatch
from sim_action.state.verdict import Judged as Judged
from sim_action.state.verdict import Signal as Signal
from sim_action.state.verdict import Verdict as Verdict
from sim_action.world.claims import Ceiling as Ceiling
from sim_action.world.claims import ClaimFinding as ClaimFinding
from sim_action.world.claims import JudgedRun as JudgedRun
from sim_action.world.claims import Setting as Setting
from sim_action.world.scene import Scene as Scene
