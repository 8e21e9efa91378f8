from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from abb_protocols.catalogue import Message, in_words, message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import YUMI_LIMITS, ZERO_JOINTS, Side, joint_names
from controller_arms import LimitedArm, PerfectArm
from reported_limiter import ReportedLimiter
from unit.control.controller_doubles import RUNNING, Double
from yumi.control.controller import State
from yumi.control.goals import MemoryBuffer
from yumi.control.loop import ArmLoop
from yumi.control.loop_commands import COMMANDS, Commands, ControllerCommand, serve
from yumi.control.loop_events import ControllerReport
from yumi.control.manager.controller_manager import ControllerManager
from yumi.control.manager.controller_switch import Strictness
from yumi.control.shared_state import Snapshot, read_snapshot

LEFT, RIGHT = Side.LEFT, Side.RIGHT
NOBODY = message("controller_unknown", controller="nobody", loaded=("double",))


class Arms:
    """Both arms, each with a double named ``double`` that is active."""

    def __init__(self) -> None:
        self.doubles = {side: Double() for side in Side}
        self.buffers = {side: MemoryBuffer() for side in Side}
        self.loops = {side: self._loop(side) for side in Side}
        self.commands = Commands(self.loops, lambda: 5.0)

    def _loop(self, side: Side) -> ArmLoop:
        manager = ControllerManager(joint_names(side), {"test/Double": lambda name: Double("velocity")}, side.unit)
        manager.load("double", self.doubles[side])
        manager.configure("double")
        manager.switch(["double"], [], RUNNING)
        limiter = ReportedLimiter(YUMI_LIMITS)
        return ArmLoop(side, LimitedArm(PerfectArm(ZERO_JOINTS), limiter), manager, limiter, self.buffers[side])

    def call(self, command: Any, *args: Any) -> Any:
        return serve(self.commands, command, *args)

    def refusal(self, command: Any, *args: Any) -> Message:
        with pytest.raises(CommandRefused) as refused:
            self.call(command, *args)
        return refused.value.said

    def snapshot(self, side: Side) -> Snapshot:
        return read_snapshot(self.buffers[side])

    def state(self, side: Side, name: str) -> State:
        return next(info.state for info in self.call(Commands.list_controllers, side) if info.name == name)


@pytest.fixture
def arms() -> Arms:
    return Arms()


def test_loop_serves_every_command_there_is(arms: Arms) -> None:
    rest = {"name": "nobody", "kind": "nothing", "controller": "nobody", "values": {}, "state": State.ACTIVE}
    rest |= {"part": "right gripper", "other": "left gripper", "seconds": 1.0}
    refusals = []
    for command in COMMANDS.values():
        names = command.__code__.co_varnames[1 : command.__code__.co_argcount]  # type: ignore[attr-defined]
        arguments = [RIGHT if name == "side" else rest[name] for name in names if name in {"side", *rest}]
        try:
            arms.call(command, *arguments)
        except CommandRefused as refusal:
            refusals.append(refusal.said.code)
    assert len(refusals) > 3
    assert "command_failed" not in refusals


def test_loop_leads_a_controller_through_its_lifecycle(arms: Arms) -> None:
    assert arms.call(Commands.list_controller_kinds, LEFT) == ("test/Double",)
    arms.call(Commands.load_controller, LEFT, "other", "test/Double")
    assert arms.state(LEFT, "other") is State.UNCONFIGURED
    arms.call(Commands.configure_controller, LEFT, "other")
    assert arms.state(LEFT, "other") is State.INACTIVE
    arms.call(Commands.clean_up_controller, LEFT, "other")
    assert arms.state(LEFT, "other") is State.UNCONFIGURED
    arms.call(Commands.unload_controller, LEFT, "other")
    assert [info.name for info in arms.call(Commands.list_controllers, LEFT)] == ["double"]


def test_loop_switches_by_the_strictness_asked_for(arms: Arms) -> None:
    lenient = (LEFT, ("nobody",), ("double",), Strictness.BEST_EFFORT)
    done = arms.call(Commands.switch_controllers, *lenient)
    assert done == in_words((message("switched"), NOBODY))
    assert arms.state(LEFT, "double") is State.INACTIVE
    assert arms.refusal(Commands.switch_controllers, LEFT, ("nobody",)) == NOBODY


def test_loop_has_an_arm_hold_whatever_commands_it(arms: Arms) -> None:
    arms.call(Commands.hold, LEFT)
    assert [arms.state(side, "double") for side in (LEFT, RIGHT)] == [State.INACTIVE, State.ACTIVE]
    arms.call(Commands.hold, LEFT)


def test_loop_refuses_what_was_planned_before_the_arm_was_stopped(arms: Arms) -> None:
    command = ControllerCommand(LEFT, "double", "a trajectory")
    planned_for = arms.call(Commands.check_commands, command)[LEFT]
    late = replace(command, activation=planned_for)
    arms.call(Commands.check_commands, late)
    arms.call(Commands.hold, LEFT)
    stopped = message("goal_refused", reason=message("interrupted_while_planned", arm="left"))
    assert arms.refusal(Commands.send_commands, late) == stopped
    arms.loops[LEFT].manager.switch(["double"], [], RUNNING)
    assert arms.refusal(Commands.send_commands, late) == stopped
    arms.call(Commands.check_commands, command)


def test_loop_sets_and_lists_parameters(arms: Arms) -> None:
    arms.call(Commands.set_parameters, RIGHT, "double", {"p": 0.25})
    infos = arms.call(Commands.list_parameters, RIGHT, "double")
    assert [(info.parameter.name, info.value) for info in infos] == [("p", 0.25), ("mode", "slow")]


def test_loop_leads_the_hardware(arms: Arms) -> None:
    info = arms.call(Commands.set_hardware_state, RIGHT, "ROB_R", State.INACTIVE)
    assert arms.call(Commands.hardware, RIGHT) == info
    assert (info.state, arms.state(RIGHT, "double")) == (State.INACTIVE, State.INACTIVE)


@pytest.mark.parametrize(
    ("command", "arguments"),
    [
        (Commands.load_controller, ("other", "test/Double")),
        (Commands.configure_controller, ("spare",)),
        (Commands.clean_up_controller, ("spare",)),
        (Commands.unload_controller, ("spare",)),
        (Commands.switch_controllers, ((), ("double",))),
        (Commands.hold, ()),
        (Commands.set_hardware_state, ("ROB_L", State.INACTIVE)),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_loop_shows_a_change_in_the_snapshot_at_once(arms: Arms, command: Any, arguments: tuple[Any, ...]) -> None:
    arms.call(Commands.load_controller, LEFT, "spare", "test/Double")
    before = arms.snapshot(LEFT).activity
    arms.call(command, LEFT, *arguments)
    assert (arms.snapshot(LEFT).activity > before, arms.snapshot(LEFT).time) == (True, 5.0)


def test_loop_refuses_what_a_rule_stands_against(arms: Arms) -> None:
    said = arms.refusal(Commands.load_controller, RIGHT, "double", "test/Double")
    assert said == message("controller_loaded_already", controller="double")


def test_loop_refuses_a_command_that_fails(arms: Arms) -> None:
    arms.loops[LEFT].manager.controllers = lambda: 1 / 0  # type: ignore[assignment,return-value,method-assign]
    said = arms.refusal(Commands.list_controllers, LEFT)
    why = message("text", text="division by zero")
    assert said == message("command_failed", command="list_controllers", kind="ZeroDivisionError", why=why)


def test_loop_sends_commands_to_controllers_of_both_arms(arms: Arms) -> None:
    arms.call(
        Commands.send_commands,
        ControllerCommand(LEFT, "double", "go left"),
        ControllerCommand(RIGHT, "double", "go right"),
    )
    assert [arms.doubles[side].orders for side in (LEFT, RIGHT)] == [["go left"], ["go right"]]


@pytest.mark.parametrize(
    ("second", "said"),
    [
        (ControllerCommand(RIGHT, "double", "bad"), message("text", text="The order is bad; send a good one.")),
        (ControllerCommand(RIGHT, "nobody", "good"), NOBODY),
        (
            ControllerCommand(LEFT, "double", "good"),
            message("several_commands", controller="double", arm="left", count=2),
        ),
    ],
)
def test_loop_sends_no_command_when_one_is_refused(arms: Arms, second: ControllerCommand, said: Message) -> None:
    first = ControllerCommand(LEFT, "double", "good")
    assert arms.refusal(Commands.send_commands, first, second) == said
    assert arms.refusal(Commands.check_commands, first, second) == said
    assert [double.orders for double in arms.doubles.values()] == [[], []]


def test_loop_checks_commands_without_sending_them(arms: Arms) -> None:
    arms.call(Commands.check_commands, ControllerCommand(LEFT, "double", "good"))
    assert arms.doubles[LEFT].orders == []


def test_loop_passes_reports_on(arms: Arms) -> None:
    arms.doubles[LEFT].notices = ["arrived"]
    (event,) = arms.loops[LEFT].take_events()
    assert event == ControllerReport(LEFT, "double", "arrived")
    arrived = message("text", text="arrived")
    assert event.said == message("controller_reports", arm="left", controller="double", report=arrived)
