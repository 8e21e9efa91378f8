"""The controller manager of one arm: which controllers exist, who is active, who claims which interface.

Switching happens between two cycles; an interface has one owner at a time; a controller whose update fails is
deactivated and the arm holds (reference/ros2_control.md §1.11). What each cycle needs is prepared when controllers
are switched.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager

from yumi.control.component import HardwareComponent
from yumi.control.controller import Controller
from yumi.control.inventory import ControllerInfo, HardwareInfo, ParameterInfo
from yumi.control.lifecycle import State
from yumi.control.loaded import LoadedController
from yumi.control.merge import MergedCommand
from yumi.control.parameter import Values
from yumi.control.requests import Strictness
from yumi.control.stations import DECODE, UPDATE
from yumi.control.switching import Switch, find, plan_switch
from yumi.errors import CommandRefused, SwitchFailed
from yumi.robot.joints import Joints
from yumi.robot.values import ZERO, ArmCommand, ArmState

Kinds = Mapping[str, Callable[[str], Controller]]
"""How a controller of each type is made, given its name."""

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


class ControllerManager:
    """Owns the controllers of one arm.

    Attributes:
        failures: sentences about controllers that failed; whoever tells them takes them out.
        activations: how often a controller was activated.
        activity: counts every change of what is loaded and in which state it is.
        kinds: the types of controllers that can be loaded.

    Args:
        joint_names: the arm's joints, chain order.
        kinds: how a controller of each type is made.
        component: name of the arm's hardware component.
        now: tells the time [s], for statistics alone.
    """

    def __init__(
        self,
        joint_names: tuple[str, ...],
        kinds: Kinds | None = None,
        component: str = "arm",
        now: Callable[[], float] = lambda: 0.0,
    ) -> None:
        self.failures: list[str] = []
        self.activations = 0
        self.activity = 0
        self._joint_names = joint_names
        self._kinds = kinds or {}
        self._component = HardwareComponent(component, joint_names)
        self._now = now
        self._loaded: dict[str, LoadedController] = {}
        self._notices: list[tuple[str, object]] = []
        self._prepare()

    @property
    def kinds(self) -> tuple[str, ...]:
        """The types of controllers that can be loaded."""
        return tuple(self._kinds)

    def load(self, name: str, controller: Controller) -> None:
        """Add a controller, unconfigured.

        Raises:
            CommandRefused: the name is taken or could not be that of a ROS node.
        """
        self._check_name(name)
        self._loaded[name] = LoadedController(name, controller, self._joint_names)
        self._note_change()

    def load_kind(self, name: str, kind: str, values: Values | None = None) -> None:
        """Make a controller of type ``kind``, unconfigured, with parameters that differ from their defaults.

        Raises:
            CommandRefused: the name is not allowed, the type unknown, or a value not allowed; nothing was changed.
        """
        self._check_name(name)
        if kind not in self._kinds:
            known = ", ".join(self._kinds) or "none"
            raise CommandRefused(
                f"Controller {name!r} cannot be loaded: type {kind!r} is not known; known are: {known}."
            )
        with _told(name, "loaded"):
            loaded = LoadedController(name, self._kinds[kind](name), self._joint_names)
            loaded.set_parameters(values or {})
        self._loaded[name] = loaded
        self._note_change()

    def unload(self, name: str) -> None:
        """Forget a controller.

        Raises:
            CommandRefused: no such controller, or it is active.
        """
        loaded = find(self._loaded, name)
        if loaded.state is State.ACTIVE:
            raise CommandRefused(f"Controller {name!r} is active and cannot be unloaded; deactivate it first.")
        with _told(name, "unloaded"):
            loaded.clean_up()
        del self._loaded[name]
        self._note_change()

    def configure(self, name: str, values: Values | None = None) -> None:
        """Give an unconfigured or inactive controller its parameters and make it inactive.

        Raises:
            CommandRefused: no such controller, wrong state, unknown parameter or value not allowed.
        """
        try:
            with _told(name, "configured"):
                find(self._loaded, name).configure(values)
        finally:
            self._note_change()

    def clean_up(self, name: str) -> None:
        """Make an inactive controller unconfigured.

        Raises:
            CommandRefused: no such controller, or it is active.
        """
        with _told(name, "cleaned up"):
            find(self._loaded, name).clean_up()
        self._note_change()

    def set_parameters(self, name: str, values: Values) -> None:
        """Change parameters; an active controller uses them from the next cycle on.

        Raises:
            CommandRefused: no such controller, unknown parameter or value out of range; nothing was changed.
        """
        with _told(name, "given parameters"):
            find(self._loaded, name).set_parameters(values)

    def parameters(self, name: str) -> tuple[ParameterInfo, ...]:
        """What can be set on a controller and what is set.

        Raises:
            CommandRefused: no such controller.
        """
        return find(self._loaded, name).parameters()

    def switch(
        self,
        activate: Sequence[str],
        deactivate: Sequence[str],
        state: ArmState | None,
        strictness: Strictness = Strictness.STRICT,
    ) -> str:
        """Deactivate and activate controllers as one step, or change nothing at all; a sentence says what was done.

        Args:
            activate: names of inactive controllers, or of active ones that are deactivated, too: they begin anew.
            deactivate: names of active controllers.
            state: the arm's newest state; command controllers need one to begin from.
            strictness: whether controllers that cannot do what they shall are left out.

        Raises:
            CommandRefused: a name, a state or a claim stands against it; nothing was changed.
            SwitchFailed: a controller could not begin.
        """
        switch = plan_switch(self._loaded, self._component, activate, deactivate, strictness)
        begin = self._state_to_begin(switch.activate, state)
        self._deactivate(switch.deactivate)
        try:
            self._activate(switch, begin, strictness)
        finally:
            self._note_change()
        return switch.sentence

    def deactivate_commanding(self) -> tuple[str, ...]:
        """Deactivate whatever commands the arm, e.g. because the robot is lost; returns the names."""
        commanding = self._commanding
        if commanding:
            self._deactivate(commanding)
            self._note_change()
        return tuple(loaded.name for loaded in commanding)

    def set_hardware_state(self, name: str, state: State) -> HardwareInfo:
        """Lead the hardware component to ``state``; who uses what it no longer offers is deactivated.

        Raises:
            CommandRefused: no such component, or a state it cannot have; nothing was changed.
        """
        if name != self._component.name:
            raise CommandRefused(f"There is no hardware component {name!r}; this arm has: {self._component.name}.")
        self._component.check_state(state)
        if state is not State.ACTIVE:
            leaving = self._active if state is State.UNCONFIGURED else self._commanding
            self._deactivate(leaving)
        self._component.state = state
        self._note_change()
        return self.hardware()

    def check(self, name: str, message: object, state: ArmState | None) -> None:
        """Whether :meth:`receive` would have a controller take ``message``; changes nothing.

        Raises:
            CommandRefused: it would not, and why.
        """
        find(self._loaded, name).check_order(message, state)

    def receive(self, name: str, message: object, state: ArmState | None) -> None:
        """Have an active controller take an order.

        Args:
            name: the controller.
            message: a value it knows.
            state: the arm's newest state; None while it is not heard.

        Raises:
            CommandRefused: no such controller, not active, or it refuses the order; nothing was changed.
        """
        self.check(name, message, state)
        self._loaded[name].controller.receive(message, state)

    def update(self, state: ArmState) -> ArmCommand | None:
        """What the active controllers want; None holds. Never raises: who fails is deactivated."""
        try:
            return self._ask(state)
        except Exception as error:
            self._fail(self._commanding[self._merged.asked if self._merged else 0], error)
            return None

    def watch(self, state: ArmState) -> None:
        """Let the controllers that only watch see ``state``; after the reply has left. Never raises."""
        for loaded in self._watching:
            begin = self._now()
            try:
                loaded.controller.update(state)
            except Exception as error:
                self._fail(loaded, error)
            loaded.execution_time.add(self._now() - begin)

    def note_times(self, state: ArmState, marks: Sequence[float]) -> None:
        """After the reply to ``state``: take the times of the cycle's stations into the statistics."""
        self._component.note(state.session, state.time, marks)
        if self._merged is not None:
            for loaded, duration in zip(self._commanding, self._merged.times, strict=True):
                loaded.execution_time.add(duration)
        elif self._commanding:
            self._commanding[0].execution_time.add(marks[UPDATE] - marks[DECODE])

    def take_notices(self) -> Sequence[tuple[str, object]]:
        """What the controllers have to tell since the last call: their name and the notice."""
        for loaded in self._active:
            try:
                for notice in loaded.controller.take_notices():
                    self._notices.append((loaded.name, notice))
            except Exception as error:
                self._fail(loaded, error)
        if not self._notices:
            return ()
        notices, self._notices = self._notices, []
        return notices

    @property
    def is_commanding(self) -> bool:
        """Whether a controller commands the arm."""
        return bool(self._commanding)

    @property
    def reference(self) -> Joints | None:
        """Where the commanding controllers are going [rad]; None when nobody commands."""
        for loaded in self._commanding:
            reference = loaded.controller.reference
            if reference is not None:
                return reference
        return None

    def controllers(self) -> tuple[ControllerInfo, ...]:
        """All loaded controllers in the order of loading."""
        return tuple(loaded.info() for loaded in self._loaded.values())

    def hardware(self) -> HardwareInfo:
        """The arm's hardware component and who claims its interfaces."""
        claimed = {interface for loaded in self._commanding for interface in loaded.required}
        return self._component.info(claimed)

    def _check_name(self, name: str) -> None:
        if name in self._loaded:
            raise CommandRefused(f"Controller {name!r} is loaded already; unload it first or choose another name.")
        if not _NAME.fullmatch(name):
            raise CommandRefused(
                f"Controller name {name!r} cannot be the name of a node; use letters, digits and underscores."
            )

    def _state_to_begin(self, starting: Iterable[LoadedController], state: ArmState | None) -> ArmState:
        if state is not None and state.is_running:
            return state
        needy = next((loaded.name for loaded in starting if loaded.controller.is_command), None)
        if needy:
            raise CommandRefused(f"Controller {needy!r} cannot start: EGM is not running on this arm; start EGM first.")
        return state or _NOWHERE

    def _activate(self, switch: Switch, begin: ArmState, strictness: Strictness) -> None:
        """A strict switch in which one controller cannot begin leaves none of its controllers active."""
        begun: list[LoadedController] = []
        failures = []
        for loaded in switch.activate:
            try:
                loaded.activate(begin)
            except Exception as error:
                failures.append(f"Controller {loaded.name!r} could not be activated: {_words(error)}.")
                if strictness is Strictness.STRICT:
                    self._deactivate(begun)
                    break
            else:
                begun.append(loaded)
                self.activations += 1
        if failures:
            active = ", ".join(loaded.name for loaded in self._loaded.values() if loaded.state is State.ACTIVE)
            raise SwitchFailed(f"{' '.join(failures)} Active now: {active or 'none'}.")

    def _deactivate(self, leaving: Iterable[LoadedController]) -> None:
        """Whatever a controller does on its way out, it is inactive then."""
        for loaded in leaving:
            try:
                loaded.deactivate()
                self._notices += [(loaded.name, notice) for notice in loaded.controller.take_notices()]
            except Exception as error:
                self.failures.append(f"Controller {loaded.name!r} failed while it was deactivated: {_words(error)}.")

    def _fail(self, failed: LoadedController, error: Exception) -> None:
        """Who made one command together goes together: what is left of it means nothing."""
        is_commanding = failed in self._commanding
        leaving = self._commanding if is_commanding else (failed,)
        others = [repr(loaded.name) for loaded in leaving if loaded is not failed]
        went = f"it and {', '.join(others)} were" if others else "it was"
        consequence = f"{went} deactivated{' and the arm holds' if is_commanding else ''}."
        self.failures.append(f"Controller {failed.name!r} failed with {_words(error)}; {consequence}")
        self._deactivate(leaving)
        self._note_change()

    def _note_change(self) -> None:
        self.activity += 1
        self._prepare()

    def _prepare(self) -> None:
        """What every cycle needs."""
        active = tuple(loaded for loaded in self._loaded.values() if loaded.state is State.ACTIVE)
        self._active = active
        self._commanding = tuple(loaded for loaded in active if loaded.controller.is_command)
        self._watching = tuple(loaded for loaded in active if not loaded.controller.is_command)
        self._merged = (
            MergedCommand(self._commanding, self._joint_names, self._now) if len(self._commanding) > 1 else None
        )
        self._ask = self._merged.update if self._merged else _one_or_none(self._commanding)


_NOWHERE = ArmState(0.0, 0.0, 0, ZERO, ZERO, ZERO, is_running=False)
"""Given to controllers that only watch, when no state has come yet."""


def _one_or_none(commanding: Sequence[LoadedController]) -> Callable[[ArmState], ArmCommand | None]:
    return commanding[0].controller.update if commanding else lambda state: None


def _words(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"


@contextmanager
def _told(name: str, done: str) -> Iterator[None]:
    """Whatever else a controller raises when it is called is a refusal with its name."""
    try:
        yield
    except CommandRefused:
        raise
    except Exception as error:
        raise CommandRefused(f"Controller {name!r} could not be {done}: {_words(error)}.") from error
