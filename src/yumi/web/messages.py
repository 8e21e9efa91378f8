"""What a page sends to the server of ``yumi view``; anything else is refused."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec

from yumi.driver.endpoint import (
    Arm,
    Calibrate,
    Grip,
    Jog,
    JogTool,
    Move,
    Position,
    Recover,
    Request,
    SetSpeedScale,
    StartEgm,
    StopEgm,
    SwitchControllers,
)
from yumi.robot.joints import ZERO

MAX_JOINT_SPEED = 0.5
"""No joint or elbow is jogged faster than this [rad/s], before speed_scale: it stops within 0.2 s of a lost link."""

MAX_LINEAR, MAX_ANGULAR = 0.15, 0.5
"""The tool is not jogged faster than this [m/s], [rad/s], before speed_scale; for the same reason."""

_Speed = Annotated[float, msgspec.Meta(ge=-MAX_JOINT_SPEED, le=MAX_JOINT_SPEED)]
_Linear = Annotated[float, msgspec.Meta(ge=-MAX_LINEAR, le=MAX_LINEAR)]
_Angular = Annotated[float, msgspec.Meta(ge=-MAX_ANGULAR, le=MAX_ANGULAR)]


class Message(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="type"):
    """What a page sends."""


class TakeControl(Message, frozen=True, tag="take_control"):
    """A person has clicked on it; a page that has control loses it."""


class GiveBack(Message, frozen=True, tag="give_back"):
    """Control is given back."""


class Ask(Message, frozen=True, tag="ask"):
    """What the driver is asked for; answers have this ``id``. Jogs have messages of their own, with limits."""

    id: int
    request: StartEgm | StopEgm | Recover | Calibrate | Grip | Move | SwitchControllers | SetSpeedScale


class Inject(Message, frozen=True, tag="inject"):
    """A fault for a virtual robot, with the options of ``yumi fault``."""

    id: int
    name: str
    form: dict[str, str] = {}


class Seen(Message, frozen=True, tag="seen"):
    """The state that was sent is shown; the next one may come."""


class PlanMotion(Message, frozen=True, tag="plan"):
    """Plan a motion around everything, and show it: to positions as :class:`yumi.driver.endpoint.Move` has them.

    With ``is_pose`` they are poses of the fingertips in the body's frame: x, y, z [m], quaternion w, x, y, z.
    """

    id: int
    right: Position | None = None
    left: Position | None = None
    is_pose: bool = False


class ExecutePlan(Message, frozen=True, tag="execute"):
    """Follow the plan that was shown under this number."""

    id: int
    plan: int


class JointsJog(Message, frozen=True, tag="jog_joints"):
    """A key is held: joint speeds of an arm [rad/s]; zeros when it is released.

    ``hold`` counts the holds, and ``seen`` is the time of the state that the page has got last.
    """

    arm: Arm
    hold: int
    seen: float
    speeds: tuple[_Speed, _Speed, _Speed, _Speed, _Speed, _Speed, _Speed]

    @property
    def request(self) -> Request:
        """What the driver is asked for."""
        return Jog(arm=self.arm, speeds=self.speeds)

    @property
    def at_rest(self) -> Request:
        """The same without motion."""
        return Jog(arm=self.arm, speeds=ZERO)


class ToolJog(Message, frozen=True, tag="jog_tool"):
    """A key is held: speeds of the tool [m/s], [rad/s] in a frame, or of the elbow [rad/s]."""

    arm: Arm
    hold: int
    seen: float
    frame: Literal["base", "tool"] = "base"
    linear: tuple[_Linear, _Linear, _Linear] = (0.0, 0.0, 0.0)
    angular: tuple[_Angular, _Angular, _Angular] = (0.0, 0.0, 0.0)
    elbow: _Speed = 0.0

    @property
    def request(self) -> Request:
        """What the driver is asked for."""
        return JogTool(arm=self.arm, linear=self.linear, angular=self.angular, elbow=self.elbow, frame=self.frame)

    @property
    def at_rest(self) -> Request:
        """The same without motion."""
        return JogTool(arm=self.arm, frame=self.frame)


AnyJog = JointsJog | ToolJog
AnyMessage = TakeControl | GiveBack | Seen | Ask | Inject | PlanMotion | ExecutePlan | AnyJog
