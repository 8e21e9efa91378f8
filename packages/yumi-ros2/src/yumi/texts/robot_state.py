"""Texts about the state of the robot: conditions of a motion that are not met, and causes of a stop."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text

ROBOT_STATE: Mapping[str, Text] = {
    "controller_does_not_answer": Text("the controller does not answer", "check its power and the network cable"),
    "state_is_old": Text(
        "the robot's state is not known: it was last read {age:.0f} s ago",
        "check the network and the controller",
    ),
    "not_in_auto": Text("the controller is in operating mode {mode}, not in AUTO", "{turn_to_auto}"),
    "mode_unknown": Text("the controller is in an unknown mode", "{turn_to_auto}"),
    "emergency_stop_pressed": Text("the emergency stop is pressed", "{release_stop}"),
    "guard_stop_active": Text(
        "a guard stop keeps the motors off",
        "close the guard, or end what else causes the guard stop",
    ),
    "system_failure": Text("the controller is in system failure", "restart the controller"),
    "motors_off": Text("the motors are off", "{motors_on}"),
    "motors_off_after_emergency_stop": Text("the motors are off after an emergency stop", "{motors_on}"),
    "program_stopped": Text("the RAPID program is stopped", "{recover}"),
    "program_runs": Text(
        "the RAPID program runs",
        "stop the program first (stop button of the FlexPendant)",
    ),
    "not_idle": Text(
        "a state machine is not idle ({machines})", "{stop_egm}, or wait for the end of the RAPID routine"
    ),
    "neither_idle_nor_in_egm": Text(
        "the state machines are not idle ({machines})", "wait for the end of the RAPID routine, or {recover}"
    ),
    "machine": Text("{arm} arm: {machine}"),
    "stop_open": Text("a stop waits for a person's confirmation", "{confirm_stop}"),
    # ---- what is refused for it
    "not_ready": Text("the robot is not ready. {reasons:sentence}"),
    "not_ready_after_stop": Text("the robot is not ready: it was stopped by {causes}. {reasons:sentence}"),
    "cannot_bring_up": Text("the robot cannot be made ready: {reason}", "{reason:remedy}"),
    "bring_up_not_named": Text(
        "connecting moves nothing on a real robot, and it is not ready; missing: {steps}",
        "connect with bringup=True when no person is near the arms",
    ),
    "cannot_start_rapid": Text("the RAPID program cannot start: {reason}", "{reason:remedy}"),
    "cannot_run_routine": Text("a RAPID routine cannot run: {reason}", "{reason:remedy}"),
    "cannot_load_module": Text("a RAPID module cannot be loaded: {reason}", "{reason:remedy}"),
    "cannot_move_pp": Text("the program pointers cannot be moved: {reason}", "{reason:remedy}"),
    "cannot_write": Text("nothing can be written: {reason}", "{reason:remedy}"),
    "cannot_move_gripper": Text("the gripper cannot be moved: {reason}", "{reason:remedy}"),
    "cannot_calibrate": Text("the gripper cannot be calibrated: {reason}", "{reason:remedy}"),
    "cannot_be_ready": Text("the robot is not ready: {reason}", "{reason:remedy}"),
    "stopped_by": Text(
        "the robot was stopped by {causes}",
        "{causes:steps}{confirm_stop}; nothing moves before that",
    ),
    "still_stopped": Text(
        "the robot was stopped by {causes}. The stop {stop} cannot be confirmed yet: {reason}",
        "{reason:remedy}; after that, {confirm_stop}",
    ),
    "stopped_by_and_active": Text(
        "the robot was stopped by {causes}. The robot cannot move yet: {reason}",
        "{reason:remedy}; after that, {confirm_stop}",
    ),
    "another_stop_open": Text("{given:quoted} is not the stop that is open now. {open:sentence}"),
    "robot_stands": Text(
        "the robot is at rest. {cause}",
    ),
    "robot_stands_unconfirmed": Text(
        "{error:sentence} The robot is at rest. {cause} No person has confirmed the stop",
    ),
    "stop_before_installation": Text(
        "the robot was stopped by {causes}. Nothing starts until a person has confirmed this stop",
        "look at the robot, start the driver (`yumi up`), then run `yumi recover`",
    ),
    "not_ready_yet": Text(
        "{reason:sentence} If the robot is not ready after that, {recover}",
    ),
    "controller_reports_event": Text("the controller reports {event:full}"),
    "robot_was_stopped": Text("the robot was stopped"),
    "robot_changed": Text("{changes}"),
    "robot_changed_as_requested": Text("{changes}, as requested"),
    "changed_by": Text("{changes}: {causes:full}"),
    "controller_lost": Text("{changes}", "{causes:remedy}"),
    "changed_by_stop": Text(
        "{changes}: {causes}",
        "{causes:steps}{confirm_stop}; nothing moves before that",
    ),
    # ---- bringing it back
    "no_stop_cause": Text("no stop cause found in the event log"),
    "recovered": Text("recovered: {done}"),
    "recovered_after": Text("recovered after {events:and}: {done}"),
    "was_stopped_by": Text("the robot was stopped by {causes}"),
    "not_brought_back": Text("{why:sentence} {error:sentence}"),
    "not_brought_back_after_stop": Text("{why:sentence} {error:sentence} {Confirm_stop}; nothing moves before that"),
    "web_service_hangs": Text(
        "{error:sentence} The web service of the controller hangs, or the network is too slow for it",
        "check the network, or restart the controller, and {recover} again",
    ),
    "egm_started_but_holds": Text("EGM started but the arm holds: {problem}", "{problem:remedy}"),
    "no_datagram_came": Text(
        "EGM started on the robot but no datagram came for the {arms:and} arm",
        "check the remote address and port of the controller's UDPUC device {devices:list} and this machine's firewall",
    ),
    "no_datagram_came_misdirected": Text("EGM started on the robot but no datagram came: {why:full}"),
    "robot_does_not_follow": Text(
        "EGM started but the robot does not follow on the {arms:and} arm", "look at the event log on the FlexPendant"
    ),
    "egm_does_not_end": Text("the RAPID program has stopped, yet the arms still report that EGM runs", "{restart_egm}"),
    "controller_is_gone": Text(
        "the controller at {address} has not answered for {duration:g} s", "check its power and the network cable"
    ),
    "stop_requested_meanwhile": Text(
        "a stop was requested meanwhile, which ended this request", "send the request again if it is still wanted"
    ),
    "tool_unknown": Text(
        "the tool of the {arm} arm is not known: the robot has one load for tool and payload, and an earlier driver "
        "may have set it",
        "set the tool first (set_tool), or name it in the settings (egm_motion.tool)",
    ),
    # ---- what happened to an arm, and why
    "explained": Text("{event}. Cause: {causes}", "{causes:remedy}"),
    "explained_to_go_on": Text("{event}. Cause: {causes}", "{causes:steps}{event:remedy}"),
    "explained_stop": Text(
        "{event}. Cause: {causes}",
        "{causes:steps}{confirm_stop}; nothing moves before that",
    ),
    "ended_by_program": Text(
        "{event}. The controller reports no stop: its program has ended EGM, or another client has",
        "{event:remedy}",
    ),
}
