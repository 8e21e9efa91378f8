"""Joint states on topics: per arm every cycle, and all joints of the robot merged at a lower rate."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from threading import Event
from typing import Any

from sensor_msgs.msg import JointState

from yumi.clock import Clock
from yumi.hardware.fast_line import ArmBoxes
from yumi.links.supervision import Failures, SupervisedThread
from yumi.links.ticker import Ticker
from yumi.robot.joints import JOINT_COUNT, Side, finger_names, joint_names
from yumi.ros.conversions import joint_state

SILENCE = 0.25
"""An arm whose last state is older is not where it was [s]."""

_DEPTH = 10
_SLEW = 1e-3  # the system's clock is slewed by at most half of this
_CLOCK_SET_NS = 50_000_000
_GLANCE = 0.1  # [s] how soon a publisher notices that it shall end


class Stamps:
    """Turns times of the machine's monotonic clock into ROS time, without trembling when the reading is interrupted.

    Reading two clocks one after the other can only make their difference too large, so the smallest one counts; it may
    grow as fast as clocks are slewed, and is taken anew when the ROS clock is set.

    Args:
        ros_now: tells the ROS time [ns].
        now: tells the monotonic time [s].
    """

    def __init__(self, ros_now: Callable[[], int], now: Callable[[], float]) -> None:
        self._ros_now = ros_now
        self._now = now
        self._difference: int | None = None
        self._read = 0.0

    def at(self, time: float) -> int:
        """The ROS time [ns] of the monotonic ``time`` [s]."""
        now = self._now()
        difference = self._ros_now() - int(now * 1e9)
        last = difference if self._difference is None else self._difference
        if abs(difference - last) < _CLOCK_SET_NS:
            difference = min(difference, last + int((now - self._read) * _SLEW * 1e9))
        self._difference, self._read = difference, now
        return int(time * 1e9) + difference


class JointStatePublisher:
    """Publishes ``joint_states`` of one arm whenever the fast line rings.

    A thread of its own: the executor's threads may be busy with a service when the next state comes.

    Args:
        node: the arm's controller manager node.
        side: which arm.
        boxes: what the fast line shares.
        clock: the clock of the states' times.
    """

    def __init__(self, node: Any, side: Side, boxes: ArmBoxes, clock: Clock) -> None:
        self._publisher = node.create_publisher(JointState, "joint_states", _DEPTH)
        ros_clock = node.get_clock()
        self._stamps = Stamps(lambda: int(ros_clock.now().nanoseconds), clock.now)
        self._names = joint_names(side)
        self._boxes = boxes
        self._is_over = Event()
        self._failures = Failures()
        self._topic = f"{side.value}/joint_states"
        self._thread = SupervisedThread(f"joint-states-{side.value}", self._run, self._is_over)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """End the thread; before the node is destroyed."""
        self._is_over.set()
        self._thread.join()

    def _run(self) -> None:
        last = 0
        while not self._is_over.is_set():
            if not self._boxes.bell.acquire(timeout=_GLANCE):
                continue
            for number, values in self._boxes.states.since(last):
                last = number
                try:
                    self._publish(values)
                except Exception as error:  # of the middleware, such as after the clock was set: the next one may go
                    self._failures.note(f"Publishing {self._topic}", error)

    def _publish(self, values: tuple[float, ...]) -> None:
        time, position, velocity = values[0], values[1 : 1 + JOINT_COUNT], values[1 + JOINT_COUNT :]
        self._publisher.publish(joint_state(self._names, position, velocity, self._stamps.at(time)))


class MergedJointStates:
    """Publishes ``joint_states`` of the whole robot: 7 right, 7 left, then the fingers as far as they are known.

    An arm that has not been heard for :data:`SILENCE` is left out: nobody shall plan from where it was once.

    Args:
        node: any node without namespace.
        boxes: what the fast line shares, per arm.
        fingers: position [m] and speed [m/s] of each hand's fingers by side, as far as they are known.
        rate: [Hz].
        clock: the clock of the states' times.
        ticker: keeps the rate.
    """

    def __init__(
        self,
        node: Any,
        boxes: Mapping[Side, ArmBoxes],
        fingers: Callable[[], Mapping[Side, tuple[float, float]]],
        rate: float,
        clock: Clock,
        ticker: Ticker,
    ) -> None:
        self._publisher = node.create_publisher(JointState, "joint_states", _DEPTH)
        ros_clock = node.get_clock()
        self._stamps = Stamps(lambda: int(ros_clock.now().nanoseconds), clock.now)
        self._clock = clock
        self._boxes = boxes
        self._fingers = fingers
        ticker.every(1.0 / rate, "joint_states", self._publish)

    def _publish(self) -> None:
        names: list[str] = []
        position: list[float] = []
        velocity: list[float] = []
        oldest = now = self._clock.now()
        for side, boxes in self._boxes.items():
            letter = boxes.states.peek()
            if letter is not None and now - letter[1][0] < SILENCE:
                oldest = min(oldest, letter[1][0])
                names += joint_names(side)
                position += letter[1][1 : 1 + JOINT_COUNT]
                velocity += letter[1][1 + JOINT_COUNT :]
        for side, (place, speed) in self._fingers().items():
            names += finger_names(side)
            position += (place, place)
            velocity += (speed, speed)
        if names:
            self._publisher.publish(joint_state(names, position, velocity, self._stamps.at(oldest)))
