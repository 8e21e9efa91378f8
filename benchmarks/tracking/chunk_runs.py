"""Runs of chunks in virtual time: how an arm follows them, and what upstream's rule makes of the same policy.

The policy is smooth and closed-loop: each chunk begins where the arm was observed, and leads back to the policy's own
motion. Inference takes time, chunks are lost and corrected, and the next inference begins when the last one has ended.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf

import numpy as np
from numpy.typing import NDArray

from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, Joints, Side, joints, named_pose
from yumi.control.chunk_commands import ChunksExhausted, ChunkTaken, FollowChunk
from yumi.control.controllers.joint_trajectory import JointTrajectoryController
from yumi.control.goals import MemoryBuffer
from yumi.control.limiter import Limiter
from yumi.control.loop_events import ControllerReport
from yumi.control.motion.robot_response import RESPONSE_DELAY
from yumi.control.motion.spline import SplineSampler, TrajectoryPoint
from yumi.control.shared_state import TrajectoryFeedback
from yumi.control.speed_scale import SpeedScale
from yumi.planning.chunk_plan import plan_chunk
from yumi.planning.smoothing import smooth_spline_through
from yumi_evaluation.virtual_time import VirtualArmRig

Array = NDArray[np.float64]

CONTROLLER = "joint_trajectory_controller"
_WAVES = 3
_RETURN = 1.0  # [s] in which a chunk leads back to the policy's own motion
_BEGIN = 0.3  # [s] until the arm is taken over


class Policy:
    """A smooth random motion of seven joints.

    Args:
        chance: its random numbers.
        about: the posture about which it moves [rad], (7,).
        amplitude: of its waves together [rad].
    """

    def __init__(self, chance: np.random.Generator, about: Joints, amplitude: float = 0.3) -> None:
        self._about = np.array(about)
        self._sizes = amplitude / _WAVES * chance.uniform(0.5, 1.0, (_WAVES, len(about)))
        self._rates = chance.uniform(0.5, 3.0, (_WAVES, len(about)))  # [rad/s]
        self._phases = chance.uniform(0.0, 2.0 * np.pi, (_WAVES, len(about)))

    def at(self, times: Array) -> Array:
        """Its own motion at times [s], (n,): positions [rad], (n, 7)."""
        angles = self._rates * times[:, None, None] + self._phases
        waves: Array = (self._sizes * np.sin(angles)).sum(axis=1)
        return self._about + waves

    def chunk(self, times: Array, observed: float, position: Joints) -> Array:
        """Positions at times from where the arm was at the time ``observed`` [s], (n, 7)."""
        away = np.array(position) - self.at(np.array([observed]))[0]
        back: Array = away * np.exp((observed - times)[:, None] / _RETURN)
        return self.at(times) + back


@dataclass(frozen=True, slots=True)
class Inference:
    """How chunks come.

    Attributes:
        rate: of their points [Hz].
        points: of each chunk.
        duration: from an observation until its chunk is there [s].
        period: from one inference to the next [s]; where inference takes longer, the next begins when it has ended.
        loss: share of the chunks that never come.
        correction: standard deviation of what a chunk differs from the one before [rad].
    """

    rate: float
    points: int
    duration: float
    period: float = 0.2
    loss: float = 0.1
    correction: float = 0.01


@dataclass(slots=True, eq=False)
class ChunkRun:
    """What became of the chunks, cycle by cycle.

    Attributes:
        times: of the cycles [s], (n,).
        desired: positions of the controller [rad], (n, 7).
        sent: positions of the limiter [rad], (n, 7).
        measured: positions of the arm [rad], (n, 7).
        taken: what was made of each chunk.
        exhausted: when points were exhausted [s].
        refused: codes of the chunks that were refused.
        lost: how many never came.
    """

    times: Array = field(default_factory=lambda: np.empty(0))
    desired: Array = field(default_factory=lambda: np.empty((0, 7)))
    sent: Array = field(default_factory=lambda: np.empty((0, 7)))
    measured: Array = field(default_factory=lambda: np.empty((0, 7)))
    taken: list[ChunkTaken] = field(default_factory=list)
    exhausted: list[ChunksExhausted] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)
    lost: int = 0


class _Sender:
    """The policy's side: makes observations, and sends chunks when they are due.

    Args:
        inference: how chunks come.
        policy: whose they are.
        chance: decides what is lost, and how chunks are corrected.
        send: sends times since the start, positions and the start [s]; returns when the last point is due, or None
            where it was refused.
    """

    def __init__(
        self,
        inference: Inference,
        policy: Policy,
        chance: np.random.Generator,
        send: Callable[[Array, Array, float], float | None],
    ) -> None:
        self._inference, self._policy, self._chance, self._send = inference, policy, chance, send
        self._observed: tuple[float, Joints] | None = None
        self._next = -inf
        self._waited = 0.0  # [s] the policy's own time stands still while the arm waits for points
        self.until = -inf
        self.lost = 0

    def cycle(self, now: float, position: Joints) -> None:
        """An arm is at ``position`` now [s]: observe it, or send what was inferred of the last observation."""
        inference = self._inference
        if self._observed is None and now >= self._next:
            self._observed = now, position
        if self._observed is not None and now - self._observed[0] >= inference.duration:
            observed, then = self._observed
            self._observed, self._next = None, max(now, observed + inference.period)
            if self._chance.random() < inference.loss:
                self.lost += 1
                return
            since = np.arange(inference.points) / inference.rate
            own = observed - self._waited
            positions = self._policy.chunk(own + since, own, then)
            positions += self._chance.normal(0.0, inference.correction, positions.shape[1])
            waited = max(0.0, now - max(self.until, observed))
            until = self._send(since, positions, observed + waited)
            if until is not None:
                self.until = until
                self._waited += waited


def follow_chunks(
    inference: Inference, seconds: float, seed: int, side: Side = Side.RIGHT, speed: SpeedScale | None = None
) -> ChunkRun:
    """Have a virtual arm follow the chunks of a random policy."""
    chance = np.random.default_rng(seed)
    policy = Policy(chance, named_pose(side, "ready"))
    start = joints(policy.at(np.zeros(1))[0].tolist())
    controller = JointTrajectoryController(side, MemoryBuffer[TrajectoryFeedback](), speed=speed)
    rig = VirtualArmRig({CONTROLLER: controller}, side=side, position=start, limiter=Limiter(YUMI_LIMITS), speed=speed)
    rig.start()
    rig.switch_to(CONTROLLER)
    rig.run(_BEGIN)
    run, zero = ChunkRun(), rig.clock.now()

    def send(since: Array, positions: Array, begin: float) -> float | None:
        try:
            spline = plan_chunk(side, since.tolist(), positions, YUMI_LIMITS)
            chunk = FollowChunk(len(run.taken) + 1, zero + begin, spline)
            taken = rig.manager.receive(CONTROLLER, chunk, rig.line.state)
        except CommandRefused as error:
            run.refused.append(error.said.code)
            return None
        assert isinstance(taken, ChunkTaken)
        run.taken.append(taken)
        return taken.until - zero

    sender = _Sender(inference, policy, chance, send)
    first = len(rig.cycles)
    for _ in range(round(seconds / CYCLE)):
        state = rig.cycles[-1].state
        sender.cycle(state.time - zero, state.position)
        rig.cycle()
    rig.run(1.0)
    cycles = rig.cycles[first:]
    run.times = np.array([each.state.time for each in cycles])
    run.desired = np.array([(each.desired or each.sent).position for each in cycles])
    run.sent = np.array([each.sent.position for each in cycles])
    run.measured = np.array([each.state.position for each in cycles])
    reports = (each.report for each in rig.events if isinstance(each, ControllerReport))
    run.exhausted = [each for each in reports if isinstance(each, ChunksExhausted)]
    run.lost = sender.lost
    return run


def follow_upstream(inference: Inference, seconds: float, seed: int, side: Side = Side.RIGHT) -> ChunkRun:
    """What ``positions_upsampling`` of ros2_controllers makes of the same policy, without a robot: desired = measured.

    Its rule (ros2_controllers #2491, #2573): a cubic spline from the position and velocity that are desired when the
    chunk comes, through the points that are not over, to rest at the last one.
    """
    chance = np.random.default_rng(seed)
    policy = Policy(chance, named_pose(side, "ready"))
    where = joints(policy.at(np.zeros(1))[0].tolist())
    sampler = SplineSampler(smooth_spline_through([TrajectoryPoint(0.0, where)]))
    run, now = ChunkRun(), 0.0

    def send(since: Array, positions: Array, begin: float) -> float | None:
        nonlocal sampler
        due = [
            TrajectoryPoint(begin + float(each), tuple(map(float, row)))
            for each, row in zip(since, positions, strict=True)
            if begin + each - RESPONSE_DELAY > now + 1e-3
        ]
        if not due:
            run.refused.append("chunk_is_over")
            return None
        shifted = [each._replace(time=each.time - RESPONSE_DELAY) for each in due]
        place, speed = sampler.motion(now)
        sampler = SplineSampler(smooth_spline_through([TrajectoryPoint(now, place), *shifted], speed))
        run.taken.append(ChunkTaken(len(since) - len(due), 0, now, now, due[-1].time))
        return due[-1].time

    sender, rows = _Sender(inference, policy, chance, send), []
    for number in range(round((seconds + 1.0) / CYCLE)):
        now = number * CYCLE
        if now < seconds:
            sender.cycle(now, sampler.position(now - RESPONSE_DELAY))
        rows.append(sampler.position(now))
    run.times = np.arange(len(rows), dtype=np.float64) * CYCLE
    run.desired = run.sent = run.measured = np.array(rows)
    run.lost = sender.lost
    return run


@dataclass(frozen=True, slots=True)
class Steps:
    """The largest changes within one cycle, of any joint.

    Attributes:
        velocity: [rad/s].
        acceleration: [rad/s²].
        share: of the acceleration's change that the jerk limits allow in a cycle.
        rms: of the acceleration [rad/s²].
    """

    velocity: float
    acceleration: float
    share: float
    rms: float


def steps_of(positions: Array, step: float = CYCLE) -> Steps:
    """The steps of positions cycle by cycle [rad], (n, 7), of the limits of the YuMi."""
    rates = np.diff(positions, axis=0) / step
    accelerations = np.diff(rates, axis=0) / step
    changes = np.abs(np.diff(accelerations, axis=0))
    return Steps(
        velocity=float(np.abs(np.diff(rates, axis=0)).max()),
        acceleration=float(changes.max()),
        share=float((changes / (np.array(YUMI_LIMITS.jerk) * step)).max()),
        rms=float(np.sqrt(np.mean(accelerations**2))),
    )
