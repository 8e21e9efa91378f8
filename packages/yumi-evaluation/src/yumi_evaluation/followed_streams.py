"""Streams of joint positions that both arms follow in virtual time, as delivered: how late, and how smoothly.

The source is a smooth random motion of all fourteen joints, as of a policy. Its points go through the API's
``stream``, through the limiter and over EGM to the virtual robot, as those of a script do.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from math import degrees
from types import SimpleNamespace
from typing import Any, Concatenate, ParamSpec, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from abb_protocols.robot.joints import CYCLE, JOINT_COUNT, YUMI_LIMITS, Joints, Side, joints
from yumi.api.motion_executor import MotionExecutor
from yumi.api.motion_registry import MotionRegistry
from yumi.control.controllers.joint_position import JointPositionController
from yumi.control.goals import MemoryBuffer, SessionGoal, stream_delay
from yumi.control.hand_over import HandOver
from yumi.control.loop_commands import Commands, serve
from yumi.control.shared_state import Snapshot
from yumi.driver.control_process import ControlProcess
from yumi.driver.controller_names import STREAM_CONTROLLER
from yumi.driver.settings import read_controllers
from yumi_evaluation.metrics import minimum
from yumi_evaluation.virtual_time import VirtualArmRig

P = ParamSpec("P")
T = TypeVar("T")
Array = NDArray[np.float64]

_WAVES = 5  # of which the motion of a joint is made
_SPEED = 0.15  # [rad/s] root mean square
_FOUND = 0.2  # [s] after the begin the arms have found the stream, and what counts begins with a second more
_BEGIN = 1.0
_START: dict[Side, Joints] = {  # far from the ends of all ranges [rad]
    Side.RIGHT: (0.3, -1.0, -1.2, 0.0, 0.0, 0.5, 0.0),
    Side.LEFT: (-0.3, -1.0, 1.2, 0.0, 0.0, 0.5, 0.0),
}


class SmoothPolicy:
    """A smooth random motion of both arms, from far within the joints' ranges.

    Args:
        fastest: no part of it has a higher frequency [Hz].
        seed: of the random numbers.
    """

    def __init__(self, fastest: float = 0.3, seed: int = 1) -> None:
        random = np.random.default_rng(seed)
        shape = (len(Side) * JOINT_COUNT, _WAVES)
        self._rates = 2.0 * np.pi * random.uniform(0.2 * fastest, fastest, shape)
        self._phases = random.uniform(0.0, 2.0 * np.pi, shape)
        self._sizes = _SPEED * np.sqrt(2.0 / _WAVES) / self._rates
        self._offset = np.array([*_START[Side.RIGHT], *_START[Side.LEFT]]) - self._sum(0.0, self._sizes, np.sin)[0]

    def _sum(self, times: ArrayLike, sizes: Array, wave: Callable[[Array], Array]) -> Array:
        moments = np.atleast_1d(np.asarray(times, dtype=np.float64))
        return cast("Array", (sizes * wave(self._rates * moments[:, None, None] + self._phases)).sum(axis=2))

    def at(self, times: ArrayLike) -> Array:
        """Positions [rad], (n, 14), the right arm's first."""
        return cast("Array", self._offset + self._sum(times, self._sizes, np.sin))

    def velocity(self, times: ArrayLike) -> Array:
        """[rad/s], (n, 14)."""
        return self._sum(times, self._sizes * self._rates, np.cos)

    def acceleration(self, times: ArrayLike) -> Array:
        """[rad/s²], (n, 14)."""
        return -self._sum(times, self._sizes * self._rates**2, np.sin)


@dataclass(frozen=True, slots=True)
class Followed:
    """How a stream was followed.

    Attributes:
        lag: the delay of the source with which it comes closest to what was measured, of all joints [s].
        sent_lag: the same of the positions that were sent [s].
        error: largest distance from the source, so late [rad].
        acceleration: root mean square of the measured acceleration, over that of the source.
        slowed: cycles in which the limiter changed a command.
        said: what the controllers reported.
    """

    lag: float
    sent_lag: float
    error: float
    acceleration: float
    slowed: int
    said: tuple[str, ...]


class StreamedArms:
    """Both arms in virtual time, which follow streams through the API.

    Attributes:
        executor: takes the points.
        rigs: the arms.
    """

    def __init__(self) -> None:
        self._goals = {side: MemoryBuffer[SessionGoal]() for side in Side}
        self.rigs = {side: self._rig(side) for side in Side}
        for rig in self.rigs.values():
            rig.start()
            rig.run(0.2)
            rig.switch_to(STREAM_CONTROLLER)
        loops = {side: rig.line for side, rig in self.rigs.items()}
        control = _Control(loops, self._goals, self.rigs)
        self.executor = MotionExecutor(
            cast("ControlProcess", control),
            MotionRegistry(is_script=False),
            tuple(Side),
            YUMI_LIMITS,
            self.rigs[Side.RIGHT].clock,
            lambda: 1.0,
        )

    def _rig(self, side: Side) -> VirtualArmRig:
        delivered = next(each for each in read_controllers(side) if each.name == STREAM_CONTROLLER)
        rig = VirtualArmRig(
            {STREAM_CONTROLLER: JointPositionController(self._goals[side])}, side=side, position=_START[side]
        )
        values = {name: entry.value for name, entry in delivered.entries.items()}
        rig.manager.set_parameters(STREAM_CONTROLLER, values)
        return rig

    @property
    def now(self) -> float:
        """[s]."""
        return self.rigs[Side.RIGHT].clock.now()

    def cycle(self) -> None:
        """One cycle of both arms."""
        for rig in self.rigs.values():
            rig.cycle()


class _Control:
    """The control process of the arms, in this process."""

    def __init__(self, loops: Any, goals: dict[Side, MemoryBuffer[SessionGoal]], rigs: Any) -> None:
        self._rigs = rigs
        self._commands = Commands(loops, rigs[Side.RIGHT].clock.now)
        self.hand_over = HandOver(rigs[Side.RIGHT].clock.now)
        self.buffers = {side: SimpleNamespace(goals=goals[side]) for side in Side}

    def snapshot(self, side: Side) -> Snapshot:
        return cast("Snapshot", self._rigs[side].snapshot)

    def call(self, command: Callable[Concatenate[Commands, P], T], /, *args: P.args, **kwargs: P.kwargs) -> T:
        with self.hand_over.passing(command, args, kwargs):
            return serve(self._commands, command, *args, **kwargs)


def follow_stream(
    rate: float,
    policy: SmoothPolicy | None = None,
    *,
    duration: float = 7.0,
    delay: float | None = None,
    tracking: str = "feed_forward",
    noise: float = 0.0,
    lateness: float = 0.0,
    with_velocity: bool = False,
) -> Followed:
    """Have both arms follow a policy in virtual time.

    Args:
        rate: points a second.
        policy: the source.
        duration: of the stream [s].
        delay: as of ``robot.stream``.
        tracking: as of ``robot.stream``.
        noise: root mean square of what is added to each point [rad].
        lateness: on average a point comes so long after the time it is for [s].
        with_velocity: whether points have velocities, too.
    """
    policy, arms, random = policy or SmoothPolicy(), StreamedArms(), np.random.default_rng(5)
    begin, count = arms.now, int(duration * rate) + 1
    times = np.arange(count) / rate
    points = policy.at(times) + noise * random.normal(size=(count, 2 * JOINT_COUNT))
    velocities = policy.velocity(times)
    arrivals = np.maximum.accumulate(times + lateness * random.exponential(size=count))
    following = stream_delay(tracking, delay)
    first, sent = {side: len(rig.cycles) for side, rig in arms.rigs.items()}, 0
    while arms.now - begin < duration:
        # What comes before a datagram is there when the datagram is answered.
        while sent < count and begin + arrivals[sent] <= arms.now + CYCLE:
            halves = _halves(points[sent])
            speeds = _halves(velocities[sent]) if with_velocity else {}
            arms.executor.stream(dict(halves), speeds, begin + times[sent], following)
            sent += 1
        arms.cycle()
    cycles = [arms.rigs[side].cycles[first[side] :] for side in (Side.RIGHT, Side.LEFT)]
    moments = np.array([each.state.time - begin for each in cycles[0]])
    counts = moments > _BEGIN + _FOUND
    moments = moments[counts]
    measured = np.hstack([np.array([each.state.position for each in arm])[counts] for arm in cycles])
    commanded = np.hstack([np.array([each.sent.position for each in arm])[counts] for arm in cycles])
    lag = _lag(policy, moments, measured)
    accelerations = np.diff(measured, 2, axis=0) / CYCLE**2
    return Followed(
        lag,
        _lag(policy, moments, commanded),
        float(np.abs(measured - policy.at(moments - lag)).max()),
        _rms(accelerations) / _rms(policy.acceleration(moments)),
        sum(rig.snapshot.limiter.slowed for rig in arms.rigs.values()),
        tuple(str(event) for rig in arms.rigs.values() for event in rig.events if "stream" in str(event)),
    )


def _halves(values: Array) -> dict[Side, Joints]:
    return {Side.RIGHT: joints(values[:JOINT_COUNT].tolist()), Side.LEFT: joints(values[JOINT_COUNT:].tolist())}


def _lag(policy: SmoothPolicy, moments: Array, positions: Array) -> float:
    chosen = slice(None, None, 4)
    return minimum(lambda late: float(((positions[chosen] - policy.at(moments[chosen] - late)) ** 2).sum()), -0.05, 0.4)


def _rms(values: Array) -> float:
    return float(np.sqrt((values**2).mean()))


@dataclass(frozen=True, slots=True)
class Row:
    """A row of the documentation's table: a stream, and the arguments of ``robot.stream``."""

    points: str
    rate: float
    how: str = ""
    fastest: float = 0.3
    delay: float | None = None
    tracking: str = "feed_forward"
    noise: float = 0.0

    def text(self) -> str:
        """The row in Markdown; it is followed for that."""
        found = follow_stream(
            self.rate, SmoothPolicy(self.fastest), delay=self.delay, tracking=self.tracking, noise=self.noise
        )
        how = f"`{self.how}`" if self.how else ""
        return (
            f"| {self.points} | {how} | {found.lag * 1e3:.0f} ms | {found.acceleration:.2f} | "
            f"{degrees(found.error):.2f}° |"
        )


HEAD = """\
| points | arguments | lag | acceleration | error |
|---|---|---|---|---|"""

ROWS = (
    Row("smooth, 30 Hz", 30.0),
    Row("smooth, 100 Hz", 100.0),
    Row("smooth, 10 Hz", 10.0),
    Row("smooth, 250 Hz", 250.0),
    Row("lively, 30 Hz", 30.0, fastest=1.0),
    Row("lively, 100 Hz", 100.0, fastest=1.0),
    Row("lively, 10 Hz", 10.0, fastest=1.0),
    Row("smooth, 30 Hz", 30.0, "delay=0", delay=0.0),
    Row("lively, 30 Hz", 30.0, "delay=0", fastest=1.0, delay=0.0),
    Row("lively, 30 Hz, with noise of 0.02°", 30.0, fastest=1.0, noise=3e-4),
    Row("lively, 30 Hz, with noise of 0.02°", 30.0, "delay=0", fastest=1.0, noise=3e-4, delay=0.0),
    Row("smooth, 30 Hz", 30.0, 'tracking="gains"', tracking="gains"),
)
"""Of the table in docs/how-to/follow-a-stream.md."""


def table() -> str:
    """The table in Markdown."""
    return "\n".join([HEAD, *(row.text() for row in ROWS)])


if __name__ == "__main__":
    sys.stdout.write(f"{table()}\n")
