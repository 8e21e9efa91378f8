"""The controller manager of one arm: which controllers exist, which are active, which claims which interface.

Switching happens between two cycles; an interface has one owner at a time; a controller whose update fails is
deactivated and the arm holds (reference/ros2_control.md §1.11). What each cycle needs is prepared when controllers
are switched. The hardware component decides which interfaces may be used (§2); it never moves the arm: while it is
inactive no controller commands the arm, which holds; while it is unconfigured no interface can be read either. The
robot gets its replies in any state.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import reduce
from operator import or_

from abb_protocols.catalogue import Message, message, said_by
from abb_protocols.errors import CommandRefused, SwitchFailed
from abb_protocols.robot.joints import ZERO_JOINTS, ArmCommand, ArmState, Joints
from abb_runtime.parameters import Values
from yumi.control.controller import Controller, State
from yumi.control.controller_info import ControllerInfo, HardwareInfo, ParameterInfo
from yumi.control.goals import GoalKind
from yumi.control.manager.controller_switch import Strictness, Switch, find_loaded, plan_switch
from yumi.control.manager.hardware_component import HardwareComponent
from yumi.control.manager.loaded_controller import LoadedController
from yumi.control.manager.merged_command import MergedCommand
from yumi.control.motion.standstill import SentPositions
from yumi.control.sampled import Sampled
from yumi.control.stage_times import DECODE_STAGE, UPDATE_STAGE

_Kinds = Mapping[str, Callable[[str], Controller]]
"""How a controller of each type is made, given its name."""

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


class ControllerManager:
    """Owns the controllers of one arm.

    Attributes:
        failures: which controllers failed, and how; the reader removes them.
        activation: number of the newest activation of a controller that commands; a later one has a higher number.
        activity: counts every change of what is loaded and in which state it is.
        goal_kind: which goals those controllers take that command the arm.
        sent: what the arm is sent; who replies notes it.
        kinds: the types of controllers that can be loaded.

    Args:
        joint_names: the arm's joints, chain order.
        kinds: how a controller of each type is made.
        component: name of the arm's hardware component.
        now: the time [s], for statistics alone.
        activity: what to count on from: that of a control process before.
    """

    def __init__(
        self,
        joint_names: tuple[str, ...],
        kinds: _Kinds | None = None,
        component: str = "arm",
        now: Callable[[], float] = lambda: 0.0,
        activity: int = 0,
    ) -> None:
        self.failures: list[Message] = []
        self._is_interrupted = False  # what commanded the arm was ended, and nothing was activated since
        self.activation = 0
        self.activity = activity
        self.sent = SentPositions()
        self._joint_names = joint_names
        self._kinds = kinds or {}
        self._component = HardwareComponent(component, joint_names)
        self._now = now
        self._loaded: dict[str, LoadedController] = {}
        self._reports: list[tuple[str, object]] = []
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
        controller.sent = self.sent
        self._loaded[name] = LoadedController(name, controller, self._joint_names)
        self._note_change()

    def load_kind(self, name: str, kind: str) -> None:
        """Make a controller of type ``kind``, unconfigured.

        Raises:
            CommandRefused: the name is not allowed, or the type unknown; nothing was changed.
        """
        self._check_name(name)
        if kind not in self._kinds:
            raise CommandRefused(
                message("controller_type_unknown", controller=name, type=kind, types=tuple(self._kinds))
            )
        with _refusing(name, "load"):
            self.load(name, self._kinds[kind](name))

    def unload(self, name: str) -> None:
        """Forget a controller.

        Raises:
            CommandRefused: no such controller, or it is active.
        """
        loaded = find_loaded(self._loaded, name)
        if loaded.state is State.ACTIVE:
            raise CommandRefused(message("controller_still_active", controller=name))
        with _refusing(name, "unload"):
            loaded.clean_up()
        del self._loaded[name]
        self._note_change()

    def configure(self, name: str) -> None:
        """Give an unconfigured or inactive controller its parameters and make it inactive.

        Raises:
            CommandRefused: no such controller, wrong state, or values that do not go together.
        """
        try:
            with _refusing(name, "configure"):
                find_loaded(self._loaded, name).configure()
        finally:
            self._note_change()

    def clean_up(self, name: str) -> None:
        """Make an inactive controller unconfigured.

        Raises:
            CommandRefused: no such controller, or it is active.
        """
        with _refusing(name, "cleanup"):
            find_loaded(self._loaded, name).clean_up()
        self._note_change()

    def set_parameters(self, name: str, values: Values) -> None:
        """Change parameters; an active controller uses them from the next cycle on.

        Raises:
            CommandRefused: no such controller, unknown parameter or value out of range; nothing was changed.
        """
        with _refusing(name, "set_parameters"):
            find_loaded(self._loaded, name).set_parameters(values)

    def parameters(self, name: str) -> tuple[ParameterInfo, ...]:
        """What can be set on a controller and what is set.

        Raises:
            CommandRefused: no such controller.
        """
        return find_loaded(self._loaded, name).parameters()

    def switch(
        self,
        activate: Sequence[str],
        deactivate: Sequence[str],
        state: ArmState | None,
        strictness: Strictness = Strictness.STRICT,
    ) -> str:
        """Deactivate and activate controllers as one step, or change nothing at all; says in sentences what was done.

        Args:
            activate: names of inactive controllers, or of active ones that are deactivated, too: they begin anew.
            deactivate: names of active controllers.
            state: the arm's newest state; command controllers need one to begin from.
            strictness: whether controllers that cannot do what is asked are left out.

        Raises:
            CommandRefused: a name, a state or a claim stands against it; nothing was changed.
            SwitchFailed: a controller could not begin.
        """
        switch = plan_switch(self._loaded, self._component, activate, deactivate, strictness)
        if state is None or not state.is_running:
            needy = next((loaded.name for loaded in switch.activate if loaded.controller.is_command), None)
            if needy:
                raise _without_egm(needy)
        begin = state or _NOWHERE
        self._deactivate(switch.deactivate)
        try:
            self._activate(switch, begin, strictness)
        finally:
            self._note_change()
        self._is_interrupted = self._is_interrupted and not self._commanding
        return switch.sentences

    def check_take_over(self, name: str, state: ArmState | None, now: float) -> tuple[str, ...]:
        """The controllers in whose place an inactive one may be activated for a goal: those that move nothing.

        Args:
            name: the controller that has a goal.
            state: the arm's newest state; None while it is not heard.
            now: the time [s].

        Raises:
            CommandRefused: no such controller, EGM does not run, another controller commands the arm, or what commanded
                the arm was ended by an incident: only who brings the arm back activates a controller then, and not
                the next goal of a client that tries again and again.
        """
        find_loaded(self._loaded, name)
        if state is None or not state.is_running:
            raise _without_egm(name)
        if self._is_interrupted:
            raise CommandRefused(message("controllers_were_ended", controller=name))
        busy = [loaded.name for loaded in self._commanding if not loaded.controller.is_idle(now)]
        if busy:
            raise CommandRefused(message("controller_inactive", controller=name, commanding=tuple(busy)))
        return tuple(loaded.name for loaded in self._commanding)

    def is_inactive(self, name: str) -> bool:
        """Whether there is such a controller, which could be activated."""
        loaded = self._loaded.get(name)
        return loaded is not None and loaded.state is State.INACTIVE

    @property
    def commanding(self) -> tuple[str, ...]:
        """Names of the controllers that command the arm."""
        return tuple(loaded.name for loaded in self._commanding)

    def deactivate_commanding(self) -> tuple[str, ...]:
        """Deactivate whatever commands the arm, e.g. because the robot is lost; returns the names."""
        commanding = self._commanding
        if commanding:
            self._is_interrupted = True
            self._deactivate(commanding)
            self._note_change()
        return tuple(loaded.name for loaded in commanding)

    def end_streams(self, state: ArmState) -> None:
        """Have what commands the arm bring it to rest, see :meth:`.Controller.end_stream`; else it is deactivated."""
        try:
            is_ended = all(loaded.controller.end_stream(state) for loaded in self._commanding)
        except Exception as error:
            self._fail(self._commanding[0], error)
            return
        if not is_ended:
            self.deactivate_commanding()

    def set_hardware_state(self, name: str, state: State) -> HardwareInfo:
        """Lead the hardware component to ``state``; who uses what it no longer offers is deactivated.

        Raises:
            CommandRefused: no such component, or a state it cannot have; nothing was changed.
        """
        if name != self._component.name:
            raise CommandRefused(message("hardware_unknown", component=name, own_component=self._component.name))
        self._component.check_state(state)
        if state is not State.ACTIVE:
            leaving = self._active if state is State.UNCONFIGURED else self._commanding
            self._deactivate(leaving)
        self._component.state = state
        self._note_change()
        return self.hardware()

    def check(self, name: str, command: object, state: ArmState | None) -> None:
        """Whether :meth:`receive` would have a controller take ``command``; changes nothing.

        Raises:
            CommandRefused: it would not, and why.
        """
        find_loaded(self._loaded, name).check_command(command, state)

    def receive(self, name: str, command: object, state: ArmState | None) -> object:
        """Have an active controller take a command.

        Args:
            name: the controller.
            command: a value it knows.
            state: the arm's newest state; None while it is not heard.

        Returns:
            What the controller made of it, see :meth:`.Controller.receive`.

        Raises:
            CommandRefused: no such controller, not active, or it refuses the command; nothing was changed.
        """
        self.check(name, command, state)
        return self._loaded[name].controller.receive(command, state)

    def update(self, state: ArmState) -> ArmCommand | None:
        """What the active controllers want; None holds. Never raises: who fails is deactivated."""
        try:
            return self._ask(state)
        except Exception as error:
            self._fail(self._commanding[self._merged.asked if self._merged else 0], error)
            return None

    @property
    def sampled(self) -> Sampled | None:
        """The formula of the next :meth:`update`, where the core can sample that itself."""
        if self._merged is not None or not self._commanding:
            return None
        return self._commanding[0].controller.sampled

    def watch(self, state: ArmState) -> None:
        """Let the controllers that only watch see ``state``; after the reply has left. Never raises."""
        for loaded in self._watching:
            begin = self._now()
            try:
                loaded.controller.update(state)
            except Exception as error:
                self._fail(loaded, error)
            loaded.execution_time.add(self._now() - begin)

    def note_withheld(self, position: Joints) -> None:
        """The limiter holds the arm at ``position`` [rad], see :meth:`.Controller.note_withheld`. Never raises."""
        self._note(lambda controller: controller.note_withheld(position))

    def note_waiting(self, position: Joints) -> None:
        """The command waits at ``position`` [rad], see :meth:`.Controller.note_waiting`. Never raises."""
        self._note(lambda controller: controller.note_waiting(position))

    def _note(self, note: Callable[[Controller], None]) -> None:
        """Let the controllers that command the arm take note of something; one that raises has failed."""
        for loaded in self._commanding:
            try:
                note(loaded.controller)
            except Exception as error:
                self._fail(loaded, error)

    def note_times(self, state: ArmState, marks: Sequence[float]) -> None:
        """After the reply to ``state``: take the times of the cycle's stages into the statistics."""
        self._component.note(state.session, state.time, marks)
        if self._merged is not None:
            for loaded, duration in zip(self._commanding, self._merged.times, strict=True):
                loaded.execution_time.add(duration)
        elif self._commanding:
            self._commanding[0].execution_time.add(marks[UPDATE_STAGE] - marks[DECODE_STAGE])

    def take_reports(self) -> Sequence[tuple[str, object]]:
        """The reports of the controllers since the last call, each with the name."""
        for loaded in self._active:
            try:
                for report in loaded.controller.take_reports():
                    self._reports.append((loaded.name, report))
            except Exception as error:
                self._fail(loaded, error)
        reports, self._reports = self._reports, []
        return reports

    @property
    def is_commanding(self) -> bool:
        """Whether a controller commands the arm."""
        return bool(self._commanding)

    @property
    def reference(self) -> Joints | None:
        """Where the commanding controllers are going [rad]; None when none commands."""
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
            raise CommandRefused(message("controller_loaded_already", controller=name))
        if not _NAME.fullmatch(name):
            raise CommandRefused(message("controller_name_not_allowed", controller=name))

    def _activate(self, switch: Switch, begin: ArmState, strictness: Strictness) -> None:
        """A strict switch in which one controller cannot begin leaves none of its controllers active."""
        begun: list[LoadedController] = []
        failures = []
        for loaded in switch.activate:
            try:
                loaded.activate(begin)
            except Exception as error:
                failures.append(_raised(loaded.name, "activate", error))
                if strictness is Strictness.STRICT:
                    self._deactivate(begun)
                    break
            else:
                begun.append(loaded)
                if loaded.controller.is_command:  # one that only watches ends no goal
                    self.activation = self.activity + 1
        if failures:
            active = tuple(loaded.name for loaded in self._loaded.values() if loaded.state is State.ACTIVE)
            raise SwitchFailed(message("switch_failed", failures=tuple(failures), active=active))

    def _deactivate(self, leaving: Iterable[LoadedController]) -> None:
        """Whatever a controller does on its way out, it is inactive then."""
        for loaded in leaving:
            try:
                loaded.deactivate()
                self._reports += [(loaded.name, report) for report in loaded.controller.take_reports()]
            except Exception as error:
                self.failures.append(_raised(loaded.name, "deactivate", error))

    def _fail(self, failed: LoadedController, error: Exception) -> None:
        """Who made one command together goes together: what is left of it means nothing."""
        is_commanding = failed in self._commanding
        leaving = self._commanding if is_commanding else (failed,)
        self._is_interrupted = self._is_interrupted or is_commanding
        others = tuple(loaded.name for loaded in leaving if loaded is not failed)
        values = {"controller": failed.name, "type": type(error).__name__, "error": said_by(error)}
        if others:
            self.failures.append(message("commanding_controllers_failed", others=others, **values))
        else:
            self.failures.append(
                message("commanding_controller_failed" if is_commanding else "watching_controller_failed", **values)
            )
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
        self.goal_kind = reduce(or_, (loaded.controller.goal_kind for loaded in self._commanding), GoalKind.NONE)
        self._merged = (
            MergedCommand(self._commanding, self._joint_names, self._now) if len(self._commanding) > 1 else None
        )
        if self._merged:
            self._ask = self._merged.update
        else:
            self._ask = self._commanding[0].controller.update if self._commanding else _hold


_NOWHERE = ArmState(0.0, 0.0, 0, ZERO_JOINTS, ZERO_JOINTS, ZERO_JOINTS, is_running=False)
"""Given to controllers that only watch, when no state has come yet."""


def _hold(state: ArmState) -> ArmCommand | None:
    """What is commanded where no controller does."""
    return None


def _without_egm(name: str) -> CommandRefused:
    return CommandRefused(message("controller_without_egm", controller=name))


def _raised(name: str, call: str, error: Exception) -> Message:
    return message("controller_raised", controller=name, call=call, type=type(error).__name__, error=said_by(error))


@contextmanager
def _refusing(name: str, call: str) -> Iterator[None]:
    """Whatever else a controller raises when it is called is a refusal with its name."""
    try:
        yield
    except CommandRefused:
        raise
    except Exception as error:
        raise CommandRefused(_raised(name, call, error)) from error
