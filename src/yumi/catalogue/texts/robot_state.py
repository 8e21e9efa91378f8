"""May the robot move: what is not so, and what stopped it."""

from __future__ import annotations

from collections.abc import Mapping

from yumi.catalogue.text import Text

ROBOT_STATE: Mapping[str, Text] = {
    "controller_does_not_answer": Text("the controller does not answer", "check its power and the network cable"),
    "state_is_old": Text("the robot's state is unknown: it was read {age:.0f} s ago"),
    "not_in_auto": Text("the controller is in {mode}", "{turn_to_auto}"),
    "mode_unknown": Text("the controller is in an unknown mode", "{turn_to_auto}"),
    "emergency_stop_pressed": Text("the emergency stop is pressed", "{release_stop}"),
    "guard_stop_active": Text(
        "a guard stop keeps the motors off", "close the guard, or press motors on at the controller"
    ),
    "system_failure": Text("the controller is in system failure", "restart the controller"),
    "motors_off": Text("the motors are off", "{motors_on}"),
    "motors_off_after_emergency_stop": Text("the motors are off after an emergency stop", "{motors_on}"),
    "program_stopped": Text("the RAPID program is stopped", "{recover}"),
    "program_runs": Text("the RAPID program runs", "stop it first"),
    "not_idle": Text(
        "a state machine is not idle ({machines})", "{stop_egm}, or wait for the end of the RAPID routine"
    ),
    "neither_idle_nor_in_egm": Text(
        "the state machines are not idle ({machines})", "wait for the end of the RAPID routine, or {recover}"
    ),
    "machine": Text("{arm} arm: {machine}"),
    "stop_open": Text("a person must confirm the stop {stop}", "{confirm_stop}"),
    # ---- what is refused for it
    "not_ready": Text("not ready: {reasons}"),
    "not_ready_after": Text("not ready: {reasons}. {causes}"),
    "refused": Text("{request} refused: {reason}", "{reason:remedy}"),
    "stopped_by": Text("the robot was stopped by {causes}", "{confirm_stop}. Nothing moves before that"),
    "still_stopped": Text(
        "the stop {stop} cannot be confirmed yet: {reason}. The robot was stopped by {causes}",
        "{reason:remedy}, then {confirm_stop}",
    ),
    "stopped_and_active": Text(
        "the robot was stopped by {causes}. Now {reason}", "{reason:remedy}, then {confirm_stop}"
    ),
    "another_stop": Text("{given:quoted} is not the stop that is open now. The open one: {open:sentence}"),
    # ---- what happened to an arm, and why
    "explained": Text("{event:sentence} Cause: {causes}"),
    "explained_stop": Text("{event:sentence} Cause: {causes}. {Confirm_stop}"),
    "ended_by_program": Text(
        "{event:sentence} The controller reports no stop: its program has ended EGM, or another client has"
    ),
}
