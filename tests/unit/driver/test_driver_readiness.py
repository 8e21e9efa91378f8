"""The table of conditions: which request needs what, what each refusal says, and the page written from it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from abb_protocols.catalogue import Message, clause, message, remedy_of
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import RobotNotReady
from abb_protocols.robot.joints import Side
from abb_protocols.rws.values import ControllerState, ExecutionState, OperatingMode
from refusals import refused
from yumi.control.shared_state import ArmProblem, Snapshot
from yumi.driver.readiness import (
    NEEDED,
    Condition,
    ConditionalRequest,
    check_request,
    reference_page,
    unmet,
    why_arm_does_not_follow,
    why_not_ready,
)
from yumi.driver.robot_state import EGM_RUNNING, RobotState
from yumi.driver.state_machine import MachineState

READY = RobotState(
    is_connected=True,
    operating_mode=OperatingMode.AUTO,
    controller_state=ControllerState.MOTORS_ON,
    execution=ExecutionState.RUNNING,
    machines=dict.fromkeys(Side, MachineState.IDLE),
)
STOPPED = replace(READY, execution=ExecutionState.STOPPED)
BUSY = replace(READY, machines={Side.RIGHT: MachineState.RUN_RAPID_ROUTINE, Side.LEFT: MachineState.IDLE})

BUSY_RIGHT = message("machine", arm="right", machine="RUN_RAPID_ROUTINE")


def stopped_by(state: ControllerState) -> RobotState:
    return replace(STOPPED, controller_state=state)


def test_robot_that_is_ready_meets_every_condition_of_ready() -> None:
    assert why_not_ready(READY) == ()
    assert unmet(NEEDED[ConditionalRequest.READY], READY) is None


@pytest.mark.parametrize(
    ("state", "reason"),
    [
        (RobotState(), [message("controller_does_not_answer")]),
        (replace(READY, operating_mode=None), [message("mode_unknown")]),
        (replace(READY, operating_mode=OperatingMode.MANUAL_REDUCED), [message("not_in_auto", mode="MANR")]),
        (stopped_by(ControllerState.EMERGENCY_STOP), [message("emergency_stop_pressed")]),
        (stopped_by(ControllerState.EMERGENCY_STOP_RESET), [message("motors_off_after_emergency_stop")]),
        (stopped_by(ControllerState.GUARD_STOP), [message("guard_stop_active")]),
        (stopped_by(ControllerState.SYSTEM_FAILURE), [message("system_failure")]),
        (stopped_by(ControllerState.MOTORS_OFF), [message("motors_off")]),
        (STOPPED, [message("program_stopped")]),
        (BUSY, [message("neither_idle_nor_in_egm", machines=(BUSY_RIGHT,))]),
        (
            replace(READY, machines=dict.fromkeys(Side)),
            [
                message(
                    "neither_idle_nor_in_egm",
                    machines=tuple(
                        message("machine", arm=arm, machine="no state machine") for arm in ("right", "left")
                    ),
                )
            ],
        ),
        (replace(READY, stop="10013-7-ab"), [message("stop_open", stop="10013-7-ab")]),
        (
            replace(stopped_by(ControllerState.EMERGENCY_STOP), stop="10013-7-ab"),
            [message("emergency_stop_pressed"), message("stop_open", stop="10013-7-ab")],
        ),
    ],
)
def test_reason_is_the_first_condition_that_is_not_met_and_an_open_stop(
    state: RobotState, reason: list[Message]
) -> None:
    assert why_not_ready(state) == tuple(reason)


@pytest.mark.parametrize(
    "state", [STOPPED, BUSY, stopped_by(ControllerState.MOTORS_OFF), stopped_by(ControllerState.EMERGENCY_STOP_RESET)]
)
def test_what_recovering_does_is_not_asked_for_beside_a_confirmation(state: RobotState) -> None:
    assert why_not_ready(replace(state, stop="50204-1-cd")) == (message("stop_open", stop="50204-1-cd"),)


def test_arm_in_egm_is_ready() -> None:
    machines = dict.fromkeys(Side, MachineState.RUN_EGM_ROUTINE)
    assert why_not_ready(replace(READY, machines=machines, egm=dict.fromkeys(Side, EGM_RUNNING))) == ()


@pytest.mark.parametrize(
    ("request_", "state", "code", "reason"),
    [
        (
            ConditionalRequest.WRITE,
            replace(READY, operating_mode=OperatingMode.MANUAL_FULL),
            "cannot_write",
            message("not_in_auto", mode="MANF"),
        ),
        (
            ConditionalRequest.BRING_UP,
            stopped_by(ControllerState.EMERGENCY_STOP),
            "cannot_bring_up",
            message("emergency_stop_pressed"),
        ),
        (
            ConditionalRequest.START_RAPID,
            stopped_by(ControllerState.MOTORS_OFF),
            "cannot_start_rapid",
            message("motors_off"),
        ),
        (ConditionalRequest.MOVE_PP, READY, "cannot_move_pp", message("program_runs")),
        (ConditionalRequest.RUN_ROUTINE, BUSY, "cannot_run_routine", message("not_idle", machines=(BUSY_RIGHT,))),
        (ConditionalRequest.CALIBRATE, BUSY, "cannot_calibrate", message("not_idle", machines=(BUSY_RIGHT,))),
    ],
)
def test_request_is_refused_with_its_reason(
    request_: ConditionalRequest, state: RobotState, code: str, reason: Message
) -> None:
    with refused(RobotNotReady, code, reason=reason):
        check_request(request_, state)


def test_condition_of_one_arm_leaves_the_other_out() -> None:
    check_request(ConditionalRequest.RUN_ROUTINE, BUSY, (Side.LEFT,))
    with refused(RobotNotReady, "cannot_calibrate", reason=message("not_idle", machines=(BUSY_RIGHT,))):
        check_request(ConditionalRequest.CALIBRATE, BUSY, (Side.RIGHT,))


def test_what_a_bring_up_brings_about_does_not_forbid_it() -> None:
    check_request(ConditionalRequest.BRING_UP, stopped_by(ControllerState.MOTORS_OFF))
    check_request(ConditionalRequest.BRING_UP, BUSY)


@pytest.mark.parametrize("front_end", FrontEnd)
@pytest.mark.parametrize("condition", dict.fromkeys(each for needed in NEEDED.values() for each in needed))
def test_every_condition_says_a_reason_and_a_remedy_to_every_reader(condition: Condition, front_end: FrontEnd) -> None:
    reason = condition.reason(replace(READY, stop="50204-1-cd"), tuple(Side))
    assert clause(reason, front_end)
    assert remedy_of(reason, front_end)


@pytest.mark.parametrize(
    ("snapshot", "reason"),
    [
        (Snapshot(), message("arm_without_egm", arm="left")),
        (Snapshot(is_running=True), None),
        (
            Snapshot(is_running=True, problem=ArmProblem.REFERENCES_IGNORED),
            message("references_ignored", arm="left"),
        ),
        (Snapshot(is_running=True, problem=ArmProblem.IMPLAUSIBLE), message("feedback_implausible", arm="left")),
    ],
)
def test_arm_says_why_it_takes_no_goals(snapshot: Snapshot, reason: Message | None) -> None:
    assert why_arm_does_not_follow(Side.LEFT, snapshot) == reason


@pytest.mark.words
def test_page_of_the_documentation_is_what_the_table_says() -> None:
    page = Path(__file__).parents[3] / "docs" / "reference" / "readiness.md"
    assert page.read_text() == reference_page(), "run: make pages"
