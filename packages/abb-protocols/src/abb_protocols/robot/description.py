"""The robot in numbers: origins of joints and fingers, shapes (boxes, cylinders, capsules), hand, cups, masses.

:mod:`abb_protocols.robot.urdf` makes a URDF of them. Link frames are those of the public YuMi descriptions
(reference/yumi.md §1.4), so their meshes fit. Lengths in [m], angles in [rad], masses in [kg] unless the name says
otherwise.

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

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi, sqrt

from abb_protocols.robot.gripper_values import GripperModules
from abb_protocols.robot.joints import Pose, Side, Vector
from abb_protocols.robot.kinematics import IDENTITY_QUATERNION, compose_poses, euler_zyx, foot_to_body


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
FINGERTIPS = Pose((0.0, 0.0, 0.1142), IDENTITY_QUATERNION)
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
HAND = Mass(0.230, (0.0082, 0.0117, 0.0520), (0.00021, 0.0, 0.0, 0.00024, 0.0, 0.00009))
"""ABB's servo gripper with its default fingers (§2.3)."""
FINGER_MASS = Mass(0.0075, (-0.006, 0.0065, 0.0225), (1.4e-6, 0.0, 0.0, 1.3e-6, 0.0, 1.8e-7))

# Fitted to the public meshes (§1.10).
# The covers that are shown (meshes of abb-view) are made to be within these: see setup/make_meshes.py.
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
LINK_SHAPES: tuple[tuple[Cylinder | Capsule, ...], ...] = (
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

SERVO_GRIPPERS: Mapping[Side, GripperModules] = dict.fromkeys(Side, GripperModules.SERVO)


def joint_1_origin(side: Side) -> Origin:
    """Where the first joint of the arm sits on the body (reference/yumi.md §1.5)."""
    pose = compose_poses(foot_to_body(side), _FOOT_TO_JOINT_1)
    return Origin(pose.position, euler_zyx(pose.orientation))


def link_origins() -> tuple[Origin, ...]:
    """Where each joint sits on the link before it in chain order, the first one on the arm's foot."""
    return (Origin(_FOOT_TO_JOINT_1.position, euler_zyx(_FOOT_TO_JOINT_1.orientation)), *JOINT_ORIGINS)


def link_mass(index: int) -> Mass:
    """Mass of the arm's link, counted from 0 in chain order."""
    mass, centre, (xx, xy, xz, yy, yz, zz) = _LINKS[index]
    scale = mass * 1e-4
    return Mass(mass, centre, (xx * scale, xy * scale, xz * scale, yy * scale, yz * scale, zz * scale))
