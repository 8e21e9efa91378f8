"""Messages of ROS as JSON, and JSON as messages."""

from __future__ import annotations

from typing import Any

import pytest

from yumi.cli.robot import fill_message, message_values
from yumi.errors import SettingsError

trajectory_msgs = pytest.importorskip("trajectory_msgs.msg")
sensor_msgs = pytest.importorskip("sensor_msgs.msg")

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
    ("values", "sentence"),
    [
        ({"joint_name": []}, "There is no field 'joint_name'; the fields are header, joint_names, points"),
        ({"joint_names": "a"}, "joint_names is 'a'; it takes sequence<string>"),
        ({"header": 3}, "3 is no JSON object; the fields are stamp, frame_id"),
        ({"points": [{"positions": ["x"]}]}, "it takes sequence<double>"),
        ([1], r"\[1\] is no JSON object"),
    ],
)
def test_wrong_field_or_value_is_refused_with_what_is_allowed(values: Any, sentence: str) -> None:
    with pytest.raises(SettingsError, match=sentence):
        fill_message(trajectory_msgs.JointTrajectory(), values)


def test_whole_number_is_taken_where_a_field_has_decimals() -> None:
    assert fill_message(sensor_msgs.Temperature(), {"temperature": 20}).temperature == 20.0
