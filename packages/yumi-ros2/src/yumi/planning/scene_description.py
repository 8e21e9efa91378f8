"""The robot as planners read it: a URDF of the shapes that are kept apart, and an SRDF with groups and exceptions.

The shapes are those of :mod:`yumi.core.collision`, so that what was planned is what the limiter lets pass.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from xml.etree import ElementTree as ET

from abb_protocols.robot.description import (
    FLANGE_ORIGIN,
    JOINT_EFFORT,
    JOINT_ORIGINS,
    LINK_SHAPES,
    TOOL0_ORIGIN,
    Origin,
    joint_1_origin,
)
from abb_protocols.robot.gripper_values import GripperModules
from abb_protocols.robot.joints import YUMI_LIMITS, JointLimits, Pose, Side, Vector, finger_names, joint_names, prefixed
from abb_protocols.robot.kinematics import euler_zyx
from abb_protocols.robot.urdf import box_xml, cylinder_xml, joint_xml, limit_xml, link_xml
from yumi.core.collision import (
    COLLISION_PADDING,
    TOOL_FRAME,
    CollisionPart,
    Obstacle,
    body_boxes,
    gripper_parts,
    link_parts,
)

GROUPS: Mapping[str, tuple[Side, ...]] = {
    **{f"{side.word}_arm": (side,) for side in Side},
    "both_arms": tuple(Side),
}
"""The groups of joints that are planned for together."""

# Pairs of links of one arm that need not be checked, counted in chain order from 1, the gripper as 8. Both arms have
# the same shapes. Neighbours overlap by construction, and so do the capsules of links with one short link between them.
_ADJACENT_LINKS = ((1, 2), (2, 3), (2, 4), (3, 4), (4, 5), (4, 6), (5, 6), (5, 7), (5, 8), (6, 7), (6, 8), (7, 8))
# These did not touch in 100,000 random postures; tests/unit/planning looks again, with Pinocchio and Coal.
_NEVER_TOUCHING_LINKS = ((1, 3), (3, 5), (3, 6), (3, 7), (3, 8), (4, 7))


def _body_link() -> str:
    """The link of everything that stands still."""
    return prefixed("yumi_body")


def _link_names(side: Side) -> tuple[str, ...]:
    """The arm's links in chain order, then its gripper, as in the robot's description."""
    links = (prefixed(f"yumi_link_{index + 1}_{side.value}") for index in range(len(LINK_SHAPES)))
    return (*links, prefixed(f"gripper_{side.value}_base"))


def planning_description(
    grippers: Mapping[Side, GripperModules],
    *,
    tools: Mapping[Side, Sequence[CollisionPart]] | None = None,
    obstacles: Sequence[Obstacle] = (),
    clearance: float,
    to_boxes: float,
    limits: JointLimits = YUMI_LIMITS,
) -> str:
    """A URDF of both arms, whose shapes are larger by ``clearance``: free in it is that far apart in truth.

    Args:
        grippers: the modules of each arm's gripper.
        tools: more parts of an arm.
        obstacles: what stands around the robot.
        clearance: of the arms from each other and from the body, at least [m]; half of it is added to each.
        to_boxes: of the arms from obstacles [m].
        limits: of the joints.
    """
    grown = clearance / 2.0
    boxes = [_box(each.centre, each.size, grown) for each in body_boxes()]
    boxes += [_box(obstacle.centre, obstacle.size, to_boxes - grown) for obstacle in obstacles]
    parts = [link_xml(_body_link(), solids=boxes)]
    for side in Side:
        own = (*link_parts(), *gripper_parts(grippers[side]), *(tools or {}).get(side, ()))
        names, parent = _link_names(side), _body_link()
        for index, origin in enumerate((joint_1_origin(side), *JOINT_ORIGINS)):
            parts.append(link_xml(names[index], solids=_capsules(own, index, grown)))
            limit = limit_xml(limits.lower[index], limits.upper[index], JOINT_EFFORT, limits.velocity[index])
            inside = f'<axis xyz="0 0 1"/>{limit}'
            parts.append(joint_xml(joint_names(side)[index], "revolute", parent, names[index], origin, inside))
            parent = names[index]
        flange, tool0 = (prefixed(f"yumi_{name}_{side.value}") for name in ("flange", "tool0"))
        parts += [link_xml(flange), joint_xml(f"{flange}_joint", "fixed", parent, flange, FLANGE_ORIGIN)]
        parts += [link_xml(tool0), joint_xml(f"{tool0}_joint", "fixed", flange, tool0, TOOL0_ORIGIN)]
        parts.append(link_xml(names[-1], solids=_capsules(own, TOOL_FRAME, grown)))
        parts.append(joint_xml(f"{names[-1]}_joint", "fixed", tool0, names[-1], Origin()))
    return f'<?xml version="1.0"?>\n<robot name="yumi">{"".join(parts)}</robot>'


def semantic_description(*, with_fingers: bool = True) -> str:
    """The SRDF: groups, end effectors, named states, and the pairs of links that need not be checked.

    Args:
        with_fingers: the fingers are links of their own, as in the robot's description; else the gripper is one link.
    """
    robot = ET.Element("robot", name="yumi")
    for name, sides in GROUPS.items():
        group = ET.SubElement(robot, "group", name=name)
        if len(sides) > 1:
            for side in sides:
                ET.SubElement(group, "group", name=f"{side.word}_arm")
        else:
            tip = prefixed(f"yumi_tool0_{sides[0].value}")
            ET.SubElement(group, "chain", base_link=_body_link(), tip_link=tip)
    if with_fingers:
        for side in Side:
            group = ET.SubElement(robot, "group", name=f"{side.word}_gripper")
            for finger in finger_names(side):
                ET.SubElement(group, "joint", name=finger)
            ET.SubElement(
                robot,
                "end_effector",
                name=f"{side.word}_gripper",
                parent_link=prefixed(f"yumi_tool0_{side.value}"),
                group=f"{side.word}_gripper",
                parent_group=f"{side.word}_arm",
            )
            ET.SubElement(robot, "passive_joint", name=finger_names(side)[1])  # the first one's motor moves it
    for first, second, reason in disabled_pairs(with_fingers=with_fingers):
        ET.SubElement(robot, "disable_collisions", link1=first, link2=second, reason=reason)
    ET.indent(robot)
    return '<?xml version="1.0"?>\n' + ET.tostring(robot, encoding="unicode")


def disabled_pairs(*, with_fingers: bool = True) -> Iterator[tuple[str, str, str]]:
    """Pairs of links that need not be checked, with MoveIt's word for the reason."""
    for side in Side:
        names = _link_names(side)
        yield _body_link(), names[0], "Adjacent"
        # The shoulder turns it beside the body, a few millimetres away at home.
        yield _body_link(), names[1], "Adjacent"
        for pairs, reason in ((_ADJACENT_LINKS, "Adjacent"), (_NEVER_TOUCHING_LINKS, "Never")):
            for first, second in pairs:
                yield names[first - 1], names[second - 1], reason
        if with_fingers:
            fingers = ["finger".join(name.rsplit("joint", 1)) for name in finger_names(side)]
            yield fingers[0], fingers[1], "Adjacent"
            for finger in fingers:
                yield names[-1], finger, "Adjacent"
                for first, second in (*_ADJACENT_LINKS, *_NEVER_TOUCHING_LINKS):
                    if second == len(names):
                        yield names[first - 1], finger, "Never"
    yield _link_names(Side.RIGHT)[0], _link_names(Side.LEFT)[0], "Never"  # bolted to one body, next to each other


def _capsules(parts: Iterable[CollisionPart], frame: int, grown: float) -> Iterator[str]:
    """The parts of one frame."""
    for part in parts:
        if part.frame == frame:
            yield from cylinder_xml(part.start, part.end, part.radius + COLLISION_PADDING + grown, is_round=True)


def _box(centre: Pose, size: Vector, grown: float) -> str:
    return box_xml(Origin(centre.position, euler_zyx(centre.orientation)), [edge + 2.0 * grown for edge in size])
