"""The grippers' signals as a subscription tells them: what is known, for how long, and what happens when it ends."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import pytest

from abb_protocols.errors import ControllerRefused, NoConnection, ProtocolError
from abb_protocols.robot.gripper_values import GripperModules, ServoState
from abb_protocols.robot.joints import Side
from abb_protocols.rws.values import Priority, Resource
from abb_runtime.rws.client import Change
from refusals import refused
from yumi.driver.gripper_signals import GripperSignals

MODULES = {Side.RIGHT: GripperModules.SERVO, Side.LEFT: GripperModules.VISION_VACUUM}


@dataclass
class Robot:
    """The part of a client that is needed: tells every signal as 0 at first, and what the test says later."""

    lacking: Side | None = None
    resources: list[tuple[Resource, ...]] = field(default_factory=list)
    closed: int = 0
    failure: NoConnection | None = None
    loses_at_once: bool = False
    present: dict[str, float] = field(default_factory=dict)
    while_read: Callable[[], None] = lambda: None
    unread: NoConnection | None = None

    def subscribe(
        self, resources: Sequence[Resource], on_change: Callable[[Change], None], on_lost: Callable[[str], None]
    ) -> Robot:
        if self.failure is not None:
            raise self.failure
        if self.lacking is not None and any(f"_{self.lacking.name[0]};" in each.path for each in resources):
            raise ControllerRefused(f"no signal of the {self.lacking.word} hand", status=400)
        self.resources.append(tuple(resources))
        self.on_change, self.on_lost = on_change, on_lost
        for resource in resources:
            on_change(Change(resource.path, {"lvalue": "0", "lstate": "not simulated"}))
        if self.loses_at_once:
            on_lost("the robot has closed the connection")
        return self

    def signals(self) -> Mapping[str, float]:
        self.while_read()
        if self.unread is not None:
            raise self.unread
        return self.present

    def tell(self, name: str, value: str) -> None:
        self.on_change(Change(f"/rw/iosystem/signals/{name};state", {"lvalue": value}))

    def close(self) -> None:
        self.closed += 1


@pytest.fixture
def robot() -> Robot:
    return Robot()


@pytest.fixture
def signals(robot: Robot) -> GripperSignals:
    signals = GripperSignals(robot, MODULES)
    signals.keep_open()
    return signals


def test_signals_of_both_grippers_are_subscribed_once_with_high_priority(robot: Robot, signals: GripperSignals) -> None:
    signals.keep_open()
    (resources,) = robot.resources
    assert {resource.priority for resource in resources} == {Priority.HIGH}
    names = {resource.path.removesuffix(";state").rpartition("/")[2] for resource in resources}
    assert {"hand_ActualPosition_R", "hand_ActualPosition_L", "hand_ActualPressure1_L"} <= names
    assert "hand_ActualPressure1_R" not in names


def test_reading_is_there_from_the_first_values_on_and_follows_changes(robot: Robot, signals: GripperSignals) -> None:
    first = signals.state(Side.RIGHT)
    assert first is not None
    assert (first.state, first.position) == (ServoState.READY, 0.0)
    for name, value in (("hand_SysState_R", "3"), ("hand_ActualPosition_R", "123"), ("hand_ActualSpeed_R", "250")):
        robot.tell(name, value)
    reading = signals.state(Side.RIGHT)
    assert reading is not None
    assert (reading.state, reading.position, reading.speed) == (
        ServoState.FREE_MOVE_TO_MIN_POS,
        pytest.approx(0.0123),
        pytest.approx(-0.025),
    )


def test_force_is_that_of_the_gripper_while_it_holds_something(robot: Robot, signals: GripperSignals) -> None:
    robot.tell("hand_HoldForce_R", "75")
    assert signals.state(Side.RIGHT).force == 0.0
    robot.tell("hand_SysState_R", "9")
    robot.tell("hand_ActualPosition_R", "100")
    reading = signals.state(Side.RIGHT)
    assert (reading.force, reading.is_holding) == (7.5, True)


def test_vacuum_module_shows_what_it_has_picked(robot: Robot, signals: GripperSignals) -> None:
    robot.tell("hand_StatusVacuum1_L", "1")
    robot.tell("hand_ActualPressure1_L", "40")
    cup = signals.state(Side.LEFT).cups[1]
    assert (cup.pressure, cup.has_picked(70e3), cup.has_picked(30e3)) == (40e3, True, False)


def test_nothing_is_known_after_the_end_of_the_subscription_until_there_is_another(
    robot: Robot, signals: GripperSignals
) -> None:
    robot.on_lost("the robot has closed the connection")
    assert (signals.is_open, signals.state(Side.RIGHT)) == (False, None)
    robot.tell("hand_SysState_R", "1")  # a late one
    assert signals.value(Side.RIGHT, "hand_SysState") is None
    signals.keep_open()
    assert signals.value(Side.RIGHT, "hand_SysState") == 0.0


def test_subscription_that_is_lost_while_it_begins_is_asked_for_again(robot: Robot) -> None:
    robot.loses_at_once = True
    signals = GripperSignals(robot, MODULES)
    signals.keep_open()
    assert not signals.is_open
    robot.loses_at_once = False
    signals.keep_open()
    assert signals.is_open


def test_gripper_that_the_controller_lacks_stays_unknown() -> None:
    signals = GripperSignals(Robot(lacking=Side.LEFT), MODULES)
    signals.keep_open()
    assert signals.state(Side.RIGHT) is not None
    assert signals.state(Side.LEFT) is None


def test_robot_that_cannot_be_reached_is_reported(robot: Robot) -> None:
    robot.failure = NoConnection("memory does not answer.")
    with pytest.raises(NoConnection, match="memory does not answer"):
        GripperSignals(robot, MODULES).keep_open()


def test_signal_that_changes_while_the_web_socket_opens_is_read(robot: Robot) -> None:
    robot.present = {"hand_SysState_R": 9.0, "hand_SysState_L": 1.0, "DRV1K1": 1.0}
    signals = GripperSignals(robot, MODULES)
    signals.keep_open()
    assert [signals.value(side, "hand_SysState") for side in (Side.RIGHT, Side.LEFT)] == [9.0, 1.0]
    assert signals.value(Side.RIGHT, "hand_SysError") == 0.0


def test_signal_that_is_reported_while_all_are_read_keeps_what_was_reported(robot: Robot) -> None:
    robot.present = {"hand_SysState_R": 1.0}
    robot.while_read = lambda: robot.tell("hand_SysState_R", "9")
    signals = GripperSignals(robot, MODULES)
    signals.keep_open()
    assert signals.value(Side.RIGHT, "hand_SysState") == 9.0


def test_signals_that_cannot_be_read_end_the_subscription(robot: Robot) -> None:
    robot.unread = NoConnection("memory does not answer.")
    signals = GripperSignals(robot, MODULES)
    with pytest.raises(NoConnection, match="memory does not answer"):
        signals.keep_open()
    assert (robot.closed, signals.is_open, signals.state(Side.RIGHT)) == (1, False, None)


def test_close_ends_the_subscription(robot: Robot, signals: GripperSignals) -> None:
    signals.close()
    signals.close()
    assert (robot.closed, signals.is_open) == (1, False)


@pytest.mark.parametrize("code", [13, 14, 18, 31])
def test_state_no_gripper_has_is_refused(robot: Robot, signals: GripperSignals, code: int) -> None:
    robot.tell("hand_SysState_R", str(code))
    with refused(ProtocolError, "gripper_state_unknown", state=float(code)):
        signals.state(Side.RIGHT)


def test_change_that_makes_no_sense_changes_nothing(robot: Robot, signals: GripperSignals) -> None:
    robot.tell("hand_SysState_R", "busy")
    robot.tell("hand_Unknown_R", "1")
    assert signals.value(Side.RIGHT, "hand_SysState") == 0.0
