"""The robot manager: owns the robot's readiness over RWS and offers it as services."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from threading import Lock
from typing import Any

from std_srvs.srv import Trigger

from yumi.clock import Clock
from yumi.control.requests import SwitchControllers
from yumi.control.snapshot import Snapshot
from yumi.errors import RobotNotReady, YumiError
from yumi.hardware.bringup import Bringup
from yumi.hardware.fast_lines import FastLines
from yumi.hardware.state_machine import MachineState
from yumi.robot.joints import Side

FIRST_DATAGRAM = 5.0
"""How long both arms may take from the start signal until they follow [s]."""

_GLANCE = 0.01

POSITION_CONTROLLER = "joint_position_controller"
"""What commands an arm after EGM has started."""


class RobotManager:
    """Brings the robot to ready, starts and stops EGM with the controllers on top.

    Args:
        bringup: what is done over RWS.
        fast_lines: where the controllers live.
        clock: where waiting time comes from.
    """

    def __init__(self, bringup: Bringup, fast_lines: FastLines, clock: Clock) -> None:
        self._bringup = bringup
        self._fast_lines = fast_lines
        self._clock = clock
        self._lock = Lock()  # one at a time; the robot has one state

    def make_ready(self) -> None:
        """Motors on, program running, state machines idle; nothing when it is ready or EGM runs."""
        with self._lock:
            if not self._is_guided():
                self._bringup.make_ready()

    def start_egm(self) -> str:
        """Start EGM on both arms and activate their position controllers; makes the robot ready first if need be.

        Raises:
            YumiError: a step failed; the message says which.
        """
        with self._lock:
            self._fast_lines.check()
            if not self._is_guided():
                self._begin_egm()
            for side in Side:
                if not self._snapshot(side).is_commanded:
                    self._fast_lines.ask(SwitchControllers(side, activate=(POSITION_CONTROLLER,)))
        return "EGM runs on both arms, the position controllers are active"

    def stop_egm(self) -> str:
        """Deactivate the controllers that command the arms and stop EGM; both arms come to rest.

        Raises:
            YumiError: a step failed; the message says which.
        """
        with self._lock:
            try:
                self._hold()
            finally:
                self._bringup.stop_egm()  # whatever became of the fast line
        return "EGM has ended on both arms"

    def _hold(self) -> None:
        """Deactivate whatever commands the arms: they come to rest and hold."""
        for side in Side:
            if self._snapshot(side).is_commanded:
                self._fast_lines.ask(SwitchControllers(side, deactivate=(POSITION_CONTROLLER,)))

    def end_motion(self) -> None:
        """Hold, and end EGM if the robot is in it: what the driver does before it goes.

        Raises:
            YumiError: the robot could not be told.
        """
        if any(self._bringup.state(side) is MachineState.RUN_EGM_ROUTINE for side in Side):
            self.stop_egm()

    def check_ready(self) -> str:
        """Whether EGM can be started, or runs.

        Raises:
            RobotNotReady: it cannot; the message says why.
        """
        self._fast_lines.check()
        if self._is_guided():
            return "ready, EGM runs"
        reason = self._bringup.why_not_ready()
        if reason is not None:
            raise RobotNotReady(f"not ready: {reason}")
        return "ready"

    def describe(self) -> str:
        """The robot's state in one line."""
        controller = self._bringup.describe()
        arms = "; ".join(f"{side.word} arm {self._bringup.state(side).name}, EGM {self._egm(side)}" for side in Side)
        return f"{controller}; {arms}"

    def _begin_egm(self) -> None:
        if any(self._snapshot(side).is_running for side in Side):
            self._bringup.stop_egm()  # one arm alone: end it, so that both begin together
        self._bringup.make_ready()
        self._bringup.start_egm()
        self._wait_until_both_follow()

    def _wait_until_both_follow(self) -> None:
        end = self._clock.now() + FIRST_DATAGRAM
        while not self._is_guided():
            if self._clock.now() >= end:
                raise RobotNotReady(self._why_not_guided())
            self._clock.wait(_GLANCE)

    def _why_not_guided(self) -> str:
        silent = [side for side in Side if not self._snapshot(side).is_streaming]
        if not silent:
            arms = " and ".join(side.word for side in Side if not self._snapshot(side).is_running)
            return f"EGM started but the robot does not follow on the {arms} arm; look at the event log on the pendant."
        arms = " and ".join(side.word for side in silent)
        devices = ", ".join(side.unit for side in silent)
        return (
            f"EGM started on the robot but no datagram came for the {arms} arm; check the remote address and port of "
            f"the controller's UDPUC device {devices} and this machine's firewall."
        )

    def _is_guided(self) -> bool:
        return all(self._snapshot(side).is_running for side in Side)

    def _egm(self, side: Side) -> str:
        snapshot = self._snapshot(side)
        return "running" if snapshot.is_running else "streaming" if snapshot.is_streaming else "off"

    def _snapshot(self, side: Side) -> Snapshot:
        return self._fast_lines.snapshot(side)


class RobotManagerServices:
    """Offers the robot manager's methods as ``std_srvs/Trigger`` services of its node.

    Args:
        node: the robot manager's node.
        manager: what is offered.
        group: callback group of its own, since a service may take seconds.
        on_change: called after each service, since controllers and EGM may have changed.
    """

    def __init__(self, node: Any, manager: RobotManager, group: Any, on_change: Callable[[], None]) -> None:
        self._log = node.get_logger()
        self._on_change = on_change
        offers: Mapping[str, Callable[[], str]] = {
            "start_egm": manager.start_egm,
            "stop_egm": manager.stop_egm,
            "robot_is_ready": manager.check_ready,
            "get_state": manager.describe,
        }
        for name, action in offers.items():
            node.create_service(Trigger, f"~/{name}", self._answer_with(name, action), callback_group=group)

    def _answer_with(self, name: str, action: Callable[[], str]) -> Callable[[Any, Any], Any]:
        def answer(_: Any, response: Any) -> Any:
            try:
                response.message = action()
                response.success = True
            except YumiError as error:
                response.message = str(error)
                response.success = False
                if name != "robot_is_ready":
                    self._log.error(f"{name}: {error}")
            self._on_change()
            return response

        return answer
