"""Controllers are switched a thousand times in mid-motion, at random moments: the admitted command never jumps."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import pairwise
from random import Random

import pytest

from egm_loop import EgmLoop
from yumi.control.controller import Controller
from yumi.control.goals import put_goal
from yumi.control.mailbox import Mailbox, MemoryMailbox
from yumi.control.parameter import Values
from yumi.controllers.joint_position import JointPositionController
from yumi.robot.joints import joints
from yumi.robot.limits import YUMI_LIMITS

SWITCHES = 1000
MAKERS: Mapping[str, tuple[Callable[[Mailbox], Controller], Values]] = {
    "gentle": (JointPositionController, {"p": 0.6}),
    "strong": (JointPositionController, {"p": 2.0}),
}
"""Every controller that may be switched to: how it is made, given where its goals arrive, and its parameters."""


class SwitchedLoop(EgmLoop):
    """A lone arm on which one of :data:`MAKERS` commands at a time, or nobody."""

    def __init__(self) -> None:
        super().__init__()
        self.goals = MemoryMailbox()
        self.active: str | None = None
        for name, (make, values) in MAKERS.items():
            self.manager.load(name, make(self.goals))
            self.manager.configure(name, values)

    def switch(self, name: str | None) -> None:
        leaving = (self.active,) if self.active else ()
        self.line.switch((name,) if name else (), leaving, self.clock.now())
        self.active = name

    def send_goal(self, random: Random) -> None:
        """Somewhere in the middle half of every joint's range."""
        ranges = zip(YUMI_LIMITS.lower, YUMI_LIMITS.upper, strict=True)
        goal = joints([low + (high - low) * random.uniform(0.25, 0.75) for low, high in ranges])
        put_goal(self.goals, self.snapshot.session, goal)


def speeds_at_switches(loop: SwitchedLoop, random: Random) -> Iterator[float]:
    """Switch, let some cycles pass, give a new goal, let some cycles pass; the fastest joint's speed at each switch."""
    for _ in range(SWITCHES):
        assert loop.line.state is not None
        yield max(map(abs, loop.line.state.velocity))
        loop.switch(random.choice([None, *MAKERS]))
        for _ in range(random.randint(0, 5)):
            loop.cycle()
        loop.send_goal(random)
        for _ in range(random.randint(1, 20)):
            loop.cycle()


@pytest.fixture(scope="module")
def loop() -> SwitchedLoop:
    """After a thousand switches."""
    loop = SwitchedLoop()
    loop.begin()
    loop.deactivate()
    speeds = list(speeds_at_switches(loop, Random(4)))
    assert sum(speed > 0.1 for speed in speeds) > SWITCHES / 2  # in mid-motion
    return loop


def test_no_switch_makes_the_admitted_command_jump(loop: SwitchedLoop) -> None:
    for before, after in pairwise(loop.cycles):
        room = after.state.dt * 1.001
        steps = zip(before.admitted.position, after.admitted.position, YUMI_LIMITS.velocity, strict=True)
        assert all(abs(new - old) <= speed * room + 1e-9 for old, new, speed in steps)
        assert all(map(float.__le__, map(abs, after.admitted.velocity), YUMI_LIMITS.velocity))


def test_no_switch_overloads_the_robot(loop: SwitchedLoop) -> None:
    assert loop.robot.arm.overload is None
    assert loop.snapshot.is_running
    assert loop.snapshot.session == 1


def test_no_switch_makes_a_controller_fail(loop: SwitchedLoop) -> None:
    assert loop.manager.failures == []
    assert loop.snapshot.refused == 0
