"""The managed nodes of the driver: ``yumi_robot``, ``r/arm``, ``r/gripper`` (and both for l), led up in this order.

The robot manager's own node is none of them: its ``get_state`` is the thesis's, and a managed node's has another type.

What the driver's managed nodes lead through their lives: the robot, its arms and its hands.

A managed node (REP-2007): what it leads through its life is connected, permitted, held and let go one after another.

===================== ================================================================
transition            what it means here
===================== ================================================================
configure             connect and check
activate              permit motion
deactivate            hold, and permit none
cleanup               disconnect
shutdown              both of them; only a restart of the driver helps then
===================== ================================================================
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from threading import RLock
from typing import Any, Protocol

from rclpy._rclpy_pybind11 import RCLError
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.lifecycle import LifecycleNodeMixin, TransitionCallbackReturn
from rclpy.node import Node

from yumi.control.controller import State, Transition
from yumi.control.loop import CommandPort, Commands
from yumi.errors import CommandRefused, YumiError
from yumi.robot.joints import Side
from yumi.ros.controllers import ArmHardware
from yumi.ros.permission import Permission


class Connection(Protocol):
    """The way to the controller."""

    def connect(self) -> str:
        """Log in and check the controller; which one it is. Nothing where that has been done.

        Raises:
            YumiError: there is no way, or the controller cannot be used.
        """

    def disconnect(self) -> str:
        """Log out."""


class Stopping(Protocol):
    """What can bring the robot to a stop."""

    def end_motion(self) -> None:
        """Hold, and end EGM if the robot is in it."""


class Fingers(Protocol):
    """What is needed of a gripper."""

    def position(self) -> float:
        """Where its fingers are now [m]."""

    def hold(self) -> None:
        """Stop fingers that move; what it holds stays held.

        Raises:
            YumiError: it does not obey, or cannot be reached.
        """


class RobotLife:
    """The robot: its connection, and whether anything may move.

    Being active permits motion, whether or not the robot is ready for it: an emergency stop ends no permission.

    Args:
        connection: the way to it.
        manager: what ends EGM.
        line: where its arms are held, at once and whatever the connection is worth.
        grippers: its hands.
    """

    noun = "the robot"

    def __init__(
        self, connection: Connection, manager: Stopping, line: CommandPort, grippers: Iterable[Fingers]
    ) -> None:
        self._connection = connection
        self._manager = manager
        self._line = line
        self._grippers = tuple(grippers)

    def configure(self) -> str:
        return self._connection.connect()

    def activate(self) -> str:
        return "The robot's node is active: requests that move it are served."

    def deactivate(self) -> str:
        for side in Side:
            with suppress(YumiError):  # of a control process that has ended: EGM is ended all the same
                self._line.call(Commands.hold, side)
        try:
            self._manager.end_motion()
        finally:  # an arm whose EGM does not end is no reason to let fingers go on
            for gripper in self._grippers:
                with suppress(YumiError):  # not every robot has two hands
                    gripper.hold()
        return "The robot holds, and may not move."

    def cleanup(self) -> str:
        return self._connection.disconnect()


class ArmLife:
    """One arm: the hardware component whose interfaces controllers use.

    Args:
        side: which arm.
        hardware: its component.
    """

    def __init__(self, side: Side, hardware: ArmHardware) -> None:
        self.noun = f"the {side.word} arm"
        self._unit = side.unit
        self._hardware = hardware

    def configure(self) -> str:
        """What is active stays so: whoever asked for it has that already."""
        if self._hardware.info().state is State.UNCONFIGURED:
            self._hardware.bring_to(self._unit, State.INACTIVE)
        return f"{self.noun.capitalize()} is configured."

    def activate(self) -> str:
        self._hardware.bring_to(self._unit, State.ACTIVE)
        return f"{self.noun.capitalize()} is active: its controllers can be used."

    def deactivate(self) -> str:
        if self._hardware.info().state is State.ACTIVE:
            self._hardware.bring_to(self._unit, State.INACTIVE)
        return f"{self.noun.capitalize()} holds, and may not move."

    def cleanup(self) -> str:
        self._hardware.bring_to(self._unit, State.UNCONFIGURED)
        return f"{self.noun.capitalize()} offers nothing any more."


class GripperLife:
    """One hand.

    Args:
        side: which arm carries it.
        gripper: the hand.
    """

    def __init__(self, side: Side, gripper: Fingers) -> None:
        self.noun = f"the {side.word} gripper"
        self._gripper = gripper

    def configure(self) -> str:
        position = self._gripper.position()
        return f"{self.noun.capitalize()} is there, its fingers at {position * 1e3:.1f} mm."

    def activate(self) -> str:
        return f"{self.noun.capitalize()} is active: it takes goals."

    def deactivate(self) -> str:
        self._gripper.hold()
        return f"{self.noun.capitalize()} stands, keeps what it holds, and takes no goals."

    def cleanup(self) -> str:
        return f"{self.noun.capitalize()} is let go."


class Life(Protocol):
    """What a managed node leads; each step gives a sentence for the log and may raise YumiError."""

    noun: str
    """What it is in a sentence, e.g. ``the left arm``."""

    def configure(self) -> str:
        """Connect and check; on failure nothing is connected."""

    def activate(self) -> str:
        """Prepare for motion."""

    def deactivate(self) -> str:
        """Hold."""

    def cleanup(self) -> str:
        """Disconnect."""


class ManagedNode(LifecycleNodeMixin, Node):  # type: ignore[misc]  # rclpy has no types
    """The node of one life, with the services of every managed node (``~/change_state``, ``~/get_state`` …).

    Args:
        name: its name.
        life: what it leads.
        on_change: called after each transition, whoever wanted it.
        namespace: its namespace.

    Attributes:
        state: where it is; what a transition forbids is forbidden from its beginning on.
    """

    def __init__(self, name: str, life: Life, on_change: Callable[[], None], namespace: str = "") -> None:
        Node.__init__(self, name, namespace=namespace)
        self._life = life
        self._on_change = on_change
        self._lock = RLock()  # one transition at a time
        self.state = State.UNCONFIGURED
        LifecycleNodeMixin.__init__(self, callback_group=ReentrantCallbackGroup())
        # rclpy lets a transition that is not possible now raise, and then nobody answers who asked for it.
        service = self._service_change_state
        service.callback = self._answering(service.callback)

    def why_not_active(self) -> str | None:
        """What must be done before motion is permitted; None when it is."""
        return None if self.state is State.ACTIVE else self._demand("activate")

    def why_not_configured(self) -> str | None:
        """What must be done before there is a connection; None when there is one."""
        return None if self.state in {State.INACTIVE, State.ACTIVE} else self._demand("configure")

    def bring_up(self) -> None:
        """Configure and activate it, as far as that goes."""
        self.follow(lambda: State.ACTIVE)

    def follow(self, wanted: Callable[[], State]) -> None:
        """Go where what it leads has gone, or shall go; asked while nobody else changes it."""
        with self._lock:
            for step in _steps(self.state, wanted()):
                if getattr(self, f"trigger_{step.value}")() != TransitionCallbackReturn.SUCCESS:
                    return

    def on_configure(self, _: Any) -> Any:
        return self._step(self._life.configure, State.INACTIVE)

    def on_activate(self, _: Any) -> Any:
        return self._step(self._life.activate, State.ACTIVE)

    def on_deactivate(self, _: Any) -> Any:
        self.state = State.INACTIVE  # whatever becomes of it: nothing is permitted from now on
        self._step(self._life.deactivate, State.INACTIVE)
        return TransitionCallbackReturn.SUCCESS

    def on_cleanup(self, _: Any) -> Any:
        self.state = State.UNCONFIGURED  # from now on nobody asks
        self._step(self._life.cleanup, State.UNCONFIGURED)
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state: Any) -> Any:
        if self.state is State.ACTIVE:
            self.on_deactivate(state)
        if self.state is State.INACTIVE:
            self.on_cleanup(state)
        self.state = State.FINALIZED
        return TransitionCallbackReturn.SUCCESS

    def on_error(self, _: Any) -> Any:
        """A step failed as nobody foresaw, which the log says: from here it begins anew."""
        self.state = State.UNCONFIGURED
        return TransitionCallbackReturn.SUCCESS

    def _step(self, step: Callable[[], str], reached: State) -> Any:
        log = self.get_logger()
        try:
            log.info(step())
            self.state = reached
        except YumiError as error:
            log.error(str(error))
            return TransitionCallbackReturn.FAILURE
        except Exception as error:  # rclpy would make it an error without words
            log.error(f"{type(error).__name__}: {error}.")
            raise
        finally:
            self._on_change()
        return TransitionCallbackReturn.SUCCESS

    def _answering(self, change: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
        def answer(request: Any, response: Any) -> Any:
            try:
                with self._lock:
                    return change(request, response)
            except RCLError:
                wanted = request.transition.label or f"number {request.transition.id}"
                self.get_logger().error(f"Transition {wanted} refused: {self._life.noun} is {self.state.value}.")
                response.success = False
                return response

        return answer

    def _demand(self, transition: str) -> str:
        if self.state is State.FINALIZED:
            return f"{self._life.noun} has been shut down; restart the driver."
        if transition == "activate" and self.state is State.UNCONFIGURED:
            transition = "configure and activate"
        name = self.get_fully_qualified_name()
        return f"{self._life.noun} is {self.state.value}; {transition} it first (ros2 lifecycle set {name} …)."


_UP = {State.UNCONFIGURED: Transition.CONFIGURE, State.INACTIVE: Transition.ACTIVATE}
_DOWN = {State.ACTIVE: Transition.DEACTIVATE, State.INACTIVE: Transition.CLEANUP}
_ORDER = [State.UNCONFIGURED, State.INACTIVE, State.ACTIVE]


def _steps(begin: State, end: State) -> list[Transition]:
    """The transitions from one state to another; none where one of them is final."""
    if begin not in _ORDER or end not in _ORDER:
        return []
    first, last = _ORDER.index(begin), _ORDER.index(end)
    return [_UP[state] for state in _ORDER[first:last]] + [
        _DOWN[state] for state in reversed(_ORDER[last + 1 : first + 1])
    ]


def demand(*reasons: str | None) -> None:
    """Refuse with the first reason there is.

    Raises:
        CommandRefused: there is one.
    """
    for reason in reasons:
        if reason is not None:
            raise CommandRefused(reason[0].upper() + reason[1:])


ROBOT = "yumi_robot"
ARM = "arm"
GRIPPER = "gripper"


class ManagedNodes:
    """All of them.

    Args:
        connection: the way to the controller.
        manager: what stops the robot.
        line: where the arms' hardware components live.
        grippers: both hands.
        on_change: called after each transition.

    Attributes:
        permission: what they permit together.
        grippers: those of the hands, which have the hands' actions.
    """

    def __init__(
        self,
        connection: Connection,
        manager: Stopping,
        line: CommandPort,
        grippers: Mapping[Side, Fingers],
        on_change: Callable[[], None],
    ) -> None:
        self._robot = ManagedNode(ROBOT, RobotLife(connection, manager, line, grippers.values()), on_change)
        self._hardware = {side: ArmHardware(side, line) for side in Side}
        self._arms = {
            side: ManagedNode(ARM, ArmLife(side, hardware), on_change, side.value)
            for side, hardware in self._hardware.items()
        }
        self.grippers = {
            side: ManagedNode(GRIPPER, GripperLife(side, gripper), on_change, side.value)
            for side, gripper in grippers.items()
        }
        self.permission = Permission(self._robot, self._arms)

    @property
    def all(self) -> list[Any]:
        """Every node, in the order in which they are led up."""
        return [self._robot, *self._arms.values(), *self.grippers.values()]

    @property
    def is_connected(self) -> bool:
        """Whether the robot may be asked."""
        return self._robot.why_not_configured() is None

    def bring_up(self) -> None:
        """Configure and activate all, as far as that goes; the log says why one does not."""
        for node in self.all:
            node.bring_up()

    def follow_hardware(self, side: Side) -> None:
        """Lead an arm's node where its hardware component has been led by a controller manager's service."""
        self._arms[side].follow(lambda: self._hardware[side].state)

    def may_ask_hand(self, side: Side) -> bool:
        """Whether a hand may be asked."""
        return self.is_connected and self.grippers[side].why_not_configured() is None

    def why_no_grip(self, side: Side) -> str | None:
        """Why a hand takes no goals; None when it does."""
        return self.permission.to_move() or self.grippers[side].why_not_active()

    def destroy(self) -> None:
        """When nothing spins any more."""
        for node in self.all:
            node.destroy_node()
