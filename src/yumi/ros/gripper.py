"""Both hands in ROS: actions, services and topics of each, and the signals they all come from.

The actions of one hand: their results come from what the gripper measures, never from elapsed time.

The services of one hand: calibration, jog, stop, error, vacuum and blow-off.

What one hand shows, on topics: its fingers, its state, and the pressure in its vacuum modules.
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
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, Trigger

from yumi.driver.gripper import CHANNELS, Gripper
from yumi.driver.gripper_io import GripperSignals
from yumi.driver.settings import GripperSettings
from yumi.errors import CommandRefused, NoConnection, RobotNotReady, YumiError
from yumi.process.supervision import SupervisedThread
from yumi.robot.gripper import GripperGoal, GripperState, Outcome, ServoState, VacuumState, gripper_goal
from yumi.robot.joints import Side, finger_names
from yumi.ros.executors import Ticker
from yumi.ros.messages import stamp


class HandTurn:
    """Whose turn a hand's fingers are: one goal or service at a time; safe from any thread.

    It remembers why the last goal was refused or failed, too: the results of ROS's gripper actions have no text.

    Attributes:
        failures: how many goals were refused or failed, and why the last one was.
    """

    def __init__(self) -> None:
        self.failures = (0, "")
        self._lock = Lock()
        self._is_taken = False

    def take(self) -> bool:
        """Take it; False when somebody else has it."""
        with self._lock:
            was_taken, self._is_taken = self._is_taken, True
        return not was_taken

    def give_back(self) -> None:
        self._is_taken = False

    def fail(self, reason: str) -> None:
        """A goal was refused or failed."""
        with self._lock:
            self.failures = (self.failures[0] + 1, reason)


class HandAction(ABC):
    """Serves one action of a hand.

    Args:
        node: the gripper's node.
        gripper: the hand.
        force: holding force where a goal names none [N].
        group: callback group that lets a goal run while others are refused.
        why_not: why no goal is taken now; None when they are.
        turn: shared by all that moves the fingers.
    """

    kind: Any
    name: str

    def __init__(
        self,
        node: Any,
        gripper: Gripper,
        force: float,
        group: Any,
        why_not: Callable[[], str | None] = lambda: None,
        turn: HandTurn | None = None,
    ) -> None:
        self._log = node.get_logger()
        self._gripper = gripper
        self._force = force
        self._why_not_now = why_not
        self._turn = turn or HandTurn()
        self._server = ActionServer(
            node,
            self.kind,
            self.name,
            execute_callback=self._execute,
            goal_callback=self._consider,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
            callback_group=group,
        )

    def destroy(self) -> None:
        self._server.destroy()

    @abstractmethod
    def order(self, goal: Any) -> GripperGoal:
        """What a goal asks for.

        Raises:
            CommandRefused: it asks for what the hand cannot do.
        """

    @abstractmethod
    def feedback(self, position: float) -> Any:
        """The feedback while the fingers are at ``position`` [m]."""

    @abstractmethod
    def result(self, position: float, effort: float, *, stalled: bool, reached_goal: bool) -> Any:
        """The result when the fingers came to rest at ``position`` [m] and hold something with ``effort`` [N]."""

    def _consider(self, goal: Any) -> Any:
        reason = self._why_not(goal)
        if reason is None:
            return GoalResponse.ACCEPT
        self._turn.fail(reason)
        self._log.warning(f"Gripper goal refused: {reason}")
        return GoalResponse.REJECT

    def _why_not(self, goal: Any) -> str | None:
        """Why a goal is refused, or None; it then has its turn."""
        try:
            self.order(goal)
        except CommandRefused as error:
            return str(error)
        reason = self._why_not_now()
        if reason is None and not self._turn.take():
            return "another goal is being carried out; wait for its result, or cancel it."
        return reason

    def _execute(self, handle: Any) -> Any:
        order = self.order(handle.request)
        try:
            outcome = self._carry_out(handle, order)
        except YumiError as error:
            stopped = self._why_not_now()  # the robot may have been stopped meanwhile
            cause = f" {stopped}" if stopped and stopped not in str(error) else ""
            self._turn.fail(f"{error}{cause}")
            self._log.error(f"Gripper goal failed: {error}{cause}")
            handle.abort()
            return self._result_of(order, None)
        finally:
            self._turn.give_back()
        if outcome is None:
            handle.canceled()
        else:
            handle.succeed()
        return self._result_of(order, outcome)

    def _carry_out(self, handle: Any, order: GripperGoal) -> Outcome | None:
        self._gripper.begin(order, self._check)
        return self._gripper.wait(
            order,
            lambda position: handle.publish_feedback(self.feedback(position)),
            lambda: bool(handle.is_cancel_requested),
        )

    def _check(self) -> None:
        reason = self._why_not_now()
        if reason is not None:
            raise RobotNotReady(reason)

    def _result_of(self, order: GripperGoal, outcome: Outcome | None) -> Any:
        return self.result(
            self._gripper.last_position,
            order.force if outcome is Outcome.HOLDING else 0.0,
            stalled=outcome in {Outcome.HOLDING, Outcome.STALLED},
            reached_goal=outcome in {Outcome.OPEN, Outcome.CLOSED, Outcome.IN_PLACE},
        )


class GripperAction(HandAction):
    """``~/gripper_cmd``: the position of one finger joint [m], 0 is closed, 0.025 open; see ``gripper_goal``."""

    kind = GripperCommand
    name = "~/gripper_cmd"

    def order(self, goal: Any) -> GripperGoal:
        return gripper_goal(goal.command.position, goal.command.max_effort, self._force)

    def feedback(self, position: float) -> Any:
        return GripperCommand.Feedback(position=position)

    def result(self, position: float, effort: float, *, stalled: bool, reached_goal: bool) -> Any:
        return GripperCommand.Result(position=position, effort=effort, stalled=stalled, reached_goal=reached_goal)


class ParallelGripperAction(HandAction):
    """``~/parallel_gripper_cmd``: position, and where wanted speed and effort, of one finger joint or both."""

    kind = ParallelGripperCommand
    name = "~/parallel_gripper_cmd"

    def order(self, goal: Any) -> GripperGoal:
        command, names = goal.command, finger_names(self._gripper.side)
        unknown = [name for name in command.name if name not in names]
        if unknown:
            raise CommandRefused(f"{unknown[0]!r} is no finger of this hand; name {' or '.join(names)}, or none.")
        if not command.position:
            raise CommandRefused("The goal has no position; give that of a finger [m].")
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
        raise CommandRefused(f"The fingers cannot have different values of {what}: one motor moves both.")
    return float(values[0]) if values else 0.0


def hand_actions(
    node: Any,
    gripper: Gripper,
    force: float,
    group: Any,
    why_not: Callable[[], str | None] = lambda: None,
    turn: HandTurn | None = None,
) -> tuple[HandAction, ...]:
    """All actions of a hand; arguments as of :class:`HandAction`."""
    shared = turn or HandTurn()
    kinds: tuple[type[HandAction], ...] = (GripperAction, ParallelGripperAction)
    return tuple(kind(node, gripper, force, group, why_not, shared) for kind in kinds)


Action = Callable[[], str]


class GripperServices:
    """Serves calibrate, jog_open, jog_close, stop, clear_error, vacuum_1, blow_1, vacuum_2, blow_2.

    What the hand does not have is refused.

    Args:
        node: the gripper's node.
        gripper: the hand.
        group: callback group for what takes seconds.
        why_not: why nothing may move now; None when it may.
        turn: shared by all that moves the fingers.
        calibrate: calibrates the hand.
    """

    def __init__(
        self,
        node: Any,
        gripper: Gripper,
        group: Any,
        why_not: Callable[[], str | None],
        turn: HandTurn,
        calibrate: Callable[[Gripper], None],
    ) -> None:
        self._log = node.get_logger()
        self._gripper = gripper
        self._why_not_now = why_not
        self._turn = turn
        self._calibrate_hand = calibrate
        triggers: Mapping[str, Action] = {
            "calibrate": lambda: self._moving(self._calibrate),
            "jog_open": lambda: self._moving(partial(self._jog, opens=True)),
            "jog_close": lambda: self._moving(partial(self._jog, opens=False)),
            "stop": self._stop,
            "clear_error": self._clear_error,
        }
        for name, action in triggers.items():
            node.create_service(Trigger, f"~/{name}", partial(self._trigger, name, action), callback_group=group)
        for channel in CHANNELS:
            for name, switch in (("vacuum", self._switch_vacuum), ("blow", self._switch_blow)):
                full = f"{name}_{channel}"
                callback = partial(self._set, full, partial(switch, channel))
                node.create_service(SetBool, f"~/{full}", callback, callback_group=group)

    def _trigger(self, name: str, action: Action, _: Any, response: Any) -> Any:
        return self._answer(name, action, response)

    def _set(self, name: str, action: Callable[[bool], str], request: Any, response: Any) -> Any:
        return self._answer(name, lambda: action(bool(request.data)), response)

    def _answer(self, name: str, action: Action, response: Any) -> Any:
        try:
            response.message, response.success = action(), True
        except YumiError as error:
            self._log.error(f"{name}: {error}")
            response.message, response.success = str(error), False
        return response

    def _moving(self, action: Action) -> str:
        """Carry out what moves the fingers, unless something else does."""
        self._check()
        if not self._turn.take():
            raise CommandRefused("A goal is being carried out; wait for its result, or cancel it.")
        try:
            return action()
        finally:
            self._turn.give_back()

    def _check(self) -> None:
        reason = self._why_not_now()
        if reason is not None:
            raise RobotNotReady(reason)

    def _calibrate(self) -> str:
        self._calibrate_hand(self._gripper)
        return "The gripper is calibrated: closed is 0."

    def _jog(self, *, opens: bool) -> str:
        self._gripper.jog(opens=opens, check=self._check)
        return f"The fingers {'open' if opens else 'close'} until stop is called."

    def _stop(self) -> str:
        self._gripper.stop()
        return "The fingers stand; what they held is free."

    def _clear_error(self) -> str:
        self._gripper.clear_error()
        return "The gripper reports no error."

    def _switch_vacuum(self, channel: int, is_on: bool) -> str:
        self._gripper.check_vacuum(channel)
        self._check()
        self._gripper.switch_vacuum(channel, is_on=is_on)
        return f"Vacuum {channel} is {'on' if is_on else 'off'}."

    def _switch_blow(self, channel: int, is_on: bool) -> str:
        self._gripper.check_vacuum(channel)
        self._check()
        self._gripper.switch_blow_off(channel, is_on=is_on)
        return f"Blow-off {channel} is {'on' if is_on else 'off'}."


PERIOD = 0.04
"""Time between two messages [s]: the controller tells what changes every 50 ms, and none shall be missed."""

FAILURES, FAILURE = "goals_failed", "last_failure"
"""Keys in ``gripper/state``: how many goals were refused or failed, and why the last one was."""

_DEPTH = 10
_STATE_EVERY = 12  # messages, while nothing changes
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class GripperTopics:
    """Publishes ``gripper/joint_states``, ``gripper/state``, ``gripper/vacuum_1/pressure`` and ``…/object_picked``.

    Nothing comes while the controller tells nothing of the hand, except ``gripper/state`` after a goal that was refused
    or failed.

    Args:
        node: a node in the arm's namespace.
        side: which arm carries the hand.
        reading: the hand as it is now, or None while that is not known.
        picked_pressure: a vacuum module whose pressure is not above this has picked something [Pa].
        channels: its vacuum modules.
        ticker: keeps the rate.
        turn: knows why the last goal was refused or failed.
    """

    def __init__(
        self,
        node: Any,
        side: Side,
        reading: Callable[[], GripperState | None],
        picked_pressure: float,
        channels: tuple[int, ...],
        ticker: Ticker,
        turn: HandTurn,
    ) -> None:
        self._clock = node.get_clock()
        self._names = list(finger_names(side))
        self._side = side
        self._reading = reading
        self._threshold = picked_pressure
        self._states = node.create_publisher(JointState, "gripper/joint_states", _DEPTH)
        self._status = node.create_publisher(DiagnosticStatus, "gripper/state", _LATCHED)
        topic = "gripper/vacuum_{}/{}"
        self._pressures = {
            each: node.create_publisher(FluidPressure, topic.format(each, "pressure"), _DEPTH) for each in channels
        }
        self._picked = {
            each: node.create_publisher(Bool, topic.format(each, "object_picked"), _LATCHED) for each in channels
        }
        self._told: dict[int, bool] = {}
        self._turn = turn
        self._failures = turn.failures
        self._last: ServoState | None = None
        self._count = 0
        ticker.every(PERIOD, f"{side.value}/gripper", self._publish)

    def _publish(self) -> None:
        reading, failures = self._reading(), self._turn.failures
        has_failed, self._failures = failures != self._failures, failures
        if reading is None:
            if has_failed:
                self._publish_status(None)
            return
        now = stamp(self._clock.now().nanoseconds)
        self._states.publish(self._fingers(reading, now))
        for channel, cup in reading.cups.items():
            self._publish_cup(channel, cup, now)
        self._count += 1
        if has_failed or reading.state is not self._last or self._count % _STATE_EVERY == 0:
            self._last = reading.state
            self._publish_status(reading)

    def _publish_status(self, reading: GripperState | None) -> None:
        status, (count, reason) = gripper_status(self._side, reading), self._failures
        status.values = [*status.values, KeyValue(key=FAILURES, value=str(count)), KeyValue(key=FAILURE, value=reason)]
        self._status.publish(status)

    def _fingers(self, reading: GripperState, now: Any) -> Any:
        count = len(self._names)
        message = JointState(name=self._names)
        message.header.stamp = now
        message.position = [reading.position] * count
        message.velocity = [reading.speed] * count
        message.effort = [reading.force] * count
        return message

    def _publish_cup(self, channel: int, cup: VacuumState, now: Any) -> None:
        message = FluidPressure(fluid_pressure=cup.pressure)
        message.header.stamp = now
        self._pressures[channel].publish(message)
        has_picked = cup.has_picked(self._threshold)
        if self._told.get(channel) != has_picked:
            self._told[channel] = has_picked
            self._picked[channel].publish(Bool(data=has_picked))


def gripper_status(side: Side, reading: GripperState | None) -> DiagnosticStatus:
    """A hand for ``gripper/state`` and ``/diagnostics``."""
    status = DiagnosticStatus(name=f"yumi: {side.word} gripper", hardware_id=f"Hand_{side.name[0]}")
    status.level, status.message = _level(reading)
    if reading is not None:
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


def _level(reading: GripperState | None) -> tuple[bytes, str]:
    if reading is None:
        return DiagnosticStatus.STALE, "the controller tells nothing of it"
    if reading.state is ServoState.ERROR:
        return DiagnosticStatus.ERROR, f"error {reading.error}; look at the event log, then call clear_error"
    if not reading.is_calibrated:
        return DiagnosticStatus.WARN, "not calibrated; call calibrate"
    if reading.is_holding:
        return DiagnosticStatus.OK, "holding"
    return DiagnosticStatus.OK, reading.state.name.lower().replace("_", " ")


_RETRY = 0.5  # [s] between two attempts to have the controller tell, and between two looks while it does not


class FingerState(NamedTuple):
    """The fingers of one hand, for the merged joint states.

    Attributes:
        position: of each from the middle [m].
        speed: of each, positive when opening [m/s].
    """

    position: float
    speed: float


class HandParts(NamedTuple):
    """What is served.

    Attributes:
        grippers: both hands.
        signals: what the controller tells of them.
        settings: forces, thresholds and what they are made of.
    """

    grippers: Mapping[Side, Gripper]
    signals: GripperSignals
    settings: GripperSettings


class Hands:
    """Serves both hands on their nodes, and keeps their signals coming.

    Args:
        parts: what is served.
        nodes: the node with the actions and services of each hand.
        streams: a node for the topics of each.
        say: told when the controller does not tell of the hands, and when it does again.
        ticker: keeps the topics' rates.
        why_not: why a hand may not move now; None when it may.
        may_ask: whether the robot may be asked.
        calibrate: calibrates a hand.
    """

    def __init__(
        self,
        parts: HandParts,
        nodes: Mapping[Side, Any],
        streams: Mapping[Side, Any],
        say: Callable[[str], None],
        ticker: Ticker,
        why_not: Callable[[Side], str | None] = lambda side: None,
        may_ask: Callable[[Side], bool] = lambda side: True,
        calibrate: Callable[[Gripper], None] = Gripper.calibrate,
    ) -> None:
        self._parts = parts
        self._say = say
        self._may_ask = may_ask
        self._calibrate = calibrate
        self._reason = ""
        self._asked: dict[Side, FingerState] = {}
        self._is_over = Flag()
        self._thread = SupervisedThread("hands", self._watch, self._is_over, self._forget)
        self._turns = {side: HandTurn() for side in Side}
        self._actions = [
            action for side, node in nodes.items() for action in self._serve(side, node, partial(why_not, side))
        ]
        settings = parts.settings
        self._topics = [
            GripperTopics(
                node,
                side,
                partial(self._reading, side),
                settings.picked_pressure,
                settings.modules(side).vacuum_channels,
                ticker,
                self._turns[side],
            )
            for side, node in streams.items()
        ]

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
        """The fingers of each hand as far as they are known."""
        readings = {side: self._reading(side) for side in self._parts.grippers}
        told = {side: FingerState(one.position, one.speed) for side, one in readings.items() if one is not None}
        return {**self._asked, **told}

    def statuses(self) -> list[DiagnosticStatus]:
        """Both hands for ``/diagnostics``."""
        return [gripper_status(side, self._reading(side)) for side in self._parts.grippers]

    def _serve(self, side: Side, node: Any, why_not: Callable[[], str | None]) -> tuple[Any, ...]:
        gripper, group, turn = self._parts.grippers[side], ReentrantCallbackGroup(), self._turns[side]
        GripperServices(node, gripper, group, why_not, turn, self._calibrate)
        return hand_actions(node, gripper, self._parts.settings.force, group, why_not, turn)

    def _reading(self, side: Side) -> GripperState | None:
        try:
            return self._parts.signals.state(side)
        except YumiError as error:
            self._tell(str(error))
            return None

    def _watch(self) -> None:
        while not self._is_over.wait(_RETRY):
            sides = [side for side in self._parts.grippers if self._may_ask(side)]
            if not sides:
                continue
            try:
                self._parts.signals.keep_open()
                self._asked.clear()
                self._tell("")
            except NoConnection as error:
                self._asked.clear()
                self._tell(f"Nothing is known of the grippers: {error}")
            except YumiError as error:
                self._tell(f"The controller does not tell of the grippers by itself, they are asked: {error}")
                self._ask(sides)

    def _forget(self) -> None:
        """The watch has failed and begins anew: until then nothing is known that it feeds."""
        self._asked.clear()
        self._tell("Nothing is known of the grippers: their watch has failed, see the log.")
        self._parts.signals.close()

    def _ask(self, sides: list[Side]) -> None:
        """Where the fingers are, twice a second; what cannot be asked is not known."""
        for side in sides:
            try:
                self._asked[side] = FingerState(self._parts.grippers[side].position(), 0.0)
            except YumiError:
                self._asked.pop(side, None)

    def _tell(self, reason: str) -> None:
        if reason != self._reason:
            self._reason = reason
            self._say(reason or "The controller tells of the grippers by itself.")
