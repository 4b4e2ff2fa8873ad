"""The plan of a proof: which scenarios, which mutants, what they cost, and which fit into a budget."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from sim_action.core.errors import InvalidScenario, UsageError
from sim_action.core.records import replace
from sim_action.runner.mutation import planning
from sim_action.runner.mutation.mutant import Mutant, Original
from sim_action.runner.mutation.world_faults import ICE, SHOVE_S, WALL
from sim_action.scenario.mutation import Mutation, SensorFault
from sim_action.scenario.source import Refused
from sim_action.sensors.imu import Imu
from sim_action.sensors.lidar import Lidar
from tests.runner.mutation.runs import curve, original, straight
from tests.scenarios import LEAST, load
from tests.traces import WHEELS, trace


def test_the_first_variation_on_the_first_engine_is_proven(tmp_path: Path) -> None:
    plain = load(tmp_path, LEAST)
    varied = replace(plain.source, group="burger")
    several = [replace(plain, source=replace(varied, number=number), compared=True) for number in (1, 2)]
    refused = Refused("b.sim.yml", "b", None, InvalidScenario([]))
    found = list(planning.first_runs([(plain,), (several[0], plain), (several[1],), refused]))
    assert [each if isinstance(each, Refused) else (each.source.number, each.compared) for each in found] == [
        *((1, False), (1, False)),
        refused,
    ]


def test_the_command_line_chooses_kinds_and_single_mutants(tmp_path: Path) -> None:
    run = original(tmp_path)
    (plan,) = planning.planned([run], ("removed:crate", "motor-off"))
    assert [mutant.name for mutant in plan.chosen] == ["motor-off:wheel_left_joint", "removed:crate"]
    assert plan.left_out == 17
    assert planning.within([plan], 0.5, 1)[0].left_out == 19
    assert len(planning.planned([run])[0].chosen) == 19
    planning.refuse_unknown(["wall", "removed:any name"])
    with pytest.raises(UsageError, match="did you mean 'wall'") as refused:
        planning.refuse_unknown(["wal"])
    assert str(refused.value).count("silenced") == 1


def test_a_single_mutant_that_no_run_has_is_refused(tmp_path: Path) -> None:
    plans = planning.planned([original(tmp_path)])
    planning.refuse_unmatched(plans, ["motor-off:wheel_left_joint", "dropped"])
    planning.refuse_unmatched([], ["motor-off:wheel"])
    for name, hint in (("motor-off:wheel_lft_joint", "did you mean 'motor-off:wheel_left_joint'"), ("noisy:x", "none")):
        with pytest.raises(UsageError, match=hint) as refused:
            planning.refuse_unmatched(plans, ["silenced", name])
        assert "removed:crate" not in str(refused.value)


def test_a_budget_takes_the_first_of_each_kind_first_and_scenarios_in_turns(tmp_path: Path) -> None:
    quick, slow = original(tmp_path), original(tmp_path, wall_time=2.0)
    plans = planning.planned([quick, slow])
    assert planning.cost(plans, 2) == (19 + 38) / 2
    some = planning.within(plans, 4.5, 2)
    assert [[mutant.kind for mutant in plan.chosen] for plan in some] == [["silenced", "swapped", "wall"]] * 2
    assert [plan.left_out for plan in some] == [16, 16]
    (first,) = planning.within(plans[:1], 14.0, 1)
    assert [mutant.name for mutant in plans[0].chosen if mutant not in first.chosen] == [
        *("reversed:angular", "reversed:wheel_left_joint", "scaled:x2"),
        "removed:far crate",
        "moved:far crate",
    ]
    assert planning.within(plans, 1000.0, 1) == plans


SENSOR_FAULTS: tuple[SensorFault, ...] = ("frozen", "stale", "biased", "drifting")
SENSORS = "{lidar: {noise: 0.01}}, {imu: {}}, {contact: {}}"


def of_kind(run: Original, kind: str) -> list[Mutant]:
    return list(next(row for row in planning.TABLE if row.kind == kind).mutants(run))


def names(run: Original) -> list[str]:
    return [mutant.name for kind in planning.KINDS for mutant in of_kind(run, kind)]


def only(run: Original, kind: str) -> Mutant:
    (mutant,) = of_kind(run, kind)
    return mutant


def test_mutants_of_commands_and_motors(tmp_path: Path) -> None:
    # A robot that drives by itself has mutants of commands motors and world.
    assert names(original(tmp_path)) == [
        *("silenced", "swapped", "wall", "reversed:linear", "reversed:angular", "reversed:wheel_left_joint"),
        *("turned", "scaled:x0.5", "scaled:x2", "swapped-wheels"),
        *("motor-off:wheel_left_joint", "removed:crate", "removed:far crate", "slippery", "shoved"),
        *("moved:crate", "moved:far crate", "delayed:0.5s", "heavier:x2"),
    ]
    # Without commands there are none of commands.
    run = original(tmp_path, commands="")
    assert {"silenced", "swapped", "scaled:x2", "reversed:linear", "swapped-wheels", "delayed:0.5s"}.isdisjoint(
        names(run)
    )


def test_motors_that_only_hold_a_joint_have_mutants_after_those_that_move(tmp_path: Path) -> None:
    still = trace([0.0, 1.0], effort=[1.0, 2.0])
    assert [mutant.name for mutant in of_kind(original(tmp_path, still), "motor-off")] == [f"motor-off:{WHEELS[0]}"]
    idle = trace([0.0, 1.0], effort=[0.05, 0.0])
    assert not of_kind(original(tmp_path, idle), "motor-off")


@pytest.mark.parametrize(
    ("name", "mutation"),
    [
        ("silenced", Mutation(silent=True)),
        ("swapped", Mutation(mirrored=True)),
        ("swapped-wheels", Mutation(crossed_wheels=True)),
        ("heavier:x2", Mutation(mass=2.0)),
        ("scaled:x0.5", Mutation(speed=0.5)),
        ("scaled:x2", Mutation(speed=2.0)),
        ("reversed:linear", Mutation(reversed="linear")),
        ("reversed:wheel_left_joint", Mutation(reversed_joint=WHEELS[0])),
    ],
)
def test_faults_at_the_seams(name: str, mutation: Mutation, tmp_path: Path) -> None:
    run = original(tmp_path)
    (mutant,) = (mutant for mutant in of_kind(run, name.partition(":")[0]) if mutant.name == name)
    assert mutant.loaded.mutation == mutation
    assert mutant.loaded.scenario.name == f"burger drives ({name})"
    assert run.loaded.mutation is None
    assert mutant.loaded.scenario.expect == run.scenario.expect


def test_strengths_and_calm_runs(tmp_path: Path) -> None:
    # A delay adds to that of the scenario.
    run = original(tmp_path, commands="commands: [{twist: [{linear: 0.2}], latency: 0.1}]")
    late = only(run, "delayed")
    latencies = [strength.loaded.scenario.commands[0].latency for strength in late.strengths]
    assert latencies == [0.1 + delay for delay in planning.DELAYS_S]
    assert late.loaded.mutation == Mutation()
    # Strengths of a fault.
    run = original(tmp_path)
    slippery, faster = only(run, "slippery"), of_kind(run, "scaled")[1]
    assert [strength.loaded.scenario.world.ground.friction for strength in slippery.strengths] == [0.2, ICE]
    assert [strength.name for strength in faster.stronger] == ["scaled:x10", "scaled:x57.3"]
    (chosen,) = planning.planned([run], ["scaled:x57.3"])[0].chosen
    assert (chosen.name, chosen.strengths[1:]) == ("scaled:x57.3", ())
    # A calm run has no chance and no disturbance.
    assert not of_kind(original(tmp_path), "calm")
    rough = "commands: [{twist: [{linear: 0.2}], latency: 0.1, jitter: 0.1, dropouts: 0.1}]"
    calm = only(original(tmp_path, sensors="{lidar: {noise: 0.1}}", commands=rough), "calm").loaded.scenario
    (source,), (lidar,) = calm.commands, calm.sensors
    assert isinstance(lidar.sensor, Lidar)
    assert (source.latency, source.jitter, source.dropouts, lidar.sensor.noise) == (0.1, 0.0, 0.0, 0.0)
    # A turned robot begins with another heading.
    pose = only(original(tmp_path), "turned").loaded.scenario.robot.pose
    assert pose.yaw == pytest.approx(math.pi / 2)


def test_a_shove_hits_the_upper_edge_from_the_right_halfway_through_the_run(tmp_path: Path) -> None:
    (shove,) = only(original(tmp_path), "shoved").loaded.scenario.world.disturbances
    assert (shove.at, shove.duration, shove.link, shove.body) == (10.0, SHOVE_S, None, None)
    assert shove.force is not None
    assert shove.point is not None
    # The burger has 1 kg, is 19 cm high, and its base is 1 cm above the ground.
    assert shove.force == pytest.approx((0.0, 10.0, 0.0), abs=0.2)
    assert shove.point == pytest.approx((-0.03, -0.09, 0.18), abs=0.015)
    (shove,) = only(original(tmp_path, curve()), "shoved").loaded.scenario.world.disturbances
    assert shove.force is not None
    assert math.atan2(shove.force[1], shove.force[0]) == pytest.approx(math.radians(135), abs=0.05)


def test_walls_and_robots_that_are_bolted_down(tmp_path: Path) -> None:
    # A robot that is bolted down is not shoved.
    run = original(tmp_path)
    bolted = run.scenario.model_copy(update={"robot": run.scenario.robot.model_copy(update={"base": "fixed"})})
    assert not of_kind(replace(run, loaded=replace(run.loaded, scenario=bolted)), "shoved")
    # A wall stands across the way.
    wall = only(original(tmp_path), "wall").loaded.scenario.world.objects[-1]
    assert wall.name == WALL
    assert (wall.pose.x, wall.pose.y, wall.pose.yaw) == pytest.approx((1.2, 0.0, 0.0))
    wall = only(original(tmp_path, curve()), "wall").loaded.scenario.world.objects[-1]
    assert wall.pose.yaw == pytest.approx(0.6 * 1.57, abs=0.1)
    assert not of_kind(original(tmp_path, straight(0.5)), "wall")


def test_other_robots_are_left_out_or_left_without_commands(tmp_path: Path) -> None:
    driven = "{name: cart, model: turtlebot3_burger, pose: {x: 3}, commands: {twist: [{linear: 0.1}]}}"
    parked = "{name: parked, model: turtlebot3_burger, pose: {x: 5}}"
    world = f"\n  actors: [{driven}, {parked}]"
    *_, cart, lot = of_kind(original(tmp_path, objects=world), "removed")
    assert (cart.name, lot.name) == ("removed:cart", "removed:parked")
    assert [actor.name for actor in cart.loaded.scenario.world.actors] == ["parked"]
    named = original(tmp_path, objects=world, expect="{clearance: {at_least: 0.1, to: [cart, parked]}}")
    *_, still = of_kind(named, "removed")
    assert [(actor.name, len(actor.commands)) for actor in still.loaded.scenario.world.actors] == [
        *(("cart", 0), ("parked", 0))
    ]


def test_objects_that_other_parts_name_are_not_removed(tmp_path: Path) -> None:
    run = original(tmp_path, expect="{clearance: {at_least: 0.1, to: [crate]}}")
    assert [mutant.name for mutant in of_kind(run, "removed")] == ["removed:far crate"]
    objects = only_names(of_kind(run, "removed")[0])
    assert objects == ["crate"]


def only_names(mutant: Mutant) -> list[str]:
    return [body.name for body in mutant.loaded.scenario.world.objects]


def test_objects_move_by_their_own_size_but_not_beyond_the_way(tmp_path: Path) -> None:
    near = "- {name: near, box: [0.8, 0.8, 0.2], pose: {x: 1.5, y: 0.5}}"
    moved = {mutant.subject: mutant for mutant in of_kind(original(tmp_path, objects=near), "moved")}
    places = {
        name: next(body.pose for body in mutant.loaded.scenario.world.objects if body.name == name)
        for name, mutant in moved.items()
    }
    assert (places["crate"].x, places["crate"].y) == pytest.approx((1.0, 0.6))
    assert places["near"].y == pytest.approx(0.0)
    assert moved["crate"].words == "the object 'crate' stands 0.40 m nearer to the robot's way"


def test_objects_that_move_or_have_mutants(tmp_path: Path) -> None:
    # An object never moves into the robot.
    behind = "- {name: behind, box: [0.4, 0.4, 0.4], pose: {x: -0.7}}"
    (mutant,) = (each for each in of_kind(original(tmp_path, objects=behind), "moved") if each.subject == "behind")
    assert mutant.loaded.scenario.world.objects[-1].pose.x == pytest.approx(-0.55)
    at_it = behind.replace("-0.7", "-0.4")
    assert "moved:behind" not in names(original(tmp_path, objects=at_it))
    # Only the nearest objects have mutants.
    several = "\n    ".join(f"- {{name: box{n}, box: [0.1, 0.1, 0.1], pose: {{x: {n}, y: 2}}}}" for n in range(6))
    found = [mutant.subject for mutant in of_kind(original(tmp_path, objects=several), "removed")]
    assert found == ["crate", "box0", "box1", "box2", "box3"]


def test_sensors_have_mutants_if_somebody_may_read_them(tmp_path: Path) -> None:
    assert not of_kind(original(tmp_path, sensors=SENSORS), "frozen")
    (tmp_path / "control.py").write_text("def control(seen): return None\n")
    run = original(tmp_path, sensors=SENSORS, commands="commands: {script: control.py}")
    for reading in SENSOR_FAULTS:
        faults = [mutant.loaded.mutation for mutant in of_kind(run, reading)]
        assert faults == [Mutation(sensor=name, reading=reading) for name in ("lidar", "imu", "contact")]
    noisy = of_kind(run, "noisy")
    assert [mutant.subject for mutant in noisy] == ["lidar", "imu"]
    lidar, imu = (noisy[at].loaded.scenario.sensors[at].sensor for at in range(2))
    assert isinstance(lidar, Lidar)
    assert isinstance(imu, Imu)
    assert (lidar.noise, imu.gyro_noise, imu.accelerometer_noise) == (0.1, 0.05, 0.5)
    assert not of_kind(run, "dropped")


def test_every_row_says_what_it_changes() -> None:
    assert len(set(planning.KINDS)) == len(planning.TABLE)
    assert all(row.words for row in planning.TABLE)
