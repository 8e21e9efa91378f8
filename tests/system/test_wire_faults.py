"""Datagrams that are late, forged, cut, lost, swapped or doubled, over real sockets: what is sent never jumps.

How many cycles may stay without an answer is in ``test_wire_faults_in_virtual_time``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from math import radians

import pytest
from tapped_controller import TappedController
from wire_faults import LASTING, SINGLE, Attack, Swing, Tapped, check_limits, check_path, swing, swing_velocity

import yumi
from abb_protocols.robot.joints import CYCLE, ZERO_JOINTS, Joints, Side
from abb_runtime.clock import SystemClock
from abb_runtime.fault_command import fault as fault_command
from yumi.api.motion_registry import Motion
from yumi.api.robot import Robot

pytestmark = [pytest.mark.real_time, pytest.mark.alone, pytest.mark.timeout(120)]

LENGTH = 60.0  # of the swing [s]
POINTS_PER_SECOND = 20
BEFORE, AFTER = 125, 100  # cycles
PATIENCE = 20.0  # [s]
STALLED = radians(3.0)
"""How far the swing goes in 60 ms, for which this machine may stand still [rad]."""

ANSWERED = 25
"""Cycles in a row that get an answer again after an attack."""

ON_SOCKETS = {
    "egm-forge-30",
    "egm-truncate-40",
    "egm-swap-arms",
    "egm-duplicate-1-from-robot",
    "egm-foreign-port",
}
"""What sockets do that links in memory do not: other senders, other ports, short and doubled datagrams."""


ATTACKS = [
    pytest.param(each, id=str(each), marks=() if str(each) in ON_SOCKETS else pytest.mark.soak)
    for each in (*SINGLE, *LASTING)
]
"""Those of :data:`ON_SOCKETS` run with all other tests, the rest with ``make soak``."""

assert {str(each) for each in (*SINGLE, *LASTING)} >= ON_SOCKETS


class Rig:
    """A virtual robot in a process of its own, and a script that swings both of its arms."""

    def __init__(self, robot: Robot, controller: TappedController) -> None:
        self._robot = robot
        self._controller = controller
        self._clock = SystemClock()
        self._motions: tuple[Motion, ...] = ()
        self._swings_since = dict.fromkeys(Side, 0)

    def passed(self, side: Side) -> Tapped:
        return self._controller.passed[side]

    def swing(self) -> None:
        """Both arms swing, and have done so for some time."""
        if not self._motions or any(motion.is_done for motion in self._motions):
            self._robot.recover()
            self._robot.move_to(
                right=swing(Side.RIGHT, 0.0), left=swing(Side.LEFT, 0.0), speed_scale=1.0, acceleration=1.0
            )
            right, left = (_trajectory(side) for side in (Side.RIGHT, Side.LEFT))
            self._motions = self._robot.follow(right=right, left=left, wait=False)
            self._controller.read()
            self._swings_since = {side: self.passed(side).cycle for side in Side}
        self.wait_for_cycles(self._swings_since, BEFORE + 50)

    def wait_until_answered(self) -> None:
        """Both arms get an answer in every cycle again; the swing before the next attack begins here."""
        self.until(lambda: all(_is_answered(self.passed(side)) for side in Side))
        self._swings_since = {side: self.passed(side).cycle for side in Side}

    def wait_for_cycles(self, since: dict[Side, int], count: int) -> None:
        self.until(lambda: all(self.passed(side).cycle >= since[side] + count for side in Side))

    def until(self, is_so: Callable[[], bool]) -> None:
        end = self._clock.now() + PATIENCE
        self._controller.read()
        while not is_so():
            assert self._clock.now() < end, f"did not happen within {PATIENCE} s"
            self._clock.wait(5 * CYCLE)
            self._controller.read()

    def strike(self, attack: Attack) -> None:
        """``yumi fault``."""
        options = {
            "--robot": f"127.0.0.1:{self._controller.rws_port}",
            "--arm": attack.side and attack.side.word,
            "--duration": attack.duration,
            "--by": attack.amount,
            "--way": attack.way and attack.way.value,
        }
        chosen = [text for name, value in options.items() if value is not None for text in (name, str(value))]
        fault_command.main([attack.fault.value.name, *chosen], standalone_mode=False)


def _is_answered(passed: Tapped) -> bool:
    last = [each.cycle for each in passed.heard[-ANSWERED:]]
    return last[-1] - last[0] < ANSWERED and passed.cycle - last[-1] <= 1


def _trajectory(side: Side) -> list[tuple[float, Joints, Joints]]:
    """Times, positions and velocities of a swing that ends at rest."""
    last = int(LENGTH * POINTS_PER_SECOND)
    times = [number / POINTS_PER_SECOND for number in range(last)]
    return [
        *((time, swing(side, time), swing_velocity(time)) for time in times),
        (LENGTH, swing(side, LENGTH), ZERO_JOINTS),
    ]


@pytest.fixture(scope="module")
def connected(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    controller = TappedController(tmp_path_factory.mktemp("controller"))
    controller.start()
    left, right = (controller.egm_ports[side] for side in (Side.LEFT, Side.RIGHT))
    with yumi.connect(f"127.0.0.1:{controller.rws_port}", left_egm_port=left, right_egm_port=right) as robot:
        yield Rig(robot, controller)
    controller.stop()


@pytest.fixture
def rig(connected: Rig) -> Rig:
    connected.swing()
    return connected


@pytest.mark.parametrize("attack", ATTACKS)
def test_what_is_sent_keeps_its_limits_and_never_follows_what_is_false(rig: Rig, attack: Attack) -> None:
    begin = {side: rig.passed(side).cycle for side in Side}
    paths = {side: Swing(side, rig.passed(side).heard[-BEFORE:]) for side in Side}
    rig.strike(attack)
    rig.wait_for_cycles(begin, int((attack.duration or 0.0) / CYCLE) + AFTER)
    rig.wait_until_answered()
    for side in Side:
        heard = rig.passed(side).since(begin[side])
        check_limits(heard, stops=attack.stops)
        check_path(heard, paths[side], replace(attack, strays=max(attack.strays, STALLED)))
