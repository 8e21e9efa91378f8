"""The load on an arm's flange: tool and payload as one, for the controller's model of the arm."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, isclose, isfinite

import numpy as np

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.description import Mass
from abb_protocols.robot.joints import ORIGIN_POSE, Pose, Quaternion, Vector, rotate
from abb_protocols.robot.kinematics import quaternion_from_matrix

_MOST_LOAD = 0.5  # [kg] an arm carries, its gripper included (reference/yumi.md)
_FARTHEST_FROM_FLANGE = 0.5  # [m] of a centre of gravity or a TCP: what is farther was hardly meant in metres
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

    tcp: Pose = ORIGIN_POSE
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
