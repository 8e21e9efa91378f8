"""``robot_description``: the driver tells its own, and a controller manager waits for one that has its arm."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any
from xml.etree import ElementTree

from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from yumi.robot.gripper import GripperModules
from yumi.robot.joints import Side, joint_names
from yumi.robot.limits import JointLimits
from yumi.robot.model import robot_description

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_REMINDER = 2.0  # [s]


def publish_descriptions(node: Any, limits: JointLimits, grippers: Mapping[Side, GripperModules]) -> list[Any]:
    """Tell the robot's description to whoever listens, also later: for all, and in each arm's namespace; publishers.

    Args:
        node: whose publishers they are.
        limits: what trajectories may ask of the joints: tools plan with the speeds of the description.
        grippers: what each hand is made of.
    """
    message = String(data=robot_description(limits, grippers))
    topics = ("robot_description", *(f"{side.value}/robot_description" for side in Side))
    publishers = [node.create_publisher(String, topic, LATCHED) for topic in topics]
    for publisher in publishers:
        publisher.publish(message)
    return publishers


class DescriptionWait:
    """Waits on ``robot_description`` for the first description that has the arm's joints; later ones change nothing.

    Args:
        node: the controller manager's node.
        side: the arm.
        on_description: called once.
    """

    def __init__(self, node: Any, side: Side, on_description: Callable[[], None]) -> None:
        self._log = node.get_logger()
        self._names = joint_names(side)
        self._on_description = on_description
        self._urdf = ""
        self._is_due = False  # the timer runs before anything is spun, and is overdue then though all is well
        self._reminder = node.create_timer(_REMINDER, self._remind)
        node.create_subscription(String, "robot_description", self._take, LATCHED)

    @property
    def is_over(self) -> bool:
        """Whether a description has come."""
        return bool(self._urdf)

    def _remind(self) -> None:
        if self._is_due:
            self._log.warning("Waiting for a message on robot_description.")
        self._is_due = True

    def _take(self, message: Any) -> None:
        if self._urdf:
            if message.data != self._urdf:
                self._log.warning("Another robot description has come; it is ignored until the driver is restarted.")
            return
        reason = self._why_not(message.data)
        if reason:
            self._log.error(f"The robot description cannot be used: {reason}.")
            return
        self._urdf = message.data
        self._reminder.cancel()
        self._on_description()

    def _why_not(self, urdf: str) -> str:
        try:
            found = {joint.get("name") for joint in ElementTree.fromstring(urdf).iter("joint")}
        except ElementTree.ParseError as error:
            return f"it is no XML ({error})"
        missing = [name for name in self._names if name not in found]
        return f"it has no joint {', '.join(missing)}" if missing else ""
