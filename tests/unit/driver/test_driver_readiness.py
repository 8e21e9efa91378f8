"""The table of conditions: which request needs what, what each refusal says, and the page written from it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from yumi.control.shared_state import Problem, Snapshot
from yumi.driver.readiness import (
    EGM_RUNNING,
    NEEDED,
    Condition,
    Request,
    RobotState,
    check_request,
    reason_of,
    reference_page,
    sentence_of,
    unmet,
    why_arm_does_not_follow,
    why_not_ready,
)
from yumi.driver.state_machine import MachineState
from yumi.errors import RobotNotReady
from yumi.robot.joints import Side
from yumi.rws.types import ControllerState, ExecutionState, OperatingMode

READY = RobotState(
    is_connected=True,
    operating_mode=OperatingMode.AUTO,
    controller_state=ControllerState.MOTORS_ON,
    execution=ExecutionState.RUNNING,
    machines=dict.fromkeys(Side, MachineState.IDLE),
)
STOPPED = replace(READY, execution=ExecutionState.STOPPED)
BUSY = replace(READY, machines={Side.RIGHT: MachineState.RUN_RAPID_ROUTINE, Side.LEFT: MachineState.IDLE})


def stopped_by(state: ControllerState) -> RobotState:
    return replace(STOPPED, controller_state=state)


def test_robot_that_is_ready_meets_every_condition_of_ready() -> None:
    assert why_not_ready(READY) == ""
    assert unmet(NEEDED[Request.READY], READY) is None


@pytest.mark.parametrize(
    ("state", "reason"),
    [
        (RobotState(), "the controller does not answer"),
        (replace(READY, operating_mode=OperatingMode.MANUAL_REDUCED), "the controller is in MANR"),
        (stopped_by(ControllerState.EMERGENCY_STOP), "the emergency stop is pressed"),
        (stopped_by(ControllerState.EMERGENCY_STOP_RESET), "the motors are off after an emergency stop"),
        (stopped_by(ControllerState.GUARD_STOP), "a guard stop keeps the motors off"),
        (stopped_by(ControllerState.SYSTEM_FAILURE), "the controller is in system failure"),
        (stopped_by(ControllerState.MOTORS_OFF), "the motors are off"),
        (STOPPED, "the RAPID program is stopped"),
        (BUSY, "the state machines are not idle (right arm: RUN_RAPID_ROUTINE)"),
        (
            replace(READY, machines=dict.fromkeys(Side)),
            "the state machines are not idle (right arm: no state machine, left arm: no state machine)",
        ),
        (replace(READY, stop="10013-7-ab"), "a person must confirm the stop 10013-7-ab"),
        (
            replace(STOPPED, stop="50204-1-cd"),
            "the RAPID program is stopped; a person must confirm the stop 50204-1-cd",
        ),
    ],
)
def test_reason_names_the_first_condition_that_is_not_met_and_an_open_stop(state: RobotState, reason: str) -> None:
    assert why_not_ready(state) == reason


def test_arm_in_egm_is_ready() -> None:
    machines = dict.fromkeys(Side, MachineState.RUN_EGM_ROUTINE)
    assert why_not_ready(replace(READY, machines=machines, egm=dict.fromkeys(Side, EGM_RUNNING))) == ""


@pytest.mark.parametrize(
    ("request_", "state", "sentence"),
    [
        (
            Request.WRITE,
            replace(READY, operating_mode=OperatingMode.MANUAL_FULL),
            "The controller is in MANF; turn it to AUTO on the FlexPendant, nothing else can.",
        ),
        (
            Request.BRING_UP,
            stopped_by(ControllerState.EMERGENCY_STOP),
            "The emergency stop is pressed; release it where it was pressed.",
        ),
        (Request.START_RAPID, stopped_by(ControllerState.MOTORS_OFF), "The motors are off; switch the motors on."),
        (Request.MOVE_PP, READY, "The RAPID program runs; stop it first."),
        (
            Request.RUN_ROUTINE,
            BUSY,
            "A state machine is not idle (right arm: RUN_RAPID_ROUTINE); end EGM, or wait for the end of the RAPID "
            "routine.",
        ),
        (
            Request.CALIBRATE,
            BUSY,
            "A state machine is not idle (right arm: RUN_RAPID_ROUTINE); end EGM, or wait for the end of the RAPID "
            "routine.",
        ),
    ],
)
def test_request_is_refused_with_reason_and_remedy(request_: Request, state: RobotState, sentence: str) -> None:
    with pytest.raises(RobotNotReady) as refusal:
        check_request(request_, state)
    assert str(refusal.value) == sentence


def test_condition_of_one_arm_leaves_the_other_out() -> None:
    check_request(Request.RUN_ROUTINE, BUSY, (Side.LEFT,))
    with pytest.raises(RobotNotReady, match=r"^The right gripper cannot be calibrated: a state machine is not idle"):
        check_request(Request.CALIBRATE, BUSY, (Side.RIGHT,), "the right gripper cannot be calibrated: ")


def test_what_a_bring_up_brings_about_does_not_forbid_it() -> None:
    check_request(Request.BRING_UP, stopped_by(ControllerState.MOTORS_OFF))
    check_request(Request.BRING_UP, BUSY)


@pytest.mark.parametrize("condition", dict.fromkeys(each for needed in NEEDED.values() for each in needed))
def test_every_condition_says_a_reason_and_a_remedy(condition: Condition) -> None:
    state = replace(READY, stop="50204-1-cd")
    assert not {"{", "}"} & set(reason_of(condition, state))
    assert sentence_of(condition, state)[0].isupper()
    assert sentence_of(condition, state).endswith(f"; {condition.remedy}.")


@pytest.mark.parametrize(
    ("snapshot", "reason"),
    [
        (Snapshot(), "EGM is not running on the left arm"),
        (Snapshot(is_running=True), ""),
        (
            Snapshot(is_running=True, problem=Problem.REFERENCES_IGNORED),
            "left arm: the robot does not follow the references",
        ),
    ],
)
def test_arm_says_why_it_takes_no_goals(snapshot: Snapshot, reason: str) -> None:
    assert why_arm_does_not_follow(Side.LEFT, snapshot).startswith(reason)
    assert bool(why_arm_does_not_follow(Side.LEFT, snapshot)) is bool(reason)


def test_page_of_the_documentation_is_what_the_table_says() -> None:
    page = Path(__file__).parents[3] / "docs" / "reference" / "readiness.md"
    assert page.read_text() == reference_page(), "run: python -m yumi.driver.readiness > docs/reference/readiness.md"
