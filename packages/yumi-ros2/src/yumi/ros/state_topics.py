"""The topics that show the robot: joint states, ``egm_state``, ``/diagnostics``, ``~/state`` and ``~/gpio_states``.

Joint states are published per arm every cycle, and merged at a lower rate; while EGM is silent they are what the
monitor reads from the controller.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping
from functools import partial
from math import inf
from threading import Event
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from sensor_msgs.msg import JointState
from yumi_interfaces.msg import RobotState as RobotStateMessage

from abb_protocols.errors import YumiError
from abb_protocols.robot.joints import Side, finger_names, joint_names
from abb_runtime.clock import Clock
from abb_runtime.process.supervision import SupervisedThread, ThreadFailures
from yumi.control.hand_over import HandOver
from yumi.control.shared_state import JointStates, Snapshot
from yumi.driver.control_process import ArmBuffers
from yumi.driver.robot_state import RobotState
from yumi.ros.messages import (
    GPIO_STATES,
    LATCHED_QOS,
    Stamps,
    egm_status,
    gpio_states,
    joint_state,
    robot_state,
    robot_status,
    stamp,
)
from yumi.ros.nodes import TimerThread

STALE_STATE = 1.0
"""The position of an arm whose last state is older is not known [s]; without EGM one comes every 0.4 s."""

_STATE_POLL = 0.05
"""How often the robot's state is compared with the last one [s]; that asks nothing of the robot itself."""

_STATE_PERIOD = 1.0
"""The robot's state is published at least so often [s]."""

_EGM_STATE_PERIOD = 0.1  # [s]
_DIAGNOSTICS_PERIOD = 1.0  # [s]
_CYCLE_WAIT = 0.1  # [s] within which a publisher's thread ends
_STATES_DEPTH = 10
_SIGNALS_PERIOD = 0.5  # [s]: one request each, of the 19.6 a second that the controller answers

MeasuredState = Callable[[Side], JointStates | None]
"""The newest measured state of an arm; None where there has been none."""


def newest_state(buffers: ArmBuffers, polled: JointStates | None) -> JointStates | None:
    """The newer one of what EGM reported of an arm last, and what was read from the controller (``polled``)."""
    newest = buffers.states.read()
    if newest is None or (polled is not None and polled.time > newest[1].time):
        return polled
    return newest[1]


class JointStatePublisher:
    """Publishes ``joint_states`` of one arm after each control cycle, or as they are read while there is none.

    A thread of its own: the executor's threads may be busy with a service when the next state comes.

    Args:
        node: the arm's controller manager node.
        side: which arm.
        buffers: the state shared by the control process.
        clock: the clock of the states' times.
        polled: the arm as it was read from the controller last.
        frame: of the robot's base.
    """

    def __init__(
        self,
        node: Any,
        side: Side,
        buffers: ArmBuffers,
        clock: Clock,
        polled: MeasuredState = lambda side: None,
        frame: str = "",
    ) -> None:
        self._side = side
        self._polled = polled
        self._frame = frame
        self._published = -inf
        self._publisher = node.create_publisher(JointState, "joint_states", _STATES_DEPTH)
        self._stamps = Stamps.of(node, clock)
        self._names = joint_names(side)
        self._buffers = buffers
        self._is_over = Event()
        self._failures = ThreadFailures()
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
            has_cycle = self._buffers.cycle_done.acquire(timeout=_CYCLE_WAIT)
            read = None if has_cycle else self._polled(self._side)
            new = [] if read is None or read.time <= self._published else [(last, read)]
            for number, state in self._buffers.states.since(last) if has_cycle else new:
                last = number
                try:
                    self._publish(state)
                except Exception as error:  # of the middleware, such as after the clock was set: the next one may go
                    self._failures.note(f"Publishing {self._topic}", error)

    def _publish(self, state: JointStates) -> None:
        self._published = state.time
        message = joint_state(self._names, state.position, state.velocity, self._stamps.at(state.time), self._frame)
        self._publisher.publish(message)


class MergedJointStates:
    """Publishes ``joint_states`` of the whole robot: 7 right, 7 left, then the fingers as far as they are known.

    An arm without a state for :data:`STALE_STATE` is left out: its old position is no start for planning. The stamp is
    that of the oldest state that EGM reports; where EGM is silent, of the oldest one that was read from the controller.

    Args:
        node: the robot's node for topics.
        buffers: the state shared by the control process, per arm.
        fingers: position [m] and speed [m/s] of each gripper's fingers by side, as far as they are known.
        rate: [Hz].
        clock: the clock of the states' times.
        timers: keeps the rate.
        polled: an arm as it was read from the controller last.
        frame: of the robot's base.
    """

    def __init__(
        self,
        node: Any,
        buffers: Mapping[Side, ArmBuffers],
        fingers: Callable[[], Mapping[Side, tuple[float, float]]],
        rate: float,
        clock: Clock,
        timers: TimerThread,
        polled: MeasuredState = lambda side: None,
        frame: str = "",
    ) -> None:
        self._polled = polled
        self._frame = frame
        self._publisher = node.create_publisher(JointState, "joint_states", _STATES_DEPTH)
        self._stamps = Stamps.of(node, clock)
        self._clock = clock
        self._buffers = buffers
        self._fingers = fingers
        timers.every(1.0 / rate, "joint_states", self._publish)

    def _publish(self) -> None:
        names: list[str] = []
        position: list[float] = []
        velocity: list[float] = []
        now = self._clock.now()
        reported: list[float] = []
        read: list[float] = []
        for side, buffers in self._buffers.items():
            polled = self._polled(side)
            state = newest_state(buffers, polled)
            if state is not None and now - state.time < STALE_STATE:
                (read if state is polled else reported).append(state.time)
                names += joint_names(side)
                position += state.position
                velocity += state.velocity
        for side, (place, speed) in self._fingers().items():
            names += finger_names(side)
            position += (place, place)
            velocity += (speed, speed)
        if names:
            # An arm that stands must not make the states of one that moves look old.
            oldest = min(reported or read, default=now)
            self._publisher.publish(joint_state(names, position, velocity, self._stamps.at(oldest), self._frame))


class HealthTopics:
    """Publishes ``egm_state`` of each arm and the driver's ``/diagnostics``.

    Args:
        node: whose ``/diagnostics`` it is.
        streams: a node for the topics of each arm.
        snapshot: the state of an arm.
        robot: the state of the robot.
        grippers: both grippers' statuses for ``/diagnostics``.
        timers: keeps the rates.
        hand_over: who commands the arms.
        desired: the arms on which EGM is to run.
    """

    def __init__(
        self,
        node: Any,
        streams: Mapping[Side, Any],
        snapshot: Callable[[Side], Snapshot],
        robot: Callable[[], RobotState],
        grippers: Callable[[], list[DiagnosticStatus]],
        timers: TimerThread,
        hand_over: HandOver,
        desired: Callable[[], Container[Side]] = tuple,
    ) -> None:
        clock, root = node.get_clock(), node.get_namespace().strip("/")
        place = f"/{root}/" if root else ""
        diagnostics = node.create_publisher(DiagnosticArray, "/diagnostics", 1)

        def status(side: Side) -> DiagnosticStatus:
            return egm_status(side, snapshot(side), hand_over.of(side), is_desired=side in desired())

        def publish_arm(publisher: Any, side: Side) -> None:
            publisher.publish(status(side))

        def publish_diagnostics() -> None:
            array = DiagnosticArray()
            array.header.stamp = stamp(clock.now().nanoseconds)
            array.status = [robot_status(robot()), *map(status, Side), *grippers()]
            for each in array.status:  # those of several robots meet on /diagnostics
                each.name = f"{place}{each.name}"
            diagnostics.publish(array)

        for side, stream in streams.items():
            publisher = stream.create_publisher(DiagnosticStatus, "egm_state", 1)
            timers.every(_EGM_STATE_PERIOD, f"{side.value}/egm_state", partial(publish_arm, publisher, side))
        timers.every(_DIAGNOSTICS_PERIOD, "/diagnostics", publish_diagnostics)


class RobotStateTopic:
    """Publishes ``~/state`` of the robot manager, latched, on each change and once a second."""

    def __init__(
        self, node: Any, state: Callable[[], RobotState], clock: Clock, timers: TimerThread, frame: str = ""
    ) -> None:
        self._frame = frame
        self._publisher = node.create_publisher(RobotStateMessage, "~/state", LATCHED_QOS)
        self._ros_clock = node.get_clock()
        self._state = state
        self._clock = clock
        self._last: RobotState | None = None
        self._published = 0.0
        timers.every(_STATE_POLL, "yumi_robot_manager/state", self.update)

    def update(self) -> None:
        """Publish a state that has changed, or was published long ago."""
        state, now = self._state(), self._clock.now()
        if state == self._last and now - self._published < _STATE_PERIOD:
            return
        self._last, self._published = state, now
        self._publisher.publish(robot_state(state, self._ros_clock.now().nanoseconds, self._frame))


class SignalsTopic:
    """Publishes ``~/gpio_states``, all I/O signals of the controller, twice a second while a client listens.

    Args:
        node: the robot manager's node.
        read: reads them all; raises YumiError.
        timers: of its own, since a controller may take seconds to answer.
        frame: of the robot's base.
    """

    def __init__(
        self, node: Any, read: Callable[[], Mapping[str, float]], timers: TimerThread, frame: str = ""
    ) -> None:
        self._frame = frame
        self._log = node.get_logger()
        self._clock = node.get_clock()
        self._read = read
        if GPIO_STATES is not None:
            self._publisher = node.create_publisher(GPIO_STATES, "~/gpio_states", 1)
            timers.every(_SIGNALS_PERIOD, "gpio_states", self._publish)

    def _publish(self) -> None:
        if not self._publisher.get_subscription_count():
            return
        try:
            values = self._read()
        except YumiError as error:
            self._log.warning(f"gpio_states: {error}", throttle_duration_sec=10.0)
            return
        self._publisher.publish(gpio_states(values, self._clock.now().nanoseconds, self._frame))
