"""The motion along chunks: where an arm is commanded while each chunk replaces the rest of the ones before.

Each chunk comes as a spline whose position, velocity and acceleration are continuous. Its seam is one segment of fifth
order from what the arm is commanded there, to the position, velocity and acceleration of the new spline a little later.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from abb_protocols.catalogue import message
from abb_protocols.robot.joints import JointLimits, Joints, joints
from yumi.control.chunk_commands import FollowChunk
from yumi.control.motion.setpoint import Setpoint
from yumi.control.motion.spline import Segment, Spline, SplineSampler, TrajectoryPoint, segment_between
from yumi.control.motion.spline_limits import derivative, hull
from yumi.control.trajectory_commands import ResultCode, trajectory_refused

LONGEST_LEAD = 1.6
"""A chunk begins at most so much later than the points before it end [s]."""

_LEADS = (0.1, 0.15, 0.2, 0.3, 0.4, 0.6, 0.8, 1.2, LONGEST_LEAD)  # [s] tried in this order
_SHARES = (0.5, 1.0)  # of the limits, tried in this order: a gentle lead is worth some time
_SHORTEST = 1e-3  # [s] of a chunk that is left
_ROUNDING = 1e-6  # [rad], [rad/s] and so on: what calculating makes of a value at its limit
_KEPT = 0.3  # [s] what was commanded so long ago is asked for: the arm is behind by its delay


class ChunkMotion:
    """The path of an arm along chunks, on a clock of its own; it ends in motion where the points are exhausted.

    Args:
        number: of the newest chunk.
        spline: from the seam on, on the clock of the chunk.
        shift: when the chunk's time 0 is, on the clock of the motion [s].
        points: when points are due that have not been executed, on the clock of the motion [s].
        late: how many points of the chunk are not executed, since they were due already.
        replaced: how many points of the chunks before are not executed any more.
        before: what is followed until the seam; None where the seam is where the motion begins.

    Attributes:
        number: as above.
        late: as above.
        replaced: as above.
        seam: when the lead begins, on the clock of the motion [s].
        joined: when it has arrived on the spline through the points [s].
        end: when the last point is due [s].
        at_end: how the joints move then.
        points: as above.
    """

    def __init__(
        self,
        number: int,
        spline: Spline,
        shift: float,
        points: tuple[float, ...],
        late: int,
        replaced: int,
        before: ChunkMotion | None,
    ) -> None:
        self.number, self.points, self.late, self.replaced = number, points, late, replaced
        self.seam, self.joined = shift + spline.begin, shift + spline.segments[0].end
        self.end = shift + spline.end
        last = spline.last
        self.at_end = Setpoint(joints(last.position), joints(last.velocity), joints(last.acceleration))
        self._sampler, self._shift, self._before = SplineSampler(spline), shift, before

    def motion(self, time: float) -> tuple[Joints, Joints]:
        """Positions [rad] and velocities [rad/s]."""
        if self._before is not None and time < self.seam:
            return self._before.motion(time)
        return self._sampler.motion(time - self._shift)

    def setpoint(self, time: float) -> Setpoint:
        """Positions, velocities and accelerations."""
        if time >= self.end:
            return self.at_end
        if self._before is not None and time < self.seam:
            return self._before.setpoint(time)
        return self._sampler.setpoint(time - self._shift)

    def without_past(self, time: float) -> ChunkMotion:
        """The same, where what lies further back than the arm's delay is forgotten."""
        if self._before is not None and self.seam < time - _KEPT:
            self._before = None
        return self

    def until(self, time: float) -> ChunkMotion:
        """What leads to ``time`` [s]: chunks that would begin later are left out, unless there are none before."""
        motion = self
        while motion._before is not None and motion.seam >= time:
            motion = motion._before
        return motion


def join_chunk(
    chunk: FollowChunk,
    shift: float,
    before: ChunkMotion | Setpoint,
    time: float,
    names: Sequence[str],
    limits: JointLimits,
) -> ChunkMotion:
    """The motion that goes on along a new chunk, without a step in position, velocity and acceleration.

    A chunk that has begun is joined at once; one that begins later, where it begins, or where the points before end.

    Args:
        chunk: the new chunk.
        shift: when the chunk's time 0 is, on the clock of the motion [s].
        before: the motion until now; or how the joints are commanded where there is none.
        time: now, on the clock of the motion [s].
        names: of the joints.
        limits: of the joints.

    Raises:
        TrajectoryRefused: the chunk is over, begins too late, is too far away, or the limits leave no way onto it.
    """
    spline = chunk.spline
    begin, end = shift + spline.begin, shift + spline.end
    if end - time < _SHORTEST:
        raise trajectory_refused(message("chunk_is_over", late=time - end), ResultCode.OLD_HEADER_TIMESTAMP)
    last: ChunkMotion | None
    if isinstance(before, ChunkMotion):
        seam = max(time, min(begin, before.end))
        last = before.without_past(time).until(seam)
        start, points = last.setpoint(seam), before.points
    else:
        seam, last, start, points = time, None, before, ()
    if begin - seam > LONGEST_LEAD:
        raise trajectory_refused(message("chunk_begins_too_late", early=begin - seam, most=LONGEST_LEAD))
    _check_jump(chunk, start, max(seam, begin) - shift, max(0.0, begin - seam), names, limits)
    lead = _lead(spline, start, seam - shift, limits)
    if lead is None:
        raise trajectory_refused(message("chunk_out_of_reach", duration=end - seam))
    due = [begin, *(shift + segment.end for segment in spline.segments)]
    new = [each for each in due if each > time]
    pending = [each for each in points if each > time]
    kept = [each for each in pending if each < new[0] - _SHORTEST and each <= seam] if seam > time else []
    joined = Spline(spline.segments.after(lead), spline.last)
    late, replaced = len(due) - len(new), len(pending) - len(kept)
    return ChunkMotion(chunk.number, joined, shift, (*kept, *new), late, replaced, last)


def _check_jump(
    chunk: FollowChunk, start: Setpoint, time: float, gap: float, names: Sequence[str], limits: JointLimits
) -> None:
    """Refuse a chunk that is elsewhere than the arm: a wrong joint, unit or arm, or a policy that has lost its way."""
    there = SplineSampler(chunk.spline).position(time)
    for name, now, then, speed in zip(names, start.position, there, limits.velocity, strict=True):
        most = chunk.jump + gap * speed
        if not abs(then - now) <= most:  # NaN too
            raise trajectory_refused(message("chunk_jumps", joint=name, distance=then - now, most=most))


def _lead(spline: Spline, start: Setpoint, seam: float, limits: JointLimits) -> Segment | None:
    """The segment from ``start`` at ``seam`` [s] onto the spline, all on the chunk's clock; None within no limits."""
    sampler = SplineSampler(spline)
    ends = list(dict.fromkeys(_ends(spline, seam)))
    for share in _SHARES:
        for end in ends:
            then = sampler.setpoint(end) if end < spline.end else Setpoint(*spline.last[1:])
            lead = segment_between(TrajectoryPoint(seam, *start), TrajectoryPoint(end, *then))
            if _keeps(lead, start, share, limits):
                return lead
    return None


def _ends(spline: Spline, seam: float) -> Iterator[float]:
    """Where a lead may end, the nearest first."""
    for duration in _LEADS:
        end = max(seam + duration, spline.begin)
        if end >= spline.end:
            yield spline.end
            return
        yield end


def _keeps(lead: Segment, start: Setpoint, share: float, limits: JointLimits) -> bool:
    """Whether a lead keeps a share of the limits; it may begin beyond them, and not go further."""
    length = lead.end - lead.begin
    tops = zip(limits.lower, limits.upper, limits.velocity, limits.acceleration, limits.jerk, strict=True)
    for row, position, speed, rate, (lower, upper, fastest, strongest, jerk) in zip(
        lead.rows, *start, tops, strict=True
    ):
        speed_most, rate_most = max(share * fastest, abs(speed)), max(share * strongest, abs(rate))
        bounds = (
            (min(lower, position), max(upper, position)),
            (-speed_most, speed_most),
            (-rate_most, rate_most),
            (-share * jerk, share * jerk),
        )
        polynomial: Sequence[float] = row
        for lowest, highest in bounds:
            low, high = hull(polynomial, length)
            if not (lowest - _ROUNDING <= low and high <= highest + _ROUNDING):  # NaN too
                return False
            polynomial = derivative(polynomial)
    return True
