"""The driver's commands in ROS: services and actions of the robot manager's node, and its ``speed_scale``.

Services of one lane wait for each other: what only reads, what brings the robot to a stop, and what writes a signal or
variable or allows a collision is served beside what takes its time. The actions ``set_mode`` and ``recover`` run one at
a time, but for the mode ``motors_off``, with one sentence of feedback for each step. A goal that cannot be met is not
rejected, since a rejection has no text: it is aborted at once, with the reason.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from threading import Lock
from typing import Any

import msgspec
from control_msgs.msg import SpeedScalingFactor
from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor, SetParametersResult
from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger
from yumi_interfaces import action, srv

from abb_protocols.catalogue import message
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import CommandRefused, YumiError
from abb_protocols.robot.description import Mass
from abb_protocols.robot.joints import Pose
from yumi.control.speed_scale import FULL_SPEED
from yumi.driver.command import ArmName, Caller, Command, CommandedRobot, Lane
from yumi.driver.commands import Recover, SetMode, SetSpeedScale, carry_out, offered_to
from yumi.driver.speed_setting import LOWEST_SPEED_SCALE, SpeedSetting
from yumi.ros.messages import (
    LATCHED_QOS,
    SERVICES_QOS,
    mass_of,
    mode_of,
    pose_of_ros_message,
    robot_state,
    say_why,
    side_of_ros_message,
)
from yumi.ros.nodes import TimerThread

_OF_THEIR_OWN = (SetSpeedScale, SetMode, Recover)
"""The commands that are no plain services: a parameter is set with it, or they are actions."""

_VALUES: Mapping[Any, Callable[[Any], Any]] = {
    ArmName: lambda word: side_of_ros_message(word).word,
    Pose: pose_of_ros_message,
    Mass: mass_of,
}
"""An argument of a command from a field of a request, by its type; others are what they are."""


def _command_of(kind: type[Command[Any]], request: Any) -> Command[Any]:
    """The command with the arguments of a request; those that it has no field for keep their defaults.

    Raises:
        CommandRefused: there is no such arm.
    """
    fields = [each for each in msgspec.structs.fields(kind) if hasattr(request, each.name)]
    return kind(**{it.name: _VALUES.get(it.type, lambda value: value)(getattr(request, it.name)) for it in fields})


class CommandServices:
    """The services of the robot manager's node: one for each command that ROS may give.

    Args:
        node: the robot manager's node.
        robot: what the commands act on.
    """

    def __init__(self, node: Any, robot: CommandedRobot) -> None:
        self._node = node
        self._log = node.get_logger()
        self._robot = robot
        self._callback_groups = {lane: MutuallyExclusiveCallbackGroup() for lane in Lane}
        for kind in offered_to(FrontEnd.ROS):
            if kind not in _OF_THEIR_OWN:
                self._serve(kind, kind.service or kind.method())

    def _serve(self, kind: type[Command[Any]], name: str) -> None:
        def answer(request: Any, response: Any) -> Any:
            try:
                result = str(carry_out(_command_of(kind, request), self._robot))
                setattr(response, "value" if hasattr(response, "value") else "message", result)
                response.success = True
            except YumiError as error:
                response.success = False
                say_why(response, error)
                if kind.lane is not Lane.READ:
                    self._log.error(f"{name}: {error}")
            return response

        self._node.create_service(
            getattr(srv, kind.__name__, Trigger),
            f"~/{name}",
            answer,
            qos_profile=SERVICES_QOS,
            callback_group=self._callback_groups[kind.lane],
        )


class _Cancelled(Exception):
    """The client has cancelled the goal; the next step has not begun. It is not reported as a failure."""


@dataclass(frozen=True, eq=False)
class _GoalCaller(Caller):
    """The client of a goal: ``is_gone`` is whether it has cancelled the goal, ``meanwhile`` when beside its steps."""

    meanwhile: str = ""

    def check(self, step: str = "") -> None:
        if self.is_gone():
            raise _Cancelled(f"Cancelled before: {step}." if step else f"Cancelled {self.meanwhile}.")


class CommandActions:
    """The actions of the robot manager's node; arguments as of :class:`CommandServices`, ``frame`` is the base."""

    def __init__(self, node: Any, robot: CommandedRobot, frame: str = "") -> None:
        self._node = node
        self._frame = frame
        self._log = node.get_logger()
        self._clock = node.get_clock()
        self._robot = robot
        self._busy = Lock()
        self._servers = [
            self._serve(
                action.SetMode,
                "set_mode",
                lambda goal: SetMode(mode_of(goal.mode).value),
                "while another change was made",
            ),
            self._serve(
                action.Recover,
                "recover",
                lambda goal: Recover(goal.confirm_stop.strip()),
                "while the controller did not answer",
            ),
        ]

    def destroy(self) -> None:
        for server in self._servers:
            server.destroy()

    def _serve(self, kind: Any, name: str, command: Callable[[Any], Command[str]], meanwhile: str) -> Any:
        def execute(handle: Any) -> Any:
            def show(step: str) -> None:
                caller.check(step)  # a cancelled goal ends before its next step, also that of a stop
                handle.publish_feedback(kind.Feedback(step=step))

            caller = _GoalCaller(
                show=show,
                is_gone=lambda: bool(handle.is_cancel_requested),
                meanwhile=meanwhile,
            )
            result, is_alone = kind.Result(), self._busy.acquire(blocking=False)
            try:
                asked = command(handle.request)
                if not is_alone and not asked.is_stop:  # a stop ends what is being done
                    raise CommandRefused(message("another_mode_change"))
                result.message = carry_out(asked, self._robot, caller)
                result.success = True
                handle.succeed()
            except _Cancelled as cancelled:
                result.message = str(cancelled)
                handle.canceled()
            except YumiError as error:
                say_why(result, error)
                self._log.error(f"{name}: {error}")
                handle.abort()
            finally:
                if is_alone:
                    self._busy.release()
            state = self._robot.manager.monitor.state()
            result.state = robot_state(state, self._clock.now().nanoseconds, self._frame)
            return result

        return ActionServer(
            self._node,
            kind,
            f"~/{name}",
            execute_callback=execute,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
            callback_group=ReentrantCallbackGroup(),
        )


_POLL_PERIOD = 0.05  # [s]
_NAME = "speed_scale"


class SpeedScaleInterface:
    """``speed_scale`` as the service ``~/set_speed_scale`` and as a parameter; both change the one setting.

    It can be set in every state of the robot, and waits for no other service. ``~/speed_scale`` is what holds now.
    """

    def __init__(self, node: Any, speed: SpeedSetting, timers: TimerThread) -> None:
        self._node = node
        self._speed = speed
        self._log = node.get_logger()
        described = ParameterDescriptor(
            description="The factor on the speed of every controller.",
            floating_point_range=[FloatingPointRange(from_value=LOWEST_SPEED_SCALE, to_value=FULL_SPEED)],
        )
        node.add_on_set_parameters_callback(self._on_set_parameters)
        node.declare_parameter(_NAME, speed.value, described)  # the callback takes a value of the command line
        self._publisher = node.create_publisher(SpeedScalingFactor, "~/speed_scale", LATCHED_QOS)
        self._published = 0.0
        timers.every(_POLL_PERIOD, "speed_scale", self._publish)
        node.create_service(
            srv.SetSpeedScale,
            "~/set_speed_scale",
            self._set,
            qos_profile=SERVICES_QOS,
            callback_group=MutuallyExclusiveCallbackGroup(),
        )

    def _publish(self) -> None:
        if self._speed.in_force != self._published:
            self._published = self._speed.in_force
            self._publisher.publish(SpeedScalingFactor(factor=self._published))

    def _on_set_parameters(self, parameters: list[Any]) -> SetParametersResult:
        for parameter in parameters:
            if parameter.name == _NAME and parameter.value != self._speed.value:
                try:
                    self._log.info(self._speed.set(parameter.value))
                except CommandRefused as error:
                    return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _set(self, request: Any, response: Any) -> Any:
        try:
            response.message = self._speed.set(request.speed_scale)
            response.success = True
            self._node.set_parameters([Parameter(_NAME, value=self._speed.value)])
            self._log.info(response.message)
        except CommandRefused as error:
            say_why(response, error)
        return response
