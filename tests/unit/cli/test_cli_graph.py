"""Messages of ROS as JSON, and JSON as messages."""

from __future__ import annotations

from typing import Any

import pytest

from abb_protocols.errors import SettingsError
from abb_protocols.robot.joints import Side, joint_names
from refusals import refused
from yumi.cli.graph import fill_message, message_values, parameter_line
from yumi.control.controllers.joint_position import JointPositionController
from yumi.control.goals import MemoryBuffer

trajectory_msgs = pytest.importorskip("trajectory_msgs.msg")
sensor_msgs = pytest.importorskip("sensor_msgs.msg")
rcl_interfaces = pytest.importorskip("rcl_interfaces.msg")

VALUES = {
    "joint_names": ["a", "b"],
    "points": [{"positions": [1.0, 2.0], "time_from_start": {"sec": 3}}],
    "header": {"frame_id": "base"},
}


def test_message_is_filled_and_shown_by_the_names_of_its_fields() -> None:
    shown = message_values(fill_message(trajectory_msgs.JointTrajectory(), VALUES))
    assert (shown["joint_names"], shown["header"]["frame_id"]) == (["a", "b"], "base")
    assert shown["points"][0]["positions"] == [1.0, 2.0]
    assert shown["points"][0]["time_from_start"] == {"sec": 3, "nanosec": 0}


@pytest.mark.parametrize(
    ("values", "code", "said"),
    [
        ({"joint_name": []}, "no_field", {"name": "joint_name", "fields": ("header", "joint_names", "points")}),
        ({"joint_names": "a"}, "field_takes_other", {"given": "'a'", "type": "sequence<string>"}),
        ({"header": 3}, "fields_no_object", {"given": "3", "fields": ("stamp", "frame_id")}),
        ({"points": [{"positions": ["x"]}]}, "field_takes_other", {"type": "sequence<double>"}),
        ([1], "fields_no_object", {"given": "[1]"}),
    ],
)
def test_wrong_field_or_value_is_refused_with_what_is_allowed(values: Any, code: str, said: dict[str, Any]) -> None:
    with refused(SettingsError, code, **said):
        fill_message(trajectory_msgs.JointTrajectory(), values)


def test_whole_number_is_taken_where_a_field_has_decimals() -> None:
    assert fill_message(sensor_msgs.Temperature(), {"temperature": 20}).temperature == 20.0


def test_parameter_is_shown_with_its_meaning_unit_and_range() -> None:
    described = rcl_interfaces.ParameterDescriptor(description="p of this joint; -1 takes p of all joints. [s]")
    described.floating_point_range = [rcl_interfaces.FloatingPointRange(from_value=-1.0, to_value=2.0)]
    described.additional_constraints = "in s"
    line = parameter_line("gains.a.p", -1.0, described)
    assert line == "gains.a.p: -1.0  # p of this joint; -1 takes p of all joints. [s]; -1 to 2"
    choices = rcl_interfaces.ParameterDescriptor(description="How.", additional_constraints="one of a, b")
    assert parameter_line("kind", "a", choices) == "kind: a  # How; one of a, b"
    assert parameter_line("names", ["a"], rcl_interfaces.ParameterDescriptor()) == "names:\n- a"


def test_every_gain_of_one_joint_says_that_minus_one_takes_the_common_one() -> None:
    parameters = JointPositionController(MemoryBuffer()).parameters(joint_names(Side.RIGHT))
    own = [each for each in parameters if each.name.startswith("gains.")]
    assert len(own) == 21
    for each in own:
        gain = each.name.rpartition(".")[2]
        assert each.description == f"{gain} of this joint; -1 takes {gain} of all joints."
