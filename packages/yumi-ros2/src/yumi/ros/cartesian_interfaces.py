"""The ROS interfaces of the Cartesian controllers, together."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from abb_protocols.robot.joints import JointLimits, Side
from yumi.control.controllers.cartesian import CartesianController
from yumi.control.tool_limits import ToolLimited, ToolLimits
from yumi.control.trajectory_commands import TrajectoryEnded, TrajectoryOutcome
from yumi.driver.control_process import ControlProcess
from yumi.driver.controller_names import CARTESIAN_CONTROLLER
from yumi.ros.controller_manager_node import MakeInterface
from yumi.ros.frames import RobotFrames
from yumi.ros.kinematics_services import KinematicsServices
from yumi.ros.line_actions import LineAction, MoveBothLinearAction, MoveLinearAction
from yumi.ros.tool_topics import ServoPoseTopic, ServoTwistTopic, TargetPoseTopic, ToolTopic


class CartesianTopics:
    """All topics of one Cartesian controller, and its action; the ends of other lines are logged."""

    def __init__(
        self,
        node: Any,
        side: Side,
        actions: tuple[LineAction, ...],
        parts: tuple[LineAction | ToolTopic | KinematicsServices, ...],
        on_end: Callable[[], None],
    ) -> None:
        self._log = node.get_logger()
        self._side, self._actions, self._parts, self._on_end = side, actions, parts, on_end

    def on_event(self, event: Any) -> None:
        is_known = [each.on_arm_event(self._side, event) for each in self._actions]
        if not any(is_known) and isinstance(event, TrajectoryEnded):
            if event.outcome is TrajectoryOutcome.SUCCEEDED:  # a line for each, see rclpy's loggers
                self._log.info(str(event))
            else:
                self._log.warning(str(event))
        if isinstance(event, ToolLimited):
            self._log.info(str(event))

    def destroy(self) -> None:
        self._on_end()
        for part in self._parts:
            part.destroy()


def cartesian_interfaces(
    dual: Any,
    streams: Mapping[Side, Any],
    control: ControlProcess,
    now: Callable[[], float],
    frames: RobotFrames,
    limits: JointLimits,
    base: str,
    within: ToolLimits,
) -> Mapping[str, MakeInterface]:
    """What Cartesian controllers offer, by their type.

    ``dual`` is the node of the action of both arms, ``streams`` are nodes for streams alone, ``base`` is a frame. Lines
    keep ``limits`` of the joints, and are planned ``within`` those of the tool.
    """
    targets: dict[Side, TargetPoseTopic] = {}
    frames.listen(dual)
    both = MoveBothLinearAction(
        dual, f"dual_arm_{CARTESIAN_CONTROLLER}/move_linear", control, now, targets, frames, base
    )

    def make(node: Any, side: Side, name: str) -> CartesianTopics:
        target = TargetPoseTopic(node, side, control, now, name, frames)
        target.limits, target.within = limits, within
        streamed = (kind(streams[side], side, control, now, name, frames) for kind in (ServoPoseTopic, ServoTwistTopic))
        action = MoveLinearAction(side, node, f"{name}/move_linear", control, now, {side: target}, frames, base)
        services = KinematicsServices(node, side, name, frames)
        if name == CARTESIAN_CONTROLLER:
            targets[side] = target

        def end() -> None:
            if targets.get(side) is target:
                del targets[side]
                both.end_open_goals()

        return CartesianTopics(node, side, (action, both), (action, target, *streamed, services), end)

    return {CartesianController.kind: make}
