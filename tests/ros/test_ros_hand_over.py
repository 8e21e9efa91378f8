"""From a policy to a person and back, on both arms, over ROS, page and Python, in real time."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from math import sin
from pathlib import Path
from threading import Event as Flag
from threading import Thread
from types import TracebackType
from typing import Any, Protocol

import numpy as np
import pytest
from controller_manager_msgs.srv import SwitchController
from ros_bench import Client
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

import yumi
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import Joints, Side, joint_names
from browser import browser
from cartesian_bench import shares
from soak import long, short, tell
from system.teleoperation_bench import LEFT_START, START
from system.test_hand_over_measured import ARMS, WITHIN, commanding, sent, teleoperate, unbroken, wait_for
from system.test_teleoperation_measured import recorded_driver
from system.test_view_teleoperation import GAMEPAD, page_of, served_page
from yumi.api.attach import RunningDriver
from yumi.recording.message_types import EVENTS_TOPIC
from yumi.recording.reader import recorded_messages

RATE = 50.0  # [Hz] of the policies
SIDES = tuple(Side[arm.upper()] for arm in ARMS)
LEADING = "joint_position_controller"
BUMPERS = (4, 5)  # of the gamepad: the clutches of the left and of the right arm


class Sender(Protocol):
    """How a policy reaches the arms."""

    def take(self) -> None:
        """Have the arms follow it; raises CommandRefused."""

    def send(self, points: dict[Side, Joints]) -> None:
        """The next point of both arms; raises CommandRefused where it is known at once that it is refused."""


class PythonSender:
    """A script that has attached itself."""

    def __init__(self, driver: RunningDriver) -> None:
        self._driver = driver

    def take(self) -> None:
        """Each point takes the arms."""

    def send(self, points: dict[Side, Joints]) -> None:
        self._driver.stream(right=points[Side.RIGHT], left=points[Side.LEFT])


class RosSender:
    """A node that publishes on the topic of both arms."""

    def __init__(self, driver: RunningDriver) -> None:
        self._driver, self._client = driver, Client()
        self._publisher = self._client.node.create_publisher(JointState, "joint_commands", 10)

    def take(self) -> None:
        """The person's device had another controller command the arms."""
        for side in Side:
            active = [each.name for each in self._driver.controllers[side.word] if each.commands]
            if active == [LEADING]:
                continue
            request = SwitchController.Request(
                activate_controllers=[LEADING],
                deactivate_controllers=active,
                strictness=SwitchController.Request.STRICT,
            )
            answer = self._client.call(SwitchController, f"/{side.value}/controller_manager/switch_controller", request)
            if not answer.ok:
                raise CommandRefused(answer.message)

    def send(self, points: dict[Side, Joints]) -> None:
        names = [name for side in points for name in joint_names(side)]
        point = JointState(name=names, position=[value for values in points.values() for value in values])
        point.header.stamp = self._client.node.get_clock().now().to_msg()
        self._publisher.publish(point)

    def close(self) -> None:
        self._client.close()


class Policy:
    """A program that turns both wrists back and forth whenever it may, from where the arms are then.

    Attributes:
        refusals: how often it was refused, by the code; of points on a topic none is heard.
    """

    def __init__(self, make: Callable[[RunningDriver], Sender]) -> None:
        self.refusals: Counter[str] = Counter()
        self._make, self._is_over = make, Flag()
        self._failure: BaseException | None = None
        self._thread = Thread(target=self._run)

    def __enter__(self) -> Policy:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._is_over.set()
        self._thread.join()
        if self._failure is not None:
            raise self._failure  # what else has failed comes of it

    def _run(self) -> None:
        try:
            with yumi.attach() as driver, yumi.attach() as own:
                sender = self._make(own)
                try:
                    while not self._is_over.is_set():
                        self._begin(driver, sender)
                finally:
                    if isinstance(sender, RosSender):
                        sender.close()
        except BaseException as error:
            self._failure = error

    def _begin(self, driver: RunningDriver, sender: Sender) -> None:
        """Move until something else commands an arm."""
        begin, start = time.monotonic(), dict(zip(SIDES, sent(driver), strict=True))
        try:
            sender.take()
            while not self._is_over.wait(1.0 / RATE):
                passed = time.monotonic() - begin
                turn = 0.1 * sin(3.0 * passed) * min(1.0, passed)
                sender.send({side: (*at[:6], at[6] + turn) for side, at in start.items()})
                if passed > 0.5 and {each.who for each in commanding(driver)} != {"stream"}:
                    self._is_over.wait(0.1)
                    return
        except CommandRefused as error:
            self.refusals[error.said.code] += 1
            self._is_over.wait(0.05)


def hold(page: Any, *, is_held: bool) -> None:
    for bumper in BUMPERS:
        page.evaluate(f"pad.hold({bumper}, {str(is_held).lower()})")


def teleoperate_at_the_page(page: Any, driver: RunningDriver, turn: float) -> None:
    """Take both arms with the gamepad, move the tools a little, and let go."""

    def press() -> None:
        if {each.who for each in commanding(driver)} != {"device"}:
            hold(page, is_held=False)
            page.wait_for_timeout(100)
            hold(page, is_held=True)
        page.wait_for_timeout(400)

    wait_for(driver, "device", act=press)
    page.evaluate(f"pad.axes[1] = {turn}")
    page.wait_for_timeout(400)
    page.evaluate("pad.axes[1] = 0")
    hold(page, is_held=False)


def pass_on(
    driver: RunningDriver, take_over: Callable[[float], None], give_back: Callable[[], object], turn: float
) -> None:
    """From the policy to a person, who lets go; then the policy gets the arms back."""
    wait_for(driver, "stream")
    time.sleep(0.5)
    take_over(turn)
    wait_for(driver, "none")
    assert all(each.is_reserved for each in commanding(driver))
    time.sleep(0.4)
    still = sent(driver)
    time.sleep(0.4)
    assert sent(driver) == still
    give_back()
    wait_for(driver, "stream")


@pytest.mark.ros
@pytest.mark.alone
@pytest.mark.parametrize("times", [short(4, pytest.mark.real_time, pytest.mark.timeout(180)), long(20, 600.0)])
def test_no_take_over_steps_whether_policy_and_person_come_over_ros_page_or_python(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ros: None, times: int
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    record, makers = tmp_path / "take_overs.mcap", (PythonSender, RosSender)
    with recorded_driver(tmp_path, record, with_ros=True) as driver:
        driver.move_to(right=START, left=LEFT_START)  # away from the body: an arm at a limit takes longer to stand
        services = Client()

        def give_back_by_ros() -> None:
            assert services.call(Trigger, "/yumi_robot_manager/give_back").success

        def run(take_over: Callable[[float], None]) -> None:
            """Half of the take-overs, with a policy over Python and one over ROS."""
            for maker in makers:
                with Policy(maker) as policy:
                    for number in range(times // 4):
                        turn = -0.2 if number % 2 else 0.2  # and back again
                        pass_on(driver, take_over, give_back_by_ros if number % 2 else driver.give_back, turn)
                assert policy.refusals[REFUSED[maker]] > 0, policy.refusals
                wait_for(driver, "none")  # its stream is over

        run(lambda turn: teleoperate(driver, turn))
        with browser() as chromium, served_page(tmp_path) as url, page_of(chromium, url, GAMEPAD) as page:
            page.select_option("#device", "gamepad")
            run(lambda turn: teleoperate_at_the_page(page, driver, turn))
        services.close()
    values = list(recorded_messages(record))
    kinds = Counter(value.kind for topic, _, value in values if topic == EVENTS_TOPIC)
    assert kinds["ArmGivenBack"] == 2 * times
    assert kinds["CommanderChanged"] >= 2 * 2 * times
    worst = np.zeros(3)
    for topic in ("r/cycle", "l/cycle"):
        for part in unbroken([value for name, _, value in values if name == topic]):
            worst = np.maximum(worst, shares(part))
    tell(f"{times} take-overs of both arms over ROS, page and Python: shares of the limits {worst}")
    assert worst.max() <= WITHIN


REFUSED = {PythonSender: "arm_reserved_for_person", RosSender: "text"}
"""What each policy hears of an arm that is reserved; a service of ROS answers in words."""
