"""The controller manager of one arm: which controllers exist, which are active, which claims which interface.

Switching happens between two cycles; an interface has one owner at a time; a controller whose update fails is
deactivated and the arm holds (reference/ros2_control.md §1.11). What each cycle needs is prepared when controllers
are switched. The hardware component decides which interfaces may be used (§2); it never moves the arm: while it is
inactive no controller commands the arm, which holds; while it is unconfigured no interface can be read either. The
robot gets its replies in any state.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import IntEnum
from functools import reduce
from math import inf
from operator import or_
from sys import intern

from yumi.catalogue import Message, message, said_by
from yumi.control.controller import (
    BEGIN,
    DECODE,
    LIMIT,
    SEND,
    TRANSITIONS,
    UPDATE,
    Controller,
    ControllerInfo,
    GoalKind,
    HardwareInfo,
    InterfaceInfo,
    ParameterInfo,
    RunningStatistics,
    Sampled,
    State,
    Statistics,
    Transition,
    allowed,
    find_parameter,
)
from yumi.errors import CommandRefused, SwitchFailed
from yumi.robot.joints import ZERO, ArmCommand, ArmState, Joints, joints
from yumi.settings import Values

INTERFACE_KINDS = ("position", "velocity")
"""What each joint offers, both as command and as state."""

STATISTICS_WINDOW = 5.0
"""Times of the hardware are those of the last whole window [s]: what was long ago says nothing of the arm now."""

_ALLOWED = (State.UNCONFIGURED, State.INACTIVE, State.ACTIVE)


class Strictness(IntEnum):
    """What becomes of a switch that names controllers which cannot do what is asked; the numbers are ROS's.

    BEST_EFFORT leaves those out, STRICT refuses the whole switch. AUTO and FORCE_AUTO are BEST_EFFORT, as upstream.
    """

    BEST_EFFORT = 1
    STRICT = 2
    AUTO = 3
    FORCE_AUTO = 4


class HardwareComponent:
    """The component of one arm; active from the start.

    Attributes:
        name: its name.
        state: unconfigured, inactive or active.
        interfaces: names of its interfaces, each both a command and a state interface.

    Args:
        joint_names: the arm's joints, chain order.
    """

    def __init__(self, name: str, joint_names: tuple[str, ...]) -> None:
        self.name = name
        self.state = State.ACTIVE
        self.interfaces = tuple(f"{joint}/{kind}" for joint in joint_names for kind in INTERFACE_KINDS)
        self._read_time, self._write_time, self._period = self._times = [RunningStatistics() for _ in range(3)]
        self._recent: tuple[Statistics, ...] = ()
        self._begin = -inf
        self._last: tuple[int, float] | None = None

    @property
    def is_available(self) -> bool:
        """Whether its interfaces exist."""
        return self.state is not State.UNCONFIGURED

    def check_state(self, state: State) -> None:
        """Whether it may be led to ``state``.

        Raises:
            CommandRefused: it may not.
        """
        if state not in _ALLOWED:
            choices = tuple(choice.value for choice in _ALLOWED)
            raise CommandRefused(
                message("hardware_state_not_allowed", component=self.name, state=state.value, allowed=choices)
            )

    def check_interfaces(self, controller: str, required: Sequence[str], required_state: Sequence[str]) -> None:
        """Whether a controller may begin to use these interfaces.

        Raises:
            CommandRefused: one does not exist, or the component's state forbids it.
        """
        for interface in (*required, *required_state):
            if interface not in self.interfaces:
                raise CommandRefused(
                    message(
                        "interface_missing",
                        controller=controller,
                        interface=interface,
                        interfaces=tuple(self.interfaces),
                    )
                )
        if not self.is_available or (required and self.state is not State.ACTIVE):
            raise CommandRefused(
                message("hardware_not_active", controller=controller, component=self.name, state=self.state.value)
            )

    def note(self, session: int, now: float, marks: Sequence[float]) -> None:
        """After a reply: how long reading and answering took.

        Args:
            session: EGM session of the cycle.
            now: when the datagram arrived [s].
            marks: of the cycle's stages, see :class:`yumi.control.controller.StageClock`.
        """
        is_new = self._last is None or self._last[0] != session
        if is_new or now - self._begin > STATISTICS_WINDOW:
            self._recent = () if is_new else tuple([times.result() for times in self._times])
            self._begin = now
            for times in self._times:
                times.reset()
        self._read_time.add(marks[DECODE] - marks[BEGIN])
        self._write_time.add(max(0.0, marks[SEND] - marks[LIMIT]))
        if self._last is not None and self._last[0] == session:
            self._period.add(now - self._last[1])
        self._last = (session, now)

    def info(self, claimed: Collection[str]) -> HardwareInfo:
        """The component as the outside sees it.

        Args:
            claimed: names of the command interfaces that are held by controllers.
        """
        available = self.is_available
        read_time, write_time, period = self._recent or [times.result() for times in self._times]
        return HardwareInfo(
            name=self.name,
            state=self.state,
            command_interfaces=tuple(InterfaceInfo(name, available, name in claimed) for name in self.interfaces),
            state_interfaces=tuple(InterfaceInfo(name, available) for name in self.interfaces),
            read_time=read_time,
            write_time=write_time,
            period=period,
        )


class LoadedController:
    """One controller of one arm, from load to unload.

    Attributes:
        name: its name.
        controller: what it is.
        state: its lifecycle state.
        required: the command interfaces it claims when active, known once it is configured.
        required_state: the state interfaces it needs when active, known once it is configured.
        execution_time: how long its updates took since it was activated last [s].

    Args:
        joint_names: the arm's joints, chain order.
    """

    def __init__(self, name: str, controller: Controller, joint_names: tuple[str, ...]) -> None:
        self.name = name
        self.controller = controller
        self.state = State.UNCONFIGURED
        self.required: tuple[str, ...] = ()
        self.required_state: tuple[str, ...] = ()
        self.execution_time = RunningStatistics()
        self._joint_names = joint_names
        self._parameters = {parameter.name: parameter for parameter in controller.parameters(joint_names)}
        self._values: Values = {key: parameter.default for key, parameter in self._parameters.items()}

    def configure(self, values: Values | None = None) -> None:
        """Take ``values`` and become inactive; an inactive one is cleaned up first.

        Raises:
            CommandRefused: wrong state or value, nothing was changed; or the controller or its interfaces do not go
                with the values, then it is unconfigured.
        """
        if self.state is not State.INACTIVE:
            self.check(Transition.CONFIGURE)
        complete = self._complete(values or {}, is_settled=False)
        self.clean_up()
        self.controller.configure(complete)
        # The interfaces may depend on the parameters, so they are asked for afterwards.
        required = _interned(self.controller.command_interfaces(self._joint_names))
        required_state = _interned(self.controller.state_interfaces(self._joint_names))
        for interfaces in (required, required_state):
            twice = next((name for name in interfaces if interfaces.count(name) > 1), None)
            if twice:
                raise CommandRefused(message("interface_named_twice", controller=self.name, interface=twice))
        self.required, self.required_state, self._values = required, required_state, complete
        self.state = State.INACTIVE

    def set_parameters(self, values: Values) -> None:
        """Change parameters, all or none; an active controller uses them from the next cycle on.

        Raises:
            CommandRefused: unknown parameter, value not allowed, or it is settled by now; nothing was changed.
        """
        is_settled = self.state is not State.UNCONFIGURED
        complete = self._complete(values, is_settled=is_settled)
        if is_settled:
            self.controller.configure(complete)
        self._values = complete

    def clean_up(self) -> None:
        """Become unconfigured; nothing when it is so already.

        Raises:
            CommandRefused: it is active.
        """
        if self.state is State.UNCONFIGURED:
            return
        self.check(Transition.CLEANUP)
        self.state = TRANSITIONS[self.state, Transition.CLEANUP]
        self.required = self.required_state = ()
        self.controller.clean_up()

    def activate(self, state: ArmState) -> None:
        """Begin from ``state``; whatever the controller raises is passed on, and it stays inactive."""
        self.execution_time.reset()
        self.controller.activate(state)
        self.state = State.ACTIVE

    def deactivate(self) -> None:
        """End; inactive even when the controller raises, which is passed on."""
        self.state = State.INACTIVE
        self.controller.deactivate()

    def check(self, transition: Transition) -> None:
        """Whether it may make a transition.

        Raises:
            CommandRefused: it may not; the sentence says what it may.
        """
        if (self.state, transition) not in TRANSITIONS:
            raise CommandRefused(
                message(
                    "transition_not_allowed",
                    controller=self.name,
                    state=self.state.value,
                    transition=transition.value,
                    allowed=tuple(choice.value for choice in allowed(self.state)),
                )
            )

    def check_command(self, command: object, state: ArmState | None) -> None:
        """Whether it would take a command now.

        Raises:
            CommandRefused: it is not active, or it refuses.
        """
        if self.state is not State.ACTIVE:
            raise CommandRefused(message("controller_not_active", controller=self.name, state=self.state.value))
        self.controller.check(command, state)

    def parameters(self) -> tuple[ParameterInfo, ...]:
        """What can be set and what is set."""
        return tuple(ParameterInfo(parameter, self._values[key]) for key, parameter in self._parameters.items())

    def info(self) -> ControllerInfo:
        """The controller as the outside sees it."""
        return ControllerInfo(
            name=self.name,
            kind=self.controller.kind,
            state=self.state,
            required=self.required,
            claimed=self.required if self.state is State.ACTIVE else (),
            required_state=self.required_state,
            execution_time=self.execution_time.result(),
        )

    def _complete(self, values: Values, *, is_settled: bool) -> Values:
        complete = dict(self._values)
        for key, value in values.items():
            parameter = find_parameter(self._parameters.values(), key)
            if parameter is None:
                known = tuple(each.name for each in self._parameters.values() if not each.fixed)
                raise CommandRefused(
                    message("controller_parameter_unknown", controller=self.name, parameter=key, parameters=known)
                )
            if parameter.fixed:
                continue
            try:
                accepted = parameter.accept(value)
            except CommandRefused as refusal:
                raise CommandRefused(
                    message("controller_parameter_refused", controller=self.name, parameter=key, reason=refusal.said)
                ) from refusal
            if is_settled and parameter.read_only and accepted != self._values[key]:
                raise CommandRefused(
                    message(
                        "controller_parameter_settled",
                        controller=self.name,
                        parameter=key,
                        state=self.state.value,
                    )
                )
            complete[key] = accepted
        return complete


def _interned(names: tuple[str, ...]) -> tuple[str, ...]:
    """The same names as one object each, which halves the time it takes to send lists of them."""
    return tuple(map(intern, names))


class MergedCommand:
    """Asks several commanding controllers; who gives which value is settled when controllers are switched.

    A joint's position is the one of the controller that claims it; where none does, of the one that claims the
    joint's velocity, which has to say where its motion leads. Velocities likewise. When one of them holds, the arm
    holds.

    Attributes:
        asked: index of the controller that was asked last, for the case that it failed.
        times: how long each one's update took in the last cycle [s].

    Args:
        members: the controllers, at least one.
        joint_names: the arm's joints, chain order.
        now: the time [s], for ``times`` alone.
    """

    def __init__(
        self, members: Sequence[LoadedController], joint_names: tuple[str, ...], now: Callable[[], float]
    ) -> None:
        self.asked = 0
        self.times = [0.0] * len(members)
        self._updates = tuple(member.controller.update for member in members)
        self._now = now
        self._positions = _owners(members, joint_names, ("position", "velocity"))
        self._velocities = _owners(members, joint_names, ("velocity", "position"))

    def update(self, state: ArmState) -> ArmCommand | None:
        """The merged command for ``state``; None holds."""
        commands = []
        begin = self._now()
        for index, update in enumerate(self._updates):
            self.asked = index
            command = update(state)
            end = self._now()
            self.times[index], begin = end - begin, end
            if command is None:
                return None
            commands.append(command)
        position = _gathered([command.position for command in commands], self._positions)
        return ArmCommand(position, _gathered([command.velocity for command in commands], self._velocities))


def _owners(
    members: Sequence[LoadedController], joint_names: tuple[str, ...], kinds: tuple[str, ...]
) -> tuple[int, ...]:
    """For each joint the index of the controller that claims the first of ``kinds`` that is claimed."""
    claims = {interface: index for index, member in enumerate(members) for interface in member.required}
    wanted = [[claims.get(f"{joint}/{kind}") for kind in kinds] for joint in joint_names]
    return tuple(next((index for index in choices if index is not None), 0) for choices in wanted)


def _gathered(values: Sequence[Joints], owners: tuple[int, ...]) -> Joints:
    """One value for each joint; the very tuple where all come from one controller."""
    first = owners[0]
    if owners.count(first) == len(owners):
        return values[first]
    return joints([values[owner][joint] for joint, owner in enumerate(owners)])


@dataclass(frozen=True, slots=True)
class Switch:
    """What is done in one step, in this order.

    Attributes:
        deactivate: active controllers.
        activate: controllers that are inactive by then; one that is in both lists begins anew.
        left_out: why something else that was asked for is not done.
    """

    deactivate: tuple[LoadedController, ...]
    activate: tuple[LoadedController, ...]
    left_out: tuple[Message, ...] = ()

    @property
    def sentences(self) -> str:
        """What was done, once it is done: first in the words that clients of ros2_control know."""
        done = message("switched" if self.deactivate or self.activate else "nothing_to_switch")
        return " ".join(map(str, (done, *self.left_out)))


def plan_switch(
    loaded: Mapping[str, LoadedController],
    component: HardwareComponent,
    activate: Sequence[str],
    deactivate: Sequence[str],
    strictness: Strictness,
) -> Switch:
    """What the switch comes to.

    Args:
        loaded: all controllers of the arm by name.
        component: its hardware.
        activate: names of controllers to activate.
        deactivate: names of controllers to deactivate.
        strictness: whether those that cannot are left out.

    Raises:
        CommandRefused: a name or a state stands against it and it is strict, or an interface does, however strict.
    """
    chooser = _Chooser(loaded, strictness)
    stopping = chooser.chosen(deactivate, Transition.DEACTIVATE, ())
    starting = chooser.chosen(activate, Transition.ACTIVATE, stopping)
    if not stopping and not starting and chooser.known == 0 and chooser.left_out:
        raise CommandRefused(message("switch_without_effect", reasons=tuple(chooser.left_out)))
    for controller in starting:
        component.check_interfaces(controller.name, controller.required, controller.required_state)
    staying = [each for each in loaded.values() if each.state is State.ACTIVE and each not in stopping]
    owners: dict[str, str] = {}
    for controller in (*staying, *starting):
        for interface in controller.required:
            if interface in owners:
                raise CommandRefused(
                    message(
                        "interface_claimed",
                        controller=controller.name,
                        interface=interface,
                        owner=owners[interface],
                    )
                )
            owners[interface] = controller.name
    return Switch(stopping, starting, tuple(chooser.left_out))


class _Chooser:
    """Goes through the names of a switch; what cannot be done is left out or refused."""

    def __init__(self, loaded: Mapping[str, LoadedController], strictness: Strictness) -> None:
        self.left_out: list[Message] = []
        self.known = 0
        self._loaded = loaded
        self._is_strict = strictness is Strictness.STRICT

    def chosen(
        self, names: Sequence[str], transition: Transition, stopping: tuple[LoadedController, ...]
    ) -> tuple[LoadedController, ...]:
        """Those of ``names`` that can make the transition; who is ``stopping`` can begin anew."""
        controllers = []
        for name in dict.fromkeys(names):
            try:
                controller = find(self._loaded, name)
                self.known += 1
                if controller not in stopping:
                    controller.check(transition)
            except CommandRefused as refusal:
                if self._is_strict:
                    raise
                self.left_out.append(refusal.said)
            else:
                controllers.append(controller)
        return tuple(controllers)


def find(loaded: Mapping[str, LoadedController], name: str) -> LoadedController:
    """The controller of that name.

    Raises:
        CommandRefused: there is none; the sentence lists those there are.
    """
    if name not in loaded:
        raise CommandRefused(message("controller_unknown", controller=name, loaded=tuple(loaded)))
    return loaded[name]


Kinds = Mapping[str, Callable[[str], Controller]]
"""How a controller of each type is made, given its name."""

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


class ControllerManager:
    """Owns the controllers of one arm.

    Attributes:
        failures: which controllers failed, and how; the reader removes them.
        activation: number of the newest activation of a controller that commands; a later one has a higher number.
        activity: counts every change of what is loaded and in which state it is.
        goal_kind: which goals those controllers take that command the arm.
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
        kinds: Kinds | None = None,
        component: str = "arm",
        now: Callable[[], float] = lambda: 0.0,
        activity: int = 0,
    ) -> None:
        self.failures: list[Message] = []
        self._is_interrupted = False  # what commanded the arm was ended, and nothing was activated since
        self.activation = 0
        self.activity = activity
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
        self._loaded[name] = LoadedController(name, controller, self._joint_names)
        self._note_change()

    def load_kind(self, name: str, kind: str, values: Values | None = None) -> None:
        """Make a controller of type ``kind``, unconfigured, with parameters that differ from their defaults.

        Raises:
            CommandRefused: the name is not allowed, the type unknown, or a value not allowed; nothing was changed.
        """
        self._check_name(name)
        if kind not in self._kinds:
            raise CommandRefused(
                message("controller_type_unknown", controller=name, type=kind, types=tuple(self._kinds))
            )
        with _refusing(name, "load"):
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
            raise CommandRefused(message("controller_still_active", controller=name))
        with _refusing(name, "unload"):
            loaded.clean_up()
        del self._loaded[name]
        self._note_change()

    def configure(self, name: str, values: Values | None = None) -> None:
        """Give an unconfigured or inactive controller its parameters and make it inactive.

        Raises:
            CommandRefused: no such controller, wrong state, unknown parameter or value not allowed.
        """
        try:
            with _refusing(name, "configure"):
                find(self._loaded, name).configure(values)
        finally:
            self._note_change()

    def clean_up(self, name: str) -> None:
        """Make an inactive controller unconfigured.

        Raises:
            CommandRefused: no such controller, or it is active.
        """
        with _refusing(name, "cleanup"):
            find(self._loaded, name).clean_up()
        self._note_change()

    def set_parameters(self, name: str, values: Values) -> None:
        """Change parameters; an active controller uses them from the next cycle on.

        Raises:
            CommandRefused: no such controller, unknown parameter or value out of range; nothing was changed.
        """
        with _refusing(name, "set_parameters"):
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
        find(self._loaded, name)
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
        find(self._loaded, name).check_command(command, state)

    def receive(self, name: str, command: object, state: ArmState | None) -> None:
        """Have an active controller take a command.

        Args:
            name: the controller.
            command: a value it knows.
            state: the arm's newest state; None while it is not heard.

        Raises:
            CommandRefused: no such controller, not active, or it refuses the command; nothing was changed.
        """
        self.check(name, command, state)
        self._loaded[name].controller.receive(command, state)

    def update(self, state: ArmState) -> ArmCommand | None:
        """What the active controllers want; None holds. Never raises: who fails is deactivated."""
        try:
            return self._ask(state)
        except Exception as error:
            self._fail(self._commanding[self._merged.asked if self._merged else 0], error)
            return None

    @property
    def sampled(self) -> Sampled | None:
        """The law of the next :meth:`update`, where the core can sample that itself."""
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
            self._commanding[0].execution_time.add(marks[UPDATE] - marks[DECODE])

    def take_reports(self) -> Sequence[tuple[str, object]]:
        """The reports of the controllers since the last call, each with the name."""
        for loaded in self._active:
            try:
                for report in loaded.controller.take_reports():
                    self._reports.append((loaded.name, report))
            except Exception as error:
                self._fail(loaded, error)
        if not self._reports:
            return ()
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


_NOWHERE = ArmState(0.0, 0.0, 0, ZERO, ZERO, ZERO, is_running=False)
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
