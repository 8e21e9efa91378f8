from __future__ import annotations

import subprocess
import sys
from io import StringIO
from math import radians

import pytest

import yumi
from abb_protocols.robot.joints import Side, home
from fake_robot import FakeRobot
from yumi.api.connect import print_step
from yumi.api.gripper import Gripper
from yumi.api.robot_arm import Arm


def test_pendants_numbers_are_put_in_chain_order() -> None:
    assert yumi.abb_degrees(0, -130, 30, 0, 40, 0, j7=-135) == yumi.degrees(0, -130, -135, 30, 0, 40, 0)
    assert yumi.abb_degrees(j1=1, j2=2, j3=3, j4=4, j5=5, j6=6, j7=7) == tuple(map(radians, (1, 2, 7, 3, 4, 5, 6)))


def test_seven_numbers_in_a_row_are_never_taken_for_the_pendants() -> None:
    with pytest.raises(TypeError, match="abb_degrees"):
        yumi.abb_degrees(0, -130, -135, 30, 0, 40, 0)  # type: ignore[call-arg, misc]


def test_package_lists_what_it_offers_before_anything_is_used() -> None:
    script = (
        "import yumi; print(*dir(yumi)); yumi.errors.CommandRefused; print(all(getattr(yumi, n) for n in dir(yumi)))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    names = (
        "Chunk EgmServer __version__ abb_degrees attach connect connect_async degrees errors in_degrees pose "
        "read_recording"
    )
    assert done.stdout == f"{names}\nTrue\n"


def test_objects_of_a_script_say_what_they_are() -> None:
    robot = yumi.connect("127.0.0.1:1")
    twin = yumi.connect_async("127.0.0.1:1")
    assert [repr(each) for each in (robot.right, robot.left.gripper, twin, twin.left, twin.right.gripper)] == [
        "<yumi.Arm right, not connected>",
        "<yumi.Gripper left, not connected>",
        "<yumi.AsyncRobot at 127.0.0.1:1, not connected>",
        "<yumi.AsyncArm left, not connected>",
        "<yumi.AsyncGripper right, not connected>",
    ]


def test_arm_shows_its_joints_as_the_flexpendant_does() -> None:
    arm = Arm(Side.RIGHT, lambda: FakeRobot().executor, Gripper(Side.RIGHT, lambda: None, 10.0))  # type: ignore[arg-type,return-value]
    assert arm.degrees == pytest.approx({"j1": 0, "j2": -130, "j3": 30, "j4": 0, "j5": 40, "j6": 0, "j7": -135})
    shown = "<yumi.Arm right, holding: j1 0.0°  j2 -130.0°  j3 30.0°  j4 0.0°  j5 40.0°  j6 0.0°  j7 -135.0°>"
    assert repr(arm) == shown
    assert arm.poses["home"] == home(Side.RIGHT)
    assert set(arm.poses) == {"home", "calibration", "ready"}


@pytest.mark.parametrize(("is_terminal", "shown"), [(True, "yumi: motors on\n"), (False, "")])
def test_steps_are_shown_on_a_terminal(monkeypatch: pytest.MonkeyPatch, is_terminal: bool, shown: str) -> None:
    output = StringIO()
    monkeypatch.setattr(output, "isatty", lambda: is_terminal)
    monkeypatch.setattr("sys.stderr", output)
    print_step("motors on")
    assert output.getvalue() == shown
