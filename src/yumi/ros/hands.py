"""Both hands in ROS: actions, services and topics of each, and the signals they all come from."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from threading import Event as Flag
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.callback_groups import ReentrantCallbackGroup

from yumi.errors import NoConnection, YumiError
from yumi.hardware.gripper import Gripper
from yumi.hardware.hand_signals import HandSignals
from yumi.links.supervision import SupervisedThread
from yumi.links.ticker import Ticker
from yumi.robot.hand import HandReading
from yumi.robot.joints import Side
from yumi.ros.gripper_action import HandTurn, hand_actions
from yumi.ros.gripper_services import GripperServices
from yumi.ros.gripper_topics import GripperTopics, gripper_status
from yumi.settings import GripperSettings

_RETRY = 0.5  # [s] between two attempts to have the controller tell, and between two looks while it does not


class FingerState(NamedTuple):
    """The fingers of one hand, for the merged joint states.

    Attributes:
        position: of each from the middle [m].
        speed: of each, positive when opening [m/s].
    """

    position: float
    speed: float


class HandParts(NamedTuple):
    """What is served.

    Attributes:
        grippers: both hands.
        signals: what the controller tells of them.
        settings: forces, thresholds and what they are made of.
    """

    grippers: Mapping[Side, Gripper]
    signals: HandSignals
    settings: GripperSettings


class Hands:
    """Serves both hands on their nodes, and keeps their signals coming.

    Args:
        parts: what is served.
        nodes: the node with the actions and services of each hand.
        streams: a node for the topics of each.
        say: told when the controller does not tell of the hands, and when it does again.
        ticker: keeps the topics' rates.
        why_not: why a hand may not move now; None when it may.
        may_ask: whether the robot may be asked.
        calibrate: calibrates a hand.
    """

    def __init__(
        self,
        parts: HandParts,
        nodes: Mapping[Side, Any],
        streams: Mapping[Side, Any],
        say: Callable[[str], None],
        ticker: Ticker,
        why_not: Callable[[Side], str | None] = lambda side: None,
        may_ask: Callable[[Side], bool] = lambda side: True,
        calibrate: Callable[[Gripper], None] = Gripper.calibrate,
    ) -> None:
        self._parts = parts
        self._say = say
        self._may_ask = may_ask
        self._calibrate = calibrate
        self._reason = ""
        self._asked: dict[Side, FingerState] = {}
        self._is_over = Flag()
        self._thread = SupervisedThread("hands", self._watch, self._is_over, self._forget)
        self._turns = {side: HandTurn() for side in Side}
        self._actions = [
            action for side, node in nodes.items() for action in self._serve(side, node, partial(why_not, side))
        ]
        settings = parts.settings
        self._topics = [
            GripperTopics(
                node,
                side,
                partial(self._reading, side),
                settings.picked_pressure,
                settings.modules(side).vacuum_channels,
                ticker,
                self._turns[side],
            )
            for side, node in streams.items()
        ]

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """End the thread and the subscription; before the client is closed."""
        self._is_over.set()
        self._thread.join()
        self._parts.signals.close()

    def destroy(self) -> None:
        """When nothing spins any more."""
        for action in self._actions:
            action.destroy()

    def fingers(self) -> dict[Side, FingerState]:
        """The fingers of each hand as far as they are known."""
        readings = {side: self._reading(side) for side in self._parts.grippers}
        told = {side: FingerState(one.position, one.speed) for side, one in readings.items() if one is not None}
        return {**self._asked, **told}

    def statuses(self) -> list[DiagnosticStatus]:
        """Both hands for ``/diagnostics``."""
        return [gripper_status(side, self._reading(side)) for side in self._parts.grippers]

    def _serve(self, side: Side, node: Any, why_not: Callable[[], str | None]) -> tuple[Any, ...]:
        gripper, group, turn = self._parts.grippers[side], ReentrantCallbackGroup(), self._turns[side]
        GripperServices(node, gripper, group, why_not, turn, self._calibrate)
        return hand_actions(node, gripper, self._parts.settings.force, group, why_not, turn)

    def _reading(self, side: Side) -> HandReading | None:
        try:
            return self._parts.signals.reading(side)
        except YumiError as error:
            self._tell(str(error))
            return None

    def _watch(self) -> None:
        while not self._is_over.wait(_RETRY):
            sides = [side for side in self._parts.grippers if self._may_ask(side)]
            if not sides:
                continue
            try:
                self._parts.signals.keep_open()
                self._asked.clear()
                self._tell("")
            except NoConnection as error:
                self._asked.clear()
                self._tell(f"Nothing is known of the grippers: {error}")
            except YumiError as error:
                self._tell(f"The controller does not tell of the grippers by itself, they are asked: {error}")
                self._ask(sides)

    def _forget(self) -> None:
        """The watch has failed and begins anew: until then nothing is known that it feeds."""
        self._asked.clear()
        self._tell("Nothing is known of the grippers: their watch has failed, see the log.")
        self._parts.signals.close()

    def _ask(self, sides: list[Side]) -> None:
        """Where the fingers are, twice a second; what cannot be asked is not known."""
        for side in sides:
            try:
                self._asked[side] = FingerState(self._parts.grippers[side].position(), 0.0)
            except YumiError:
                self._asked.pop(side, None)

    def _tell(self, reason: str) -> None:
        if reason != self._reason:
            self._reason = reason
            self._say(reason or "The controller tells of the grippers by itself.")
