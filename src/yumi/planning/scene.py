"""The robot as planners read it: a URDF of the shapes that are kept apart, and an SRDF with groups and exceptions.

The shapes are those of :mod:`yumi.robot.collision`, so that what was planned is what the limiter lets pass.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import atan2, dist, hypot
from xml.etree import ElementTree as ET

from yumi.robot.collision import PADDING, Obstacle, Part, gripper_parts, link_parts
from yumi.robot.description import (
    BODY_SHAPES,
    FLANGE_ORIGIN,
    JOINT_EFFORT,
    JOINT_ORIGINS,
    TOOL0_ORIGIN,
    Origin,
    joint_1_origin,
)
from yumi.robot.gripper import GripperModules
from yumi.robot.joints import YUMI_LIMITS, JointLimits, Pose, Side, Vector, finger_names, joint_names, prefixed
from yumi.robot.kinematics import euler_zyx

GROUPS: Mapping[str, tuple[Side, ...]] = {
    "right_arm": (Side.RIGHT,),
    "left_arm": (Side.LEFT,),
    "both_arms": (Side.RIGHT, Side.LEFT),
}
"""The groups of joints that are planned for together."""

# Pairs of links of one arm that need not be checked, counted in chain order from 1, the gripper as 8. Both arms have
# the same shapes. Neighbours overlap by construction, and so do the capsules of links with one short link between them.
NEIGHBOURS = ((1, 2), (2, 3), (2, 4), (3, 4), (4, 5), (4, 6), (5, 6), (5, 7), (5, 8), (6, 7), (6, 8), (7, 8))
# These did not touch in 100,000 random postures; tests/unit/planning looks again, with Pinocchio and Coal.
NEVER = ((1, 3), (3, 5), (3, 6), (3, 7), (3, 8), (4, 7))


def body_link() -> str:
    """The link of everything that stands still."""
    return prefixed("yumi_body")


def link_names(side: Side) -> tuple[str, ...]:
    """The arm's links in chain order, then its gripper, as in the robot's description."""
    return (*(prefixed(f"yumi_link_{number}_{side.value}") for number in range(1, 8)), gripper_link(side))


def gripper_link(side: Side) -> str:
    return prefixed(f"gripper_{side.value}_base")


def planning_description(
    grippers: Mapping[Side, GripperModules],
    *,
    tools: Mapping[Side, Sequence[Part]] | None = None,
    obstacles: Sequence[Obstacle] = (),
    clearance: float,
    limits: JointLimits = YUMI_LIMITS,
) -> str:
    """A URDF of both arms, whose shapes are larger by ``clearance``: free in it is that far apart in truth.

    Args:
        grippers: the modules of each arm's gripper.
        tools: more parts of an arm.
        obstacles: what stands around the robot.
        clearance: between any two shapes, at least [m]; half of it is added to each.
        limits: of the joints.
    """
    grown = clearance / 2.0
    boxes = [_box_of(low, high) for low, high in ((box.low_mm, box.high_mm) for box in BODY_SHAPES)]
    boxes += [(obstacle.centre, obstacle.size) for obstacle in obstacles]
    parts = [_link(body_link(), (_box(centre, size, grown) for centre, size in boxes))]
    for side in Side:
        own = (*link_parts(), *gripper_parts(grippers[side]), *(tools or {}).get(side, ()))
        names, parent = link_names(side), body_link()
        for index, origin in enumerate((joint_1_origin(side), *JOINT_ORIGINS)):
            lower, upper, speed = limits.lower[index], limits.upper[index], limits.velocity[index]
            limit = f'<limit lower="{lower}" upper="{upper}" effort="{JOINT_EFFORT}" velocity="{speed}"/>'
            parts.append(_link(names[index], _capsules(own, index, grown)))
            inside = f'<axis xyz="0 0 1"/>{limit}'
            parts.append(_joint(joint_names(side)[index], "revolute", parent, names[index], origin, inside))
            parent = names[index]
        flange, tool0 = (prefixed(f"yumi_{name}_{side.value}") for name in ("flange", "tool0"))
        parts += [_link(flange), _joint(f"{flange}_joint", "fixed", parent, flange, FLANGE_ORIGIN)]
        parts += [_link(tool0), _joint(f"{tool0}_joint", "fixed", flange, tool0, TOOL0_ORIGIN)]
        parts.append(_link(names[-1], _capsules(own, len(names) - 1, grown)))
        parts.append(_joint(f"{names[-1]}_joint", "fixed", tool0, names[-1], Origin()))
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
            for each in ("right_arm", "left_arm"):
                ET.SubElement(group, "group", name=each)
        else:
            tip = prefixed(f"yumi_tool0_{sides[0].value}")
            ET.SubElement(group, "chain", base_link=body_link(), tip_link=tip)
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
        names = link_names(side)
        yield body_link(), names[0], "Adjacent"
        yield body_link(), names[1], "Adjacent"  # the shoulder turns it beside the body, a few millimetres away at home
        for pairs, reason in ((NEIGHBOURS, "Adjacent"), (NEVER, "Never")):
            for first, second in pairs:
                yield names[first - 1], names[second - 1], reason
        if with_fingers:
            fingers = ["finger".join(name.rsplit("joint", 1)) for name in finger_names(side)]
            yield fingers[0], fingers[1], "Adjacent"
            for finger in fingers:
                yield names[-1], finger, "Adjacent"
                for first, second in (*NEIGHBOURS, *NEVER):
                    if second == len(names):
                        yield names[first - 1], finger, "Never"
    yield link_names(Side.RIGHT)[0], link_names(Side.LEFT)[0], "Never"  # bolted to one body, next to each other


def _link(name: str, solids: Iterable[str] = ()) -> str:
    return f'<link name="{name}">{"".join(f"<collision>{solid}</collision>" for solid in solids)}</link>'


def _joint(name: str, kind: str, parent: str, child: str, origin: Origin, rest: str = "") -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{_origin(origin.xyz, origin.rpy)}{ends}{rest}</joint>'


def _origin(xyz: Vector, rpy: Vector = (0.0, 0.0, 0.0)) -> str:
    return f'<origin xyz="{" ".join(map(repr, xyz))}" rpy="{" ".join(map(repr, rpy))}"/>'


def _box_of(low_mm: Vector, high_mm: Vector) -> tuple[Pose, Vector]:
    x, y, z = ((low + high) / 2000.0 for low, high in zip(low_mm, high_mm, strict=True))
    width, depth, height = ((high - low) / 1000.0 for low, high in zip(low_mm, high_mm, strict=True))
    return Pose((x, y, z), (1.0, 0.0, 0.0, 0.0)), (width, depth, height)


def _box(centre: Pose, size: Vector, grown: float) -> str:
    sizes = " ".join(repr(edge + 2.0 * grown) for edge in size)
    return f'{_origin(centre.position, euler_zyx(centre.orientation))}<geometry><box size="{sizes}"/></geometry>'


def _capsules(parts: Iterable[Part], frame: int, grown: float) -> Iterator[str]:
    """The parts of one frame, each as a cylinder and a ball at each end: URDF has no capsule."""
    for part in parts:
        if part.frame != frame:
            continue
        radius = part.radius + PADDING + grown
        x, y, z = (b - a for a, b in zip(part.start, part.end, strict=True))
        mx, my, mz = ((a + b) / 2.0 for a, b in zip(part.start, part.end, strict=True))
        turn = (0.0, atan2(hypot(x, y), z), atan2(y, x))  # z along the axis
        size = f'radius="{radius}" length="{dist(part.start, part.end)}"'
        yield f"{_origin((mx, my, mz), turn)}<geometry><cylinder {size}/></geometry>"
        for point in (part.start, part.end):
            yield f'{_origin(point)}<geometry><sphere radius="{radius}"/></geometry>'
