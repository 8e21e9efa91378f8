"""URDF: that of the robot for ROS, with its XML of links, joints, boxes and meshes, and the frames of one read again.

Every number of :func:`robot_description` stands in :mod:`abb_protocols.robot.description`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from math import atan2, cos, dist, hypot, sin
from xml.etree import ElementTree as ET

from abb_protocols.robot.description import (
    BODY_MASS,
    BODY_SHAPES,
    CAMERA,
    CUPS,
    FINGER_MASS,
    FINGER_ORIGINS,
    FINGER_SHAPES,
    FINGERTIPS,
    FLANGE_ORIGIN,
    GRIPPER_MASSES,
    GRIPPER_SHAPES,
    JOINT_DAMPING,
    JOINT_EFFORT,
    JOINT_FRICTION,
    JOINT_ORIGINS,
    LINK_SHAPES,
    SERVO_GRIPPERS,
    TOOL0_ORIGIN,
    Box,
    Capsule,
    Mass,
    Origin,
    Shape,
    joint_1_origin,
    link_mass,
)
from abb_protocols.robot.gripper_values import FINGER_TRAVEL, MAX_GRIP_FORCE, TOP_FINGER_SPEED, GripperModules
from abb_protocols.robot.joints import YUMI_LIMITS, JointLimits, Pose, Side, Vector, finger_names, joint_names, prefixed
from abb_protocols.robot.kinematics import IDENTITY_QUATERNION, compose_poses, euler_zyx, quaternion_from_euler_zyx

_MATERIALS = {
    "abb_white": "0.94 0.94 0.92 1",
    "abb_grey": "0.56 0.58 0.60 1",
    "abb_graphite": "0.22 0.23 0.25 1",
}


MESHES = "package://yumi_ros2/meshes"
"""Where ROS's tools find the meshes of :func:`robot_description`."""

_VISUALS: Mapping[str, tuple[tuple[str, str], ...]] = {
    "body": (("torso", "abb_white"), ("base", "abb_grey")),
    **{
        f"link_{number}": ((f"link_{number}", "abb_white"), (f"ring_{number}", "abb_graphite"))
        for number in range(1, 7)
    },
    "link_7": (("link_7", "abb_grey"),),
    "gripper": (("gripper", "abb_graphite"),),
    "finger": (("finger", "abb_grey"),),
}
"""The meshes of each link, with their materials."""


def robot_description(
    limits: JointLimits = YUMI_LIMITS, grippers: Mapping[Side, GripperModules] = SERVO_GRIPPERS, meshes: str = ""
) -> str:
    """The URDF: ``yumi_base_link`` at the root, two arms, two grippers; all names with the robot's prefix.

    Args:
        limits: of the joints; tools take the speeds they plan with from here.
        grippers: the modules of each gripper, for its mass.
        meshes: URL of the folder of the meshes that are shown, such as :data:`MESHES`; empty: the shapes that collide
            are shown, too, which every program can do.
    """
    parts = [f'<material name="{name}"><color rgba="{rgba}"/></material>' for name, rgba in _MATERIALS.items()]
    root, body = prefixed("yumi_base_link"), prefixed("yumi_body")
    parts.append(link_xml(root))
    parts.append(link_xml(body, BODY_MASS, _solids(BODY_SHAPES), "abb_grey", _visuals("body", meshes)))
    parts.append(joint_xml(f"{root}_to_body", "fixed", root, body, Origin()))
    parts += _frame(prefixed("yumi_base"), root, Origin())
    for side in (Side.LEFT, Side.RIGHT):
        parts += _arm(side, limits, meshes)
        parts += _gripper(side, grippers[side], meshes)
    robot = ET.fromstring(f'<robot name="yumi">{"".join(parts)}</robot>')
    ET.indent(robot)
    # No encoding in the declaration: lxml refuses a decoded string that names one.
    return '<?xml version="1.0"?>\n' + ET.tostring(robot, encoding="unicode")


def _arm(side: Side, limits: JointLimits, meshes: str) -> Iterator[str]:
    parent, origins = prefixed("yumi_body"), (joint_1_origin(side), *JOINT_ORIGINS)
    for index, (name, origin) in enumerate(zip(joint_names(side), origins, strict=True)):
        link = prefixed(f"yumi_link_{index + 1}_{side.value}")
        visuals = _visuals(f"link_{index + 1}", meshes)
        yield link_xml(link, link_mass(index), _solids(LINK_SHAPES[index]), "abb_white", visuals)
        limit = limit_xml(limits.lower[index], limits.upper[index], JOINT_EFFORT, limits.velocity[index])
        dynamics = f'<dynamics damping="{JOINT_DAMPING}" friction="{JOINT_FRICTION[index]}"/>'
        yield joint_xml(name, "revolute", parent, link, origin, f'<axis xyz="0 0 1"/>{limit}{dynamics}')
        parent = link
    flange = prefixed(f"yumi_flange_{side.value}")
    yield from _frame(flange, parent, FLANGE_ORIGIN)
    yield from _frame(prefixed(f"yumi_tool0_{side.value}"), flange, TOOL0_ORIGIN)


def _gripper(side: Side, modules: GripperModules, meshes: str) -> Iterator[str]:
    base = prefixed(f"gripper_{side.value}_base")
    yield link_xml(base, GRIPPER_MASSES[modules], _solids(GRIPPER_SHAPES), "abb_graphite", _visuals("gripper", meshes))
    yield joint_xml(f"{base}_joint", "fixed", prefixed(f"yumi_tool0_{side.value}"), base, Origin())
    frames = {"fingertips": FINGERTIPS, **{f"vacuum_{channel}": CUPS[channel] for channel in modules.vacuum_channels}}
    if modules.has_camera:
        frames["camera"] = CAMERA
    for name, pose in frames.items():
        origin = Origin(pose.position, euler_zyx(pose.orientation))
        yield from _frame(prefixed(f"gripper_{side.value}_{name}"), base, origin)
    first, second = finger_names(side)
    mimic = {second: f'<mimic joint="{first}" multiplier="1" offset="0"/>'}  # one motor drives both fingers
    limit = limit_xml(0.0, FINGER_TRAVEL, MAX_GRIP_FORCE, TOP_FINGER_SPEED)
    for name, origin in zip((first, second), FINGER_ORIGINS, strict=True):
        finger = "finger".join(name.rsplit("joint", 1))  # the last one: the prefix may have the word
        yield link_xml(finger, FINGER_MASS, _solids(FINGER_SHAPES), "abb_grey", _visuals("finger", meshes))
        yield joint_xml(name, "prismatic", base, finger, origin, f'<axis xyz="-1 0 0"/>{limit}{mimic.get(name, "")}')


def _frame(name: str, parent: str, origin: Origin) -> Iterator[str]:
    """A link without a body, fixed to ``parent``."""
    yield link_xml(name)
    yield joint_xml(f"{name}_joint", "fixed", parent, name, origin)


def joint_xml(name: str, kind: str, parent: str, child: str, origin: Origin, rest: str = "") -> str:
    """A joint, with what is inside it beside its place."""
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{_origin(origin)}{ends}{rest}</joint>'


def limit_xml(lower: float, upper: float, effort: float, velocity: float) -> str:
    """What a joint can do."""
    return f"<limit {_attributes(lower=lower, upper=upper, effort=effort, velocity=velocity)}/>"


def _visuals(part: str, meshes: str) -> str:
    """The meshes of a link, where there is a folder of them."""
    return "".join(
        f'<visual><geometry><mesh filename="{meshes}/{name}.stl"/></geometry><material name="{material}"/></visual>'
        for name, material in (_VISUALS[part] if meshes else ())
    )


def link_xml(
    name: str, mass: Mass | None = None, solids: Iterable[str] = (), material: str = "", visuals: str = ""
) -> str:
    """A link; the solids that collide are shown of a material, too, unless it has visuals of its own."""
    parts = []
    if mass is not None:
        inertia = _attributes(**dict(zip(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), mass.inertia, strict=True)))
        body = f'<mass value="{mass.mass:.15g}"/><inertia {inertia}/>'
        parts.append(f"<inertial>{_origin(Origin(mass.centre))}{body}</inertial>")
    parts.append(visuals)
    for solid in solids:
        shown = f'<visual>{solid}<material name="{material}"/></visual>' if material and not visuals else ""
        parts.append(f"{shown}<collision>{solid}</collision>")
    return f'<link name="{name}">{"".join(parts)}</link>'


def _solids(shapes: Iterable[Shape]) -> Iterator[str]:
    """URDF's solids that make up the shapes."""
    for shape in shapes:
        if isinstance(shape, Box):
            low, high = _metres(shape.low_mm), _metres(shape.high_mm)
            yield box_xml(Origin(_middle(low, high)), [b - a for a, b in zip(low, high, strict=True)])
        else:
            ends = _metres(shape.start_mm), _metres(shape.end_mm)
            yield from cylinder_xml(*ends, shape.radius_mm / 1000.0, is_round=isinstance(shape, Capsule))


def box_xml(middle: Origin, size: Iterable[float]) -> str:
    """A box by its middle and its edges [m]."""
    return f'{_origin(middle)}<geometry><box size="{_numbers(size)}"/></geometry>'


def cylinder_xml(start: Vector, end: Vector, radius: float, *, is_round: bool) -> Iterator[str]:
    """A cylinder, with a ball at each end where it is a capsule, which URDF does not have [m]."""
    x, y, z = (b - a for a, b in zip(start, end, strict=True))
    along = Origin(_middle(start, end), (0.0, atan2(hypot(x, y), z), atan2(y, x)))  # z along the axis
    sizes = f'radius="{radius:.15g}" length="{dist(start, end):.15g}"'
    yield f"{_origin(along)}<geometry><cylinder {sizes}/></geometry>"
    for point in (start, end) if is_round else ():
        yield f'{_origin(Origin(point))}<geometry><sphere radius="{radius:.15g}"/></geometry>'


def _origin(origin: Origin) -> str:
    return f'<origin xyz="{_numbers(origin.xyz)}" rpy="{_numbers(origin.rpy)}"/>'


def _attributes(**values: float) -> str:
    return " ".join(f'{name}="{value:.15g}"' for name, value in values.items())


def _numbers(values: Iterable[float]) -> str:
    return " ".join(f"{value:.15g}" for value in values)


def _middle(a: Vector, b: Vector) -> Vector:
    x, y, z = ((low + high) / 2.0 for low, high in zip(a, b, strict=True))
    return (x, y, z)


def _metres(values_mm: Vector) -> Vector:
    x, y, z = (value / 1000.0 for value in values_mm)
    return (x, y, z)


# ---- the frames of a URDF, read again


@dataclass(frozen=True, slots=True)
class UrdfFrame:
    """A link seen from its parent, where the joint between them is at zero.

    Attributes:
        name: of the link.
        parent: of the link before it.
        origin: ``frame_to_parent`` at zero.
        joint: the joint that moves it, of which a mimicking one follows; empty when it is fixed.
        axis: of the joint, in the frame.
        slides: whether the joint slides along its axis [m], else it turns about it [rad].
        multiplier: what the joint's position is multiplied by.
    """

    name: str
    parent: str
    origin: Pose
    joint: str = ""
    axis: Vector = (0.0, 0.0, 0.0)
    slides: bool = False
    multiplier: float = 1.0

    def to_parent(self, position: float = 0.0) -> Pose:
        """``frame_to_parent`` with its joint at ``position`` [rad] or [m]."""
        if not self.joint:
            return self.origin
        position *= self.multiplier
        x, y, z = self.axis
        if self.slides:
            return compose_poses(self.origin, Pose((x * position, y * position, z * position), IDENTITY_QUATERNION))
        s, turn = sin(position / 2.0), cos(position / 2.0)
        return compose_poses(self.origin, Pose((0.0, 0.0, 0.0), (turn, x * s, y * s, z * s)))


def read_frames(urdf: str) -> tuple[UrdfFrame, ...]:
    """The frames of a URDF in its order, parents first; the root has none."""
    frames = []
    for joint in ET.fromstring(urdf).iter("joint"):
        kind, mimic, name = joint.attrib["type"], joint.find("mimic"), joint.attrib["name"]
        origin, axis = joint.find("origin"), joint.find("axis")
        place = {} if origin is None else origin.attrib
        frames.append(
            UrdfFrame(
                joint.find("child").attrib["link"],  # type: ignore[union-attr]  # every joint has both
                joint.find("parent").attrib["link"],  # type: ignore[union-attr]
                Pose(_vector(place.get("xyz")), quaternion_from_euler_zyx(_vector(place.get("rpy")))),
                "" if kind == "fixed" else name if mimic is None else mimic.attrib["joint"],
                (0.0, 0.0, 0.0) if axis is None else _vector(axis.get("xyz")),
                kind == "prismatic",
                1.0 if mimic is None else float(mimic.get("multiplier", "1")),
            )
        )
    return tuple(frames)


def _vector(text: str | None) -> Vector:
    x, y, z = (float(word) for word in (text or "0 0 0").split())
    return (x, y, z)
