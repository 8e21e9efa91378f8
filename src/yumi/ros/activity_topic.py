"""``~/activity``: who is in which state, told again whenever that changes, and known to whoever comes late."""

from __future__ import annotations

from collections.abc import Callable
from threading import Lock
from typing import Any

from rclpy.qos import DurabilityPolicy, QoSProfile

from yumi.control.inventory import ControllerInfo, HardwareInfo
from yumi.control.lifecycle import State
from yumi.errors import YumiError
from yumi.ros.controller_messages import ACTIVITY, activity

_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class ActivityTopic:
    """Publishes the states of one arm's controllers and hardware when they have changed, if there is a type for it.

    Args:
        node: the controller manager's node.
        controllers: what is loaded.
        hardware: the arm's component.
    """

    def __init__(
        self, node: Any, controllers: Callable[[], tuple[ControllerInfo, ...]], hardware: Callable[[], HardwareInfo]
    ) -> None:
        self._clock = node.get_clock()
        self._log = node.get_logger()
        self._controllers = controllers
        self._hardware = hardware
        self._lock = Lock()
        self._last: tuple[tuple[str, State], ...] | None = None
        self._publisher = None
        if ACTIVITY is not None:
            self._publisher = node.create_publisher(ACTIVITY, "~/activity", _LATCHED)

    def update(self) -> None:
        """Look, and tell if something has changed; without the fast line there is nothing to tell."""
        if self._publisher is None:
            return
        with self._lock:
            try:
                controllers, hardware = self._controllers(), self._hardware()
            except YumiError as error:
                self._log.warning(f"activity: {error}", throttle_duration_sec=10.0)
                return
            states = (*((info.name, info.state) for info in controllers), (hardware.name, hardware.state))
            if states != self._last:
                self._last = states
                self._publisher.publish(activity(controllers, hardware, self._clock.now().nanoseconds))
