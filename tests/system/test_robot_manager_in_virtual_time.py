"""The robot manager against the virtual controller: named states, single steps, signals and variables."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from math import nan, radians
from threading import Thread
from time import monotonic
from typing import Any

import pytest

from abb_protocols.catalogue import Message, clause, message
from abb_protocols.errors import CommandRefused, ControllerRefused, NoConnection, RobotNotReady
from abb_protocols.robot.description import HAND, Mass
from abb_protocols.robot.joints import CYCLE, Pose, Side, joints
from abb_protocols.robot.load import Tool, principal_inertia
from abb_protocols.rws import rapid_values
from abb_protocols.rws.values import ControllerState, ExecutionState, OperatingMode
from abb_runtime.faults import Fault, FaultDirection
from refusals import assert_says, refused
from system.virtual_time_bench import DriverArm, System
from yumi.control.loop_events import AllowedCollisionsChanged
from yumi.control.shared_state import ArmProblem, Snapshot
from yumi.driver import rapid_routines
from yumi.driver.robot_state import RobotMode
from yumi.driver.state_machine import EgmMotionSettings, MachineState, StateMachines, tooldata


@pytest.fixture
def system() -> System:
    return System()


def test_manager_reports_all_that_is_known(system: System) -> None:
    system.manager.start_egm()
    state = system.manager.state()
    assert (state.is_connected, state.operating_mode, state.reasons) == (True, OperatingMode.AUTO, ())
    assert (state.controller_state, state.execution) == (ControllerState.MOTORS_ON, ExecutionState.RUNNING)
    assert set(state.machines.values()) == {MachineState.RUN_EGM_ROUTINE}
    assert set(state.egm.values()) == {"running"}
    assert state.speed_ratio == 100
    assert state.last_event is not None
    assert state.last_event.code == 10150


def max_speed_deviation(system: System, side: Side) -> float:
    settings = rapid_values.decode(system.client.symbol(side.task, "TRobEGM", "settings"))
    return settings[3][7]  # type: ignore[index,return-value]


def test_robots_own_speed_limit_is_lowered_with_speed_scale_and_raised_with_the_next_start_of_egm(
    system: System,
) -> None:
    manager = system.manager
    manager.speed.set(0.1)
    manager.start_egm()
    assert [max_speed_deviation(system, side) for side in Side] == pytest.approx([18.0, 18.0])
    manager.speed.set(1.0)
    assert_says(manager.speed.said, "speed_scale_waits_for_egm", value=1.0, in_force=0.1)
    assert manager.state().speed_scale == 0.1
    manager.stop_egm()
    manager.start_egm()
    assert [max_speed_deviation(system, side) for side in Side] == pytest.approx([180.0, 180.0])
    assert manager.state().speed_scale == 1.0


def test_arm_that_starts_alone_of_both_keeps_its_speed_limit_until_the_next_start(
    system: System, monkeypatch: pytest.MonkeyPatch
) -> None:
    manager, write = system.manager, StateMachines._write_settings

    def write_but_left(machines: StateMachines, side: Side, scale: float, *, is_allowed: bool) -> None:
        write(machines, side, scale, is_allowed=is_allowed and side is Side.RIGHT)

    manager.speed.set(0.1)
    with monkeypatch.context() as patch:
        patch.setattr(StateMachines, "_write_settings", write_but_left)
        with refused(RobotNotReady, "state_machines_did_not_start_egm") as refusal:
            manager.start_egm()
        assert message("machine", arm="left", machine="IDLE") in refusal.value.said.values["machines"]
    assert manager.state().egm == {Side.RIGHT: "running", Side.LEFT: "off"}
    assert not system.arms[Side.RIGHT].snapshot.is_commanded
    manager.speed.set(1.0)
    assert_says(manager.speed.said, "speed_scale_waits_for_egm", value=1.0, in_force=0.1)
    assert manager.state().speed_scale == 0.1
    manager.stop_egm()
    assert manager.state().egm == dict.fromkeys(Side, "off")


def test_state_says_what_may_touch_and_what_limits_an_arm(system: System, monkeypatch: pytest.MonkeyPatch) -> None:
    manager = system.manager
    manager.note(AllowedCollisionsChanged((("left gripper", "right gripper"),)))
    limited = {"limited_part": "left forearm", "limited_other": "body", "limited_distance": 0.0104}
    now = {Side.RIGHT: Snapshot(is_streaming=True, speed_cap=0.1), Side.LEFT: Snapshot(**limited)}
    monkeypatch.setattr(system.control, "snapshot", now.__getitem__)
    state = manager.state()
    assert state.allowed_collisions == ("left gripper - right gripper",)
    near = message("parts_near", part="left forearm", other="body", distance=0.0104)
    assert state.limited_by == (clause(near),)
    assert "may touch: left gripper - right gripper" in str(state)
    assert state.speed_scale == 0.1
    now.update(dict.fromkeys(Side, Snapshot()))
    manager.note(AllowedCollisionsChanged(()))
    state = manager.state()
    assert (state.allowed_collisions, state.limited_by, state.speed_scale) == ((), (), 1.0)


CUP = Mass(0.1, (0.0, 0.02, 0.15), (1e-4, 0.0, 0.0, 1e-4, 0.0, 5e-5))
TCP = Pose((0.0, 0.0, 0.1142), (1.0, 0.0, 0.0, 0.0))


def robots_tool(system: System, side: Side, name: str = "egm_tool") -> Any:
    """What the robot's EGM motion has been started with [mm, kg]."""
    return rapid_values.decode(system.client.symbol(side.task, "TRobEGM", name))


def test_tool_and_payload_are_the_load_of_the_next_egm_motion_and_stay_when_the_program_starts_anew(
    system: System,
) -> None:
    manager, total = system.manager, Tool(TCP, HAND, CUP).total
    manager.set_tool(Side.RIGHT, TCP, HAND)
    sentence = manager.set_payload(Side.RIGHT, CUP)
    assert sentence.startswith("EGM will start on the right arm with 0.330 kg at [5.7, 14.2, 81.7] mm from tool0: tool")
    assert robots_tool(system, Side.RIGHT, "settings")[3][0][1][0] == pytest.approx((0.0, 0.0, 114.2))
    manager.start_egm()
    _, (place, _), (mass, centre, _, *moments) = robots_tool(system, Side.RIGHT)
    assert place == pytest.approx((0.0, 0.0, 114.2))
    assert (mass, centre) == (
        pytest.approx(total.mass),
        pytest.approx([1e3 * value for value in total.centre], rel=1e-5),
    )
    assert sorted(moments) == pytest.approx(sorted(principal_inertia(total)[1]), rel=1e-4)
    assert robots_tool(system, Side.LEFT)[2][0] != pytest.approx(total.mass)
    manager.stop_rapid()
    manager.pp_to_main()  # the robot forgets its settings
    manager.start_egm()
    assert robots_tool(system, Side.RIGHT)[2][0] == pytest.approx(total.mass)
    manager.stop_egm()
    manager.set_payload(Side.RIGHT, Mass(0.0, (0.0, 0.0, 0.0), (0.0,) * 6))
    manager.start_egm()
    assert robots_tool(system, Side.RIGHT)[2][0] == pytest.approx(HAND.mass)


def test_next_driver_knows_the_tool_centre_but_counts_no_payload_twice(system: System) -> None:
    system.manager.make_ready()
    system.manager.set_tool(Side.RIGHT, TCP, HAND)
    system.manager.set_payload(Side.RIGHT, CUP)
    before = robots_tool(system, Side.RIGHT, "settings")
    system.start_driver()
    system.bringup.check_controller()
    manager = system.manager
    assert manager.tcp(Side.RIGHT).position == pytest.approx(TCP.position)
    assert manager.tcp(Side.LEFT).position == (0.0, 0.0, 0.0)
    with refused(CommandRefused, "tool_unknown", arm="right"):
        manager.set_payload(Side.RIGHT, CUP)
    assert robots_tool(system, Side.RIGHT, "settings") == before
    manager.set_tool(Side.RIGHT, TCP, HAND)
    assert "0.330 kg" in manager.set_payload(Side.RIGHT, CUP)


def test_tool_of_the_settings_carries_a_payload() -> None:
    system = System(motion=EgmMotionSettings(tool=tooldata(Tool(TCP, HAND))))
    assert system.manager.tcp(Side.LEFT).position == pytest.approx(TCP.position)
    assert "0.330 kg" in system.manager.set_payload(Side.LEFT, CUP)


def test_tool_is_not_changed_while_egm_runs(system: System) -> None:
    system.manager.start_egm()
    before = robots_tool(system, Side.LEFT, "settings")
    with refused(RobotNotReady, "tool_fixed_while_egm_runs", arm="left"):
        system.manager.set_tool(Side.LEFT, TCP, HAND)
    assert robots_tool(system, Side.LEFT, "settings") == before


def test_payload_that_an_arm_does_not_carry_is_refused_and_nothing_is_written(system: System) -> None:
    system.manager.set_tool(Side.LEFT, TCP, HAND)
    before = robots_tool(system, Side.LEFT, "settings")
    with refused(CommandRefused, "load_too_heavy", mass=2.0 + HAND.mass, most=0.5):
        system.manager.set_payload(Side.LEFT, replace(CUP, mass=2.0))
    assert robots_tool(system, Side.LEFT, "settings") == before
    assert "OUTPUT_STATIONARY_ROB_R" in system.manager.signals()


def test_arm_that_guides_on_keeps_its_own_speed_limit_while_the_other_one_begins(system: System) -> None:
    manager = system.manager
    manager.speed.set(0.1)
    manager.start_egm([Side.LEFT])
    manager.speed.set(1.0)
    manager.start_egm([Side.LEFT, Side.RIGHT])
    told = {side: arm.speed_scale.read() for side, arm in system.arms.items()}
    assert {side: letter[1] for side, letter in told.items() if letter} == {Side.LEFT: (0.1,), Side.RIGHT: (1.0,)}


def test_robot_itself_moves_no_faster_than_its_lowered_limit(system: System) -> None:
    manager = system.manager
    manager.speed.set(0.1)
    manager.start_egm()
    arm = system.arms[Side.RIGHT]
    start = arm.snapshot.position
    arm.go(joints([value + 0.4 * (index == 6) for index, value in enumerate(start)]))
    begin = len(arm.measured)
    system.until(lambda: arm.snapshot.position[6] > start[6] + 0.39, 5.0)
    ways = [after[6] - before[6] for before, after in pairwise(arm.measured[begin:])]
    assert max(ways) / CYCLE == pytest.approx(radians(18.0), rel=0.05)


@pytest.mark.parametrize(
    ("mode", "guided"),
    [
        (RobotMode.EGM_LEFT, {Side.LEFT}),
        (RobotMode.EGM_RIGHT, {Side.RIGHT}),
        (RobotMode.EGM_BOTH, set(Side)),
        (RobotMode.READY, set()),
    ],
)
def test_manager_goes_to_a_named_state_from_egm_on_both_arms(
    system: System, mode: RobotMode, guided: set[Side]
) -> None:
    system.manager.start_egm()
    system.manager.go_to(mode, system.steps.append)
    assert {side for side, egm in system.manager.state().egm.items() if egm == "running"} == guided
    assert {side for side, arm in system.arms.items() if arm.snapshot.is_commanded} == guided


def test_manager_reports_each_step_on_the_way(system: System) -> None:
    told: list[str] = []
    system.manager.go_to(RobotMode.EGM_RIGHT, told.append)
    assert told == [
        "switch the motors on",
        "move the program pointers to main",
        "start the RAPID program",
        "start EGM on the right arm",
        "activate joint_position_controller on the right arm",
    ]
    told.clear()
    system.manager.go_to(RobotMode.MOTORS_OFF, told.append)
    assert told == ["stop EGM", "motors off"]
    assert system.client.controller_state() is ControllerState.MOTORS_OFF


def test_manager_switches_step_by_step(system: System) -> None:
    manager = system.manager
    assert manager.motors_on() == "The motors are on"
    assert manager.pp_to_main() == "The program pointers are at main"
    assert manager.start_rapid() == "The RAPID program runs"
    assert manager.set_speed_ratio(40) == "The speed ratio is 40 %"
    assert manager.state().speed_ratio == 40
    assert manager.stop_rapid() == "The RAPID program is stopped"
    assert manager.motors_off() == "The motors are off"


def test_manager_refuses_steps_in_the_wrong_state(system: System) -> None:
    with refused(RobotNotReady, "cannot_start_rapid", reason=message("motors_off")):
        system.manager.start_rapid()
    system.manager.make_ready()
    with refused(RobotNotReady, "cannot_move_pp", reason=message("program_runs")):
        system.manager.pp_to_main()
    with refused(CommandRefused, "speed_ratio_out_of_range", percent=101, lowest=0, highest=100):
        system.manager.set_speed_ratio(101)


def test_manager_runs_a_routine_by_name(system: System) -> None:
    system.manager.make_ready()
    told = system.manager.run_routine(Side.LEFT, "runMoveToCalibrationPosition")
    assert told == "Routine runMoveToCalibrationPosition of T_ROB_L has run"
    assert system.world.arms[Side.LEFT].position[2] == pytest.approx(2.35619, abs=1e-4)


@pytest.mark.parametrize(("percent", "code"), [(0, "routine_without_speed"), (1, "routine_not_ended")])
def test_routine_that_does_not_end_is_explained(
    system: System, monkeypatch: pytest.MonkeyPatch, percent: int, code: str
) -> None:
    monkeypatch.setattr(rapid_routines, "LONGEST_ROUTINE", 0.5)
    system.manager.make_ready()
    goal = "[[20,-130,30,0,40,0],[135,9E+09,9E+09,9E+09,9E+09,9E+09]]"
    system.manager.panel.write_variable("T_ROB_L", "TRobRAPID", "move_jointtarget_input", goal)
    system.manager.set_speed_ratio(percent)
    with refused(RobotNotReady, code, routine="runMoveAbsJ", task="T_ROB_L", duration=0.5):
        system.manager.run_routine(Side.LEFT, "runMoveAbsJ")


def test_speed_ratio_is_changed_while_a_routine_runs(system: System, monkeypatch: pytest.MonkeyPatch) -> None:
    system.manager.make_ready()
    thread = Thread(target=system.manager.set_speed_ratio, args=(20,))
    during: list[int] = []
    wait = system.wait

    def wait_for_the_end(seconds: float) -> None:
        """The routine's end is polled: its turn is taken."""
        if system.manager._routines.is_running and thread.ident is None:
            thread.start()
            thread.join(1.0)
            during.append(system.world.controller.speed_ratio)
        wait(seconds)

    monkeypatch.setattr(system, "wait", wait_for_the_end)
    system.manager.run_routine(Side.LEFT, "runMoveToCalibrationPosition")
    thread.join()
    assert during == [20]


def test_manager_refuses_a_routine_while_egm_runs(system: System) -> None:
    system.manager.start_egm()
    machine = message("machine", arm="left", machine="RUN_EGM_ROUTINE")
    with refused(RobotNotReady, "cannot_run_routine", reason=message("not_idle", machines=(machine,))):
        system.manager.run_routine(Side.LEFT, "runMoveJ")


def test_manager_reads_and_writes_signals(system: System) -> None:
    assert system.manager.panel.read_signal("RUN_SG_ROUTINE") == "0"
    system.manager.write_signal("RUN_SG_ROUTINE", "1")
    assert system.manager.panel.read_signal("RUN_SG_ROUTINE") == "1"


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("nothing", "1", message("signal_unknown", signal="nothing")),
        ("RUN_SG_ROUTINE", "much", message("no_number_for_signal", value="much", signal="RUN_SG_ROUTINE")),
        ("RUN_SG_ROUTINE", "nan", message("signal_not_finite", value=nan, signal="RUN_SG_ROUTINE")),
        ("../panel", "1", message("no_signal_name", name="../panel")),
    ],
)
def test_manager_refuses_signals_that_cannot_be(system: System, name: str, value: str, said: Message) -> None:
    with refused(CommandRefused, said.code, **said.values):
        system.manager.write_signal(name, value)
    assert system.manager.panel.read_signal("RUN_SG_ROUTINE") == "0"


def test_manager_does_not_write_a_signal_that_is_read_only(system: System) -> None:
    with refused(ControllerRefused, "rws_refused", reason=message("rws_reject")):
        system.manager.write_signal("OUTPUT_STATIONARY_ROB_L", 0)


def test_manager_reads_and_writes_variables(system: System) -> None:
    system.manager.panel.write_variable("T_ROB_L", "TRobSG", "target_position_input", "12.5")
    assert system.manager.panel.read_variable("T_ROB_L", "TRobSG", "target_position_input") == "12.5"


def test_manager_refuses_variables_that_cannot_be(system: System) -> None:
    with refused(CommandRefused, "variable_unknown", module="TRobSG", variable="nothing", task="T_ROB_L"):
        system.manager.panel.read_variable("T_ROB_L", "TRobSG", "nothing")
    with refused(CommandRefused, "no_rapid_value", value="12,5", kind="num", example="1.5"):
        system.manager.panel.write_variable("T_ROB_L", "TRobSG", "target_position_input", "12,5")


PICK = """MODULE Pick
    PERS num count:=0;
    PROC pickOne()
        count:=count+%d;
    ENDPROC
ENDMODULE
"""


def test_manager_loads_a_module_and_runs_its_routine(system: System) -> None:
    system.manager.make_ready()
    told = system.manager.run_module(Side.LEFT, "Pick.mod", PICK % 1, "pickOne")
    assert told == "Routine pickOne of T_ROB_L has run"
    assert system.manager.panel.read_variable("T_ROB_L", "Pick", "count") == "1"
    assert system.client.execution() is ExecutionState.RUNNING


def test_manager_replaces_a_module_that_was_loaded_before(system: System) -> None:
    system.manager.make_ready()
    for step in (1, 5):
        system.manager.run_module(Side.LEFT, "Pick.mod", PICK % step, "pickOne")
    assert system.manager.panel.read_variable("T_ROB_L", "Pick", "count") == "5"


@pytest.mark.parametrize(
    ("file_name", "text", "said"),
    [
        ("../x.mod", PICK % 1, message("no_rapid_file_name", name="../x.mod")),
        ("Pick.mod", "PROC x() ENDPROC", message("text_without_module", file="Pick.mod")),
        ("Pick.mod", "MODULE TRobMain\nENDMODULE", message("module_name_reserved", module="TRobMain")),
        (
            "Pick.mod",
            "MODULE Pick\nPROC x( ENDPROC\nENDMODULE",
            message("module_not_loaded", task="T_ROB_L", path="HOME:/Pick.mod"),
        ),
    ],
)
def test_manager_refuses_modules_that_cannot_be(system: System, file_name: str, text: str, said: Message) -> None:
    system.manager.make_ready()
    with refused(CommandRefused, said.code, **said.values):
        system.manager.load_module(Side.LEFT, file_name, text)
    assert "Pick" not in {module.name for module in system.client.modules("T_ROB_L")}


def test_manager_says_that_a_routine_is_unknown(system: System) -> None:
    system.manager.make_ready()
    with refused(CommandRefused, "routine_unknown", task="T_ROB_R", routine="nothing"):
        system.manager.run_routine(Side.RIGHT, "nothing")
    assert system.client.execution() is ExecutionState.RUNNING


def test_motors_go_off_also_when_the_arms_cannot_come_to_rest_gently(system: System) -> None:
    system.manager.start_egm()
    system.faults.inject(Fault.WRONG_PROGRAM)
    system.manager.motors_on()
    assert system.manager.motors_off() == "The motors are off"
    assert system.client.controller_state() is ControllerState.MOTORS_OFF
    assert any("do not come to rest gently" in step for step in system.steps)


def test_stop_ends_what_is_being_done_before_its_next_step(system: System) -> None:
    """Asked from another thread; it waits for its turn, which comes at once."""
    stops: list[Thread] = []

    def told(step: str) -> None:
        if step == "start the RAPID program":
            stops.append(Thread(target=system.manager.stop_rapid))
            stops[0].start()
            while not system.manager._stop_requests:  # until the thread waits for its turn
                pass

    with refused(RobotNotReady, "stop_requested_meanwhile"):
        system.manager.go_to(RobotMode.EGM_BOTH, told)
    stops[0].join()
    assert system.client.execution() is ExecutionState.STOPPED


def moving_arm(system: System) -> DriverArm:
    """The right arm, on its way to a goal that is far."""
    system.manager.start_egm()
    arm = system.arms[Side.RIGHT]
    arm.go(joints([0.8 + value if index == 0 else value for index, value in enumerate(arm.snapshot.position)]))
    system.wait(0.2)
    assert arm.snapshot.velocity[0] > 0.5
    return arm


@pytest.mark.parametrize("stop", ["stop_egm", "stop_rapid", "motors_off", "set_mode"])
def test_stop_has_the_arms_hold_while_it_waits_for_its_turn(system: System, stop: str) -> None:
    arm, stops = moving_arm(system), list[Thread]()

    def request() -> None:
        if stop == "set_mode":
            system.manager.go_to(RobotMode.MOTORS_OFF, lambda _: None)
        else:
            getattr(system.manager, stop)()

    def within_another_turn() -> None:
        stops.append(Thread(target=request))
        stops[0].start()
        end = monotonic() + 5.0
        while arm.snapshot.is_commanded and monotonic() < end:
            pass
        assert not arm.snapshot.is_commanded

    with refused(RobotNotReady, "stop_requested_meanwhile"):
        system.manager.start_egm(check=within_another_turn)
    stops[0].join()
    assert system.manager.egm_arms == ()


@pytest.mark.parametrize("stop", ["stop_egm", "stop_rapid", "motors_off", "end_motion"])
def test_stop_has_the_arms_hold_although_the_controller_does_not_answer(
    system: System, stop: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    arm = moving_arm(system)

    def not_heard(*_: object) -> str:
        raise NoConnection("The controller does not answer.")

    for request in ("symbol", "execution", "controller_state"):
        monkeypatch.setattr(system.client, request, not_heard)
    with pytest.raises(NoConnection):
        getattr(system.manager, stop)()
    assert not arm.snapshot.is_commanded
    system.until(lambda: max(map(abs, arm.snapshot.velocity)) < 1e-3, 1.0)


def test_recover_starts_egm_again_on_an_arm_that_ignores_its_references(system: System) -> None:
    arm = system.arms[Side.RIGHT]
    system.manager.start_egm()
    session = arm.snapshot.session
    system.faults.inject(Fault.EGM_LOSS, Side.RIGHT, 1.0, 100.0, FaultDirection.TO_ROBOT)
    arm.go(joints([value + 0.2 for value in arm.snapshot.position]))
    system.wait(0.5)
    assert arm.snapshot.problem is ArmProblem.REFERENCES_IGNORED
    assert not arm.snapshot.is_commanded
    assert "the controllers are active" in system.manager.recover(lambda _: None)
    assert (arm.snapshot.problem, arm.snapshot.is_commanded) == (ArmProblem.NONE, True)
    assert arm.snapshot.session > session
    system.wait(1.0)
    goal = joints([value + 0.2 for value in arm.snapshot.position])
    arm.go(goal)
    system.until(lambda: arm.snapshot.position == pytest.approx(goal, abs=1e-2), 2.0)
