"""What the driver's managed nodes lead through their lives: the robot, its arms and its hands."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from typing import Protocol

from yumi.control.lifecycle import State
from yumi.control.requests import HoldArm
from yumi.errors import YumiError
from yumi.robot.joints import Side
from yumi.ros.arm_hardware import ArmHardware
from yumi.ros.controller_nodes import Line


class Connection(Protocol):
    """The way to the controller."""

    def connect(self) -> str:
        """Log in and check the controller; which one it is. Nothing where that has been done.

        Raises:
            YumiError: there is no way, or the controller cannot be used.
        """

    def disconnect(self) -> str:
        """Log out."""


class Stopping(Protocol):
    """What can bring the robot to a stop."""

    def end_motion(self) -> None:
        """Hold, and end EGM if the robot is in it."""


class Fingers(Protocol):
    """What is needed of a gripper."""

    def position(self) -> float:
        """Where its fingers are now [m]."""

    def hold(self) -> None:
        """Stop fingers that move; what it holds stays held.

        Raises:
            YumiError: it does not obey, or cannot be reached.
        """


class RobotLife:
    """The robot: its connection, and whether anything may move.

    Being active permits motion, whether or not the robot is ready for it: an emergency stop ends no permission.

    Args:
        connection: the way to it.
        manager: what ends EGM.
        line: where its arms are held, at once and whatever the connection is worth.
        grippers: its hands.
    """

    noun = "the robot"

    def __init__(self, connection: Connection, manager: Stopping, line: Line, grippers: Iterable[Fingers]) -> None:
        self._connection = connection
        self._manager = manager
        self._line = line
        self._grippers = tuple(grippers)

    def configure(self) -> str:
        return self._connection.connect()

    def activate(self) -> str:
        return "The robot's node is active: requests that move it are served."

    def deactivate(self) -> str:
        for side in Side:
            with suppress(YumiError):  # of a fast line that is gone: the other arm is held, and EGM ended, all the same
                self._line.ask(HoldArm(side))
        try:
            self._manager.end_motion()
        finally:  # an arm whose EGM does not end is no reason to let fingers go on
            for gripper in self._grippers:
                with suppress(YumiError):  # not every robot has two hands
                    gripper.hold()
        return "The robot holds, and may not move."

    def cleanup(self) -> str:
        return self._connection.disconnect()


class ArmLife:
    """One arm: the hardware component whose interfaces controllers use.

    Args:
        side: which arm.
        hardware: its component.
    """

    def __init__(self, side: Side, hardware: ArmHardware) -> None:
        self.noun = f"the {side.word} arm"
        self._unit = side.unit
        self._hardware = hardware

    def configure(self) -> str:
        """What is active stays so: whoever asked for it has that already."""
        if self._hardware.info().state is State.UNCONFIGURED:
            self._hardware.bring_to(self._unit, State.INACTIVE)
        return f"{self.noun.capitalize()} is configured."

    def activate(self) -> str:
        self._hardware.bring_to(self._unit, State.ACTIVE)
        return f"{self.noun.capitalize()} is active: its controllers can be used."

    def deactivate(self) -> str:
        if self._hardware.info().state is State.ACTIVE:
            self._hardware.bring_to(self._unit, State.INACTIVE)
        return f"{self.noun.capitalize()} holds, and may not move."

    def cleanup(self) -> str:
        self._hardware.bring_to(self._unit, State.UNCONFIGURED)
        return f"{self.noun.capitalize()} offers nothing any more."


class GripperLife:
    """One hand.

    Args:
        side: which arm carries it.
        gripper: the hand.
    """

    def __init__(self, side: Side, gripper: Fingers) -> None:
        self.noun = f"the {side.word} gripper"
        self._gripper = gripper

    def configure(self) -> str:
        position = self._gripper.position()
        return f"{self.noun.capitalize()} is there, its fingers at {position * 1e3:.1f} mm."

    def activate(self) -> str:
        return f"{self.noun.capitalize()} is active: it takes goals."

    def deactivate(self) -> str:
        self._gripper.hold()
        return f"{self.noun.capitalize()} stands, keeps what it holds, and takes no goals."

    def cleanup(self) -> str:
        return f"{self.noun.capitalize()} is let go."
