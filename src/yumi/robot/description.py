"""The robot and its tools in numbers: frames, shapes and masses, the URDF for ROS, and the load on an arm's flange.

Every number stands in one of the tables below. :func:`robot_description` turns them into a URDF of both arms and
grippers, :func:`read_frames` reads the frames of such a URDF again, and :class:`Tool` is what a flange carries, as one
load for the controller's model of the arm. Link frames are those of the public YuMi descriptions (reference/yumi.md
§1.4), so their meshes fit. Lengths in [m], angles in [rad], masses in [kg] unless the name says otherwise.

==================================== ==================================================================================
link                                 where
==================================== ==================================================================================
yumi_base_link, yumi_body, yumi_base the foot of the robot; ABB's base frame, in which poses of the tool are given
yumi_link_1_r … yumi_link_7_r        the links in chain order
yumi_flange_r                        where a tool is bolted on, x forward (REP-103, ROS-Industrial)
yumi_tool0_r                         the same place, z forward: RAPID's tool0
gripper_r_base                       the gripper, if the arm has one: the fingers, and what follows
gripper_r_fingertips                 between ABB's standard fingertips, z forward
gripper_r_camera                     z along the view of its camera, if it has one
gripper_r_vacuum_1, gripper_r_vacuum_2 a cup, z into it, if it has the module
==================================== ==================================================================================
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from math import atan2, cos, dist, hypot, isclose, isfinite, pi, sin, sqrt
from xml.etree import ElementTree as ET

import numpy as np

from yumi.catalogue import message
from yumi.errors import CommandRefused
from yumi.robot.gripper import GripperModules
from yumi.robot.joints import (
    YUMI_LIMITS,
    JointLimits,
    Pose,
    Quaternion,
    Side,
    Vector,
    finger_names,
    joint_names,
    prefixed,
    rotate,
)
from yumi.robot.kinematics import (
    IDENTITY,
    compose,
    euler_zyx,
    foot_to_body,
    quaternion_from_euler_zyx,
    quaternion_from_matrix,
)

FINGER_TRAVEL = 0.025
FINGER_SPEED = 0.025
FINGER_FORCE = 20.0


@dataclass(frozen=True, slots=True)
class Origin:
    """A child frame in its parent: ``xyz`` [m] and fixed-axis roll, pitch, yaw [rad]."""

    xyz: Vector = (0.0, 0.0, 0.0)
    rpy: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Mass:
    """Mass [kg], centre [m] and inertia about it (xx, xy, xz, yy, yz, zz) [kg m²]."""

    mass: float
    centre: Vector
    inertia: tuple[float, float, float, float, float, float]


@dataclass(frozen=True, slots=True)
class Box:
    """An axis-aligned box between two corners [mm]."""

    low_mm: Vector
    high_mm: Vector


@dataclass(frozen=True, slots=True)
class Cylinder:
    """A cylinder between two points on its axis [mm], flat ends."""

    start_mm: Vector
    end_mm: Vector
    radius_mm: float


@dataclass(frozen=True, slots=True)
class Capsule:
    """A cylinder with a half ball on both ends, between two points [mm]."""

    start_mm: Vector
    end_mm: Vector
    radius_mm: float


Shape = Box | Cylinder | Capsule

# Chain order; the first joint hangs on the body and differs between the arms.
JOINT_ORIGINS = (
    Origin((0.030, 0.0, 0.100), (pi / 2, 0.0, 0.0)),
    Origin((-0.030, 0.1730, 0.0), (-pi / 2, 0.0, 0.0)),
    Origin((-0.0405, 0.0, 0.0785), (pi / 2, -pi / 2, 0.0)),
    Origin((0.0405, 0.1645, 0.0), (-pi / 2, 0.0, 0.0)),
    Origin((-0.027, 0.0, 0.1005), (pi / 2, 0.0, 0.0)),
    Origin((0.027, 0.029, 0.0), (-pi / 2, 0.0, 0.0)),
)
# The flange lies where tool0 is; its x axis is tool0's z axis. Together they are Rz(π), as in the public descriptions.
FLANGE_ORIGIN = Origin((0.0, 0.0, 0.007), (0.0, -pi / 2, pi / 2))
TOOL0_ORIGIN = Origin((0.0, 0.0, 0.0), (pi / 2, 0.0, pi / 2))
FINGER_ORIGINS = (Origin((0.0, -0.0065, 0.0837)), Origin((0.0, 0.0065, 0.0837), (0.0, 0.0, pi)))
# ABB's frames of the gripper, seen from tool0 (reference/yumi.md §2.2): [m], and quaternions w, x, y, z.
_S = sqrt(0.5)
FINGERTIPS = Pose((0.0, 0.0, 0.1142), IDENTITY)
CAMERA = Pose((-0.0073, 0.0283, 0.0351), (0.5, -0.5, 0.5, 0.5))
CUPS = {1: Pose((0.0635, 0.0185, 0.0375), (_S, 0.0, _S, 0.0)), 2: Pose((-0.0635, 0.0185, 0.0375), (0.0, -_S, 0.0, _S))}
_FOOT_TO_JOINT_1 = Pose((0.0, 0.0, 0.066), (0.0, 0.0, 0.0, 1.0))

# ABB publishes no torques; public descriptions carry this number, and tools refuse a joint without one.
JOINT_EFFORT = 300.0
JOINT_DAMPING = 0.5
# The controller's friction feed-forward times the gear (§1.3), chain order [N m].
JOINT_FRICTION = (1.41, 1.41, 0.60, 0.60, 0.234, 0.236, 0.234)

# Estimated from the shapes at the density that gives ABB's total of 38 kg (§1.9):
# mass, centre, inertia per mass [1e-4 m²].
_LINKS = (
    (1.297, (0.0103, -0.0226, 0.0513), (31.9, 2.6, -5.5, 31.5, 8.9, 17.2)),
    (1.902, (-0.0179, 0.0643, -0.0146), (50.0, 7.85, 1.58, 16.2, -8.2, 49.6)),
    (0.968, (-0.0211, -0.0267, 0.0500), (22.3, -3.2, 6.2, 25.4, 5.95, 15.95)),
    (1.591, (0.0227, 0.0560, -0.0157), (43.4, -9.8, -2.5, 15.7, -7.9, 44.3)),
    (0.463, (-0.0074, -0.0278, 0.0459), (22.9, -1.5, 3.8, 21.0, 7.4, 10.6)),
    (0.634, (0.0113, -0.0124, -0.0094), (10.1, 0.17, -0.57, 10.5, 0.37, 11.0)),
    (0.056, (0.0, 0.0, -0.0045), (2.26, 0.0, 0.0, 2.24, 0.02, 2.97)),
)
# ABB's base mass and centre (§1.9); inertia of a block of the torso's size.
BODY_MASS = Mass(24.18, (-0.061, 0.0, 0.063), (0.98, 0.0, 0.0, 0.98, 0.0, 0.82))
# ABB's loads of the gripper's five kinds, without fingers and cups (§2.3); a cup with its filter adds 7.5 g.
GRIPPER_MASSES: Mapping[GripperModules, Mass] = {
    GripperModules.SERVO: Mass(0.215, (0.0087, 0.0123, 0.0492), (0.00017, 0.0, 0.0, 0.00020, 0.0, 0.00008)),
    GripperModules.VISION: Mass(0.229, (0.0079, 0.0124, 0.0487), (0.00017, 0.0, 0.0, 0.00019, 0.0, 0.00008)),
    GripperModules.VACUUM: Mass(0.226, (0.0089, 0.0123, 0.0487), (0.00017, 0.0, 0.0, 0.00020, 0.0, 0.00008)),
    GripperModules.VISION_VACUUM: Mass(0.240, (0.0082, 0.0125, 0.0481), (0.00018, 0.0, 0.0, 0.00020, 0.0, 0.00009)),
    GripperModules.TWO_VACUUMS: Mass(0.250, (0.0074, 0.0124, 0.0448), (0.00020, 0.0, 0.0, 0.00024, 0.0, 0.00011)),
}
FINGER_MASS = Mass(0.0075, (-0.006, 0.0065, 0.0225), (1.4e-6, 0.0, 0.0, 1.3e-6, 0.0, 1.8e-7))

# Fitted to the public meshes (§1.10).
# The covers that are shown (robot/meshes) are made to be within these: see setup/make_meshes.py.
BODY_SHAPES = (
    # The base, and the two lobes in front of it
    Box((-358, -200, -100), (0, 200, 100)),
    Box((0, 50, -20), (135, 190, 60)),
    Box((0, -190, -20), (135, -50, 60)),
    # The column, and its flare under the shoulders, as wide as leaves the forearms room at home
    Box((-360, -112, 100), (-120, 112, 300)),
    Box((-361, -108, 260), (-60, 108, 300)),
    # The shoulders, whose upper edges are chamfered
    Box((-361, -130, 300), (43, 130, 448)),
    Box((-361, -112, 448), (43, 112, 460)),
    Box((-361, -93, 460), (43, 93, 471)),
)
LINK_SHAPES: tuple[tuple[Shape, ...], ...] = (
    (
        Capsule((-0.1, 0.7, 10.1), (1.7, -14.2, 48.7), 62.5),
        Capsule((30.1, -38.5, 100.4), (21.2, -39, 98.5), 56.1),
    ),
    (
        Capsule((-10.6, 1.7, -48.3), (-0.8, -0.1, -25.4), 60),
        Capsule((-33.6, 57.2, -8.9), (-30, 146.3, 0.1), 55.7),
    ),
    (
        Capsule((-1.3, -0.2, 13), (-13.8, -17.7, 62.6), 49),
        Capsule((-40.9, -33.8, 77.6), (-35.8, -32.2, 64.9), 53.2),
    ),
    (
        Capsule((-2.8, -1.2, -30.8), (32.7, 14.2, -19.4), 54.9),
        Capsule((40.4, 134.7, -0.4), (40.6, 87.6, -3.9), 49.3),
    ),
    (
        Capsule((0, 0, 17.3), (6.8, -25.9, 44.5), 43.5),
        Capsule((-12.3, -42.9, 71), (-25.1, -43.8, 99.9), 35.3),
    ),
    (
        Capsule((3.2, -1.9, -25.5), (-9.1, -12.5, -1.1), 46.5),
        Capsule((16.8, -43.6, 0.3), (35.1, 15.5, 0.7), 39.4),
    ),
    (Cylinder((0, 0, -31), (0, 0, 7), 31.5),),
)
GRIPPER_SHAPES = (Box((-41.6, -34.5, 0), (41.6, 34.5, 83.7)),)
FINGER_SHAPES = (Box((-12, 0.5, 0), (0, 12.5, 45)),)

MATERIALS = {
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

SERVO_GRIPPERS: Mapping[Side, GripperModules] = dict.fromkeys(Side, GripperModules.SERVO)


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
    parts = [f'<material name="{name}"><color rgba="{rgba}"/></material>' for name, rgba in MATERIALS.items()]
    root, body = prefixed("yumi_base_link"), prefixed("yumi_body")
    parts.append(_link(root))
    parts.append(_link(body, BODY_MASS, BODY_SHAPES, "abb_grey", _visuals("body", meshes)))
    parts.append(_joint(f"{root}_to_body", "fixed", root, body, Origin()))
    parts += _frame(prefixed("yumi_base"), root, Origin())
    for side in (Side.LEFT, Side.RIGHT):
        parts += _arm(side, limits, meshes)
        parts += _gripper(side, grippers[side], meshes)
    robot = ET.fromstring(f'<robot name="yumi">{"".join(parts)}</robot>')
    ET.indent(robot)
    # No encoding in the declaration: lxml refuses a decoded string that names one.
    return '<?xml version="1.0"?>\n' + ET.tostring(robot, encoding="unicode")


def joint_1_origin(side: Side) -> Origin:
    """Where the first joint of the arm sits on the body (reference/yumi.md §1.5)."""
    pose = compose(foot_to_body(side), _FOOT_TO_JOINT_1)
    return Origin(pose.position, euler_zyx(pose.orientation))


def link_mass(index: int) -> Mass:
    """Mass of the arm's link, counted from 0 in chain order."""
    mass, centre, (xx, xy, xz, yy, yz, zz) = _LINKS[index]
    scale = mass * 1e-4
    return Mass(mass, centre, (xx * scale, xy * scale, xz * scale, yy * scale, yz * scale, zz * scale))


def _arm(side: Side, limits: JointLimits, meshes: str) -> Iterator[str]:
    parent, origins = prefixed("yumi_body"), (joint_1_origin(side), *JOINT_ORIGINS)
    for index, (name, origin) in enumerate(zip(joint_names(side), origins, strict=True)):
        link = prefixed(f"yumi_link_{index + 1}_{side.value}")
        visuals = _visuals(f"link_{index + 1}", meshes)
        yield _link(link, link_mass(index), LINK_SHAPES[index], "abb_white", visuals)
        limit = _limit(limits.lower[index], limits.upper[index], JOINT_EFFORT, limits.velocity[index])
        dynamics = f'<dynamics damping="{JOINT_DAMPING}" friction="{JOINT_FRICTION[index]}"/>'
        yield _joint(name, "revolute", parent, link, origin, f'<axis xyz="0 0 1"/>{limit}{dynamics}')
        parent = link
    flange = prefixed(f"yumi_flange_{side.value}")
    yield from _frame(flange, parent, FLANGE_ORIGIN)
    yield from _frame(prefixed(f"yumi_tool0_{side.value}"), flange, TOOL0_ORIGIN)


def _gripper(side: Side, modules: GripperModules, meshes: str) -> Iterator[str]:
    base = prefixed(f"gripper_{side.value}_base")
    yield _link(base, GRIPPER_MASSES[modules], GRIPPER_SHAPES, "abb_graphite", _visuals("gripper", meshes))
    yield _joint(f"{base}_joint", "fixed", prefixed(f"yumi_tool0_{side.value}"), base, Origin())
    frames = {"fingertips": FINGERTIPS, **{f"vacuum_{channel}": CUPS[channel] for channel in modules.vacuum_channels}}
    if modules.has_camera:
        frames["camera"] = CAMERA
    for name, pose in frames.items():
        origin = Origin(pose.position, euler_zyx(pose.orientation))
        yield from _frame(prefixed(f"gripper_{side.value}_{name}"), base, origin)
    first, second = finger_names(side)
    mimic = {second: f'<mimic joint="{first}" multiplier="1" offset="0"/>'}  # one motor drives both fingers
    limit = _limit(0.0, FINGER_TRAVEL, FINGER_FORCE, FINGER_SPEED)
    for name, origin in zip((first, second), FINGER_ORIGINS, strict=True):
        finger = "finger".join(name.rsplit("joint", 1))  # the last one: the prefix may have the word
        yield _link(finger, FINGER_MASS, FINGER_SHAPES, "abb_grey", _visuals("finger", meshes))
        yield _joint(name, "prismatic", base, finger, origin, f'<axis xyz="-1 0 0"/>{limit}{mimic.get(name, "")}')


def _frame(name: str, parent: str, origin: Origin) -> Iterator[str]:
    """A link without a body, fixed to ``parent``."""
    yield _link(name)
    yield _joint(f"{name}_joint", "fixed", parent, name, origin)


def _joint(name: str, kind: str, parent: str, child: str, origin: Origin, rest: str = "") -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{_origin(origin)}{ends}{rest}</joint>'


def _limit(lower: float, upper: float, effort: float, velocity: float) -> str:
    return f"<limit {_attributes(lower=lower, upper=upper, effort=effort, velocity=velocity)}/>"


def _visuals(part: str, meshes: str) -> str:
    """The meshes of a link, where there is a folder of them."""
    return "".join(
        f'<visual><geometry><mesh filename="{meshes}/{name}.stl"/></geometry><material name="{material}"/></visual>'
        for name, material in (_VISUALS[part] if meshes else ())
    )


def _link(
    name: str, mass: Mass | None = None, shapes: tuple[Shape, ...] = (), material: str = "abb_white", visuals: str = ""
) -> str:
    """A link; the shapes that collide are shown, too, unless it has visuals of its own."""
    parts = []
    if mass is not None:
        inertia = _attributes(**dict(zip(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), mass.inertia, strict=True)))
        body = f'<mass value="{mass.mass:.15g}"/><inertia {inertia}/>'
        parts.append(f"<inertial>{_origin(Origin(mass.centre))}{body}</inertial>")
    parts.append(visuals)
    for solid in [solid for shape in shapes for solid in _solids(shape)]:
        shown = "" if visuals else f'<visual>{solid}<material name="{material}"/></visual>'
        parts.append(f"{shown}<collision>{solid}</collision>")
    return f'<link name="{name}">{"".join(parts)}</link>'


def _solids(shape: Shape) -> Iterator[str]:
    """URDF's solids that make up the shape; it has no capsule."""
    if isinstance(shape, Box):
        low, high = _metres(shape.low_mm), _metres(shape.high_mm)
        size = [b - a for a, b in zip(low, high, strict=True)]
        yield f'{_origin(Origin(_middle(low, high)))}<geometry><box size="{_numbers(size)}"/></geometry>'
        return
    start, end, radius = _metres(shape.start_mm), _metres(shape.end_mm), f"{shape.radius_mm / 1000.0:.15g}"
    x, y, z = (b - a for a, b in zip(start, end, strict=True))
    along = Origin(_middle(start, end), (0.0, atan2(hypot(x, y), z), atan2(y, x)))  # z along the axis
    sizes = f'radius="{radius}" length="{dist(start, end):.15g}"'
    yield f"{_origin(along)}<geometry><cylinder {sizes}/></geometry>"
    if isinstance(shape, Capsule):
        for point in (start, end):
            yield f'{_origin(Origin(point))}<geometry><sphere radius="{radius}"/></geometry>'


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
class Frame:
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
            return compose(self.origin, Pose((x * position, y * position, z * position), IDENTITY))
        s, turn = sin(position / 2.0), cos(position / 2.0)
        return compose(self.origin, Pose((0.0, 0.0, 0.0), (turn, x * s, y * s, z * s)))


def read_frames(urdf: str) -> tuple[Frame, ...]:
    """The frames of a URDF in its order, parents first; the root has none."""
    frames = []
    for joint in ET.fromstring(urdf).iter("joint"):
        kind, mimic, name = joint.attrib["type"], joint.find("mimic"), joint.attrib["name"]
        origin, axis = joint.find("origin"), joint.find("axis")
        place = {} if origin is None else origin.attrib
        frames.append(
            Frame(
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


# ---- what a flange carries

_MOST_LOAD = 0.5  # [kg] an arm carries, its gripper included (reference/yumi.md)
_FARTHEST_FROM_FLANGE = 0.5  # [m] of a centre of gravity or a TCP: what is farther was hardly meant in metres
_AT_FLANGE = Pose((0.0, 0.0, 0.0), IDENTITY)
_LEAST_MASS = 0.001  # [kg] RAPID knows no tool without a mass; that of its tool0
_NO_LOAD = Mass(0.0, (0.0, 0.0, 0.0), (0.0,) * 6)


@dataclass(frozen=True, slots=True)
class Tool:
    """What is on an arm's flange; everything seen from tool0, the flange's frame.

    Attributes:
        tcp: pose of the tool's centre point [m].
        load: the tool itself.
        payload: what it carries.

    Raises:
        CommandRefused: a value is not finite, negative or too large; the sentence says which.
    """

    tcp: Pose = _AT_FLANGE
    load: Mass = _NO_LOAD
    payload: Mass = _NO_LOAD

    def __post_init__(self) -> None:
        for name, mass in (("tool", self.load), ("payload", self.payload)):
            if not all(map(isfinite, (mass.mass, *mass.centre, *mass.inertia))):
                raise CommandRefused(message("load_not_finite", part=name, values=str(mass)))
            if mass.mass < 0.0 or hypot(*mass.centre) > _FARTHEST_FROM_FLANGE:
                raise CommandRefused(
                    message(
                        "load_out_of_range",
                        part=name,
                        mass=mass.mass,
                        distance=hypot(*mass.centre),
                        most=_MOST_LOAD,
                        farthest=_FARTHEST_FROM_FLANGE,
                    )
                )
            if min(principal_inertia(mass)[1]) < -1e-9:
                raise CommandRefused(message("inertia_negative", part=name))
        if self.load.mass + self.payload.mass > _MOST_LOAD:
            raise CommandRefused(message("load_too_heavy", mass=self.load.mass + self.payload.mass, most=_MOST_LOAD))
        if not all(map(isfinite, self.tcp.position)) or hypot(*self.tcp.position) > _FARTHEST_FROM_FLANGE:
            raise CommandRefused(
                message("tcp_too_far", position=tuple(self.tcp.position), farthest=_FARTHEST_FROM_FLANGE)
            )
        if not isclose(hypot(*self.tcp.orientation), 1.0, abs_tol=1e-3):
            raise CommandRefused(message("tcp_not_unit", orientation=tuple(self.tcp.orientation)))

    @property
    def total(self) -> Mass:
        """Tool and payload as one body: its inertia is about the common centre."""
        mass = self.load.mass + self.payload.mass
        if mass < _LEAST_MASS:
            return Mass(_LEAST_MASS, (0.0, 0.0, _LEAST_MASS), (0.0,) * 6)
        pairs = zip(self.load.centre, self.payload.centre, strict=True)
        x, y, z = ((self.load.mass * one + self.payload.mass * other) / mass for one, other in pairs)
        inertia = [0.0] * 6
        for body in (self.load, self.payload):
            a, b, c = (at - to for at, to in zip(body.centre, (x, y, z), strict=True))
            steiner = (b * b + c * c, -a * b, -a * c, a * a + c * c, -b * c, a * a + b * b)
            inertia = [
                old + own + body.mass * way for old, own, way in zip(inertia, body.inertia, steiner, strict=True)
            ]
        xx, xy, xz, yy, yz, zz = inertia
        return Mass(mass, (x, y, z), (xx, xy, xz, yy, yz, zz))


def inertia_of(axes: Quaternion, moments: Vector) -> tuple[float, float, float, float, float, float]:
    """The inertia (xx, xy, xz, yy, yz, zz) of moments about axes that are turned by a rotation [kg m²]."""
    columns = [rotate(axes, each) for each in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]

    def entry(row: int, column: int) -> float:
        return sum(moment * axis[row] * axis[column] for moment, axis in zip(moments, columns, strict=True))

    return entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)


def principal_inertia(body: Mass) -> tuple[Quaternion, Vector]:
    """The axes of a body's moments of inertia, as a rotation from the frame it is given in, and the moments [kg m²]."""
    xx, xy, xz, yy, yz, zz = body.inertia
    moments, axes = np.linalg.eigh([(xx, xy, xz), (xy, yy, yz), (xz, yz, zz)])
    axes[:, 2] *= np.sign(np.linalg.det(axes))  # axes of a body may point either way; a rotation keeps right-handed
    first, second, third = moments.tolist()
    return quaternion_from_matrix(axes), (first, second, third)
