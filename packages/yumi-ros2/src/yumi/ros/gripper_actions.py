"""Both grippers in ROS: actions, services and topics of each, and the subscription that they all depend on.

Results of the actions come from what the gripper measures, never from elapsed time.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from threading import Event as Flag
from threading import Lock
from typing import Any, NamedTuple

from control_msgs.action import GripperCommand, ParallelGripperCommand
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, Trigger

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, NoConnection, RobotNotReady, YumiError
from abb_protocols.robot.gripper_values import GripOutcome, GripperGoal, GripperState, ServoState, gripper_goal
from abb_protocols.robot.joints import Side, finger_names, prefixed
from abb_runtime.process.supervision import SupervisedThread
from yumi.driver.gripper import VACUUM_CHANNELS, GripperCheck, RwsGripper
from yumi.driver.gripper_signals import GripperSignals
from yumi.driver.settings import GripperSettings
from yumi.ros.messages import LATCHED_QOS, SERVICES_QOS, say_why, stamp
from yumi.ros.nodes import TimerThread


class GoalFailures:
    """The goals of a gripper that were refused or failed: ROS's results have no text for it; safe from any thread.

    Attributes:
        newest: how many there were, and why the last one was.
    """

    def __init__(self) -> None:
        self.newest = (0, "")
        self._lock = Lock()

    def note(self, reason: str) -> None:
        """Count a goal that was refused or failed."""
        with self._lock:
            self.newest = (self.newest[0] + 1, reason)


class GripperActionServer(ABC):
    """One action of a gripper.

    Args:
        node: the gripper's node.
        gripper: the gripper.
        force: holding force where a goal names none [N].
        group: callback group that lets a goal run while others are refused.
        check: raises RobotNotReady or CommandRefused when the gripper may not move.
        failures: counts goals that are refused or fail.
    """

    kind: Any
    name: str

    def __init__(
        self, node: Any, gripper: RwsGripper, force: float, group: Any, check: GripperCheck, failures: GoalFailures
    ) -> None:
        self._log = node.get_logger()
        self._gripper = gripper
        self._force = force
        self._check = check
        self._failures = failures
        self._server = ActionServer(
            node,
            self.kind,
            self.name,
            execute_callback=self._execute,
            goal_callback=self._accept_or_reject,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
            callback_group=group,
        )

    def destroy(self) -> None:
        self._server.destroy()

    @abstractmethod
    def command(self, goal: Any) -> GripperGoal:
        """The command in a goal.

        Raises:
            CommandRefused: the gripper cannot do that.
        """

    @abstractmethod
    def feedback(self, position: float) -> Any:
        """The feedback while the fingers are at ``position`` [m]."""

    @abstractmethod
    def result(self, position: float, effort: float, *, stalled: bool, reached_goal: bool) -> Any:
        """The result when the fingers came to rest at ``position`` [m] and hold something with ``effort`` [N]."""

    def _accept_or_reject(self, goal: Any) -> Any:
        try:
            self.command(goal)
            self._check()
        except (CommandRefused, RobotNotReady) as error:
            reason = error.said
        else:
            if self._gripper.busy.acquire(blocking=False):  # released when the goal has ended
                return GoalResponse.ACCEPT
            reason = message("another_grip_under_way")
        self._failures.note(str(reason))
        self._log.warning(f"Gripper goal refused: {reason}")
        return GoalResponse.REJECT

    def _execute(self, handle: Any) -> Any:
        command, outcome = self.command(handle.request), None
        try:
            self._gripper.begin(command, self._check)
            outcome = self._gripper.wait(
                command,
                lambda position: handle.publish_feedback(self.feedback(position)),
                lambda: bool(handle.is_cancel_requested),
            )
            if outcome is None:
                handle.canceled()
            else:
                handle.succeed()
        except YumiError as error:
            said = error.said
            try:
                self._check()
            except (CommandRefused, RobotNotReady) as stop:  # the robot may have been stopped, or taken, meanwhile
                if stop.said != said:
                    said = message("failed_and_stopped", error=said, stop=stop.said)
            self._failures.note(str(said))
            self._log.error(f"Gripper goal failed: {said}")
            handle.abort()
        finally:
            self._gripper.busy.release()
        return self.result(
            self._gripper.last_position,
            command.force if outcome is GripOutcome.HOLDING else 0.0,
            stalled=outcome in {GripOutcome.HOLDING, GripOutcome.STALLED},
            reached_goal=outcome in {GripOutcome.OPEN, GripOutcome.CLOSED, GripOutcome.IN_PLACE},
        )


class GripperAction(GripperActionServer):
    """``~/gripper_cmd``: the position of a finger joint [m], 0 closed, 0.025 open; see ``gripper_goal``."""

    kind = GripperCommand
    name = "~/gripper_cmd"

    def command(self, goal: Any) -> GripperGoal:
        return gripper_goal(goal.command.position, goal.command.max_effort, self._force)

    def feedback(self, position: float) -> Any:
        return GripperCommand.Feedback(position=position)

    def result(self, position: float, effort: float, *, stalled: bool, reached_goal: bool) -> Any:
        return GripperCommand.Result(position=position, effort=effort, stalled=stalled, reached_goal=reached_goal)


class ParallelGripperAction(GripperActionServer):
    """``~/parallel_gripper_cmd``: position, and optionally speed and effort, of one finger joint or both."""

    kind = ParallelGripperCommand
    name = "~/parallel_gripper_cmd"

    def command(self, goal: Any) -> GripperGoal:
        command, names = goal.command, finger_names(self._gripper.side)
        unknown = [name for name in command.name if name not in names]
        if unknown:
            raise CommandRefused(message("no_finger", name=unknown[0], fingers=tuple(names)))
        if not command.position:
            raise CommandRefused(message("goal_without_position"))
        position, speed = _one("position", command.position), _one("velocity", command.velocity)
        return gripper_goal(position, _one("effort", command.effort), self._force, speed or None)

    def feedback(self, position: float) -> Any:
        return ParallelGripperCommand.Feedback(state=self._state(position, 0.0))

    def result(self, position: float, effort: float, *, stalled: bool, reached_goal: bool) -> Any:
        state = self._state(position, effort)
        return ParallelGripperCommand.Result(state=state, stalled=stalled, reached_goal=reached_goal)

    def _state(self, position: float, effort: float) -> Any:
        names = list(finger_names(self._gripper.side))
        return JointState(name=names, position=[position] * len(names), effort=[effort] * len(names))


def _one(what: str, values: Sequence[float]) -> float:
    """The value that the fingers share, since one motor moves them; 0 when there is none."""
    if any(value != values[0] for value in values[1:]):
        raise CommandRefused(message("fingers_with_different_values", what=what))
    return float(values[0]) if values else 0.0


class GripperServices:
    """Serves calibrate, jog_open, jog_close, stop, clear_error, vacuum_1, blow_1, vacuum_2, blow_2.

    What the gripper does not have is refused.

    Args:
        node: the gripper's node.
        gripper: the gripper.
        group: callback group for what takes seconds.
        check: raises RobotNotReady or CommandRefused when the gripper may not move.
        calibrate: calibrates the gripper.
    """

    def __init__(
        self,
        node: Any,
        gripper: RwsGripper,
        group: Any,
        check: GripperCheck,
        calibrate: Callable[[RwsGripper], None],
    ) -> None:
        self._node = node
        self._log = node.get_logger()
        self._group = group
        self._check = check
        self._gripper = gripper
        jog = partial(gripper.jog, check=check)

        self._serve_motion("calibrate", partial(calibrate, gripper), "The gripper is calibrated: closed is 0.")
        self._serve_motion("jog_open", partial(jog, opens=True), "The fingers open until stop is called.")
        self._serve_motion("jog_close", partial(jog, opens=False), "The fingers close until stop is called.")
        self._serve(Trigger, "stop", lambda _: gripper.stop(), "The fingers stand; what they held is free.")
        self._serve(Trigger, "clear_error", lambda _: gripper.clear_error(), "The gripper reports no error.")

        def switch(channel: int, call: Callable[..., None], request: Any) -> None:
            gripper.check_vacuum(channel)
            check()
            call(channel, is_on=bool(request.data))

        for channel in VACUUM_CHANNELS:
            switches = (("vacuum", "Vacuum", gripper.switch_vacuum), ("blow", "Blow-off", gripper.switch_blow_off))
            for name, word, call in switches:
                is_now = f"{word} {channel} is {{}}."
                self._serve(SetBool, f"{name}_{channel}", partial(switch, channel, call), is_now)

    def _serve(self, kind: Any, name: str, action: Callable[[Any], None], sentence: str) -> None:
        """Serve ``name``; the answer is ``sentence``, with on or off where the request says that, or why it failed."""

        def answer(request: Any, response: Any) -> Any:
            try:
                action(request)
                response.message = sentence.format("on" if getattr(request, "data", False) else "off")
                response.success = True
            except YumiError as error:
                self._log.error(f"{name}: {error}")
                response.success = False
                say_why(response, error)
            return response

        self._node.create_service(kind, f"~/{name}", answer, qos_profile=SERVICES_QOS, callback_group=self._group)

    def _serve_motion(self, name: str, action: Callable[[], None], sentence: str) -> None:
        """Serve what moves the fingers; refused while something else moves them."""

        def move(_: Any) -> None:
            self._check()
            with self._gripper.alone():
                action()

        self._serve(Trigger, name, move, sentence)


_STATE_PERIOD = 0.04
"""Time between two messages [s]: the controller reports changes every 50 ms, and none may be missed."""

GRIPPER_FAILURES, GRIPPER_FAILURE = "goals_failed", "last_failure"
"""Keys in ``gripper/state``: how many goals were refused or failed, and why the last one was."""

_DEPTH = 10
_STATE_EVERY = 12  # messages, while nothing changes


class GripperTopics:
    """Publishes ``gripper/joint_states``, ``gripper/state``, ``gripper/vacuum_1/pressure`` and ``…/object_picked``.

    Nothing is published while the controller reports nothing of the gripper, except ``gripper/state`` after a goal that
    was refused or failed.

    Args:
        node: a node in the arm's namespace.
        side: which arm carries the gripper.
        reading: the gripper as it is now, or None while that is not known.
        picked_pressure: a vacuum module whose pressure is not above this has picked something [Pa].
        channels: its vacuum modules.
        timers: keeps the rate.
        failures: why the last goal was refused or failed.
        frames: what stands before the names of frames.
    """

    def __init__(
        self,
        node: Any,
        side: Side,
        reading: Callable[[], GripperState | None],
        picked_pressure: float,
        channels: tuple[int, ...],
        timers: TimerThread,
        failures: GoalFailures,
        frames: str = "",
    ) -> None:
        self._frame = frames + prefixed(f"gripper_{side.value}_")
        self._clock = node.get_clock()
        self._names = list(finger_names(side))
        self._side = side
        self._reading = reading
        self._threshold = picked_pressure
        self._states = node.create_publisher(JointState, "gripper/joint_states", _DEPTH)
        self._status = node.create_publisher(DiagnosticStatus, "gripper/state", LATCHED_QOS)
        self._pressures, self._picked = {}, {}
        for each in channels:
            topic = f"gripper/vacuum_{each}"
            self._pressures[each] = node.create_publisher(FluidPressure, f"{topic}/pressure", _DEPTH)
            self._picked[each] = node.create_publisher(Bool, f"{topic}/object_picked", LATCHED_QOS)
        self._last_picked: dict[int, bool] = {}
        self._failures = failures
        self._published_failures = failures.newest
        self._last: ServoState | None = None
        self._count = 0
        timers.every(_STATE_PERIOD, f"{side.value}/gripper", self._publish)

    def _publish(self) -> None:
        reading, failures = self._reading(), self._failures.newest
        has_failed, self._published_failures = failures != self._published_failures, failures
        if reading is not None:
            self._publish_reading(reading)
            has_changed, self._last = reading.state is not self._last, reading.state
            self._count += 1
        if has_failed or (reading is not None and (has_changed or self._count % _STATE_EVERY == 0)):
            status, (count, reason) = gripper_status(self._side, reading), failures
            added = (KeyValue(key=GRIPPER_FAILURES, value=str(count)), KeyValue(key=GRIPPER_FAILURE, value=reason))
            status.values = [*status.values, *added]
            self._status.publish(status)

    def _publish_reading(self, reading: GripperState) -> None:
        now, count = stamp(self._clock.now().nanoseconds), len(self._names)
        message = JointState(name=self._names)
        message.header.stamp, message.header.frame_id = now, f"{self._frame}base"
        message.position = [reading.position] * count
        message.velocity = [reading.speed] * count
        message.effort = [reading.force] * count
        self._states.publish(message)
        for channel, cup in reading.cups.items():
            pressure = FluidPressure(fluid_pressure=cup.pressure)
            pressure.header.stamp, pressure.header.frame_id = now, f"{self._frame}vacuum_{channel}"
            self._pressures[channel].publish(pressure)
            has_picked = cup.has_picked(self._threshold)
            if self._last_picked.get(channel) != has_picked:
                self._last_picked[channel] = has_picked
                self._picked[channel].publish(Bool(data=has_picked))


def gripper_status(side: Side, reading: GripperState | None) -> DiagnosticStatus:
    """A gripper for ``gripper/state`` and ``/diagnostics``."""
    status = DiagnosticStatus(name=f"yumi: {side.word} gripper", hardware_id=f"Hand_{side.name[0]}")
    if reading is None:
        status.level, status.message = DiagnosticStatus.STALE, "the controller reports nothing of it"
        return status
    status.level = DiagnosticStatus.OK
    if reading.state is ServoState.ERROR:
        status.level = DiagnosticStatus.ERROR
        status.message = f"error {reading.error}; look at the event log, then call clear_error"
    elif not reading.is_calibrated:
        status.level, status.message = DiagnosticStatus.WARN, "not calibrated; call calibrate"
    elif reading.is_holding:
        status.message = "holding"
    else:
        status.message = reading.state.name.lower().replace("_", " ")
    values: dict[str, object] = {
        "state": reading.state.name,
        "error": reading.error,
        "calibrated": reading.is_calibrated,
        "holding": reading.is_holding,
        "position": f"{reading.position:.4f}",
        "speed": f"{reading.speed:.4f}",
        "force": f"{reading.force:.1f}",
        "camera": reading.is_camera_linked,
    }
    for channel, cup in reading.cups.items():
        values[f"vacuum_{channel}"] = "on" if cup.sucks else "blowing off" if cup.blows else "off"
        values[f"pressure_{channel}"] = f"{cup.pressure:.0f}"
    status.values = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
    return status


_RETRY = 0.5  # [s] between two attempts to subscribe, and between two readings while there is no subscription


class FingerState(NamedTuple):
    """The fingers of one gripper, for the merged joint states.

    Attributes:
        position: of each from the middle [m].
        speed: of each, positive when opening [m/s].
    """

    position: float
    speed: float


class GripperParts(NamedTuple):
    """What the driver knows of both grippers.

    Attributes:
        grippers: both grippers.
        signals: the subscription to their signals.
        settings: forces, thresholds and modules.
    """

    grippers: Mapping[Side, RwsGripper]
    signals: GripperSignals
    settings: GripperSettings


class Grippers:
    """Serves both grippers on their nodes, and keeps the subscription to their signals.

    Args:
        parts: what is served.
        nodes: the node with the actions and services of each gripper.
        streams: a node for the topics of each.
        log: called when the subscription is lost, and when it is back.
        timers: keeps the topics' rates.
        check: raises RobotNotReady or CommandRefused when a gripper may not move.
        calibrate: calibrates a gripper.
        frames: what stands before the names of frames.
    """

    def __init__(
        self,
        parts: GripperParts,
        nodes: Mapping[Side, Any],
        streams: Mapping[Side, Any],
        log: Callable[[str], None],
        timers: TimerThread,
        check: Callable[[Side], None] = lambda side: None,
        calibrate: Callable[[RwsGripper], None] = RwsGripper.calibrate,
        frames: str = "",
    ) -> None:
        self._parts = parts
        self._log = log
        self._reason = ""
        self._read: dict[Side, FingerState] = {}
        self._is_over = Flag()
        self._thread = SupervisedThread("grippers", self._keep_subscription, self._is_over, self._on_failure)
        self._actions: list[GripperActionServer] = []
        self._topics = []
        for side, node in nodes.items():
            gripper, group, failures = parts.grippers[side], ReentrantCallbackGroup(), GoalFailures()
            may_move = partial(check, side)
            GripperServices(node, gripper, group, may_move, calibrate)
            for kind in (GripperAction, ParallelGripperAction):
                self._actions.append(kind(node, gripper, parts.settings.force, group, may_move, failures))
            pressure, channels = parts.settings.picked_pressure, parts.settings.modules(side).vacuum_channels
            reading, stream = partial(self._reading, side), streams[side]
            self._topics.append(GripperTopics(stream, side, reading, pressure, channels, timers, failures, frames))

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """End the thread and the subscription; before the client is closed."""
        self._is_over.set()
        self._thread.join()
        self._parts.signals.close()

    def destroy(self) -> None:
        """When nothing spins any more."""
        for action in self._actions:
            action.destroy()

    def fingers(self) -> dict[Side, FingerState]:
        """The fingers of each gripper as far as they are known."""
        readings = {side: self._reading(side) for side in self._parts.grippers}
        reported = {side: FingerState(one.position, one.speed) for side, one in readings.items() if one is not None}
        return {**self._read, **reported}

    def statuses(self) -> list[DiagnosticStatus]:
        """Both grippers for ``/diagnostics``."""
        return [gripper_status(side, self._reading(side)) for side in self._parts.grippers]

    def _reading(self, side: Side) -> GripperState | None:
        try:
            return self._parts.signals.state(side)
        except YumiError as error:
            self._log_reason(str(error))
            return None

    def _keep_subscription(self) -> None:
        while not self._is_over.wait(_RETRY):
            try:
                self._parts.signals.keep_open()
                self._read.clear()
                self._log_reason("")
            except NoConnection as error:
                self._read.clear()
                self._log_reason(f"Nothing is known of the grippers: {error}")
            except YumiError as error:
                self._log_reason(f"No subscription to the grippers' signals, they are read instead: {error}")
                for side, gripper in self._parts.grippers.items():
                    try:
                        self._read[side] = FingerState(gripper.position(), 0.0)
                    except YumiError:
                        self._read.pop(side, None)

    def _on_failure(self) -> None:
        """The thread has failed and begins again: until then nothing is known."""
        self._read.clear()
        self._log_reason("Nothing is known of the grippers: their subscription has failed, see the log.")
        self._parts.signals.close()

    def _log_reason(self, reason: str) -> None:
        if reason != self._reason:
            self._reason = reason
            self._log(reason or "The controller reports the grippers' signals.")
