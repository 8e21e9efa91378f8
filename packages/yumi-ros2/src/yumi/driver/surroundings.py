"""The surroundings of the arms, as the driver's settings declare them, for planners beside the driver."""

from __future__ import annotations

from dataclasses import replace

import msgspec

from abb_protocols.robot.gripper_values import GripperModules
from abb_protocols.robot.joints import YUMI_LIMITS, JointLimits, Joints, Pose, Side, Vector
from yumi.core.collision import TOOL_FRAME, CollisionPart, Obstacle
from yumi.driver.settings import Settings


class SurroundingsBox(msgspec.Struct, frozen=True):
    """A box that stands around the robot: its name, the pose of its middle in the body's frame, its edges [m]."""

    name: str
    pose: Pose
    size: Vector


class SurroundingsTool(msgspec.Struct, frozen=True):
    """A capsule that an arm carries beside its gripper: its name, both ends of its axis in tool0 and its radius [m]."""

    name: str
    start: Vector
    end: Vector
    radius: float


class Surroundings(msgspec.Struct, frozen=True, kw_only=True):
    """What a motion is planned with: what must not collide, as the driver's settings declare it, and its joint speeds.

    Attributes:
        grippers: the modules of each arm's gripper, in the words of the settings; an arm without an entry has a servo.
        tools: what each arm carries beside its gripper.
        boxes: what stands around the robot.
        is_limited: whether the driver keeps the arms apart from each other, the body and the boxes.
        margin: the distance it keeps [m].
        velocity: highest joint speeds that EGM allows [rad/s], (7,) in chain order; None where they are unknown.
    """

    grippers: dict[str, str] = {}
    tools: dict[str, tuple[SurroundingsTool, ...]] = {}
    boxes: tuple[SurroundingsBox, ...] = ()
    is_limited: bool = False
    margin: float = 0.0
    velocity: Joints | None = None


def surroundings_of(settings: Settings) -> Surroundings:
    """What must not collide, as the settings declare it."""
    own = settings.collision
    return Surroundings(
        grippers={side.word: settings.gripper.modules(side).value for side in Side},
        tools={
            side.word: tuple(SurroundingsTool(part.name, part.start, part.end, part.radius) for part in parts)
            for side, parts in own.tools().items()
        },
        boxes=tuple(SurroundingsBox(each.name, each.centre, each.size) for each in own.obstacles()),
        is_limited=own.enabled,
        margin=own.margin,
    )


def shapes_of(
    surroundings: Surroundings,
) -> tuple[dict[Side, GripperModules], dict[Side, tuple[CollisionPart, ...]], tuple[Obstacle, ...]]:
    """Grippers, tools and boxes as the collision model has them."""
    grippers = {side: GripperModules(surroundings.grippers.get(side.word, "servo")) for side in Side}
    tools = {
        side: tuple(
            CollisionPart(each.name, TOOL_FRAME, each.start, each.end, each.radius)
            for each in surroundings.tools.get(side.word, ())
        )
        for side in Side
    }
    return grippers, tools, tuple(Obstacle(each.name, each.pose, each.size) for each in surroundings.boxes)


def limits_of(surroundings: Surroundings) -> JointLimits:
    """The joints' limits, no faster than the driver allows them to be."""
    known = surroundings.velocity
    return YUMI_LIMITS if known is None else replace(YUMI_LIMITS, velocity=known)
