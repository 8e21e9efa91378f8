"""What can happen to the datagrams of arms in motion, and what must hold of the references that are sent meanwhile."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import cos, degrees, hypot, pi, radians, sin
from typing import NamedTuple, Protocol

from abb_protocols.egm.codec import RobotCodec, RobotMessage, SensorCodec
from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, Joints, Side, joints
from abb_runtime.faults import Fault, FaultDirection

AMPLITUDE, PERIOD = radians(8.0), 1.0
"""Of the swing of both arms: up to 50 degrees per second, which leads the robot by up to 10 degrees."""

SWINGING = 6, 3
"""Which joints swing, in chain order."""

REST = radians(0.02)
"""An arm whose reference changes by less than this in 0.1 s stands [rad]."""

BRAKING = radians(12.0)
"""A reference that holds is not farther than this from where it left the swing: the lead, and the way to stop [rad]."""


@dataclass(frozen=True, slots=True)
class Attack:
    """Something that happens to the datagrams of the right arm, or of both.

    Attributes:
        fault: which.
        amount: how strong it is, in the unit of its kind.
        way: in which direction.
        duration: how long it lasts [s]; None where it is one datagram.
        strays: how far the reference may be from the swing while the motion goes on [rad].
        delays: whether the motion may go on later than it would have: then it is the range of the swing that counts.
        stops: whether the robot misses so many references that they stop at once, which it does not hear.
        unanswered: how many datagrams of the robot may stay without an answer of their own; None while it lasts.
    """

    fault: Fault
    amount: float | None = None
    way: FaultDirection | None = None
    duration: float | None = None
    strays: float = radians(1.0)
    delays: bool = False
    stops: bool = False
    unanswered: int | None = 0

    def __str__(self) -> str:
        parts = (self.fault.value.name, self.amount and f"{self.amount:g}", self.way and self.way.value)
        return "-".join(part for part in parts if part)

    @property
    def side(self) -> Side | None:
        """Which arm it happens to; None is both."""
        return Side.RIGHT if self.fault.value.has_side else None


SINGLE = (
    *(Attack(Fault.EGM_STALE, old) for old in (20.0, 30.0, 60.0, 100.0, 200.0)),
    # Of a sender with the robot's own address (decision 55): the true datagram with this number is a copy then.
    *(Attack(Fault.EGM_FORGE, offset_deg, unanswered=1) for offset_deg in (2.0, 5.0, 30.0, 340.0)),
    # Of the same; a session begins, and waits until the arm has come to where it was sent.
    *(
        Attack(fault, offset_deg, unanswered=40)
        for fault in (Fault.EGM_FORGE_OLD, Fault.EGM_FORGE_AHEAD)
        for offset_deg in (2.0, 5.0, 30.0, 340.0)
    ),
)
"""One datagram that is wrong."""

_MANY = radians(5.0)

LASTING = (
    Attack(Fault.EGM_TRUNCATE, None, None, 0.3, unanswered=None),
    Attack(Fault.EGM_TRUNCATE, 40.0, None, 0.3, unanswered=None),
    Attack(Fault.EGM_SWAP_ARMS, None, None, 0.5, strays=_MANY, delays=True, unanswered=None),
    Attack(Fault.EGM_OFFSET, 5.0, None, 0.3, strays=_MANY, delays=True, unanswered=None),
    Attack(Fault.EGM_OFFSET, 30.0, None, 0.3, strays=_MANY, delays=True, unanswered=None),
    Attack(Fault.EGM_LOSS, None, FaultDirection.TO_ROBOT, 0.5, strays=_MANY, delays=True, stops=True, unanswered=None),
    Attack(Fault.EGM_LOSS, 50.0, None, 0.5, strays=_MANY, delays=True, stops=True, unanswered=None),
    Attack(Fault.EGM_DELAY, 50.0, None, 0.5, strays=_MANY, delays=True, stops=True, unanswered=None),
    Attack(Fault.EGM_REORDER, 3.0, None, 0.5, strays=_MANY, delays=True, stops=True, unanswered=None),
    Attack(Fault.EGM_DUPLICATE, 1.0, FaultDirection.FROM_ROBOT, 0.5),
    # Each reference that comes twice makes the robot a cycle later for the rest of the session (reference/egm.md §4.3).
    Attack(Fault.EGM_DUPLICATE, 1.0, FaultDirection.TO_ROBOT, 0.05, strays=_MANY, delays=True),
    Attack(Fault.EGM_FOREIGN_PORT, None, None, 0.3),
)
"""What lasts for a time."""


def center(side: Side) -> Joints:
    """Where the swing of an arm has its middle [rad]: forearms lifted and turned outwards, with room on all sides."""
    sign = 1.0 if side is Side.RIGHT else -1.0
    return joints([radians(angle) for angle in (-sign * 40.0, -90.0, -sign * 135.0, 30.0, 0.0, 40.0, 0.0)])


def swing(side: Side, time: float) -> Joints:
    """Where an arm shall be ``time`` after the begin, at rest then [rad], (7,)."""
    return _swung(side, -cos(2.0 * pi * time / PERIOD))


def swing_velocity(time: float) -> Joints:
    """How fast the joints of an arm shall be then [rad/s], (7,)."""
    speed = 2.0 * pi / PERIOD * AMPLITUDE * sin(2.0 * pi * time / PERIOD)
    return joints([speed if index in SWINGING else 0.0 for index in range(7)])


def _swung(side: Side, share: float) -> Joints:
    return joints(
        [value + (AMPLITUDE * share if index in SWINGING else 0.0) for index, value in enumerate(center(side))]
    )


class Link(Protocol):
    """The robot's end of an arm's wire."""

    def send(self, datagram: bytes) -> None: ...

    def receive(self) -> list[bytes]: ...


class Heard(NamedTuple):
    """A reference that came in.

    Attributes:
        cycle: of the robot, by the looks it took.
        time: when the robot looked [s].
        position: what it was told, chain order [rad], (7,).
    """

    cycle: int
    time: float
    position: Joints


@dataclass(slots=True)
class Tapped:
    """Everything that passed the robot's end of an arm's wire, however it was meddled with behind that.

    Attributes:
        heard: the references that came in.
        sent: the cycles in which something was sent, with its bytes.
        cycle: of the robot, by the looks it took.
    """

    heard: list[Heard] = field(default_factory=list)
    sent: list[tuple[int, bytes]] = field(default_factory=list)
    cycle: int = 0

    def note_received(self, time: float, datagrams: Iterable[bytes]) -> None:
        """The robot looked, as it does in each cycle."""
        self.cycle += 1
        for datagram in datagrams:
            self.note_heard(time, datagram)

    def note_heard(self, time: float, datagram: bytes) -> None:
        told = RobotCodec().decode(datagram).position
        assert told is not None
        self.heard.append(Heard(self.cycle, time, joints([value for value in told if value is not None])))

    def note_sent(self, datagram: bytes) -> None:
        self.sent.append((self.cycle, datagram))

    def last_sent(self) -> RobotMessage:
        """What the robot said last."""
        return SensorCodec(axes=7).decode(self.sent[-1][1])

    def since(self, cycle: int) -> Sequence[Heard]:
        """The references that came after a cycle, with the last one before."""
        first = next((place for place, each in enumerate(self.heard) if each.cycle > cycle), len(self.heard))
        return self.heard[max(0, first - 1) :]


def check_limits(heard: Sequence[Heard], *, stops: bool = False) -> None:
    """Every reference is in range, and none asks for more speed or acceleration than the joints have.

    Each step is what the joints may do in one cycle, however late. After a cycle without a reference the motion may go
    on from rest or as before; so it may anywhere where it ``stops`` at once, see :class:`Attack`.
    """
    limits = YUMI_LIMITS
    slack = 1.0 + 1e-3
    before = (0.0,) * 7
    for last, this in pairwise(heard):
        where = f"in cycle {this.cycle} after {last.cycle}: {_deg(last.position)} to {_deg(this.position)}"
        assert limits.outside(this.position) is None, f"out of range {where}"
        step = joints([new - old for old, new in zip(last.position, this.position, strict=True)])
        for change, old, top, gain in zip(step, before, limits.velocity, limits.acceleration, strict=True):
            assert abs(change) <= slack * top * CYCLE, f"too fast {where}"
            if this is not heard[1]:
                now, then = change / CYCLE, (old / CYCLE, old / CYCLE)
                if stops or this.cycle > last.cycle + 1:  # the robot stood at the last reference meanwhile
                    then = min(then[0], 0.0), max(then[1], 0.0)
                apart = max(now - then[1], then[0] - now, 0.0)
                assert apart <= 1.05 * gain * CYCLE, f"{apart / (gain * CYCLE):.1f} times too abrupt {where}"
        before = step


def _deg(position: Joints) -> list[float]:
    return [round(degrees(value), 2) for value in position]


class Swing:
    """The swing that an arm's references follow, found in those before an attack."""

    def __init__(self, side: Side, heard: Sequence[Heard]) -> None:
        self._center = center(side)
        self._amplitudes: dict[int, tuple[float, float]] = {}
        for joint in SWINGING:
            self._amplitudes[joint] = self._fitted(joint, heard)

    def _fitted(self, joint: int, heard: Sequence[Heard]) -> tuple[float, float]:
        """Least squares of a sine and a cosine."""
        ss = sc = cc = sy = cy = 0.0
        for each in heard:
            s, c = _phase(each.time)
            y = each.position[joint] - self._center[joint]
            ss, sc, cc, sy, cy = ss + s * s, sc + s * c, cc + c * c, sy + s * y, cy + c * y
        determinant = ss * cc - sc * sc
        return (sy * cc - cy * sc) / determinant, (cy * ss - sy * sc) / determinant

    def excess(self, heard: Heard) -> float:
        """How far a reference is beyond its range, in the joint that is farthest [rad]."""
        ranges = {joint: hypot(a, b) for joint, (a, b) in self._amplitudes.items()}
        offsets = enumerate(zip(heard.position, self._center, strict=True))
        return max(abs(value - middle) - ranges.get(joint, 0.0) for joint, (value, middle) in offsets)

    def deviation(self, heard: Heard) -> float:
        """How far a reference is from it, in the joint that is farthest [rad]."""
        s, c = _phase(heard.time)
        wanted = {joint: a * s + b * c for joint, (a, b) in self._amplitudes.items()}
        offsets = enumerate(zip(heard.position, self._center, strict=True))
        return max(abs(value - middle - wanted.get(joint, 0.0)) for joint, (value, middle) in offsets)


def _phase(time: float) -> tuple[float, float]:
    angle = 2.0 * pi * time / PERIOD
    return sin(angle), cos(angle)


def is_at_rest(heard: Sequence[Heard]) -> bool:
    """Whether the last references stand still."""
    last = [each.position for each in heard[-25:]]
    return all(max(values) - min(values) < REST for values in zip(*last, strict=True))


def check_path(heard: Sequence[Heard], swing: Swing, attack: Attack) -> str:
    """The motion goes on, or the arm holds near where it left it; never does the reference follow what was false.

    Returns:
        Which of the two.
    """
    strays = attack.strays
    deviations = [swing.excess(each) if attack.delays else swing.deviation(each) for each in heard]
    if max(deviations) <= strays:
        return "goes on"
    left = heard[next(place for place, deviation in enumerate(deviations) if deviation > strays)]
    farthest = max(abs(now - then) for each in heard for now, then in zip(each.position, left.position, strict=True))
    assert is_at_rest(heard) or deviations[-1] <= strays, (
        f"The reference is {degrees(max(deviations)):.1f} degrees from the motion, and goes on in cycle "
        f"{heard[-1].cycle}: {_deg(heard[-1].position)}"
    )
    allowed = BRAKING if is_at_rest(heard) else BRAKING + 2.0 * AMPLITUDE
    assert farthest <= allowed, f"The reference went {degrees(farthest):.1f} degrees away from {_deg(left.position)}"
    return "holds" if is_at_rest(heard) else "goes on"
