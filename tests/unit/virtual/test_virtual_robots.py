"""Robots as data: a single-arm YuMi and an IRB 120 on the whole virtual controller."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import radians
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from abb_protocols.egm.codec import SensorCodec, SensorMessage
from abb_protocols.errors import YumiError
from abb_protocols.robot.joints import Joints, Side
from abb_runtime.clock import ManualClock
from abb_runtime.faults import Fault
from memory_http import MemoryHttp
from virtual_irc5.controller.installed_system import ROBOTS, delivered_system, factory_system, with_programs
from virtual_irc5.fault_injection import FaultInjection
from virtual_irc5.instructions.robot_data import robtarget
from virtual_irc5.mechanics.egm_motion import EgmRun
from virtual_irc5.world import World, WorldSettings

Array = NDArray[np.float64]

# Denavit and Hartenberg's parameters of an IRB 120 (theta offset [deg], d [mm], a [mm], alpha [deg]).
IRB120 = ((0, 290, 0, -90), (-90, 0, 270, 0), (0, 0, 70, -90), (0, 302, 0, 90), (0, 0, 0, -90), (180, 72, 0, 0))


def place(joints: Sequence[float]) -> Array:
    """Where tool0 of an IRB 120 is [mm]."""
    frame = np.eye(4)
    for angle, (offset, d, a, alpha) in zip(joints, IRB120, strict=True):
        t, k = angle + radians(offset), radians(alpha)
        frame = frame @ np.array(
            [
                [np.cos(t), -np.sin(t) * np.cos(k), np.sin(t) * np.sin(k), a * np.cos(t)],
                [np.sin(t), np.cos(t) * np.cos(k), -np.cos(t) * np.sin(k), a * np.sin(t)],
                [0.0, np.sin(k), np.cos(k), d],
                [0.0, 0.0, 0.0, 1.0],
            ]
        )
    point: Array = frame[:3, 3]
    return point


def world_of(robot: str, path: Path, program: str) -> World:
    file = path / "main.mod"
    file.write_text(f"MODULE Cell\n{program}\nENDMODULE\n", encoding="ascii")
    system = with_programs(factory_system(ROBOTS[robot]), {"T_ROB1": [file]})
    return World(WorldSettings(system=system))


def run(world: World, limit: float = 30.0, each: Callable[[], None] = lambda: None) -> list[Joints]:
    """Run main once; the planned positions of the robot."""
    world.controller.set_motors(on=True)
    world.controller.start_rapid("once")
    positions = []
    while world.controller.is_running and world.controller.time < limit:
        world.cycle({})
        each()
        positions.append(world.arms[Side.RIGHT].planned)
    assert not world.controller.is_running, f"still running after {limit} s"
    return positions


@pytest.mark.parametrize(
    ("robot", "facts"),
    [
        ("yumi", "14000-500000 14000-0.5/0.5 YuMi YuMi"),
        ("irb14050", "14050-500000 14050-0.5/0.5 IRB_14050 IRB_14050"),
        ("irb120", "120-500000 120-3/0.6 IRB_120 IRB_120"),
    ],
)
def test_robot_names_itself_in_get_sys_info(tmp_path: Path, robot: str, facts: str) -> None:
    names = ("SerialNo", "RobotType", "CtrlId", "SystemName")
    file, task = tmp_path / "main.mod", ROBOTS[robot].units[0].task
    text = '+" "+'.join(f"GetSysInfo(\\{name})" for name in names)
    versions = 'TPWrite GetSysInfo(\\SWVersion)+" "+GetSysInfo(\\SWVersionName);'
    file.write_text(f"MODULE Facts PROC main() TPWrite {text}; {versions} ENDPROC ENDMODULE", encoding="ascii")
    world = World(WorldSettings(system=with_programs(factory_system(ROBOTS[robot]), {task: [file]})))
    run(world)
    assert world.controller.screens[task] == (facts, "ROBOTWARE_6.13.00.00 6.13.00.00")


SQUARE = """
    PERS tooldata pen:=[TRUE,[[0,0,50],[1,0,0,0]],[0.2,[0,0,20],[1,0,0,0],0,0,0]];
    CONST robtarget corner:=[[400,-60,300],[0,0,1,0],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    PROC main()
        MoveAbsJ [[0,0,0,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v1000,fine,tool0;
        MoveJ corner,v500,fine,tool0;
        MoveL Offs(corner,0,120,0),v200,fine,tool0;
        MoveL Offs(corner,-80,120,0),v200,fine,tool0;
        MoveL Offs(corner,-80,0,0),v200,fine,tool0;
        MoveL corner,v200,fine,tool0;
    ENDPROC
"""


def test_irb_120_draws_a_square(tmp_path: Path) -> None:
    world = world_of("irb120", tmp_path, SQUARE)
    points = np.array([place(position) for position in run(world)])
    begin = int(np.argmax(np.linalg.norm(points - (400, -60, 300), axis=1) < 0.01))
    square = points[begin:]
    assert np.max(np.abs(square[:, 2] - 300.0)) < 0.1
    on_edge = np.minimum.reduce(
        [abs(square[:, 0] - 400), abs(square[:, 0] - 320), abs(square[:, 1] + 60), abs(square[:, 1] - 60)]
    )
    assert np.max(on_edge) < 0.1
    for corner in ((400, 60), (320, 60), (320, -60), (400, -60)):
        assert np.min(np.linalg.norm(square[:, :2] - corner, axis=1)) < 0.01
    speeds = np.linalg.norm(np.diff(square, axis=0), axis=1) / world.cycle_time
    assert np.max(speeds) == pytest.approx(200.0, rel=0.02)


def test_irb_120_goes_to_the_configuration_that_is_programmed(tmp_path: Path) -> None:
    program = """
        PROC main()
            VAR robtarget here;
            here:=CalcRobT([[20,30,10,60,40,50],[9E9,9E9,9E9,9E9,9E9,9E9]],tool0);
            MoveJ here,v500,fine,tool0;
            here.robconf:=[0,-2,-2,1];
            MoveJ here,v500,fine,tool0;
        ENDPROC
    """
    positions = run(world_of("irb120", tmp_path, program))
    assert np.degrees(positions[-1]) == pytest.approx((20, 30, 10, -120, -40, -130), abs=0.01)
    middle = min(positions, key=lambda each: float(np.max(np.abs(np.degrees(each) - (20, 30, 10, 60, 40, 50)))))
    assert np.degrees(middle) == pytest.approx((20, 30, 10, 60, 40, 50), abs=0.01)


def test_wrist_singularity_on_a_line_is_refused(tmp_path: Path) -> None:
    program = """
        PROC main()
            VAR robtarget here;
            MoveAbsJ [[0,0,0,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v1000,fine,tool0;
            here:=CRobT();
            MoveL RelTool(here,0,1,0\\Ry:=-60),v200,fine,tool0;
        ENDPROC
    """
    world = world_of("irb120", tmp_path, program)
    run(world)
    assert 50026 in [event.code for event in world.controller.events.entries()]
    passing = world_of("irb120", tmp_path, program.replace("here:=", "SingArea\\Wrist; here:="))
    assert run(passing)[-1][4] < radians(-30.0)


@pytest.mark.parametrize(
    ("move", "code"),
    [
        ("MoveAbsJ [[0,0,90,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tool0;", 50027),
        ("MoveJ [[900,0,300],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tool0;", 50050),
    ],
)
def test_joint_out_of_range_and_target_out_of_reach_are_refused(tmp_path: Path, move: str, code: int) -> None:
    world = world_of("irb120", tmp_path, f"PROC main()\n{move}\nENDPROC")
    before = world.arms[Side.RIGHT].planned
    run(world)
    assert code in [event.code for event in world.controller.events.entries()]
    assert world.arms[Side.RIGHT].planned == before


def test_corner_of_six_axes_is_rounded(tmp_path: Path) -> None:
    world = world_of("irb120", tmp_path, SQUARE.replace("v200,fine", "v200,z20"))
    points = np.array([place(position) for position in run(world)])
    for corner in ((400, 60, 300), (320, 60, 300), (320, -60, 300)):
        nearest = np.min(np.linalg.norm(points - corner, axis=1))
        assert 2.0 < nearest <= 20.0


@pytest.mark.parametrize(("robot", "axes_total"), [("irb120", "6"), ("irb14050", "7")])
def test_single_robot_has_one_task_and_its_own_units(tmp_path: Path, robot: str, axes_total: str) -> None:
    world = world_of(robot, tmp_path, "PROC main()\nENDPROC")
    assert list(world.controller.tasks) == ["T_ROB1"]
    unit = world.controller.units[0]
    assert (unit.name, unit.task, str(unit.total_axes)) == ("ROB_1", "T_ROB1", axes_total)
    robax, extax = world.controller.joint_target("ROB_1")
    assert len(robax) == len(extax) == 6
    assert (extax[0] > 8.9e9) is (robot == "irb120")
    assert ROBOTS[robot].title in world.controller.identity.options


def test_single_arm_yumi_moves_along_lines_with_its_arm_angle(tmp_path: Path) -> None:
    program = """
        PERS robtarget start:=[[0,0,0],[1,0,0,0],[0,0,0,0],[0,9E9,9E9,9E9,9E9,9E9]];
        PERS robtarget finish:=[[0,0,0],[1,0,0,0],[0,0,0,0],[0,9E9,9E9,9E9,9E9,9E9]];
        PROC main()
            MoveAbsJ [[10,-90,25,0,60,0],[120,9E9,9E9,9E9,9E9,9E9]],v1000,fine,tool0;
            start:=CRobT();
            MoveL Offs(start,0,0,80),v200,fine,tool0;
            MoveJ start,v200,fine,tool0;
            finish:=CRobT();
        ENDPROC
    """
    world = world_of("irb14050", tmp_path, program)
    run(world)
    texts = [world.controller.tasks["T_ROB1"].read("Cell", name) for name in ("start", "finish")]
    start, finish = ([float(x) for x in text.replace("[", "").replace("]", "").split(",")] for text in texts)
    assert finish[:7] == pytest.approx(start[:7], abs=0.02)
    assert finish[11] == pytest.approx(start[11], abs=0.02)


def test_controller_without_a_program_waits_for_one() -> None:
    world = World(WorldSettings(system=factory_system(ROBOTS["irb120"])))
    for _ in range(5):
        world.cycle({})
    assert world.arms[Side.RIGHT].is_stationary


SUPERVISED = """
    PROC main()
        VAR robtarget here;
        ConfL\\Off;
        MoveAbsJ [[{0},-100,20,0,60,0],[{1},9E9,9E9,9E9,9E9,9E9]],v500,fine,tool0;
        here:=CRobT();
        MoveL Offs(here,0,0,-100),v50,fine,tool0;
    ENDPROC
"""


def test_stop_of_all_motion_tasks_stops_both_arms_on_their_paths(tmp_path: Path) -> None:
    programs = {}
    for task, axis_1, axis_7, rest in (
        ("T_ROB_R", 20, -110, ""),
        (
            "T_ROB_L",
            -20,
            110,
            "TRAP pause\nStopMove\\AllMotionTasks; WaitTime 1; StartMove\\AllMotionTasks;\nENDTRAP\n",
        ),
    ):
        text = SUPERVISED.format(axis_1, axis_7)
        if rest:
            text = text.replace("ConfL", "CONNECT timer WITH pause; ITimer\\Single,2,timer; ConfL")
            text = "VAR intnum timer;\n" + text
        file = tmp_path / f"{task}.mod"
        file.write_text(f"MODULE Cell\n{text}{rest}\nENDMODULE\n", encoding="ascii")
        programs[task] = [file]
    world = World(WorldSettings(system=with_programs(delivered_system(), programs)))
    world.controller.set_motors(on=True)
    world.controller.start_rapid("once")
    still = []
    while world.controller.is_running and world.controller.time < 20.0:
        world.cycle({})
        if 2.4 < world.controller.time < 2.9:
            still += [arm.is_stationary and not arm.path.is_empty for arm in world.arms.values()]
    assert not world.controller.is_running
    assert len(still) > 200
    assert all(still)
    assert all(arm.path.is_empty for arm in world.arms.values())


def test_robtarget_of_six_axes_is_served(tmp_path: Path) -> None:
    world = world_of("irb120", tmp_path, "PROC main()\nENDPROC")
    arm = world.arms[Side.RIGHT]
    trans, _, turns, extax = robtarget(arm.kinematics, arm.position, None, None)
    assert trans == pytest.approx(tuple(place(arm.position)))
    assert turns == (0.0, 0.0, 0.0, 0.0)
    assert extax[0] > 8.9e9


EGM_OF_SIX_AXES = """
    VAR egmident id;
    CONST egm_minmax close:=[-0.5,0.5];
    PROC main()
        MoveAbsJ CJointT(),v100,fine,tool0;
        EGMGetId id;
        EGMSetupUC ROB_1,id,"default","UCdevice"\\{kind}\\CommTimeout:=1;
        {act}
        {run}
        TPWrite "converged";
    ERROR
        TPWrite "error";
        RAISE;
    ENDPROC
"""
JOINT = {
    "kind": "Joint",
    "act": r"EGMActJoint id\Tool:=tool0\J1:=close\J6:=close\MaxSpeedDeviation:=200;",
    "run": r"EGMRunJoint id,EGM_STOP_HOLD\J1\J6\CondTime:=0.2\RampInTime:=0.05;",
}
POSE = {
    "kind": "Pose",
    "act": r"EGMActPose id\Tool:=tool0\WObj:=wobj0,[[0,0,0],[1,0,0,0]],EGM_FRAME_WOBJ,"
    r"[[100,0,0],[1,0,0,0]],EGM_FRAME_WOBJ"
    r"\x:=close\y:=close\z:=close\rx:=close\MaxSpeedDeviation:=200;",
    "run": r"EGMRunPose id,EGM_STOP_HOLD\x\y\z\rx\CondTime:=0.2\PosCorrGain:=1;",
}


def guided(tmp_path: Path, parts: dict[str, str], message: Callable[[World], SensorMessage]) -> World:
    """Answer each datagram of an IRB 120 under EGM until its program has ended."""
    world = world_of("irb120", tmp_path, EGM_OF_SIX_AXES.format(**parts))
    world.controller.set_motors(on=True)
    world.controller.start_rapid("once")
    inbox: dict[Side, list[bytes]] = {}
    codec, answer = SensorCodec(axes=6), None
    while world.controller.is_running and world.controller.time < 10.0:
        sent = world.cycle(inbox)
        inbox = {}
        if Side.RIGHT in sent:
            assert len(codec.decode(sent[Side.RIGHT]).measured) == 6
            answer = answer or codec.encode(message(world))
            inbox = {Side.RIGHT: [answer]}
    return world


def test_egm_guides_six_joints(tmp_path: Path) -> None:
    goal = tuple(radians(value) for value in (12.0, 5.0, -4.0, 3.0, 20.0, -8.0))
    world = guided(tmp_path, JOINT, lambda _: SensorMessage(0, goal))
    assert list(world.controller.screens["T_ROB1"]) == ["converged"]
    assert world.arms[Side.RIGHT].planned == pytest.approx(goal, abs=radians(0.6))


def test_egm_guides_the_pose_of_a_six_axis_robot(tmp_path: Path) -> None:
    goals: list[tuple[float, float, float]] = []

    def message(world: World) -> SensorMessage:
        x, y, z = world.arms[Side.RIGHT].tool_pose(world.arms[Side.RIGHT].planned, None).position
        goals.append((x - 0.02, y + 0.03, z - 0.04))
        point = (goals[0][0] - 0.1, *goals[0][1:])  # seen from the sensor, which is 100 mm ahead
        orientation = world.arms[Side.RIGHT].tool_pose(world.arms[Side.RIGHT].planned, None).orientation
        return SensorMessage(0, None, tool_position=point, tool_orientation=orientation)

    world = guided(tmp_path, POSE, message)
    assert list(world.controller.screens["T_ROB1"]) == ["converged"]
    tool = world.arms[Side.RIGHT].tool_pose(world.arms[Side.RIGHT].planned, None)
    assert tool.position == pytest.approx(goals[0], abs=0.7e-3)


def test_pose_out_of_reach_ends_egm_and_switches_motors_off(tmp_path: Path) -> None:
    world = guided(tmp_path, POSE, lambda _: SensorMessage(0, None, tool_position=(3.0, 0.0, 0.0)))
    assert not world.arms[Side.RIGHT].motors_on
    assert any(
        "no posture near has the tool at [3000, 0, 0] mm" in e.description for e in world.controller.events.entries()
    )


def test_pose_without_a_rotation_moves_nothing_and_makes_the_controller_fail(tmp_path: Path) -> None:
    starts: list[tuple[float, ...]] = []

    def message(world: World) -> SensorMessage:
        arm = world.arms[Side.RIGHT]
        starts.append(arm.planned)
        x, y, z = arm.tool_pose(arm.planned, None).position
        return SensorMessage(0, None, tool_position=(x - 0.1, y, z), tool_orientation=(0.0, 0.0, 0.0, 0.0))

    world = guided(tmp_path, POSE, message)
    arm = world.arms[Side.RIGHT]
    assert not arm.motors_on
    assert arm.planned == pytest.approx(starts[0], abs=1e-6)
    assert any("whose quaternion has no direction" in each.description for each in world.controller.events.entries())


@pytest.mark.parametrize(("setup", "other"), [(JOINT, POSE), (POSE, JOINT)])
def test_egm_refuses_instructions_of_the_other_kind(
    tmp_path: Path, setup: dict[str, str], other: dict[str, str]
) -> None:
    world = guided(tmp_path, {**other, "kind": setup["kind"]}, lambda _: SensorMessage(0, (0.0,) * 6))
    assert any("EGM mode mismatch" in event.title for event in world.controller.events.entries())


@pytest.mark.parametrize("robot", ["irb120", "irb14050"])
@pytest.mark.parametrize(
    "refuse",
    [
        lambda world: world.egm[Side.RIGHT].run_joint(EgmRun()),
        lambda world: world.arms[Side.RIGHT].check_ready(),
        lambda world: world.arms[Side.RIGHT].set_reference(None, None),
        lambda world: world.network.inject(Fault.EGM_STALE, Side.RIGHT, 30.0),
        lambda world: FaultInjection(world, MemoryHttp(world.controller, ManualClock()).adapter).inject(
            Fault.COMM_TIMEOUT
        ),
    ],
)
def test_egm_of_a_single_robot_names_no_arm(robot: str, refuse: Callable[[World], None]) -> None:
    world = World(WorldSettings(system=factory_system(ROBOTS[robot])))
    with pytest.raises(YumiError, match=r"(the|The) robot( is| are| has|[:;])") as refused:
        refuse(world)
    assert "right arm" not in str(refused.value)


def test_torques_that_are_not_known_are_an_error_of_the_program_not_of_the_controller(tmp_path: Path) -> None:
    program = """
    PROC main()
        TestSignDefine 1,4002,ROB_1,1,0.004;
        WaitTime 0.1;
    ERROR
        IF ERRNO=ERR_AXIS_PAR TPWrite "no torques";
        TRYNEXT;
    ENDPROC
    """
    world = world_of("irb120", tmp_path, program)
    run(world)
    assert list(world.controller.screens["T_ROB1"]) == ["no torques"]
