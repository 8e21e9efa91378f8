"""Messages of a page of ``yumi view``: to ask, pair, take control, plan, inject faults, and jog within limits.

Anything else is refused.
"""

from __future__ import annotations

from functools import reduce
from operator import or_
from typing import TYPE_CHECKING, Annotated, Any, Literal

import msgspec

from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.robot.joints import ZERO_JOINTS
from yumi.driver.command import ArmName, Command, SentPosition
from yumi.driver.commands import offered_to
from yumi.driver.device_frame import DeviceFrame
from yumi.driver.motion_commands import Jog, JogTool

if TYPE_CHECKING:
    AskedOfDriver = Command[Any]
else:
    AskedOfDriver = reduce(or_, offered_to(FrontEnd.PAGE))
"""The commands that a page may give."""

MAX_JOG_JOINT_SPEED = 0.5
"""No joint or elbow is jogged faster than this [rad/s], before speed_scale: it stops within 0.2 s of a lost link."""

MAX_JOG_LINEAR, MAX_JOG_ANGULAR = 0.15, 0.5
"""The tool is not jogged faster than this [m/s], [rad/s], before speed_scale; for the same reason."""

_Speed = Annotated[float, msgspec.Meta(ge=-MAX_JOG_JOINT_SPEED, le=MAX_JOG_JOINT_SPEED)]
_Linear = Annotated[float, msgspec.Meta(ge=-MAX_JOG_LINEAR, le=MAX_JOG_LINEAR)]
_Angular = Annotated[float, msgspec.Meta(ge=-MAX_JOG_ANGULAR, le=MAX_JOG_ANGULAR)]


class PageMessage(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="type"):
    """What a page sends."""


class TakeControl(PageMessage, frozen=True, tag="take_control"):
    """A person has clicked on it; a page that has control loses it."""


class GiveBackMessage(PageMessage, frozen=True, tag="give_back"):
    """Control is given back."""


class Ask(PageMessage, frozen=True, tag="ask"):
    """What the driver is asked for; answers have this ``id``. Jogs have messages of their own, with limits."""

    id: int
    request: AskedOfDriver


class Inject(PageMessage, frozen=True, tag="inject"):
    """A fault for a virtual robot, with the options of ``yumi fault``."""

    id: int
    name: str
    form: dict[str, str] = {}


class Seen(PageMessage, frozen=True, tag="seen"):
    """The state that was sent is shown; the next one may come."""


class PlanMotion(PageMessage, frozen=True, tag="plan"):
    """Plan a motion around everything, and show it: to positions as :class:`yumi.driver.motion_commands.Move` has them.

    With ``is_pose`` they are poses of the fingertips in the body's frame: x, y, z [m], quaternion w, x, y, z.
    """

    id: int
    right: SentPosition | None = None
    left: SentPosition | None = None
    is_pose: bool = False


class ExecutePlan(PageMessage, frozen=True, tag="execute"):
    """Follow the plan that was shown under this number."""

    id: int
    plan: int


class JointsJog(PageMessage, frozen=True, tag="jog_joints"):
    """A key is held: joint speeds of an arm [rad/s]; zeros when it is released.

    ``hold`` counts the holds, and ``seen`` is the time of the state that the page has got last.
    """

    arm: ArmName
    hold: int
    seen: float
    speeds: tuple[_Speed, _Speed, _Speed, _Speed, _Speed, _Speed, _Speed]

    @property
    def request(self) -> Jog:
        """What the driver is asked for."""
        return Jog(arm=self.arm, speeds=self.speeds)

    @property
    def at_rest(self) -> Jog:
        """The same without motion."""
        return Jog(arm=self.arm, speeds=ZERO_JOINTS)


class ToolJog(PageMessage, frozen=True, tag="jog_tool"):
    """A key is held: speeds of the tool [m/s], [rad/s] in a frame, or of the elbow [rad/s]."""

    arm: ArmName
    hold: int
    seen: float
    frame: Literal["base", "tool"] = "base"
    linear: tuple[_Linear, _Linear, _Linear] = (0.0, 0.0, 0.0)
    angular: tuple[_Angular, _Angular, _Angular] = (0.0, 0.0, 0.0)
    elbow: _Speed = 0.0

    @property
    def request(self) -> JogTool:
        """What the driver is asked for."""
        return JogTool(arm=self.arm, linear=self.linear, angular=self.angular, elbow=self.elbow, frame=self.frame)

    @property
    def at_rest(self) -> JogTool:
        """The same without motion."""
        return JogTool(arm=self.arm, frame=self.frame)


class DeviceMessage(PageMessage, frozen=True, tag="teleoperate"):
    """A frame of the device with which the person at the page teleoperates; the page has seen the newest state."""

    frame: DeviceFrame
    is_headset: bool = False

    def __post_init__(self) -> None:
        if self.frame.seen is None:  # else the driver takes it for one of this machine, which takes no time
            raise ValueError("A frame of a page has `seen`, the time of the newest state that the page was sent.")


class Pair(PageMessage, frozen=True, tag="pair"):
    """A person has typed the code that the robot's machine shows; the answer has the key of the pairing."""

    id: int
    code: str


AnyJog = JointsJog | ToolJog
ForOperator = Ask | Inject | PlanMotion | ExecutePlan | AnyJog | DeviceMessage
"""What a page asks for that has control."""

AnyMessage = TakeControl | GiveBackMessage | Seen | Pair | ForOperator
