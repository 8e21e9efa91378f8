"""The robot manager's node: offers the robot's readiness (:mod:`yumi.hardware.robot_manager`) as services."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from std_srvs.srv import Trigger

from yumi.errors import YumiError
from yumi.hardware.robot_manager import RobotManager


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
