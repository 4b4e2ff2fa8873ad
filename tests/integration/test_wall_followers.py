"""A wall follower on a lidar: as a script, and as programs in several languages, it drives the same way, bit by bit."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Final

import numpy as np
import pytest

from sim_action.engines import installed
from sim_action.state.trace_storage import load_trace
from tests.integration.marked_processes import processes_of
from tests.integration.test_processes import run
from tests.soak import soaked

# It begins too near to the wall to its right for its lidar, and sees nothing in the middle of the room.
SCENARIO: Final = """\
name: {name}
robot: {{model: turtlebot3_burger, pose: {{x: -1.0, y: -1.2}}}}
world:
  objects:
    - {{name: south, box: [4.0, 0.1, 0.5], pose: {{y: -1.55}}}}
    - {{name: north, box: [4.0, 0.1, 0.5], pose: {{y: 1.55}}}}
    - {{name: west, box: [0.1, 3.0, 0.5], pose: {{x: -2.05}}}}
    - {{name: east, box: [0.1, 3.0, 0.5], pose: {{x: 2.05}}}}
sensors:
  - lidar: {{rays: 360, range: 1.2 m, min_range: 0.32 m, noise: 5 mm}}
    name: scan
    link: base_scan
    trace: true
commands: {{{source}, rate: 10 Hz}}
expect:
  - reach: {{x: 1.5, y: 0, tolerance: 10 cm}}
  - reach: {{x: 0, y: 1.0, tolerance: 10 cm}}
  - no_collision
time_limit: 30 s
"""

# As examples/sensors/follow_wall.py, without functions whose last bit each language rounds in a way of its own.
STEER: Final = """\
from math import sqrt

HALF = 0.7071067811865476

def steer(ahead, diagonal, beside):
    diagonal, beside = (max(0.0, min(1.2, distance)) for distance in (diagonal, beside))
    across, along = beside - diagonal * HALF, diagonal * HALF
    length = max(0.001, sqrt(across * across + along * along))
    turn = 2.0 * across / length + 3.0 * (0.5 - beside * along / length)
    if ahead < 0.75:
        turn = 1.5
    return 0.3 * max(0.2, min(1.0, ahead)), max(-1.5, min(1.5, turn))
"""
SCRIPT: Final = (
    STEER
    + """
from sim_action import LidarScan, Twist

def control(observation):
    scan = observation.sensors["scan"]
    assert isinstance(scan, LidarScan)
    return Twist.planar(*steer(scan.ranges[158:203].min(), scan.ranges[135], scan.ranges[90]))
"""
)
PYTHON: Final = (
    STEER
    + """
import json, sys

for line in sys.stdin:
    seen, answer = json.loads(line), {}
    if seen["type"] == "step":
        ranges = [9.0 if found is None else found for found in seen["sensors"]["scan"]["ranges"]]
        linear, angular = steer(min(ranges[158:203]), ranges[135], ranges[90])
        answer = {"twist": {"linear": linear, "angular": angular}}
    print(json.dumps(answer), flush=True)
"""
)
NODE: Final = """\
const HALF = 0.7071067811865476;
const within = (least, most, value) => Math.max(least, Math.min(most, value));

function steer(ahead, diagonal, beside) {
  [diagonal, beside] = [diagonal, beside].map(distance => within(0, 1.2, distance));
  const across = beside - diagonal * HALF, along = diagonal * HALF;
  const length = Math.max(0.001, Math.sqrt(across * across + along * along));
  let turn = 2 * across / length + 3 * (0.5 - beside * along / length);
  if (ahead < 0.75) turn = 1.5;
  return {linear: 0.3 * within(0.2, 1, ahead), angular: within(-1.5, 1.5, turn)};
}

require("readline").createInterface({input: process.stdin}).on("line", line => {
  const seen = JSON.parse(line);
  let answer = {};
  if (seen.type === "step") {
    const ranges = seen.sensors.scan.ranges.map(found => found === null ? 9 : found);
    answer = {twist: steer(Math.min(...ranges.slice(158, 203)), ranges[135], ranges[90])};
  }
  console.log(JSON.stringify(answer));
});
"""
PERL: Final = """\
use List::Util qw(min max);
$| = 1;
my $HALF = 0.7071067811865476;

sub steer {
  my ($ahead, $diagonal, $beside) = @_;
  ($diagonal, $beside) = map { max(0, min(1.2, $_)) } $diagonal, $beside;
  my ($across, $along) = ($beside - $diagonal * $HALF, $diagonal * $HALF);
  my $length = max(0.001, sqrt($across * $across + $along * $along));
  my $turn = 2 * $across / $length + 3 * (0.5 - $beside * $along / $length);
  $turn = 1.5 if $ahead < 0.75;
  return (0.3 * max(0.2, min(1, $ahead)), max(-1.5, min(1.5, $turn)));
}

while (<STDIN>) {
  if (/"type":"step".*"ranges":\\[([^\\]]+)\\]/) {
    my @ranges = map { $_ eq "null" ? 9 : $_ } split /,/, $1;
    printf "{\\"twist\\": {\\"linear\\": %.17g, \\"angular\\": %.17g}}\\n",
      steer(min(@ranges[158 .. 202]), $ranges[135], $ranges[90]);
  } else {
    print "{}\\n";
  }
}
"""
# Name -> the source in the scenario, the file, and what is in it.
FOLLOWERS: Final = {
    "script": ("script: follow.py", "follow.py", SCRIPT),
    "python": ("process: python program.py", "program.py", PYTHON),
} | {
    name: (f"process: [{name}, follow{ending}]", f"follow{ending}", text)
    for name, ending, text in (("node", ".js", NODE), ("perl", ".pl", PERL))
    if shutil.which(name)
}


@pytest.mark.parametrize("engine", soaked(installed(), short=installed()[-1:]))
def test_a_wall_follower_drives_the_same_way_whatever_it_is_written_in(tmp_path: Path, engine: str) -> None:
    for name, (source, file, text) in FOLLOWERS.items():
        (tmp_path / file).write_text(text)
        (tmp_path / f"{name}.sim.yml").write_text(SCENARIO.format(name=name, source=source))
    outcomes = run(tmp_path, "--backend", engine)
    assert processes_of(tmp_path) == []
    assert outcomes.keys() == FOLLOWERS.keys()
    assert len(outcomes) > 2, "install perl, or node"
    assert {outcome.status for outcome in outcomes.values()} == {"passed"}, outcomes
    assert len({outcome.digest for outcome in outcomes.values()}) == 1
    assert outcomes["script"].trace is not None
    scans = load_trace(tmp_path / "sim-results" / outcomes["script"].trace).sensors["scan"].columns["ranges"]
    # Both were there to be told apart.
    assert {-np.inf, np.inf} < set(scans.ravel().tolist())
