from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import pairwise
from math import cos, inf, nan, radians, sin, tau
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, ZERO_JOINTS, ArmCommand, ArmState, Joints, joints
from reported_limiter import ReportedLimiter, reportable
from soak import long, short
from trajectories import change_rate
from yumi.control.limiter_state import LimiterState
from yumi.control.motion.robot_response import EGM_GAIN
from yumi.control.shared_state import ArmProblem

DT = 0.004
WANTED = st.tuples(*[st.floats(-100.0, 100.0)] * 7)


def state(position: Joints, *, session: int = 1, dt: float = DT, is_running: bool = True) -> ArmState:
    return ArmState(0.0, dt, session, position, ZERO_JOINTS, position, is_running)


@pytest.fixture
def limiter() -> ReportedLimiter:
    return ReportedLimiter(YUMI_LIMITS)


def moved(position: Joints, index: int, by: float) -> Joints:
    return tuple(value + by * (place == index) for place, value in enumerate(position))  # type: ignore[return-value]


def test_limiter_starts_a_session_with_the_measured_position(limiter: ReportedLimiter, middle: Joints) -> None:
    assert limiter.limit(state(middle), ArmCommand(ZERO_JOINTS)) == ArmCommand(middle)


def test_limiter_comes_to_the_measured_position_within_the_limits_while_the_robot_does_not_follow(
    limiter: ReportedLimiter, middle: Joints
) -> None:
    path = [limiter.limit(state(middle), None).position] * 3
    elsewhere = moved(middle, 0, 0.02)
    path += [limiter.limit(state(elsewhere, is_running=False), ArmCommand(ZERO_JOINTS)).position for _ in range(60)]
    assert path[-1] == pytest.approx(elsewhere, abs=1e-6)
    assert_within_limits(path)


def test_limiter_holds_the_last_sent_command_not_the_measured_position(
    limiter: ReportedLimiter, middle: Joints
) -> None:
    limiter.limit(state(middle), None)
    crept = moved(middle, 1, -0.01)
    assert limiter.limit(state(crept), None) == ArmCommand(middle)


def smooth_path(start: Joints, index: int, distance: float, duration: float) -> list[Joints]:
    """A joint's way over a whole number of cycles, without a jerk at its ends."""
    count = round(duration / DT)
    shares = [k / count - sin(tau * k / count) / tau for k in range(1, count + 1)]
    return [moved(start, index, distance * share) for share in shares]


def follow(limiter: ReportedLimiter, path: Iterable[Joints], start: Joints, *, dt: float = DT) -> list[Joints]:
    """What is sent of a path, for a robot that starts at ``start`` and is where it was sent."""
    places = [start]
    for position in path:
        places.append(limiter.limit(state(places[-1], dt=dt), ArmCommand(position)).position)
    return places[1:]


@pytest.mark.parametrize("index", range(7))
def test_limiter_lets_a_smooth_motion_pass_unchanged(limiter: ReportedLimiter, middle: Joints, index: int) -> None:
    limiter.limit(state(middle), None)
    path = smooth_path(middle, index, 0.3, 1.0)
    assert follow(limiter, path, middle) == path
    assert limiter.counters.slowed == 0


@pytest.mark.parametrize("value", [nan, inf, -inf])
def test_limiter_holds_when_a_command_is_not_finite(limiter: ReportedLimiter, middle: Joints, value: float) -> None:
    limiter.limit(state(middle), None)
    assert limiter.limit(state(middle), ArmCommand(moved(middle, 2, value))) == ArmCommand(middle)
    assert limiter.counters.refused == 1


def test_limiter_holds_when_a_speed_is_not_finite(limiter: ReportedLimiter, middle: Joints) -> None:
    limiter.limit(state(middle), None)
    assert limiter.limit(state(middle), ArmCommand(middle, moved(ZERO_JOINTS, 0, nan))) == ArmCommand(middle)


@pytest.mark.parametrize("index", range(7))
@pytest.mark.parametrize("direction", [-1.0, 1.0])
def test_limiter_stops_each_joint_at_its_range(limiter: ReportedLimiter, index: int, direction: float) -> None:
    limit = (YUMI_LIMITS.upper if direction > 0 else YUMI_LIMITS.lower)[index]
    limiter.limit(state(ZERO_JOINTS), None)
    path = follow(limiter, [moved(ZERO_JOINTS, index, limit + direction)] * 1000, ZERO_JOINTS)
    assert path[-1][index] == pytest.approx(limit)
    assert all(abs(position[index]) <= abs(limit) for position in path)
    assert limiter.counters.position_limited == 1000


_OUTSIDE = 0.01 - 1e-12  # what a datagram's degrees round to is still no more than 0.01
OUTSIDE_BY = st.tuples(*[st.floats(-_OUTSIDE, _OUTSIDE)] * 7)


@given(outside_by=OUTSIDE_BY, wanted=st.lists(WANTED | st.none(), max_size=5))
def test_limiter_sends_no_position_out_of_range_to_an_arm_that_stands_a_little_outside(
    outside_by: Joints, wanted: list[Joints | None]
) -> None:
    """Nor leads it back to its range harder than a joint may accelerate."""
    limiter = ReportedLimiter(YUMI_LIMITS)
    rows = zip(YUMI_LIMITS.lower, YUMI_LIMITS.upper, outside_by, strict=True)
    start = joints([high + by if by > 0.0 else low + by for low, high, by in rows])
    first = limiter.limit(state(start), None)
    places = [first.position]
    for position in wanted:
        command = None if position is None else ArmCommand(position)
        places.append(limiter.limit(state(start), command).position)
    assert all(YUMI_LIMITS.outside(place) is None for place in places)
    rows = zip(first.position, start, YUMI_LIMITS.acceleration, strict=True)
    assert all(EGM_GAIN * abs(to - now) <= top * DT for to, now, top in rows)


def test_limiter_brings_an_arm_back_into_its_range_no_faster_than_it_may_move(limiter: ReportedLimiter) -> None:
    outside = moved(ZERO_JOINTS, 1, YUMI_LIMITS.upper[1] + 0.01)
    path = [limiter.limit(state(outside), None).position]
    assert path[0] == moved(ZERO_JOINTS, 1, YUMI_LIMITS.upper[1])
    path += follow(limiter, [ZERO_JOINTS] * 300, path[0])
    assert path[-1] == pytest.approx(ZERO_JOINTS, abs=1e-6)
    assert max(before[1] - after[1] for before, after in pairwise(path)) <= YUMI_LIMITS.velocity[1] * DT * 1.001


@pytest.mark.parametrize("by", [0.011, 0.05, 0.11])
def test_limiter_does_not_answer_an_arm_that_stands_further_outside(limiter: ReportedLimiter, by: float) -> None:
    outside = moved(ZERO_JOINTS, 1, YUMI_LIMITS.upper[1] + by)
    for _ in range(30):
        assert limiter.check(state(outside)) is None
    assert limiter.problem is ArmProblem.IMPLAUSIBLE


def rates(path: list[Joints], dt: float) -> list[Joints]:
    return [joints([(new - old) / dt for old, new in zip(*pair, strict=True)]) for pair in pairwise(path)]


@given(wanted=st.lists(WANTED, min_size=2, max_size=12), hold=st.integers(1, 30), dt=st.floats(0.002, 0.02))
def test_limiter_keeps_speed_acceleration_and_jerk_whatever_is_asked(
    wanted: list[Joints], hold: int, dt: float
) -> None:
    limiter = ReportedLimiter(YUMI_LIMITS)
    path = [limiter.limit(state(ZERO_JOINTS), None).position] * 3
    path += follow(limiter, [position for position in wanted for _ in range(hold)], ZERO_JOINTS, dt=dt)
    velocities = rates(path, dt)
    accelerations = rates(velocities, dt)
    for values, limits in ((velocities, YUMI_LIMITS.velocity), (accelerations, YUMI_LIMITS.acceleration)):
        for value in values:
            assert all(abs(one) <= limit * 1.001 + 1e-6 for one, limit in zip(value, limits, strict=True))
    for value in rates(accelerations, dt):
        assert all(abs(one) <= 1.05 * limit + 1e-3 for one, limit in zip(value, YUMI_LIMITS.jerk, strict=True))
    assert all(YUMI_LIMITS.outside(position) is None for position in path)


def assert_within_limits(path: list[Joints]) -> None:
    """In range, and no faster, nor accelerated or jerked more, than the joints may be."""
    assert all(YUMI_LIMITS.outside(position) is None for position in path)
    velocities = rates(path, DT)
    accelerations = rates(velocities, DT)
    bounded = ((velocities, "velocity"), (accelerations, "acceleration"), (rates(accelerations, DT), "jerk"))
    for values, name in bounded:
        shares = [abs(one) / top for each in values for one, top in zip(each, getattr(YUMI_LIMITS, name), strict=True)]
        assert max(shares) < (1.2 if name == "jerk" else 1.001), name


def wandering(random: Random, cycles: int) -> Iterator[Joints]:
    """Positions that move as hard as the joints may, most of the time, and sometimes jump; all over their range."""
    place, speed, gain, aim = list(ZERO_JOINTS), list(ZERO_JOINTS), list(ZERO_JOINTS), list(ZERO_JOINTS)
    for _ in range(cycles):
        if random.random() < 0.03:
            aim = [random.choice((-1.0, 0.0, 1.0)) * top for top in YUMI_LIMITS.acceleration]
        if random.random() < 0.02:
            place = [random.uniform(*ends) for ends in zip(YUMI_LIMITS.lower, YUMI_LIMITS.upper, strict=True)]
            speed, gain = list(ZERO_JOINTS), list(ZERO_JOINTS)
        for index, (top, jerk) in enumerate(zip(YUMI_LIMITS.velocity, YUMI_LIMITS.jerk, strict=True)):
            gain[index] += max(-jerk * DT, min(jerk * DT, aim[index] - gain[index]))
            if abs(speed[index] + gain[index] * DT) > top:
                gain[index] = 0.0
            speed[index] += gain[index] * DT
            place[index] += speed[index] * DT
        yield joints(place)


@pytest.mark.parametrize("seed", range(20))
def test_limiter_keeps_its_bounds_between_motions_at_the_limits_and_jumps(limiter: ReportedLimiter, seed: int) -> None:
    """Also while a joint is on its way to a goal that moves, turns back, or leads past the end of the range."""
    path = [limiter.limit(state(ZERO_JOINTS), None).position] * 3
    for wanted in wandering(Random(seed), 300):
        path += follow(limiter, [wanted], path[-1])
        limiter.observe(state(path[-1]))
    velocities = rates(path, DT)
    accelerations = rates(velocities, DT)
    bounded = ((velocities, "velocity"), (accelerations, "acceleration"), (rates(accelerations, DT), "jerk"))
    for values, name in bounded:
        shares = [abs(one) / top for each in values for one, top in zip(each, getattr(YUMI_LIMITS, name), strict=True)]
        assert max(shares) < 1.001, name
    assert all(YUMI_LIMITS.outside(position) is None for position in path)


@pytest.mark.parametrize("speed_deg", [2.0, 5.0, 10.0, 40.0])
@pytest.mark.parametrize("seed", range(5))
def test_slow_limiter_keeps_its_speed_and_never_fails(seed: int, speed_deg: float) -> None:
    """Goals that are much faster than the joints may be, and cycles of uneven length."""
    random, limits = Random(seed), YUMI_LIMITS.slowed_to(radians(speed_deg))
    limiter, place = ReportedLimiter(limits), ZERO_JOINTS
    limiter.limit(state(ZERO_JOINTS), None)
    for wanted in wandering(random, 300):
        dt = random.uniform(0.001, 0.005)
        (now,) = follow(limiter, [wanted], place, dt=dt)
        assert all(abs(new - old) <= 1.03 * top * dt for old, new, top in zip(place, now, limits.velocity, strict=True))
        place = now


@pytest.mark.parametrize("noise", [1e-6, 1e-5, 3e-5])
def test_limiter_follows_a_noisy_goal_without_shaking(limiter: ReportedLimiter, noise: float) -> None:
    random, place = Random(1), ZERO_JOINTS
    limiter.limit(state(ZERO_JOINTS), None)
    late = []
    for count in range(1000):
        true = 0.25 * (1.0 - cos(2.0 * count * DT))
        (place,) = follow(limiter, [moved(ZERO_JOINTS, 0, true + random.gauss(0.0, noise))], place)
        limiter.observe(state(place))
        late.append(abs(place[0] - true))
    assert max(late) < 3e-3


@given(wanted=st.lists(WANTED | st.none(), min_size=1, max_size=20), dt=st.floats(0.0, 1.0))
def test_limiter_never_steps_by_more_than_velocity_times_dt(wanted: list[Joints | None], dt: float) -> None:
    limiter = ReportedLimiter(YUMI_LIMITS)
    last = limiter.limit(state(ZERO_JOINTS), None).position
    for position in wanted:
        now = limiter.limit(state(ZERO_JOINTS, dt=dt), None if position is None else ArmCommand(position)).position
        for old, new, speed in zip(last, now, YUMI_LIMITS.velocity, strict=True):
            assert abs(new - old) <= speed * min(dt, CYCLE) * 1.001 + 1e-9
        last = now


def test_limiter_arrives_at_a_step_without_overshoot_and_stays(limiter: ReportedLimiter, middle: Joints) -> None:
    limiter.limit(state(middle), None)
    goal = moved(middle, 0, 0.5)
    path = follow(limiter, [goal] * 300, middle)
    assert path[-1] == pytest.approx(goal, abs=1e-9)
    assert max(position[0] for position in path) <= goal[0] + 1e-9
    assert limiter.counters.slowed > 0


def test_limiter_catches_up_with_a_moving_goal(limiter: ReportedLimiter, middle: Joints) -> None:
    """A jump onto a ramp: afterwards the ramp is followed without lag."""
    limiter.limit(state(middle), None)
    ramp = [moved(middle, 3, 0.2 + 1.0 * DT * count) for count in range(200)]
    assert follow(limiter, ramp, middle)[-1] == pytest.approx(ramp[-1], abs=1e-6)


@pytest.mark.parametrize("gap", [1, 5, 12])
def test_limiter_catches_up_after_a_gap_and_does_not_swing_about_its_goal(
    limiter: ReportedLimiter, middle: Joints, gap: int
) -> None:
    limiter.limit(state(middle), None)
    path = smooth_path(middle, 3, 0.5, 1.0)
    before, after = path[:100], path[100 + gap :]
    follow(limiter, before, middle)
    first = limiter.limit(state(before[-1], dt=(gap + 1) * DT), ArmCommand(after[0])).position
    sent = follow(limiter, after[1:], first)
    assert sent[60:] == after[61:]
    late = [goal[3] - position[3] for goal, position in zip(after[1:], sent, strict=True)]
    assert min(late) > -0.1 * max(late)


def hears(planned: Joints, command: ArmCommand) -> Joints:
    """Where a robot plans to be one cycle after it got ``command``."""
    rows = zip(planned, command.position, command.velocity, strict=True)
    return joints([now + DT * (EGM_GAIN * (ahead - now) + speed) for now, ahead, speed in rows])


def test_limiter_takes_its_lead_back_when_it_has_to_hold_then_stays(limiter: ReportedLimiter, middle: Joints) -> None:
    limiter.limit(state(middle), None)
    planned, path, leads = middle, [], []
    for cycle in range(480):
        command = limiter.limit(state(planned), ArmCommand(moved(middle, 0, 1.0)) if cycle < 80 else None)
        path.append(command.position)
        leads.append(command.position[0] - planned[0])
        planned = hears(planned, command)
    assert leads[79] > 0.3
    assert path[-1] == pytest.approx(planned, abs=2e-4)
    assert path[-1] == path[-50]
    assert_within_limits(path[79:])


@pytest.mark.parametrize("direction", [-1.0, 1.0])
def test_limiter_notices_a_robot_that_does_not_get_its_commands_and_does_not_run_away_from_it(
    limiter: ReportedLimiter, middle: Joints, direction: float
) -> None:
    limiter.limit(state(middle), None)
    goal = moved(middle, 0, direction)
    told, waits, noticed = [], [], []
    for _ in range(500):
        told.append(limiter.limit(state(middle), ArmCommand(goal)))
        limiter.observe(state(middle))
        waits.append(limiter.is_waiting)
        noticed.append(limiter.problem is ArmProblem.REFERENCES_IGNORED)
    assert noticed.index(True) * DT < 0.3
    assert all(noticed[noticed.index(True) :])
    # Were it to hear any of them, it would set out no faster than four cycles of the command and one of acceleration.
    path = [each.position for each in told]
    travel = max(abs(later[0] - now[0]) for now, later in zip(path, path[4:], strict=False))
    speeds = [EGM_GAIN * (each.position[0] - middle[0]) + each.velocity[0] for each in told]
    assert max(map(abs, speeds)) < EGM_GAIN * travel + YUMI_LIMITS.acceleration[0] * DT
    # It stops at once where it is not heard: to brake would lead further ahead.
    stop = waits.index(True)
    assert_within_limits(path[:stop])
    assert_within_limits(path[stop:])
    assert abs(told[-1].position[0] - middle[0]) < 2e-3

    planned, velocity = middle, ZERO_JOINTS
    for _ in range(600):
        now = state(planned)._replace(velocity=velocity)
        last, planned = planned, hears(planned, limiter.limit(now, ArmCommand(goal)))
        limiter.observe(now)
        (velocity,) = rates([last, planned], DT)
    assert limiter.problem is ArmProblem.NONE
    assert planned == pytest.approx(goal, abs=1e-3)


@pytest.mark.parametrize("gain", [0.1, 0.5, 1.0, 1.6])
@pytest.mark.parametrize("top", [0.01, 0.2, 10.0])
def test_limiter_does_not_report_a_slow_robot_as_ignoring_references(middle: Joints, gain: float, top: float) -> None:
    """Low gains, and a MaxSpeedDeviation that the limiter does not know of; two cycles of delay."""
    limiter, planned = ReportedLimiter(YUMI_LIMITS, gain=gain * EGM_GAIN), middle
    limiter.limit(state(middle), None)
    late = [ArmCommand(middle)] * 3
    for count in range(2000):
        goal = moved(middle, 1, 0.5 * sin(count * DT))
        late = [*late[1:], limiter.limit(state(planned), ArmCommand(goal) if count % 500 < 400 else None)]
        rows = zip(planned, late[0].position, late[0].velocity, strict=True)
        speeds = [gain * EGM_GAIN * (ahead - now) + speed for now, ahead, speed in rows]
        planned = joints([now + DT * max(-top, min(top, v)) for now, v in zip(planned, speeds, strict=True)])
        limiter.observe(state(planned))
        assert limiter.problem is ArmProblem.NONE


@pytest.mark.parametrize("seconds", [short(20.0), long(600.0, 600.0)])
@pytest.mark.parametrize(("noise", "deadband"), [(0.0, 1e-5), (0.0, 1e-4), (5e-5, 0.0), (2e-4, 0.0)])
def test_limiter_does_not_report_a_robot_at_rest_as_ignoring_references(
    limiter: ReportedLimiter, middle: Joints, noise: float, deadband: float, seconds: float
) -> None:
    """One that settles a little short, and one whose measured positions a controller turns into noise of its goals."""
    planned, random, command = middle, Random(1), ArmCommand(middle)
    for count in range(round(seconds / DT)):
        rows = zip(planned, command.position, command.velocity, strict=True)
        planned = joints(
            [now + DT * (EGM_GAIN * (to - now) + speed) * (abs(to - now) > deadband) for now, to, speed in rows]
        )
        seen = joints([now + random.gauss(0.0, noise) for now in planned]) if noise else planned
        checked = limiter.check(ArmState(count * DT, DT * bool(count), 1, seen, ZERO_JOINTS, planned, is_running=True))
        assert checked is not None
        goal = joints([now + 1.2 * (to + 0.1 - now) for now, to in zip(seen, middle, strict=True)])
        command = limiter.limit(checked, ArmCommand(goal))
        limiter.observe(checked)
        assert limiter.problem is ArmProblem.NONE
    assert planned == pytest.approx([value + 0.1 for value in middle], abs=2e-3)


@pytest.mark.parametrize("distance", [0.008, 0.015, 0.2])
def test_limiter_does_not_report_a_robot_that_ramps_in_slowly(
    limiter: ReportedLimiter, middle: Joints, distance: float
) -> None:
    planned, command = middle, ArmCommand(middle)
    for count in range(2500):
        fade = min(1.0, count * DT / 10.0)
        rows = zip(planned, command.position, command.velocity, strict=True)
        planned = joints([now + DT * fade * (EGM_GAIN * (to - now) + speed) for now, to, speed in rows])
        command = limiter.limit(state(planned), ArmCommand(moved(middle, 0, distance)) if count > 5 else None)
        limiter.observe(state(planned))
        assert limiter.problem is ArmProblem.NONE


@pytest.mark.parametrize("rested_for", [0.0, 0.05, 0.1, 5.0])
def test_limiter_notices_within_300_ms_that_references_are_ignored_when_a_controller_rested_before(
    limiter: ReportedLimiter, middle: Joints, rested_for: float
) -> None:
    """Whenever the motion begins within the time that is looked at."""
    random, since = Random(1), 0.0
    goal = middle
    for count in range(round((rested_for + 0.3) / DT)):
        if count * DT >= rested_for:
            goal, since = moved(middle, 0, 0.2), since + DT
        near = joints([value + random.gauss(0.0, 3e-5) for value in goal])  # never at rest
        limiter.limit(state(middle), ArmCommand(near))
        limiter.observe(state(middle))
        if limiter.problem is ArmProblem.REFERENCES_IGNORED:
            break
    assert limiter.problem is ArmProblem.REFERENCES_IGNORED
    assert 0.05 < since < 0.3


@pytest.mark.parametrize("noise", [0.0, 3e-6, 1e-5, 1e-4])
def test_limiter_that_held_goes_to_the_next_goal_whatever_the_noise_of_the_plan(
    limiter: ReportedLimiter, middle: Joints, noise: float
) -> None:
    random, planned, command = Random(1), middle, ArmCommand(middle)
    goal = moved(middle, 0, 0.2)
    for count in range(1200):
        planned = hears(planned, command)
        told = joints([now + random.gauss(0.0, noise) for now in planned])
        is_held = 80 <= count < 82  # in full motion, and a moment only
        checked = limiter.check(state(told))
        assert checked is not None
        command = limiter.limit(checked, None if is_held else ArmCommand(goal))
        limiter.observe(checked)
        if count == 400:
            assert limiter.state is LimiterState.FOLLOWING
    assert planned == pytest.approx(goal, abs=1e-3)


@pytest.mark.parametrize("jump", [radians(2.0), radians(5.0), radians(30.0), 10.0, -10.0])
def test_limiter_goes_on_when_one_position_cannot_be_true(
    limiter: ReportedLimiter, middle: Joints, jump: float
) -> None:
    limiter.limit(state(middle), None)
    path, place = [middle] * 3, middle
    for count, wanted in enumerate(smooth_path(middle, 0, 0.3, 1.0)):
        told = moved(place, 0, jump) if count in {50, 120} else place
        place = limiter.limit(state(told), ArmCommand(wanted)).position
        limiter.observe(state(told))
        path.append(place)
    assert limiter.counters.implausible == 2
    assert limiter.problem is ArmProblem.NONE
    assert_within_limits(path)
    assert path[-1] == pytest.approx(moved(middle, 0, 0.3), abs=1e-6)


def test_limiter_holds_where_it_is_while_positions_cannot_be_true_and_goes_on_afterwards(
    limiter: ReportedLimiter, middle: Joints
) -> None:
    """Those of the other arm, say; however long they come, they are not checked."""
    limiter.limit(state(middle), None)
    goal, elsewhere = moved(middle, 0, 0.5), moved(middle, 3, -0.8)
    path = [middle] * 3
    path += follow(limiter, [goal] * 40, middle)
    last = path[-1]
    for _ in range(1000):
        path.append(limiter.limit(state(elsewhere), ArmCommand(goal)).position)
    assert limiter.problem is ArmProblem.IMPLAUSIBLE
    assert path[-1] == path[-500]
    assert path[-1][3] == last[3]
    path += follow(limiter, [goal] * 300, path[-1])
    assert limiter.problem is ArmProblem.NONE
    assert path[-1] == pytest.approx(goal, abs=1e-6)
    assert_within_limits(path)


@pytest.mark.parametrize("distance", [1.0, 0.05])
def test_robot_that_follows_feels_no_step_when_a_session_begins_in_its_motion(
    limiter: ReportedLimiter, middle: Joints, distance: float
) -> None:
    command = limiter.limit(state(middle), None)
    planned, speeds, withheld = middle, [], 0
    for count in range(400):
        now = ArmState(count * DT, DT, 1 if count < 30 else 2, planned, ZERO_JOINTS, planned, is_running=True)
        checked = limiter.check(now)
        if checked is None:  # it goes on by the last command
            withheld += 1
            assert count == 29 + withheld
        else:
            command = limiter.limit(checked, ArmCommand(moved(middle, 0, distance)) if count < 30 else None)
            limiter.observe(checked)
        before, planned = planned, hears(planned, command)
        speeds.append((planned[0] - before[0]) / DT)
    assert 20 < withheld < 250
    changes = [abs(new - old) for old, new in pairwise(speeds[29:])]
    assert max(changes) < YUMI_LIMITS.acceleration[0] * DT
    assert abs(speeds[-1]) < 1e-3


def test_limiter_begins_where_the_robot_stands_when_its_new_session_does_not_follow_the_last_command(
    limiter: ReportedLimiter, middle: Joints
) -> None:
    limiter.limit(state(middle), None)
    planned = before = middle
    for count in range(60):
        now = ArmState(count * DT, DT, 1, planned, change_rate(planned, before, DT), planned, is_running=True)
        before, planned = planned, hears(planned, limiter.limit(now, ArmCommand(moved(middle, 0, 1.0))))
    planned = reportable(planned)
    sent_at, first = 59 * DT, ArmState(0.0, DT, 2, planned, ZERO_JOINTS, planned, is_running=True)
    for count in range(62, 59 + 250):  # as long as it could follow the last command
        assert limiter.check(first._replace(time=count * DT)) is None
    begun = first._replace(time=sent_at + 1.001)
    checked = limiter.check(begun)
    assert checked == begun._replace(dt=0.0)
    assert limiter.limit(checked, None) == ArmCommand(planned)


@pytest.mark.parametrize("late", [(0,), (1,), (3, 5, 7)])
def test_no_late_datagram_in_a_session_hides_that_the_last_command_leads_its_robot(
    limiter: ReportedLimiter, middle: Joints, late: tuple[int, ...]
) -> None:
    """The robot stands where its session has begun, which is less from the last command than can be known as false."""
    limiter.limit(state(middle), None)
    there = reportable(moved(middle, 0, 0.019))
    for count in range(10):
        now = state(middle if count in late else there, session=2, dt=DT * bool(count))._replace(time=0.3 + count * DT)
        assert limiter.check(now) is None
    begun = state(there, session=2)._replace(time=1.001)
    checked = limiter.check(begun)
    assert checked is not None
    assert limiter.limit(checked, None) == ArmCommand(there)


@pytest.mark.parametrize("late", [(0,), (1,), (2, 4, 6)])
def test_no_session_begins_where_a_late_datagram_alone_says_that_its_robot_stands(
    limiter: ReportedLimiter, middle: Joints, late: tuple[int, ...]
) -> None:
    """After the robot could follow the last command."""
    limiter.limit(state(middle), None)
    there, commands = reportable(moved(middle, 0, 0.019)), []
    for count in range(10):
        now = state(middle if count in late else there, session=2, dt=DT * bool(count))._replace(time=2.0 + count * DT)
        checked = limiter.check(now)
        if checked is not None:
            commands.append(limiter.limit(checked, None))
            limiter.observe(checked)
    assert commands == [ArmCommand(there)] * len(commands)
    assert len(commands) >= 2


@pytest.mark.parametrize("later", [0.3, 2.0])  # while the robot may follow the last command, and after
@pytest.mark.parametrize("between", ["another session", "elsewhere", "interruption"])
def test_two_datagrams_that_let_a_session_begin_are_of_that_session_and_in_a_row(
    limiter: ReportedLimiter, middle: Joints, between: str, later: float
) -> None:
    limiter.limit(state(middle), None)
    first, here = (state(middle, session=2)._replace(time=later + count * DT) for count in range(2))
    assert limiter.check(first) is None
    if between == "another session":
        here = here._replace(session=3)
    elif between == "elsewhere":
        assert limiter.check(here._replace(planned=moved(middle, 0, 0.5))) is None
    else:
        limiter.note_interruption()
        here = here._replace(dt=0.0)
    assert limiter.check(here) is None
    assert limiter.check(here._replace(time=later + 2 * DT, dt=DT)) is not None


@pytest.mark.parametrize("gain", [0.0, 0.5 * EGM_GAIN, EGM_GAIN, 4.0 * EGM_GAIN])
@pytest.mark.parametrize(("apart", "begins"), [(0.009, True), (0.011, False)])
def test_session_begins_where_two_datagrams_show_the_robot_within_the_same_distance_at_every_gain(
    middle: Joints, gain: float, apart: float, *, begins: bool
) -> None:
    limiter = ReportedLimiter(YUMI_LIMITS, gain=gain)
    limiter.limit(state(middle), None)
    assert limiter.check(state(middle, session=2)._replace(time=5.0)) is None
    there = state(reportable(moved(middle, 0, apart)), session=2)._replace(time=5.0 + DT)
    assert (limiter.check(there) is not None) == begins


def test_session_goes_on_from_the_last_command_when_two_datagrams_show_that_it_leads_nowhere(
    limiter: ReportedLimiter, middle: Joints
) -> None:
    limiter.limit(state(middle), None)
    here = state(moved(middle, 0, 0.005), session=2, dt=0.0)
    assert limiter.check(here._replace(time=0.3)) is None
    checked = limiter.check(here._replace(time=0.3 + DT, dt=DT))
    assert checked is not None
    assert limiter.limit(checked, None) == ArmCommand(middle)


def test_limiter_does_not_answer_a_session_that_begins_far_out_of_range(
    limiter: ReportedLimiter, middle: Joints
) -> None:
    assert limiter.check(state(moved(middle, 1, 2.0))) is None
    assert limiter.check(state(middle)) is not None  # and should the cycle fail then, the next one begins
    assert limiter.limit(state(middle), None) == ArmCommand(middle)


def test_limiter_does_not_begin_in_a_new_session_where_the_arm_cannot_have_got_since_it_was_last_heard(
    limiter: ReportedLimiter, middle: Joints
) -> None:
    """In range, of a robot that follows no earlier command any more: joint 1 turns by 180° a second."""
    start = moved(middle, 0, -2.5)
    path = [limiter.limit(state(start), None)]
    far = reportable(moved(start, 0, 5.0))
    assert YUMI_LIMITS.outside(far) is None
    for session, time in ((2, 1.2), (3, 1.5)):
        too_soon = state(far, session=session, dt=0.0)._replace(time=time)
        assert limiter.check(too_soon) is None
        path.append(limiter.limit(too_soon, None))
    assert path == [ArmCommand(start)] * 3
    assert limiter.implausible_position == far
    in_time = state(far, session=4, dt=0.0)._replace(time=1.6)
    assert limiter.check(in_time) is None  # one datagram alone may be late
    assert limiter.limit(in_time._replace(time=1.6 + DT, dt=DT), None) == ArmCommand(far)


@pytest.mark.parametrize("is_running", [True, False])
def test_limiter_never_believes_positions_that_agree_with_each_other_but_not_with_the_robots_plan(
    limiter: ReportedLimiter, middle: Joints, is_running: bool
) -> None:
    """A robot without motors may be moved by hand: there it is believed when its plan is there, too."""
    limiter.limit(state(middle), None)
    elsewhere = moved(middle, 0, 0.5)
    there = state(elsewhere, is_running=is_running)
    for count in range(60):
        checked = limiter.check(there._replace(planned=middle, time=count * DT))
        assert checked is not None
        assert checked.position == middle
        assert limiter.limit(checked, None) == ArmCommand(middle)
        assert limiter.counters.implausible == count + 1
    assert limiter.problem is ArmProblem.IMPLAUSIBLE
    for count in range(60, 90):
        checked = limiter.check(there._replace(time=count * DT))
        assert checked is not None
        assert checked.position == (middle if is_running else elsewhere)


def test_limiter_does_not_begin_where_the_robots_plan_is_not(limiter: ReportedLimiter, middle: Joints) -> None:
    assert limiter.check(state(moved(middle, 0, 0.5))._replace(planned=middle)) is None
    assert limiter.check(state(middle)) is not None


def test_limiter_does_nothing_in_no_time(limiter: ReportedLimiter, middle: Joints) -> None:
    limiter.limit(state(middle), None)
    assert limiter.limit(state(middle, dt=0.0), ArmCommand(moved(middle, 0, 1.0))).position == middle


def test_limiter_limits_fed_forward_speeds_and_their_change(limiter: ReportedLimiter, middle: Joints) -> None:
    limiter.limit(state(middle), None)
    fast: Joints = (100.0, -100.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    planned, speeds = middle, []
    for _ in range(100):
        command = limiter.limit(state(planned), ArmCommand(planned, fast))
        before, planned = planned, hears(planned, command)
        speeds.append(change_rate(planned, before, DT))
    gentlest = YUMI_LIMITS.jerk[0] * DT * DT
    assert speeds[0][:2] == pytest.approx((gentlest, -gentlest))
    steps = [(new[0] - old[0]) / DT for old, new in pairwise(speeds)]
    assert max(steps) == pytest.approx(YUMI_LIMITS.acceleration[0], rel=0.05)
    assert command.velocity[:2] == pytest.approx((YUMI_LIMITS.velocity[0], -YUMI_LIMITS.velocity[1]), rel=0.03)
    assert max(map(abs, speeds[-1])) < 1.001 * YUMI_LIMITS.velocity[0]


@pytest.mark.parametrize("gain", [0.0, EGM_GAIN])
def test_limiter_does_not_feed_an_old_speed_to_an_arm_that_stands_in_a_new_session(middle: Joints, gain: float) -> None:
    limiter = ReportedLimiter(YUMI_LIMITS, gain=gain)
    planned, speed, command = middle, 0.0, None
    for count in range(150):
        now = ArmState(count * DT, DT * bool(count), 1, planned, ZERO_JOINTS, planned, is_running=True)
        checked = limiter.check(now)
        assert checked is not None
        speed = min(1.0, speed + 0.05)
        command = limiter.limit(checked, ArmCommand(planned, moved(ZERO_JOINTS, 0, speed)))
        limiter.observe(checked)
        planned = moved(planned, 0, DT * command.velocity[0])
    assert command is not None
    assert command.velocity[0] == pytest.approx(1.0, abs=0.1)
    first = ArmState(0.9, 0.0, 2, planned, ZERO_JOINTS, planned, is_running=True)
    assert limiter.check(first) is None  # it might follow the last command
    for later in range(1, 149):
        assert limiter.check(first._replace(time=0.9 + later * DT, dt=DT)) is None
    checked = limiter.check(first._replace(time=149 * DT + 1.001, dt=DT))
    assert checked is not None
    assert limiter.limit(checked, None) == ArmCommand(planned)


@pytest.mark.parametrize("noise", [0.0, 1e-5, 1e-4])
def test_arm_that_was_held_stays_where_something_else_has_moved_it(
    limiter: ReportedLimiter, middle: Joints, noise: float
) -> None:
    """It is held, stops following, is moved by RAPID or a hand, then follows again while nothing is desired."""
    random, time, planned, command = Random(1), 0.0, middle, ArmCommand(middle)

    def step(desired: ArmCommand | None, *, is_running: bool = True) -> None:
        nonlocal time, planned, command
        time += DT
        if is_running:
            rows = zip(planned, command.position, command.velocity, strict=True)
            planned = joints([now + DT * (EGM_GAIN * (sent - now) + speed) for now, sent, speed in rows])
        measured = joints([now + random.gauss(0.0, noise) for now in planned])
        checked = limiter.check(ArmState(time, DT, 1, measured, ZERO_JOINTS, planned, is_running))
        if checked is not None:
            command = limiter.limit(checked, desired)
            limiter.observe(checked)

    for _ in range(50):
        step(None, is_running=False)
    for cycle in range(300):
        step(ArmCommand(moved(middle, 0, min(0.2, 0.3 * DT * cycle))))
    for _ in range(300):
        step(None)
    for _ in range(1000):
        planned = moved(planned, 0, -0.3 * DT * (planned[0] > middle[0] - 0.3))
        step(None, is_running=False)
    left = planned
    for _ in range(700):
        step(None)
        assert planned == pytest.approx(left, abs=2e-3)


@pytest.mark.parametrize("gain", [0.0, EGM_GAIN])
def test_speed_that_has_faded_is_none(gain: float, middle: Joints) -> None:
    """Not seven zeros: who looks whether an arm is to move would see a speed."""
    limiter, planned = ReportedLimiter(YUMI_LIMITS, gain=gain), middle
    limiter.limit(state(middle), None)
    for cycle in range(400):
        desired = ArmCommand(planned, moved(ZERO_JOINTS, 6, 0.001)) if cycle < 30 else None
        command = limiter.limit(state(planned), desired)
        limiter.observe(state(planned))
        planned = moved(planned, 6, DT * command.velocity[6])
    assert command.velocity is ZERO_JOINTS
    assert limiter.is_at_rest
