"""``speed_scale`` on the robot manager's node: the service ``~/set_speed_scale`` and a parameter of the same name."""

from __future__ import annotations

from typing import Any

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor, SetParametersResult
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.parameter import Parameter
from yumi_interfaces.srv import SetSpeedScale

from yumi.control.speed_scale import FULL
from yumi.errors import CommandRefused
from yumi.hardware.speed_setting import LOWEST, SpeedSetting

NAME = "speed_scale"


class SpeedScaleInterface:
    """Both change the one setting, in whatever state the robot is; who slows it down waits for nothing else.

    Args:
        node: the robot manager's node.
        speed: the setting.
    """

    def __init__(self, node: Any, speed: SpeedSetting) -> None:
        self._node = node
        self._speed = speed
        self._log = node.get_logger()
        described = ParameterDescriptor(
            description="The factor on the speed of every controller.",
            floating_point_range=[FloatingPointRange(from_value=LOWEST, to_value=FULL)],
        )
        node.add_on_set_parameters_callback(self._take)
        node.declare_parameter(NAME, speed.value, described)  # one given on the command line is taken by it
        node.create_service(
            SetSpeedScale, "~/set_speed_scale", self._serve, callback_group=MutuallyExclusiveCallbackGroup()
        )

    def _take(self, parameters: list[Any]) -> SetParametersResult:
        for parameter in parameters:
            if parameter.name == NAME and parameter.value != self._speed.value:
                try:
                    self._log.info(self._speed.set(parameter.value))
                except CommandRefused as error:
                    return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _serve(self, request: Any, response: Any) -> Any:
        """The service refuses with its own sentence; what it takes, the parameter tells, too."""
        try:
            response.message = self._speed.set(request.speed_scale)
            response.success = True
            self._node.set_parameters([Parameter(NAME, value=self._speed.value)])
            self._log.info(response.message)
        except CommandRefused as error:
            response.message = str(error)
        return response
