"""The state machine's states: start-up, guards, stopping and going on, RAPID routines."""

import pytest
from state_machine_bench import ARMS, Bench

from abb_protocols.robot.joints import Side, home
from abb_protocols.rws.values import ControllerState
from virtual_irc5.controller_log import RefusalReason, Refused

EDGES = ("EGM_START_JOINT", "EGM_START_POSE", "EGM_START_STREAM", "EGM_STOP", "EGM_STOP_STREAM")

# In which state and action a request is accepted, and what the arm then says (reference/statemachine.md §2.3).
# Everything that is not listed is ignored without a word.
ACCEPTED = {
    ("EGM_START_JOINT", 0, 0): "[EGM]: Waiting for fine point...",
    ("EGM_START_POSE", 0, 0): "[EGM]: Pose motion is not available for IRB 14000",
    ("EGM_START_STREAM", 0, 0): "[EGM]: Waiting for fine point...",
    ("EGM_STOP", 3, 1): "[EGM]: Stopping motion...",
    ("EGM_STOP", 3, 2): "[EGM]: Stopping motion...",
    ("EGM_STOP_STREAM", 0, 4): "[EGM]: Stopping stream...",
}
GUARDS = [(signal, state, action) for signal in EDGES for state in range(4) for action in range(6)]


@pytest.fixture
def bench() -> Bench:
    bench = Bench()
    bench.bring_up()
    return bench


@pytest.fixture(scope="module")
def shared_bench() -> Bench:
    """For the guards that ignore a request, which leave no trace."""
    bench = Bench()
    bench.bring_up()
    return bench


def put(bench: Bench, state: int, action: int) -> None:
    for side in ARMS:
        bench.write(side, "TRobMain", "current_state", str(state))
        bench.write(side, "TRobEGM", "current_action", str(action))


def test_controller_starts_with_motors_off_and_rapid_stopped() -> None:
    controller = Bench().controller
    assert controller.controller_state is ControllerState.MOTORS_OFF
    assert not controller.is_running
    assert list(controller.tasks) == ["T_ROB_R", "T_ROB_L"]


def test_state_reads_initialize_before_the_first_start() -> None:
    assert Bench().states == (1, 1)


def test_start_leads_to_idle_within_moments(bench: Bench) -> None:
    assert (bench.states, bench.actions) == ((0, 0), (0, 0))
    for side in ARMS:
        assert bench.screen(side)[-2:] == ("[Main]: Starting StateMachine loop", "[Main]: Idling...")


def test_idle_message_comes_once_in_ten_seconds(bench: Bench) -> None:
    bench.run(25.0)
    assert bench.screen(Side.LEFT).count("[Main]: Idling...") == 3


@pytest.mark.parametrize(("signal", "state", "action"), sorted(ACCEPTED))
def test_request_is_accepted(bench: Bench, signal: str, state: int, action: int) -> None:
    put(bench, state, action)
    bench.pulse(signal)
    for side in ARMS:
        assert ACCEPTED[signal, state, action] in bench.screen(side)


@pytest.mark.parametrize(("signal", "state", "action"), [limiter for limiter in GUARDS if limiter not in ACCEPTED])
def test_request_is_ignored_without_a_word(shared_bench: Bench, signal: str, state: int, action: int) -> None:
    put(shared_bench, state, action)
    before = [shared_bench.screen(side) for side in ARMS]
    shared_bench.pulse(signal)
    assert (shared_bench.states, shared_bench.actions) == ((state, state), (action, action))
    assert [shared_bench.screen(side) for side in ARMS] == before


def test_signal_that_stays_high_is_no_second_edge(bench: Bench) -> None:
    bench.pulse("EGM_START_POSE")
    bench.run(0.2)
    assert bench.states == (0, 0)
    bench.controller.signals.set("EGM_START_POSE", 1)
    bench.controller.settle()
    assert bench.states == (0, 0)


def test_falling_edge_does_nothing(bench: Bench) -> None:
    bench.controller.signals.set("EGM_START_JOINT", 1)
    bench.controller.settle()
    bench.pulse("EGM_STOP")
    bench.run_until(lambda: bench.states == (0, 0), limit=1.0)
    bench.controller.signals.set("EGM_START_JOINT", 0)
    bench.controller.settle()
    assert bench.states == (0, 0)


def test_edge_is_lost_while_rapid_is_stopped(bench: Bench) -> None:
    bench.controller.stop_rapid()
    bench.pulse("EGM_START_JOINT")
    bench.controller.start_rapid()
    bench.run(0.1)
    assert (bench.states, bench.actions) == ((0, 0), (0, 0))


def test_stop_and_start_keep_the_settings(bench: Bench) -> None:
    bench.set_egm("run.cond_time", "7")
    bench.controller.stop_rapid()
    bench.run(0.1)
    bench.controller.start_rapid()
    bench.run(0.1)
    assert bench.egm_setting(Side.LEFT, "run.cond_time") == "7"


def test_pp_to_main_resets_the_settings(bench: Bench) -> None:
    bench.set_egm("run.cond_time", "7")
    bench.controller.stop_rapid()
    bench.controller.move_pp_to_main()
    assert bench.states == (1, 1)
    bench.controller.start_rapid()
    bench.run_until(lambda: bench.states == (0, 0), limit=0.5)
    assert bench.egm_setting(Side.LEFT, "run.cond_time") == "60"


def test_pp_to_main_after_a_stop_in_the_middle_of_egm_leaves_a_robot_that_starts_again(bench: Bench) -> None:
    for _ in range(5):
        bench.pulse("EGM_START_JOINT")
        bench.run(0.2)
        bench.controller.stop_rapid()
        bench.run(3.0)
        bench.controller.move_pp_to_main()
        bench.controller.start_rapid()
        bench.run_until(lambda: (bench.states, bench.actions) == ((0, 0), (0, 0)), limit=0.5)


def test_stop_and_start_in_the_middle_of_egm_go_on_guiding(bench: Bench) -> None:
    bench.pulse("EGM_START_JOINT")
    bench.run(0.2)
    bench.controller.stop_rapid()
    bench.run(3.0)
    bench.sensors[Side.LEFT].heard.clear()
    bench.controller.start_rapid()
    bench.run(0.2)
    assert bench.states == (3, 3)
    assert bench.sensors[Side.LEFT].heard[0].seqno == 0


def test_motors_off_stop_rapid(bench: Bench) -> None:
    bench.controller.set_motors(False)
    assert not bench.controller.is_running
    with pytest.raises(Refused, match="RAPID starts with motors on only") as refused:
        bench.controller.start_rapid()
    assert refused.value.reason is RefusalReason.MOTORS_OFF


def test_run_move_abs_j_moves_the_arm_with_a_target_and_not_the_other(bench: Bench) -> None:
    target = "[[10,-120,30,0,40,0],[-130,9E+09,9E+09,9E+09,9E+09,9E+09]]"
    bench.write(Side.RIGHT, "TRobRAPID", "move_jointtarget_input", target)
    bench.write(Side.RIGHT, "TRobRAPID", "move_speed_input", "[1000,500,5000,1000]")
    bench.write(Side.RIGHT, "TRobRAPID", "routine_name_input", '"runMoveAbsJ"')
    bench.pulse("RUN_RAPID_ROUTINE")
    assert bench.states == (2, 0)
    bench.run_until(lambda: bench.states == (0, 0), limit=5.0)
    robax, extax = bench.controller.joint_target("ROB_R")
    assert robax == pytest.approx((10, -120, 30, 0, 40, 0), abs=1e-3)
    assert extax[0] == pytest.approx(-130, abs=1e-3)
    assert bench.world.arms[Side.LEFT].position == pytest.approx(home(Side.LEFT), abs=1e-9)
    assert bench.read(Side.RIGHT, "TRobRAPID", "routine_name_input") == '""'


def test_stationary_signal_falls_while_the_arm_moves(bench: Bench) -> None:
    bench.write(Side.RIGHT, "TRobRAPID", "move_jointtarget_input", "[[20,-130,30,0,40,0],[-135,0,0,0,0,0]]")
    bench.write(Side.RIGHT, "TRobRAPID", "routine_name_input", '"runMoveAbsJ"')
    assert bench.controller.signals.get("OUTPUT_STATIONARY_ROB_R").value == 1
    bench.pulse("RUN_RAPID_ROUTINE")
    bench.run(0.3)
    assert bench.controller.signals.get("OUTPUT_STATIONARY_ROB_R").value == 0
    assert bench.controller.signals.get("OUTPUT_STATIONARY_ROB_L").value == 1


def test_stopped_motion_goes_on_to_its_target_after_the_start(bench: Bench) -> None:
    bench.write(Side.RIGHT, "TRobRAPID", "move_jointtarget_input", "[[20,-130,30,0,40,0],[-135,0,0,0,0,0]]")
    bench.write(Side.RIGHT, "TRobRAPID", "routine_name_input", '"runMoveAbsJ"')
    bench.pulse("RUN_RAPID_ROUTINE")
    bench.run(0.3)
    bench.controller.stop_rapid()
    bench.run(1.0)
    assert bench.world.arms[Side.RIGHT].is_stationary
    bench.controller.start_rapid()
    bench.run_until(lambda: bench.states == (0, 0), limit=10.0)
    assert bench.controller.joint_target("ROB_R")[0][0] == pytest.approx(20, abs=1e-3)


def test_move_to_the_calibration_position(bench: Bench) -> None:
    bench.write(Side.LEFT, "TRobRAPID", "move_jointtarget_input", "[[0,-110,30,0,40,0],[135,0,0,0,0,0]]")
    for routine in ("runMoveAbsJ", "runMoveToCalibrationPosition"):
        bench.write(Side.LEFT, "TRobRAPID", "routine_name_input", f'"{routine}"')
        bench.pulse("RUN_RAPID_ROUTINE")
        bench.run_until(lambda: bench.states == (0, 0), limit=20.0)
    assert bench.world.arms[Side.LEFT].position == pytest.approx(home(Side.LEFT), abs=1e-4)


def test_target_out_of_range_is_reported_and_moves_nothing(bench: Bench) -> None:
    bench.write(Side.LEFT, "TRobRAPID", "move_jointtarget_input", "[[0,-130,300,0,40,0],[135,0,0,0,0,0]]")
    bench.write(Side.LEFT, "TRobRAPID", "routine_name_input", '"runMoveAbsJ"')
    bench.pulse("RUN_RAPID_ROUTINE")
    bench.run_until(lambda: bench.states == (0, 0), limit=1.0)
    assert "[RAPID]: 'runMoveAbsJ' failed!" in bench.screen(Side.LEFT)
    assert bench.world.arms[Side.LEFT].position == pytest.approx(home(Side.LEFT), abs=1e-9)


def test_routine_requested_during_egm_waits_for_the_next_edge(bench: Bench) -> None:
    bench.pulse("EGM_START_JOINT")
    bench.run(0.1)
    bench.write(Side.LEFT, "TRobRAPID", "routine_name_input", '"runMoveToCalibrationPosition"')
    bench.pulse("RUN_RAPID_ROUTINE")
    assert bench.states == (3, 3)
    assert bench.read(Side.LEFT, "TRobRAPID", "routine_name_input") == '"runMoveToCalibrationPosition"'


def test_unknown_routine_is_cleared_and_does_nothing(bench: Bench) -> None:
    bench.write(Side.LEFT, "TRobRAPID", "routine_name_input", '"nothingOfTheKind"')
    bench.pulse("RUN_RAPID_ROUTINE")
    bench.run_until(lambda: bench.states == (0, 0), limit=0.1)
    assert bench.read(Side.LEFT, "TRobRAPID", "routine_name_input") == '""'
    assert "[RAPID]: Attempting 'nothingOfTheKind'" in bench.screen(Side.LEFT)


def test_configuration_is_read_into_the_utility_module(bench: Bench) -> None:
    info = bench.read(Side.LEFT, "TRobUtility", "general_info")
    assert info == '[TRUE,"ROB_L",TRUE,TRUE,TRUE,6,TRUE,[[0,0,0],[1,0,0,0]]]'
    calibration = bench.read(Side.RIGHT, "TRobUtility", "calibration_values")
    assert calibration.endswith("TRUE,0.698132,TRUE,0,TRUE,-2.35619]")


def run_routine(bench: Bench, name: str) -> None:
    bench.write(Side.LEFT, "TRobRAPID", "routine_name_input", f'"{name}"')
    bench.pulse("RUN_RAPID_ROUTINE")
    bench.run_until(lambda: bench.states == (0, 0), limit=5.0)


def test_custom_module_is_loaded_called_and_unloaded(bench: Bench) -> None:
    """As yumirws does it (reference/statemachine.md §4.2)."""
    bench.controller.files["HOME:/custom.sys"] = (
        'MODULE custom\nVAR num calls;\nPROC custom_routine0()\ncalls:=calls+1;\nTPWrite "custom";\nENDPROC\nENDMODULE'
    )
    bench.write(Side.LEFT, "TRobRAPID", "module_file_path_input", '"HOME:/custom.sys"')
    run_routine(bench, "runModuleUnload")
    assert "[RAPID]: 'runModuleUnload' failed!" in bench.screen(Side.LEFT)
    run_routine(bench, "runModuleLoad")
    bench.write(Side.LEFT, "TRobRAPID", "callbyvar_name_input", '"custom_routine"')
    run_routine(bench, "runCallByVar")
    assert "custom" in bench.screen(Side.LEFT)
    assert bench.read(Side.LEFT, "custom", "calls") == "1"
    run_routine(bench, "runModuleUnload")
    assert "custom" not in [module.name for module in bench.controller.tasks["T_ROB_L"].modules]


def test_module_that_is_loaded_already_is_no_failure(bench: Bench) -> None:
    bench.controller.files["HOME:/custom.sys"] = "MODULE custom\nENDMODULE"
    bench.write(Side.LEFT, "TRobRAPID", "module_file_path_input", '"HOME:/custom.sys"')
    for _ in range(2):
        run_routine(bench, "runModuleLoad")
    assert "[RAPID]: 'runModuleLoad' failed!" not in bench.screen(Side.LEFT)


def test_emergency_stop_during_egm_leaves_a_robot_that_starts_again(bench: Bench) -> None:
    bench.pulse("EGM_START_JOINT")
    bench.run(0.2)
    bench.controller.press_emergency_stop()
    bench.run(0.5)
    assert all(arm.is_stationary for arm in bench.world.arms.values())
    bench.controller.release_emergency_stop()
    bench.bring_up()
    bench.pulse("EGM_START_JOINT")
    bench.run(0.2)
    assert (bench.states, bench.actions) == ((3, 3), (1, 1))
