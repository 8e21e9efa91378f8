"""One arm as ros2_control's hardware component, which decides who may use the arm's interfaces."""

from __future__ import annotations

from yumi.control.inventory import HardwareInfo
from yumi.control.lifecycle import State
from yumi.control.requests import ListHardware, SetHardwareState
from yumi.errors import YumiError
from yumi.robot.joints import Side
from yumi.ros.controller_nodes import Line


class ArmHardware:
    """The component of one arm.

    Args:
        side: which arm.
        line: where it lives.
    """

    def __init__(self, side: Side, line: Line) -> None:
        self._side = side
        self._line = line

    def info(self) -> HardwareInfo:
        """The component with its interfaces.

        Raises:
            YumiError: the fast line is gone.
        """
        (info,) = self._line.ask(ListHardware(self._side)).hardware
        return info

    @property
    def state(self) -> State:
        """Where it is in its life; finalized without the fast line, since only a restart helps then."""
        try:
            return self.info().state
        except YumiError:
            return State.FINALIZED

    def bring_to(self, name: str, target: State) -> None:
        """Lead it to a state; controllers that use what it no longer offers are deactivated, and the arm holds.

        Raises:
            YumiError: there is no such component, or it does not go to that state.
        """
        self._line.ask(SetHardwareState(self._side, name, target))
