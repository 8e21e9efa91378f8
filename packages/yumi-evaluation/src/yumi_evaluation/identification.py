"""Identification: with which parameters the virtual robot moves as a log says, and how well the log determines them.

The virtual robot itself is run with the commands of a log, again and again with other parameters, until what it reports
is as close to the log as it gets (Gauss-Newton). A parameter that the log does not determine has no value.

============ =======================================================================================================
word         meaning
============ =======================================================================================================
k            gain of EGM's loop: speed for each distance from the reference [1/s]
dead time    all delay between a command and the position that answers it: of the network, of the reference, of the
             servo with the servo's lag [s]; beside it the loop itself takes 1/k
lag          how much later than its commands an arm is that follows a ramp [s]
noise        standard deviation of what differs from row to row without any order [rad]
limit        speed that a joint does not exceed though it is asked for more [rad/s]
============ =======================================================================================================
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import inf, nan, radians, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from abb_protocols.catalogue import Message, clause, message
from abb_protocols.robot.joints import JointLimits, Joints
from virtual_irc5.mechanics.arm_motion import ArmModel
from virtual_irc5.mechanics.egm_motion import EgmMotionParameters
from virtual_irc5.mechanics.servo import follow_references
from yumi_evaluation.logs import Array, RobotLog

Mask = NDArray[np.bool_]
Tick = Callable[[], None]
"""Called with each run of the virtual robot."""

RUNS = 250
"""So many runs an identification takes about, for a progress bar."""

_MOST_CYCLES = 4000  # that are fitted to; of longer logs the part with the most motion
_WARM_UP = 2.0  # [s] of a motion that began before the log, until its begin no longer matters
_ITERATIONS = 8
_SETTLED = 18.0  # times 1/k: what is left of a step is a part in ten millions
_AS_GOOD = 1.2  # times the least sum of squares
_BATCH = 0.4  # [s] of rows that err together: longer than a loop remembers
_MUCH = 10.0  # of the sum of squares, in standard deviations: after a step that wins less, the derivatives serve on
_MOST_REFERENCE_CYCLES = 4
_MOST_CELLS = 24
_NEIGHBOURS = (((1, -1), (-1, 1), (1, 0), (-1, 0), (0, 1), (0, -1)), ((0, 1), (0, -1), (1, 0), (-1, 0)))
_ENOUGH = 0.3  # of the sum of squares, in standard deviations: a step that wins less is the last
_NAMES = ("gain", "reference_delay", "delay", "lag")
_FINE = np.array([1e-4, 1e-6, 1e-6, 1e-6])  # steps of the derivatives: [1/s], [s]
_COARSE = np.array([0.02, 0.002, 0.002, 0.001])
_SHARES = (1.0, 0.5, 0.2, 0.05)  # of a step that are tried
# What is believed before the log is seen: a standard deviation each. It decides where the log does not.
_DOUBT = np.array([10.0, 0.010, 0.020, 0.005])
_LOWEST, _HIGHEST = np.array([0.2, 0.0, 0.0, 0.0]), np.array([40.0, 0.1, 0.2, 0.1])
_MOST_GAIN_ERROR = 0.04  # of k and lag, as a fraction; with a larger one they are not determined
_MOST_TIME_ERROR = 0.0015  # [s] of the dead time
_ROUNDING = radians(2e-5)  # what a log of rounded numbers has at least [rad]
_SLOPE = 5  # rows over which a speed is measured
_LASTING = 10  # cycles: a joint that is behind for so long is limited
_BEHIND = 0.12  # of the speed that it is asked for
_LEAST_BEHIND = radians(2.0)  # [rad/s]
_FLAT = 0.04  # a joint at a limit of its speed varies by less
_LEAST_NOISE_ROWS = 60


@dataclass(frozen=True, slots=True)
class Dynamics:
    """What a virtual arm is run with.

    Attributes:
        gain: k [1/s].
        model: of the arm.
        bandwidth: of EGM's low-pass filter [Hz]; 0 is none.
    """

    gain: float = 5.0
    model: ArmModel = field(default_factory=ArmModel)
    bandwidth: float = 0.0

    @property
    def settings(self) -> EgmMotionParameters:
        """Of EGM."""
        return EgmMotionParameters(gain=self.gain, bandwidth=self.bandwidth, max_speed=inf, max_deviation=inf)

    def dead_time(self, cycle: float) -> float:
        """All delay between a command and the position that answers it [s]; a command arrives a cycle later."""
        return cycle + self.model.reference_delay + self.model.delay + self.model.lag

    def lag(self, cycle: float) -> float:
        """How much later than its commands an arm is that follows a ramp [s]; what is in the loop does not count."""
        return cycle + self.model.reference_delay + 1.0 / self.gain

    def limited_to(self, velocity: Sequence[float]) -> Dynamics:
        """The same with other highest speeds [rad/s], (k,)."""
        limits = replace(self.model.limits, velocity=tuple(velocity))
        return replace(self, model=replace(self.model, limits=limits))

    @property
    def velocity(self) -> Joints:
        """Highest speeds of the joints [rad/s], (k,)."""
        return self.model.limits.velocity

    def of_joints(self, which: NDArray[np.int_]) -> Dynamics:
        """That of some joints."""

        def some(values: Joints) -> Joints:
            return tuple(values[joint] for joint in which)

        limits = self.model.limits
        few = replace(
            limits,
            **{name: some(getattr(limits, name)) for name in ("lower", "upper", "velocity", "acceleration", "jerk")},
        )
        most = self.model.egm_acceleration
        return replace(
            self, model=replace(self.model, limits=few, egm_acceleration=None if most is None else some(most))
        )

    @property
    def values(self) -> Array:
        """The fitted parameters, as :data:`_NAMES` says."""
        model = self.model
        return np.array([self.gain, model.reference_delay, model.delay, model.lag])

    def with_values(self, values: Array) -> Dynamics:
        gain, reference_delay, delay, lag = (float(value) for value in values)
        return replace(
            self, gain=gain, model=replace(self.model, reference_delay=reference_delay, delay=delay, lag=lag)
        )


def answer(log: RobotLog, dynamics: Dynamics) -> Array:
    """What the virtual robot reports in the rows of a log, sent the commands of the log [rad], (n, k).

    As long as nothing limits a joint, all of it follows from one run in which one joint is sent one step: the loop is
    linear, and the same for all joints. Where a joint would be limited, the whole motion is run.
    """
    cycles = int(np.ceil(log.rows[-1])) + 1
    # The reply to a datagram is there in the next cycle.
    references, speeds = _held(np.vstack((log.start, log.commands)), cycles), None
    if log.speeds is not None:
        speeds = _held(np.vstack((np.zeros(len(log.start)), log.speeds)), cycles)
    reported = _superposed(references, speeds, log.cycle, dynamics)
    if reported is None:
        start = _joints(log.start)
        fed = None if speeds is None else [_joints(row) for row in speeds]
        sent = [_joints(row) for row in references]
        answers = follow_references(sent, start, dynamics.model, dynamics.settings, cycle=log.cycle, speeds=fed)
        reported = np.array([each.measured for each in answers])
    whole = log.rows.astype(int)
    if (whole == log.rows).all():
        return np.asarray(reported[whole])
    return np.stack([np.interp(log.rows, np.arange(cycles), joint) for joint in reported.T], axis=1)


def _superposed(references: Array, speeds: Array | None, cycle: float, dynamics: Dynamics) -> Array | None:
    """The answer as a sum of answers to steps [rad], (m, k); None where a limit would make it another one."""
    model = dynamics.model
    if model.egm_acceleration is not None:
        return None
    free = replace(model, limits=JointLimits.unlimited(1), supervises_load=False)
    lasts = min(len(references), int((_SETTLED / dynamics.gain + _SETTLED * dynamics.dead_time(cycle)) / cycle) + 1)
    to_step = _responses(free, dynamics.settings, cycle, lasts, False)
    changes = np.diff(references, axis=0, prepend=references[:1])
    measured, planned = (references[0] + np.cumsum(_convolved(changes, each), axis=0) for each in to_step)
    if speeds is not None:
        to_speed = _responses(free, dynamics.settings, cycle, lasts, True)
        measured, planned = (
            own + np.cumsum(_convolved(speeds, each), axis=0)
            for own, each in zip((measured, planned), to_speed, strict=True)
        )
    fastest = np.abs(np.diff(planned, axis=0)).max(axis=0, initial=0.0) / cycle
    return measured if (fastest < np.array(model.limits.velocity)).all() else None


@lru_cache(maxsize=32)
def _responses(
    model: ArmModel, settings: EgmMotionParameters, cycle: float, count: int, is_speed: bool
) -> tuple[Array, Array]:
    """How the reported and the planned position of a joint change, cycle by cycle, after a unit of one cycle.

    Args:
        model: of one joint without limits.
        settings: of EGM.
        cycle: [s].
        count: of cycles.
        is_speed: whether the unit is a speed that is sent, for one cycle, and not a step of the reference.
    """
    one, zero = (1.0,), (0.0,)
    references, speeds = [zero] * count, [zero] * count
    if is_speed:
        speeds[0] = one
    else:
        references = [one] * count
    answers = follow_references(references, zero, model, settings, cycle=cycle, speeds=speeds)
    positions = np.array([(*each.measured, *each.planned) for each in answers])
    measured, planned = np.diff(positions, axis=0, prepend=np.zeros((1, 2))).T
    return measured, planned


def _convolved(inputs: Array, response: Array) -> Array:
    """What follows from inputs in each cycle, (m, k), each answered by ``response`` from that cycle on."""
    size = 1 << (len(inputs) + len(response) - 1).bit_length()
    spectrum = np.fft.rfft(inputs, size, axis=0) * np.fft.rfft(response, size)[:, None]
    return np.fft.irfft(spectrum, size, axis=0)[: len(inputs)]


def _joints(values: Array) -> Joints:
    return tuple(values.tolist())


def _held(sent: Array, cycles: int) -> Array:
    """One value a cycle: where nothing was sent, the last one holds."""
    known = np.isfinite(sent).all(axis=1)
    last = np.maximum.accumulate(np.where(known, np.arange(len(sent)), 0))
    held = sent[last][:cycles]
    return np.vstack((held, np.repeat(held[-1:], cycles - len(held), axis=0)))


@dataclass(frozen=True, slots=True)
class Estimate:
    """A parameter that was identified.

    Attributes:
        value: in SI units; None where the log does not determine it.
        error: standard error of the value.
        spread: standard deviation over the joints and records that determine it alone; None where fewer than two do.
        count: so many do.
        reason: why there is no value; None where there is one.
    """

    value: float | None
    error: float = nan
    spread: float | None = None
    count: int = 0
    reason: Message | None = None


@dataclass(frozen=True, slots=True)
class Identified:
    """What the logs of a robot say of it.

    Attributes:
        dynamics: of the virtual robot that moves like it; what is not determined is as before.
        gain: k [1/s].
        dead_time: [s].
        lag: on a ramp [s].
        noise: [rad].
        limits: of each joint [rad/s], (k,).
    """

    dynamics: Dynamics
    gain: Estimate
    dead_time: Estimate
    lag: Estimate
    noise: Estimate
    limits: tuple[Estimate, ...]


def identify(logs: Sequence[RobotLog], prior: Dynamics, tick: Tick = lambda: None) -> Identified:
    """Identify a robot by motions of it; sections of other motions are left to be predicted.

    Args:
        logs: of one robot, all with the same number of joints.
        prior: what the robot is expected to be.
        tick: see :data:`Tick`.
    """
    cycle, count = float(np.mean([log.cycle for log in logs])), len(logs[0].joints)
    parts = [_excerpt(log) for log in logs if not log.section_of and has_motion(log)]
    if not parts:
        nothing = Estimate(None, reason=message("no_joint_moves"))
        noise = _noise(logs, [log.measured - log.measured.mean(axis=0) for log in logs])
        return Identified(prior, nothing, nothing, nothing, noise, (nothing,) * count)
    # Joints that stand say nothing of the loop, and the virtual robot is quicker without them.
    moving = np.flatnonzero(np.any([np.array(_travel(log)) > _least_travel(log) for log in parts], axis=0))
    parts = [_of_joints(log, moving) for log in parts]
    expected = prior.of_joints(moving)
    # Until it is known which joints are limited, none is faster than where it went on at its highest speed.
    steady = np.max([_steady(log) for log in parts], axis=0)
    seen = np.where(steady > _LEAST_BEHIND, 1.05 * steady, inf)
    used = [log.rows >= first_comparable(log) for log in parts]
    bounded = expected.limited_to(np.minimum(seen, expected.velocity).tolist())
    fit = _Search(parts, used, bounded, expected, _DOUBT, tick).fit()
    behind = [limited(log, fit.dynamics) for log in parts]
    limits = _limits(parts, behind)
    found = fit.dynamics.limited_to(
        [most if each.value is None else each.value for each, most in zip(limits, expected.velocity, strict=True)]
    )
    is_limited = any(late.any() for late in behind)
    if is_limited:
        # What no limit of speeds explains, and what comes after it, says nothing of a loop without limits.
        unknown = [each.value is None for each in limits]
        explained = [~np.logical_or.accumulate(late[:, unknown].any(axis=1)) for late in behind]
        clear = [mask & own for mask, own in zip(used, explained, strict=True)]
        if sum(int(mask.sum()) for mask in clear) >= _LEAST_NOISE_ROWS:
            used = clear
    if is_limited or any(np.ptp(answer(log, found) - answer(log, fit.dynamics)) > 0.0 for log in parts):
        fit = _Search(parts, used, found, expected, _DOUBT, tick).fit()
        found = fit.dynamics
    gain = fit.estimate(np.array([1.0, 0.0, 0.0, 0.0]), found.gain, found.gain * _MOST_GAIN_ERROR)
    if gain.value is None:
        # Where the log allows many gains, each with dead times of its own, that is one of them which was expected.
        known = np.array([1e-4, *_DOUBT[1:]])
        held = _Search(parts, used, replace(found, gain=prior.gain), expected, known, tick).fit()
        if _squares(held.residuals, used) < _AS_GOOD * _squares(fit.residuals, used):
            fit, found = held, replace(held.dynamics, gain=prior.gain)
    late = found.lag(cycle)
    velocity = list(prior.velocity)
    every = [Estimate(None, reason=message("joint_does_not_move"))] * count
    for place, joint in enumerate(moving.tolist()):
        velocity[joint], every[joint] = found.velocity[place], limits[place]
    return Identified(
        prior.with_values(found.values).limited_to(velocity),
        gain,
        fit.estimate(np.array([0.0, 1.0, 1.0, 1.0]), found.dead_time(cycle), _MOST_TIME_ERROR),
        fit.estimate(np.array([-(found.gain**-2.0), 1.0, 0.0, 0.0]), late, late * _MOST_GAIN_ERROR),
        _noise(parts, fit.residuals),
        tuple(every),
    )


def _of_joints(log: RobotLog, which: NDArray[np.int_]) -> RobotLog:
    """The log of some joints."""
    return replace(
        log,
        joints=tuple(log.joints[joint] for joint in which),
        measured=log.measured[:, which],
        commands=log.commands[:, which],
        speeds=None if log.speeds is None else log.speeds[:, which],
        start=log.start[which],
    )


def _travel(log: RobotLog) -> Array:
    """How far each joint was commanded to move, and moved [rad], (k,)."""
    commands = log.commands[np.isfinite(log.commands).all(axis=1)]
    commanded = np.ptp(np.vstack((log.start, commands)), axis=0)
    return np.asarray(np.minimum(commanded, np.ptp(log.measured, axis=0)))


def _least_travel(log: RobotLog) -> float:
    """What counts as a motion [rad]."""
    return max(radians(0.01), 20.0 * float(np.nan_to_num(_high_pass(log, log.measured)[1]).max()))


def has_motion(log: RobotLog) -> bool:
    """Whether a joint was commanded to move, and moved."""
    return bool(_travel(log).max() > _least_travel(log))


def first_comparable(log: RobotLog) -> float:
    """The first row that counts: of an arm that moves when the log begins, how it moved before is not known."""
    speed = np.abs(_speeds(log)[:_LASTING]).max()
    return 0.0 if log.section_of or speed < _LEAST_BEHIND / 4.0 else _WARM_UP / log.cycle


def _excerpt(log: RobotLog) -> RobotLog:
    """The part of a long log in which most happens."""
    first, last = int(log.rows[0]), int(log.rows[-1])
    if last < _MOST_CYCLES:
        return log
    held = _held(np.vstack((log.start, log.commands)), last + 2)
    changes = np.abs(np.diff(held, 2, axis=0)).sum(axis=1)
    total = np.concatenate(([0.0], np.cumsum(np.minimum(changes, np.quantile(changes, 0.99) or 1.0))))
    begin = int(np.argmax(total[_MOST_CYCLES:] - total[:-_MOST_CYCLES])) if first == 0 else first
    inside = (log.rows >= begin) & (log.rows <= begin + _MOST_CYCLES)
    measured = log.measured[inside]
    return replace(
        log,
        rows=log.rows[inside] - begin,
        measured=measured,
        commands=np.vstack((held[begin + 1 : begin + 2], log.commands[begin + 1 : begin + _MOST_CYCLES + 1])),
        speeds=None if log.speeds is None else log.speeds[begin : begin + _MOST_CYCLES + 1],
        start=measured[:3].mean(axis=0),
    )


# ---- the fit


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """The best parameters, and how the rows of each joint and record depend on them.

    Attributes:
        dynamics: with the best parameters.
        residuals: of each record [rad], (n, k).
        covariance: of the parameters, (4, 4).
        groups: of each joint of each record: what it alone would change in the parameters, and its covariance.
    """

    dynamics: Dynamics
    residuals: list[Array]
    covariance: Array
    groups: list[tuple[Array, Array]]

    def estimate(self, gradient: Array, value: float, most: float) -> Estimate:
        """A quantity that depends on the parameters by ``gradient``; determined up to an error of ``most``."""
        own = sqrt(gradient @ self.covariance @ gradient)
        alone = [
            float(gradient @ change)
            for change, covariance in self.groups
            if sqrt(gradient @ covariance @ gradient) < 2.0 * most
        ]
        spread = float(np.std(alone, ddof=1)) if len(alone) > 1 else None
        error = max(own, (spread or 0.0) / sqrt(max(1, len(alone))))
        if error > most:
            return Estimate(None, error, spread, len(alone), message("not_shown_by_motion"))
        return Estimate(value, error, spread, len(alone))


class _Minimum(NamedTuple):
    """Where a search ended: parameters, residuals of each record [rad] and their derivatives by the parameters."""

    values: Array
    residuals: list[Array]
    slopes: list[Array]


class _Search:
    """The search for the least sum of squares (Gauss-Newton), with what is believed before.

    Args:
        logs: the records.
        used: their rows that count.
        start: what is run, with other parameters.
        prior: which parameters are believed.
        doubt: how much, a standard deviation each.
        tick: see :data:`Tick`.
    """

    def __init__(
        self,
        logs: Sequence[RobotLog],
        used: Sequence[Mask],
        start: Dynamics,
        prior: Dynamics,
        doubt: Array,
        tick: Tick,
    ) -> None:
        self._logs, self._used, self._start, self._tick = logs, used, start, tick
        self._belief, self._believed = np.diag(doubt**-2.0), prior.values
        self._is_gain_known = bool(doubt[0] < 1e-3)
        self._count = sum(int(mask.sum()) for mask in used) * len(logs[0].joints)

    def fit(self) -> _Fit:
        minima = self._minima()
        likely = min(minima, key=lambda each: self._squares(each.residuals))
        scale = self._scale(likely)
        _, inverse, scatter = self._curvature(likely, scale)
        # By so much less the rows say than if each erred by itself; what they leave open is as was believed.
        fewer = max(1.0, float(np.trace(inverse @ scatter)) / len(_NAMES))
        cost = np.array([self._cost(each.values, each.residuals, fewer * scale) for each in minima])
        best = minima[int(np.argmin(cost))]
        groups, inverse, scatter = self._curvature(best, scale)
        # Where another minimum is hardly worse, either may be meant.
        weights = np.exp(0.5 * (cost.min() - cost))
        apart = np.array([each.values - best.values for each in minima])
        other = np.einsum("m,mp,mq->pq", weights / weights.sum(), apart, apart)
        covariance = inverse @ (scatter + self._belief) @ inverse + other
        return _Fit(self._start.with_values(best.values), best.residuals, covariance, groups)

    def _curvature(self, minimum: _Minimum, scale: float) -> tuple[list[tuple[Array, Array]], Array, Array]:
        """What each joint of each record says alone, the inverse of the curvature, and the scatter of the slope.

        Rows err together, by what the model lacks or a command that was lost: the scatter is that of whole batches.
        """
        groups, scatter, information = [], np.zeros_like(self._belief), self._belief.copy()
        for log, slope, each, mask in zip(self._logs, minimum.slopes, minimum.residuals, self._used, strict=True):
            batches = np.floor(log.times[mask] / _BATCH).astype(int)
            for joint in range(slope.shape[1]):
                own, left = slope[mask, joint], each[mask, joint]
                spread = max(float(np.square(left).mean()), _ROUNDING**2) * _correlation(left)
                products = own.T @ own
                information += products / scale
                pulls = np.zeros((batches[-1] + 1 if len(batches) else 0, len(_NAMES)))
                np.add.at(pulls, batches, own * left[:, None])
                scatter += pulls.T @ pulls / scale**2
                alone = np.linalg.inv(products / spread + self._belief)
                groups.append((-alone @ (own.T @ left) / spread, alone))
        return groups, np.linalg.inv(information), scatter

    def _minima(self) -> list[_Minimum]:
        """The least minimum and those beside it.

        A delay of so many cycles and a part is interpolated, which is another filter in each cycle: from one cycle to
        the next the derivatives jump. So the way there is found by coarse ones, and then each pair of cycles, of the
        reference's delay and the servo's, is searched by itself, as long as a neighbour is better.
        """
        near = self._descended(self._start.values, _LOWEST, _HIGHEST, _COARSE)
        cycle = self._logs[0].cycle
        at = (min(int(near.values[1] / cycle), _MOST_REFERENCE_CYCLES - 1), int(near.values[2] / cycle))
        found = {at: self._within(near.values, at)}
        searched = set[tuple[int, int]]()
        while at not in searched and len(found) < _MOST_CELLS:
            searched.add(at)
            for used, delay in _NEIGHBOURS[self._is_gain_known]:
                cell = (at[0] + used, at[1] + delay)
                if cell not in found and min(cell) >= 0 and cell[0] < _MOST_REFERENCE_CYCLES:
                    found[cell] = self._within(found[at].values, cell)
            at = min(found, key=lambda cell: self._squares(found[cell].residuals))
        return list(found.values())

    def _within(self, values: Array, cell: tuple[int, int]) -> _Minimum:
        """The minimum with delays of the reference and the servo within a cycle each, from values near."""
        cycle = self._logs[0].cycle
        lowest, highest = _LOWEST.copy(), _HIGHEST.copy()
        lowest[1:3], highest[1:3] = cycle * np.array(cell), cycle * (np.array(cell) + 1.0)
        begin = values.copy()
        begin[1:3] = np.clip(values[1:3], lowest[1:3] + 0.1 * cycle, highest[1:3] - 0.1 * cycle)
        if not self._is_gain_known:
            begin[0] = 1.0 / max(1.0 / _HIGHEST[0], 1.0 / values[0] + values[1] - begin[1])  # the lag stays
        return self._descended(begin, lowest, highest, _FINE)

    def _descended(self, values: Array, lowest: Array, highest: Array, steps: Array) -> _Minimum:
        """The minimum near ``values`` within bounds, by derivatives over ``steps``."""
        values = np.clip(values, lowest, highest)
        now = self._residuals(values)
        slopes = self._slopes(values, now, steps, highest)
        for _ in range(_ITERATIONS):
            scale = self._scale(_Minimum(values, now, slopes))
            parts = [(slope[mask], each[mask]) for slope, each, mask in zip(slopes, now, self._used, strict=True)]
            information = sum(np.einsum("njp,njq->pq", slope, slope) for slope, _ in parts) / scale
            pull = sum(np.einsum("njp,nj->p", slope, each) for slope, each in parts) / scale
            pull = pull + self._belief @ (values - self._believed)
            step = _step(information + self._belief, pull, lowest - values, highest - values)
            before = self._cost(values, now, scale)
            for share in _SHARES:
                tried = values + share * step
                then = self._residuals(tried)
                better = before - self._cost(tried, then, scale)
                if better > 0.0:
                    break
            else:
                break
            values, now = tried, then
            if better < _ENOUGH * self._correlated(_Minimum(values, now, slopes)):
                break
            if better > _MUCH or share < 1.0:
                slopes = self._slopes(values, now, steps, highest)
        return _Minimum(values, now, slopes)

    def _residuals(self, values: Array) -> list[Array]:
        self._tick()
        dynamics = self._start.with_values(values)
        return [answer(log, dynamics) - log.measured for log in self._logs]

    def _slopes(self, values: Array, now: Sequence[Array], steps: Array, highest: Array) -> list[Array]:
        """Derivatives of each residual by the parameters, (n, k, 4), on this side of the bounds."""
        columns = []
        for place, step in enumerate(np.where(values + steps > highest, -steps, steps)):
            changed = values.copy()
            changed[place] += step
            columns.append([(one - other) / step for one, other in zip(self._residuals(changed), now, strict=True)])
        return [np.stack([column[number] for column in columns], axis=-1) for number in range(len(now))]

    def _squares(self, residuals: Sequence[Array]) -> float:
        return _squares(residuals, self._used)

    def _scale(self, minimum: _Minimum) -> float:
        return max(self._squares(minimum.residuals) / self._count, _ROUNDING**2)

    def _cost(self, values: Array, residuals: Sequence[Array], scale: float) -> float:
        away = values - self._believed
        return self._squares(residuals) / scale + float(away @ self._belief @ away)

    def _correlated(self, minimum: _Minimum) -> float:
        return max(_correlation(each[mask]) for each, mask in zip(minimum.residuals, self._used, strict=True))


def _squares(residuals: Sequence[Array], used: Sequence[Mask]) -> float:
    return float(sum(np.square(each[mask]).sum() for each, mask in zip(residuals, used, strict=True)))


def _step(curvature: Array, pull: Array, lowest: Array, highest: Array) -> Array:
    """The step to the least sum of squares within bounds of the step; a parameter that would leave them stops there."""
    step, held = np.zeros(len(pull)), np.zeros(len(pull), bool)
    for _ in pull:
        free = ~held
        others = curvature[np.ix_(free, held)] @ step[held]
        step[free] = -np.linalg.solve(curvature[np.ix_(free, free)], pull[free] + others)
        beyond = free & ((step < lowest) | (step > highest))
        if not beyond.any():
            break
        step[beyond] = np.clip(step, lowest, highest)[beyond]
        held |= beyond
    return step


def _correlation(left: Array) -> float:
    """By how much fewer rows count than there are, since neighbours err alike."""
    total = float(np.square(left).sum())
    alike = float((left[1:] * left[:-1]).sum()) / total if total > 0.0 else 0.0
    return (1.0 + min(0.99, max(0.0, alike))) / (1.0 - min(0.99, max(0.0, alike)))


# ---- noise


def _high_pass(log: RobotLog, values: Array) -> tuple[Array, Array]:
    """Fourth differences of rows without a gap, and their robust standard deviation as noise of a row, (k,)."""
    rows = log.rows
    steps = np.diff(rows)
    usual = float(np.median(steps)) if len(steps) else 1.0
    together = (rows[4:] - rows[:-4]) < 4.5 * usual
    differences = np.diff(values, 4, axis=0)[together] / sqrt(70.0)  # of noise the squares 1, 4, 6, 4, 1 add up
    if len(differences) == 0:
        return differences, np.full(values.shape[1], nan)
    return differences, 1.4826 * np.median(np.abs(differences), axis=0)


def _noise(logs: Sequence[RobotLog], residuals: Sequence[Array]) -> Estimate:
    """The noise of all joints; single jerks, as of a command that was lost on its way, do not count."""
    kept, alone = [], []
    for log, each in zip(logs, residuals, strict=True):
        differences, usual = _high_pass(log, each)
        for joint in range(differences.shape[1] if len(differences) else 0):
            own = differences[:, joint]
            own = own[np.abs(own) <= 4.0 * usual[joint]] if usual[joint] > 0.0 else own
            kept.append(own)
            if len(own) >= _LEAST_NOISE_ROWS:
                alone.append(float(np.sqrt(np.square(own).mean())))
    values = np.concatenate(kept) if kept else np.zeros(0)
    if len(values) < _LEAST_NOISE_ROWS:
        return Estimate(None, reason=message("too_few_rows"))
    value = float(np.sqrt(np.square(values).mean()))
    spread = float(np.std(alone, ddof=1)) if len(alone) > 1 else None
    return Estimate(value, value * sqrt(1.94 / (2.0 * len(values))) * sqrt(2.0), spread, len(alone))


# ---- limits


def _grid(log: RobotLog) -> tuple[Array, Array]:
    """All cycles from the first row to the last, and the positions in them; over lost rows they are straight."""
    cycles = np.arange(np.ceil(log.rows[0]), np.floor(log.rows[-1]) + 1.0)
    return cycles, np.stack([np.interp(cycles, log.rows, joint) for joint in log.measured.T], axis=1)


def _speeds(log: RobotLog) -> Array:
    """Speeds of the joints in each cycle from the first row on [rad/s], (m, k): slopes over a few rows."""
    _, positions = _grid(log)
    half = _SLOPE // 2
    padded = np.pad(positions, ((half, half), (0, 0)), mode="edge")
    ways = np.arange(-half, half + 1)
    weights = ways / float(np.square(ways).sum()) / log.cycle
    return sum(weight * padded[place : place + len(positions)] for place, weight in enumerate(weights))  # type: ignore


def _asked(log: RobotLog, dynamics: Dynamics) -> tuple[Array, Array]:
    """Speeds that the loop asks for in each cycle, and what the robot then reports to have done [rad/s], (m, k)."""
    cycles, positions = _grid(log)
    cycle, model = log.cycle, dynamics.model
    held = _held(np.vstack((log.start, log.commands)), int(cycles[-1]) + 1)
    used = cycles - model.reference_delay / cycle
    numbers = np.arange(len(held))
    references = np.stack([np.interp(used, numbers, joint) for joint in held.T], axis=1)
    asked = dynamics.gain * (references - positions)
    if log.speeds is not None:
        fed = _held(np.vstack((0.0 * log.start, log.speeds)), len(held))
        asked += np.stack([np.interp(used, numbers, joint) for joint in fed.T], axis=1)
    seen = cycles + (model.delay + model.lag) / cycle
    return asked, np.stack([np.interp(seen, cycles, joint) for joint in _speeds(log).T], axis=1)


def limited_speeds(log: RobotLog, dynamics: Dynamics) -> tuple[Array, Array]:
    """In each row what the loop asks for beyond the speed of the arm, and how the speed changes, (n, k) each."""
    asked, speeds = _asked(log, dynamics)
    missing, changes = asked - speeds, np.gradient(speeds, axis=0) / log.cycle
    # What comes of the last cycles, and how fast the arm is at both ends, is not in the log.
    changes[: _SLOPE // 2] = 0.0
    changes[len(changes) - int(np.ceil((dynamics.model.delay + dynamics.model.lag) / log.cycle)) - _SLOPE :] = 0.0
    rows = _places(log, len(asked))
    return missing[rows], changes[rows]


def _steady(log: RobotLog) -> Array:
    """The highest speed of each joint where the joint kept to it; 0 where it did not [rad/s], (k,)."""
    speeds = np.abs(_speeds(log))
    most = speeds.max(axis=0)
    return np.where((speeds > (1.0 - _FLAT) * most).sum(axis=0) >= 2 * _LASTING, most, 0.0)


def _places(log: RobotLog, count: int) -> NDArray[np.int_]:
    """The cycle of each row, counted from the first row."""
    return np.asarray(np.clip(np.rint(log.rows - np.ceil(log.rows[0])).astype(int), 0, count - 1))


def limited(log: RobotLog, dynamics: Dynamics) -> Mask:
    """In which rows which joints are slower than the loop asks of them, for longer than a transient, (n, k)."""
    asked, speeds = _asked(log, dynamics)
    cycle = log.cycle
    _, noise = _high_pass(log, log.measured)
    missing = np.sign(asked) * (asked - speeds)
    most = np.maximum(
        _BEHIND * np.abs(asked), np.maximum(_LEAST_BEHIND, 6.0 * np.nan_to_num(noise) / cycle / sqrt(10.0))
    )
    late = missing > most
    found = np.zeros_like(late)
    for joint in range(late.shape[1]):
        edges = np.flatnonzero(np.diff(np.concatenate(([0], late[:, joint].astype(int), [0]))))
        for begin, end in zip(edges[::2], edges[1::2], strict=True):
            if end - begin < _LASTING:
                continue
            before = missing[:begin, joint] > 0.25 * most[:begin, joint]  # from where the joint began to be slower
            begins = begin - _run(before[::-1]) - _LASTING  # it falls behind little by little
            found[max(0, begins) : end, joint] = True
    return found[_places(log, len(found))]


def _run(mask: Mask) -> int:
    """How many are true before the first that is not."""
    return len(mask) if mask.all() else int(np.argmin(mask))


def _limits(logs: Sequence[RobotLog], behind: Sequence[Mask]) -> tuple[Estimate, ...]:
    """The highest speed of each joint that was asked for more and went on at one speed."""
    found = []
    for joint in range(behind[0].shape[1]):
        flat, varies = [], False
        for log, late in zip(logs, behind, strict=True):
            cycles, _ = _grid(log)
            speeds = np.abs(_speeds(log)[:, joint])
            at = np.interp(cycles, log.rows, late[:, joint].astype(float)) > 0.5
            edges = np.flatnonzero(np.diff(np.concatenate(([0], at.astype(int), [0]))))
            for begin, end in zip(edges[::2], edges[1::2], strict=True):
                inside = speeds[begin + 2 * _LASTING : end - _LASTING]
                if len(inside) >= _LASTING:
                    is_flat = float(np.std(inside)) < _FLAT * float(np.median(inside))
                    flat += [float(np.median(inside))] if is_flat else []
                    varies |= not is_flat
        if flat and not varies:
            spread = float(np.std(flat, ddof=1)) if len(flat) > 1 else None
            found.append(Estimate(float(np.mean(flat)), (spread or 0.0) / sqrt(len(flat)), spread, len(flat)))
        elif varies:
            found.append(Estimate(None, reason=message("slower_at_several_speeds")))
        else:
            found.append(Estimate(None, reason=message("never_asked_for_more")))
    return tuple(found)


def shown(estimate: Estimate, unit: str, scale: float = 1.0) -> str:
    """An estimate for people: ``4.98 ± 0.03 1/s``, or that it is not determined and why."""
    if estimate.value is None:
        return f"not determined ({clause(estimate.reason)})" if estimate.reason else "not determined"
    spread = estimate.spread if estimate.spread is not None else estimate.error
    return f"{scale * estimate.value:.4g} ± {scale * spread:.2g} {unit}"
