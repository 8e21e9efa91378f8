"""Replies lost over real sockets while both arms move as fast as they may, measured at the robot's side."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import accumulate, pairwise
from math import radians

import pytest
from tapped_controller import TappedController
from wire_faults import Tapped, center

import yumi
from abb_protocols.egm.codec import MotorState, SensorCodec
from abb_protocols.errors import YumiError
from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, ZERO_JOINTS, Joints, Side, joints
from abb_runtime.clock import SystemClock
from abb_runtime.fault_command import fault as fault_command
from abb_runtime.faults import Fault, FaultDirection
from soak import tell
from trajectories import change_rate
from yumi.api.motion_registry import Motion
from yumi.api.robot import Robot
from yumi.control.motion.robot_response import EGM_GAIN

pytestmark = pytest.mark.timeout(300)

ROUNDS = 10
LOST = (0.06, 0.1, 0.15, 0.25, 0.4)  # [s]
FAST, MOVES = radians(120.0), radians(0.01)  # [rad/s] of a command; [rad]
MISSED = 5
"""Commands that the robot may have missed when it gets one again: their way is what reaches it at once."""

TURN = radians(110.0)
PATIENCE = 20.0  # [s]
Begin = Callable[[Robot, float], tuple[Motion, ...]]


def turned(side: Side, angle: float) -> Joints:
    """Two joints turned by ``angle`` [rad], with room on all sides."""
    signs = {4: 1.0, 6: -1.0}
    return joints([value + signs.get(index, 0.0) * angle for index, value in enumerate(center(side))])


def move_to(robot: Robot, angle: float) -> tuple[Motion, ...]:
    return robot.move_to(**{side.word: turned(side, angle) for side in Side}, wait=False)


def follow(robot: Robot, angle: float) -> tuple[Motion, ...]:
    return robot.follow(**{side.word: [(2.0, turned(side, angle), ZERO_JOINTS)] for side in Side}, wait=False)


BEGINS: dict[str, Begin] = {"goals": move_to, "trajectories": follow}


class Losses:
    """A virtual robot in a process of its own, and a script that moves both of its arms.

    Attributes:
        worst: by how much the planned speed of a joint changed in a cycle, as a share of what is allowed, so far.
        went_on: after how many losses both motions reached their goals.
    """

    def __init__(self, robot: Robot, controller: TappedController) -> None:
        self.worst = 0.0
        self.went_on = 0
        self._robot, self._controller = robot, controller
        self._clock = SystemClock()
        self._angle = TURN

    def passed(self, side: Side) -> Tapped:
        return self._controller.passed[side]

    def until(self, is_so: Callable[[], bool]) -> None:
        end = self._clock.now() + PATIENCE
        while not is_so():
            assert self._clock.now() < end, f"did not happen within {PATIENCE} s"
            self._clock.wait(CYCLE)
            self._controller.read()

    def lose(self, begin: Begin, seconds: float, *, at_speed: bool) -> None:
        """Lose the replies to both arms for a time, in the middle of a motion or as it begins."""
        self._robot.recover()
        self._robot.move_to(**{side.word: turned(side, -self._angle) for side in Side})
        self._controller.read()
        first = {side: len(self.passed(side).heard) - 1 for side in Side}
        motions = begin(self._robot, self._angle)
        self._angle = -self._angle
        self.until(lambda: all(self._moves(side, first[side], at_speed=at_speed) for side in Side))
        since = {side: self.passed(side).cycle for side in Side}
        options = [
            "--robot",
            f"127.0.0.1:{self._controller.rws_port}",
            "--way",
            FaultDirection.TO_ROBOT.value,
            "--duration",
            seconds,
        ]
        fault_command.main([Fault.EGM_LOSS.value.name, *map(str, options)], standalone_mode=False)
        cycles = round((seconds + 0.5) / CYCLE)
        self.until(lambda: all(self.passed(side).cycle > since[side] + cycles for side in Side))
        for side in Side:
            self._check(side, since[side])
        ended = ""
        try:
            for motion in motions:
                motion.wait(PATIENCE)
            self.went_on += 1
        except YumiError as error:
            ended = str(error)
        assert not ended or seconds > LOST[0], ended

    def _moves(self, side: Side, first: int, *, at_speed: bool) -> bool:
        heard = self.passed(side).heard
        if not at_speed:
            return abs(heard[-1].position[6] - heard[first].position[6]) > MOVES
        return abs(heard[-1].position[6] - heard[-2].position[6]) > FAST * CYCLE

    def _check(self, side: Side, since: int) -> None:
        """The robot never sets out faster than the commands that it may have missed explain, and goes on reporting."""
        passed = self.passed(side)
        sent = [each.position for each in passed.since(since - MISSED)]
        codec = SensorCodec(axes=7)
        reports = [(cycle, codec.decode(datagram)) for cycle, datagram in passed.sent if cycle >= since]
        assert reports[-1][1].motors is MotorState.ON
        plans = [(cycle, report.planned) for cycle, report in reports]
        speeds = [(now[0], change_rate(now[1], old[1], CYCLE)) for old, now in pairwise(plans) if now[0] == old[0] + 1]
        for joint, strongest in enumerate(YUMI_LIMITS.acceleration):
            ways = [abs(new[joint] - old[joint]) for old, new in zip(sent, sent[MISSED:], strict=False)]
            ways = list(accumulate(ways, max))
            for (before, old), (cycle, new) in pairwise(speeds):
                way = ways[min(cycle - since, len(ways) - 1)]
                if cycle == before + 1:
                    share = abs(new[joint] - old[joint]) / (EGM_GAIN * way + strongest * CYCLE)
                    self.worst = max(self.worst, share)
        assert self.worst <= 1.0


@pytest.fixture(scope="module")
def losses(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Losses]:
    controller = TappedController(tmp_path_factory.mktemp("controller"))
    controller.start()
    left, right = (controller.egm_ports[side] for side in (Side.LEFT, Side.RIGHT))
    options = {"left_egm_port": left, "right_egm_port": right, "default_speed_scale": 1.0, "acceleration": 1.0}
    with yumi.connect(f"127.0.0.1:{controller.rws_port}", **options) as robot:
        yield Losses(robot, controller)
    controller.stop()


@pytest.mark.real_time
@pytest.mark.alone
@pytest.mark.parametrize(("kind", "seconds"), [("goals", 0.06), ("trajectories", 0.25)])
def test_robot_that_follows_again_changes_its_speed_by_no_more_than_five_commands_explain(
    losses: Losses, kind: str, seconds: float
) -> None:
    """All losses are in ``test_lost_replies_in_virtual_time``."""
    losses.lose(BEGINS[kind], seconds, at_speed=True)


@pytest.mark.soak
@pytest.mark.timeout(1800)
def test_no_loss_of_many_changes_the_speed_of_a_robot_that_follows_again_by_more(losses: Losses) -> None:
    for number in range(1, ROUNDS + 1):
        for begin in BEGINS.values():
            for at_speed in (False, True):
                for seconds in LOST:
                    losses.lose(begin, seconds, at_speed=at_speed)
        count = number * 2 * len(BEGINS) * len(LOST)
        tell(f"{count} losses: worst change of speed {losses.worst:.2f} of what is allowed; {losses.went_on} went on")
