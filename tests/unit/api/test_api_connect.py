from __future__ import annotations

from inspect import signature
from math import nan, pi
from pathlib import Path
from traceback import format_exception
from typing import Any

import pytest

import yumi
from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, NoConnection, RobotNotReady, SettingsError
from abb_protocols.robot.joints import Side
from abb_runtime.udp import free_port
from refusals import assert_says, refused
from yumi.api.connect import AsyncRobot, controllers_for, settings_for

NOBODY = "127.0.0.1:1"
MISSING = ("joint_goal_controller", "joint_trajectory_controller")


@pytest.mark.parametrize(
    ("address", "where"),
    [
        ("192.168.125.1", ("192.168.125.1", 80)),
        ("192.168.125.1:8080", ("192.168.125.1", 8080)),
        ("127.0.0.1", ("127.0.0.1", 8080)),
        ("localhost:80", ("localhost", 80)),
        (None, ("192.168.125.1", 80)),
    ],
)
def test_address_is_a_host_with_the_usual_port_or_its_own(address: str | None, where: tuple[str, int]) -> None:
    robot = settings_for(address).robot
    assert (robot.address, robot.rws_port) == where


@pytest.mark.parametrize(
    ("options", "code", "values"),
    [
        ({"address": ""}, "no_address", {"address": ""}),
        ({"address": "robot:http"}, "no_address", {"address": "robot:http"}),
        ({"default_speed_scale": 0.0}, "fraction_out_of_range", {"parameter": "default_speed_scale", "value": 0.0}),
        ({"default_speed_scale": nan}, "fraction_out_of_range", {"parameter": "default_speed_scale"}),
        ({"acceleration": 1.1}, "fraction_out_of_range", {"parameter": "acceleration", "value": 1.1}),
        ({"speed_scale": 0.0}, "value_out_of_range", {"parameter": "speed_scale", "lowest": 0.01, "highest": 1.0}),
        ({"arms": "middle"}, "connect_arms_unknown", {"given": "'middle'"}),
        ({"arms": ()}, "connect_arms_unknown", {"given": "()"}),
        ({"arms": ("left", "left")}, "connect_arms_unknown", {}),
        ({"left_egm_port": 70000}, "value_out_of_range", {"parameter": "left_port", "lowest": 1.0, "highest": 65535.0}),
        ({"rws_port": 80}, "connect_port_twice", {"address": "127.0.0.1:1", "port": 80}),
        (
            {"address": "127.0.0.1", "rws_port": 0},
            "value_out_of_range",
            {"parameter": "rws_port", "lowest": 1.0, "highest": 65535.0},
        ),
        ({"config": "nowhere.yaml"}, "settings_unreadable", {"file": "nowhere.yaml"}),
    ],
)
def test_connect_refuses_what_is_no_robot(options: dict[str, Any], code: str, values: dict[str, Any]) -> None:
    with pytest.raises(SettingsError) as refusal:
        yumi.connect(**{"address": NOBODY, **options})
    said = refusal.value.said
    if said.code == "setting_refused":
        assert said.values["place"].split(":")[0] == "connect"
        said = said.values["reason"]
    assert_says(said, code, **values)


def refuse(*_: object) -> None:
    try:
        raise ConnectionRefusedError
    except ConnectionRefusedError as error:
        raise NoConnection("Nothing listens there.") from error


@pytest.mark.parametrize("begin", ["open", "recover"])
def test_robot_that_is_not_reached_is_told_without_the_errors_of_other_libraries(
    monkeypatch: pytest.MonkeyPatch, begin: str
) -> None:
    monkeypatch.setattr(f"yumi.api.connection.Connection.{begin}", refuse)
    robot = yumi.connect(NOBODY)
    monkeypatch.setattr(robot, "_is_connected", begin == "recover")
    with pytest.raises(NoConnection, match="Nothing listens there") as error:
        getattr(robot, begin)()
    lines = format_exception(error.value)
    assert not [line for line in lines if "ConnectionRefusedError" in line]
    assert lines[-1] == "abb_protocols.errors.NoConnection: Nothing listens there.\n"
    assert len(lines) <= 4  # a title, the caller, the method


def test_connect_demands_the_controllers_it_moves_with(tmp_path: Path) -> None:
    file = tmp_path / "controllers.yaml"
    only = "{ros__parameters: {joint_position_controller: {type: yumi_controllers/JointPositionController}}}"
    file.write_text(f"/r/controller_manager: {only}\n/l/controller_manager: {only}\n")
    with refused(SettingsError, "controllers_missing", arm="right", missing=MISSING):
        yumi.connect(NOBODY, controllers=file)


def test_connect_takes_a_factor_on_all_speeds() -> None:
    assert "speed_scale" in signature(yumi.connect).parameters
    assert settings_for(NOBODY, login={"speed_scale": 0.3}).robot.speed_scale == 0.3
    assert settings_for(NOBODY).robot.speed_scale is None


def test_connect_gives_the_shares_to_the_goal_controllers() -> None:
    for entries in controllers_for(settings_for(NOBODY), default_speed_scale=0.3, acceleration=0.7).values():
        (values,) = [entry.values for entry in entries if entry.name == "joint_goal_controller"]
        assert (values["speed_scale"], values["acceleration_scale"]) == (0.3, 0.7)
        assert values["top_speed"] == pytest.approx(pi)  # MaxSpeedDeviation of the delivered settings


def test_robot_that_does_not_answer_is_not_connected() -> None:
    robot = yumi.connect(NOBODY, left_egm_port=free_port(), right_egm_port=free_port())
    for _ in range(2):  # nothing is left claimed
        with pytest.raises(NoConnection), robot:
            pass
    assert not robot.is_connected


def test_robot_that_is_not_connected_says_so() -> None:
    robot = yumi.connect(NOBODY)
    assert repr(robot) == "<yumi.Robot at 127.0.0.1:1, not connected>"
    for ask in (
        lambda: robot.right.position,
        lambda: robot.left.move_to([0.0] * 7),
        lambda: robot.right.stream([0.0] * 7),
        robot.right.gripper.open,
        lambda: robot.move_to(left=[0.0] * 7),
        robot.stop,
        robot.recover,
        robot.describe,
        lambda: robot.speed_scale,
        lambda: setattr(robot, "speed_scale", 0.5),
    ):
        with refused(RobotNotReady, "script_not_connected"):
            ask()
    robot.close()


def test_robot_needs_a_goal_for_one_arm_at_least() -> None:
    with refused(CommandRefused, "no_arm_has_goal"):
        yumi.connect(NOBODY).move_to()


def test_connect_async_takes_the_same_options() -> None:
    assert isinstance(yumi.connect_async(NOBODY, arms="left"), AsyncRobot)
    with refused(
        SettingsError,
        "setting_refused",
        place="connect",
        reason=message("fraction_out_of_range", parameter="default_speed_scale", value=2.0),
    ):
        yumi.connect_async(NOBODY, default_speed_scale=2.0)


def test_degrees_become_radians_and_back() -> None:
    angles = (0.0, -130.0, 135.0, 30.0, 0.0, 40.0, 180.0)
    assert yumi.degrees(*angles)[6] == pytest.approx(pi)
    assert yumi.degrees(angles) == yumi.degrees(list(angles)) == yumi.degrees(*angles)
    assert yumi.in_degrees(yumi.degrees(angles)) == pytest.approx(angles)


@pytest.mark.parametrize("angles", [(), (1.0,), (1.0,) * 6, ([1.0] * 8,)])
def test_degrees_are_seven(angles: tuple[Any, ...]) -> None:
    with pytest.raises(ValueError, match="an arm has 7 joints"):
        yumi.degrees(*angles)


def test_package_offers_what_it_says_and_nothing_else() -> None:
    for name in yumi.__all__:
        assert getattr(yumi, name) is not None
    with pytest.raises(AttributeError, match="module 'yumi' has no attribute 'disconnect'"):
        _ = yumi.disconnect


def test_sides_of_the_robot_are_its_arms() -> None:
    robot = yumi.connect(NOBODY)
    assert (robot.right.side, robot.left.gripper.side) == (Side.RIGHT, Side.LEFT)
