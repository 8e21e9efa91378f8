"""A managed node (REP-2007): what it leads through its life is connected, permitted, held and let go one after another.

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

from collections.abc import Callable
from threading import RLock
from typing import Any, Protocol

from rclpy._rclpy_pybind11 import RCLError
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.lifecycle import LifecycleNodeMixin, TransitionCallbackReturn
from rclpy.node import Node

from yumi.control.lifecycle import State, Transition
from yumi.errors import CommandRefused, YumiError


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
