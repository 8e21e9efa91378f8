"""Smart Grippers: why one does not move, hold or switch."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text

GRIPPERS: Mapping[str, Text] = {
    "gripper_reserved_for_person": Text(
        "the {gripper} gripper is reserved for the person who commands its arm, or has not given it back",
        "{give_back} for programs",
    ),
    "gripper_busy": Text("the {gripper} gripper carries out another command", "wait for its end"),
    "gripper_not_calibrated": Text("the {gripper} gripper is not calibrated", "{calibrate} first"),
    "gripper_calibration_failed": Text(
        "the {gripper} gripper could not be calibrated", "check its 24 V supply and its fingers"
    ),
    "gripper_stopped_before_it_moved": Text("the {gripper} gripper was stopped before it moved"),
    "gripper_stopped": Text("the {gripper} gripper was stopped on its way"),
    "gripper_still_moves": Text("the {gripper} gripper still moves after {timeout:g} s", "look at it"),
    "gripper_does_not_stop": Text("the {gripper} gripper does not stop", "clear its error, or look at the event log"),
    "gripper_error_stays": Text(
        "the {gripper} gripper still reports an error", "check its 24 V supply and look at the event log"
    ),
    "gripper_reports_error": Text(
        "the {gripper} gripper reports error {error:g}", "look at the event log, then clear the error"
    ),
    "gripper_command_not_taken": Text(
        "the {arm} arm took no gripper command within {timeout:g} s", "see that the RAPID program runs"
    ),
    "no_smart_gripper": Text("the controller has no signal {signal}: it has no {gripper} Smart Gripper"),
    # ---- vacuum
    "vacuum_channel_unknown": Text("a gripper has vacuum 1 and 2 at most, not {channel}"),
    "gripper_has_no_vacuum": Text(
        "the {gripper} gripper has no vacuum: it is configured as {modules}",
        "if it has vacuum {channel}, set gripper.{gripper} in yumi.yaml",
    ),
    "gripper_has_other_vacuum": Text(
        "the {gripper} gripper has vacuum {has:list} only: it is configured as {modules}",
        "if it has vacuum {channel}, set gripper.{gripper} in yumi.yaml",
    ),
    "vacuum_not_switched": Text(
        "the {gripper} gripper did not switch vacuum {channel} {level}",
        "check that the module is there and look at the event log",
    ),
    "blow_off_not_switched": Text(
        "the {gripper} gripper did not switch blow-off {channel} {level}",
        "check that the module is there and look at the event log",
    ),
    # ---- when the robot becomes ready
    "gripper_unusable": Text("the {gripper} gripper cannot be used: {reason}", "{reason:remedy}"),
    "gripper_left_uncalibrated": Text(
        "the {gripper} gripper is not calibrated, and the driver does not calibrate it now: {reason}",
        "{calibrate} when its fingers may close",
    ),
    "gripper_presses_on_something": Text("it presses on something"),
    "gripper_fingers_move": Text("its fingers move"),
    "calibration_not_named": Text("the fingers of a real robot close only where a call names it"),
    "calibration_not_allowed_by_settings": Text(
        "the setting gripper.calibrate is 'never'",
    ),
    "gripper_may_hold_something_after_stop": Text(
        "the robot was stopped, and a gripper without calibration does not know what it holds"
    ),
    "gripper_tested": Text("the {gripper} gripper was closed as a test"),
    "gripper_holds_and_was_not_tested": Text("the {gripper} gripper holds something and was not closed as a test"),
    "gripper_test_failed": Text(
        "its test failed: it was to close, and its fingers are at {position:.1mm}",
        "look at what is between them, or calibrate it with nothing between them",
    ),
}
