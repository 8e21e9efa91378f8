"""The table of commands to a driver: get, start, stop, recover, grip, motors, RAPID, modules, signals, variables.

A new command is a class with its arguments and ``run``, and its line in :data:`COMMANDS`: each front end that it is for
then has it. Those that move arms are in :mod:`yumi.driver.motion_commands`.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
from typing import Annotated, Any, Literal

import msgspec

from abb_protocols.catalogue import headline, message
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import CommandRefused, GoalNotReached
from abb_protocols.robot.description import Mass
from abb_protocols.robot.gripper_values import FINGER_TRAVEL, MAX_GRIP_FORCE, GripDirection, finger_position_goal, grip
from abb_protocols.robot.joints import Pose, Side
from yumi.control.hand_over import Commander, requested_by
from yumi.control.loop_commands import Commands
from yumi.driver.command import (
    EVERY_FRONT_END,
    ArmName,
    ArmNames,
    Caller,
    Command,
    CommandedRobot,
    Lane,
    R,
    side_of,
    sides_of,
)
from yumi.driver.motion_commands import Follow, Jog, JogTool, Move, Stream, Teleoperate
from yumi.driver.reports import RECENT_EVENTS, ControllerStatus, DriverState, GripReport
from yumi.driver.robot_state import ModeName, RobotMode, arms_in_words
from yumi.driver.surroundings import Surroundings

_SCRIPT = frozenset({FrontEnd.SCRIPT})
_SCRIPT_AND_SHELL = _SCRIPT | {FrontEnd.SHELL}
_ROS = frozenset({FrontEnd.ROS})
_NOT_ROS = EVERY_FRONT_END - _ROS

_Width = Annotated[
    float, msgspec.Meta(description="Open so far [m]; else all the way.", extra={"to": 2.0 * FINGER_TRAVEL})
]
_Force = Annotated[float, msgspec.Meta(description="Hold with this force [N].", extra={"to": MAX_GRIP_FORCE})]


# ---- what only looks


class GetState(Command[DriverState], frozen=True):
    """Show what the robot does, and why it does not move."""

    lane = Lane.READ
    front_ends = _SCRIPT_AND_SHELL
    shell_name = "state"

    def run(self, robot: CommandedRobot, caller: Caller) -> DriverState:
        events = robot.events.since(robot.events.count - RECENT_EVENTS)
        return msgspec.structs.replace(robot.state(), events=events)


class GetControllers(Command[dict[str, tuple[ControllerStatus, ...]]], frozen=True):
    """List the controllers of both arms; which of them command."""

    lane = Lane.READ
    front_ends = _SCRIPT_AND_SHELL
    shell_name = "controllers"

    def run(self, robot: CommandedRobot, caller: Caller) -> dict[str, tuple[ControllerStatus, ...]]:
        return robot.controllers()


class GetSurroundings(Command[Surroundings], frozen=True):
    """The shapes that must not collide, as the driver's settings declare them."""

    lane = Lane.READ
    front_ends = _SCRIPT

    def run(self, robot: CommandedRobot, caller: Caller) -> Surroundings:
        return robot.surroundings


class DescribeState(Command[str], frozen=True):
    """The robot's state in one line."""

    lane = Lane.READ
    front_ends = _ROS
    service = "get_state"

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        return robot.manager.describe()


class RobotIsReady(Command[str], frozen=True):
    """Whether EGM can be started, or runs; refused where it cannot, with the reason."""

    lane = Lane.READ
    front_ends = _ROS

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        return robot.manager.check_ready()


# ---- EGM, modes and speed


class StartEgm(Command[str], frozen=True):
    """Start EGM; makes the robot ready first if need be.

    Without an arm it starts on the arms that are configured.
    """

    shell_name = "start"
    examples = ("yumi start", "yumi start right")

    arms: ArmNames = ()

    def needed_arms(self, robot: CommandedRobot) -> Sequence[Side]:
        return sides_of(self.arms) or tuple(Side)

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        return robot.manager.start_egm(sides_of(self.arms) or None, caller.report, caller.check)


class StopEgm(Command[str], frozen=True):
    """Bring the arms to rest and end EGM.

    It waits for nothing else.
    """

    lane = Lane.STOP
    shell_name = "stop"
    examples = ("yumi stop",)

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        return robot.manager.stop_egm()


class SetMode(Command[str], frozen=True):
    """Bring the robot to a mode."""

    front_ends = _SCRIPT_AND_SHELL | _ROS
    shell_name = "mode"

    mode: ModeName

    @property
    def is_stop(self) -> bool:
        return self.mode == RobotMode.MOTORS_OFF.value

    def needed_arms(self, robot: CommandedRobot) -> Sequence[Side]:
        return RobotMode(self.mode).arms

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        if self.is_stop:  # carried out for who is gone, too
            return robot.manager.go_to(RobotMode.MOTORS_OFF, caller.show)
        return robot.manager.go_to(RobotMode(self.mode), caller.report, caller.check)


class Recover(Command[str], frozen=True):
    """Bring the robot back after a stop; ``confirm`` is the id of the stop that a person has confirmed."""

    confirm: str = ""

    def needed_arms(self, robot: CommandedRobot) -> Sequence[Side]:
        return robot.manager.egm_arms

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        return robot.recover(caller.report, caller.check, self.confirm)


class SetSpeedScale(Command[str], frozen=True):
    """Set the factor on the speed of every controller."""

    lane = Lane.WRITE
    shell_name = "speed-scale"

    speed_scale: float

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        return robot.manager.speed.set(self.speed_scale)


class SetSpeedRatio(Command[str], frozen=True):
    """Override of the speeds of RAPID motions [%]; it does not change EGM motions."""

    lane = Lane.WRITE
    front_ends = _ROS

    percent: int

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        return robot.manager.set_speed_ratio(self.percent)


class GiveBack(Command[str], frozen=True):
    """Give arms back to programs that a person has let go.

    A person who has teleoperated or jogged an arm leaves it reserved, so that no policy, stream or plan goes on by
    itself. Without an arm both are given back.
    """

    lane = Lane.WRITE
    examples = ("yumi give-back", "yumi give-back right")
    button = "Give arms back"

    arms: ArmNames = ()

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        given = robot.control.hand_over.give_back(sides_of(self.arms) or tuple(Side))
        if not given:
            return headline(message("no_arm_reserved"))
        return headline(message("arms_given_back", arms=arms_in_words(given)))


# ---- grippers


class Calibrate(Command[str], frozen=True):
    """Close the fingers of grippers and call that zero.

    EGM must not run. Without an arm both grippers are calibrated.
    """

    front_ends = _NOT_ROS
    examples = ("yumi calibrate right",)
    button = "Calibrate grippers"

    arms: ArmNames = ("right", "left")

    def check(self) -> None:
        if not self.arms:
            raise CommandRefused(message("no_gripper_named"))

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        sides = sides_of(self.arms)
        with ExitStack() as stack:
            for side in sides:
                stack.enter_context(robot.grippers[side].alone())
                robot.manager.check_gripper(side)
            robot.calibrate(sides, caller.check)
        if len(set(sides)) > 1:
            return headline(message("grippers_now_calibrated"))
        return headline(message("gripper_now_calibrated", arm=sides[0].word))


class Grip(Command[GripReport], frozen=True):
    """Open or close a gripper; says what it holds."""

    front_ends = _NOT_ROS
    examples = ("yumi grip right open --width 0.03", "yumi grip right close --force 8")

    arm: ArmName
    action: Literal["open", "close"]
    width: _Width | None = None
    force: _Force | None = None

    def check(self) -> None:
        if self.action == "open" and self.force is not None:
            raise CommandRefused(message("force_while_opening"))
        if self.action == "close" and self.width is not None:
            raise CommandRefused(message("width_while_closing"))

    def run(self, robot: CommandedRobot, caller: Caller) -> GripReport:
        if self.action == "open":
            goal = finger_position_goal(FINGER_TRAVEL if self.width is None else self.width / 2.0)
        else:
            goal = grip(GripDirection.INWARDS, robot.force if self.force is None else self.force)
        side = side_of(self.arm)
        gripper = robot.grippers[side]
        with gripper.alone():
            gripper.begin(goal, partial(robot.manager.check_gripper, side))
            outcome = gripper.wait(goal, is_cancelled=caller.is_gone)
        if outcome is None:
            raise GoalNotReached(message("gripper_stopped_asker_gone", arm=side.word))
        return GripReport(outcome, 2.0 * gripper.last_position, side.word)


# ---- controllers and what may touch


class SwitchControllers(Command[str], frozen=True):
    """Activate and deactivate controllers of one arm in one step."""

    front_ends = _NOT_ROS
    shell_name = "switch"

    arm: ArmName
    activate: tuple[str, ...] = ()
    deactivate: tuple[str, ...] = ()

    def check(self) -> None:
        if not self.activate and not self.deactivate:
            raise CommandRefused(message("no_controller_named"))

    def needed_arms(self, robot: CommandedRobot) -> Sequence[Side]:
        return (side_of(self.arm),)

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        side = side_of(self.arm)
        done = robot.control.call(Commands.switch_controllers, side, self.activate, self.deactivate)
        return done or headline(message("controllers_switched", arm=side.word))


class AllowCollision(Command[str], frozen=True):
    """Let two parts touch for ``seconds``, slowly; 0 ends it, as does the end of the client's connection."""

    lane = Lane.CONTACT
    front_ends = _SCRIPT | _ROS

    part: str
    other: str
    seconds: float

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        if self.seconds == 0.0:
            return robot.manager.end_allowed_collision(self.part, self.other)
        is_refused = False
        try:
            return robot.manager.allow_collision(self.part, self.other, self.seconds)
        except CommandRefused:
            is_refused = True
            raise
        finally:  # what was refused is not the client's own to end; what has failed otherwise may have been done
            if not is_refused:
                end = partial(robot.manager.end_allowed_collision, self.part, self.other)
                caller.hold((self.part, self.other), end, None)


# ---- the controller's panel, its program and what the arms carry


class _PanelCommand(Command[str], frozen=True):
    """What is done by the controller's panel and its program; ROS alone offers it."""

    front_ends = _ROS


class MotorsOn(_PanelCommand, frozen=True):
    """Motors on."""

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        return robot.manager.motors_on()


class MotorsOff(_PanelCommand, frozen=True):
    """Motors off; EGM is ended before."""

    lane = Lane.STOP

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        return robot.manager.motors_off()


class StartRapid(_PanelCommand, frozen=True):
    """Start the program where its pointers are."""

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        return robot.manager.start_rapid()


class StopRapid(_PanelCommand, frozen=True):
    """Stop the program; EGM is ended before."""

    lane = Lane.STOP

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        return robot.manager.stop_rapid()


class PpToMain(_PanelCommand, frozen=True):
    """Program pointers to main; the program must be stopped."""

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        return robot.manager.pp_to_main()


class RunRoutine(_PanelCommand, frozen=True):
    """Run a RAPID routine in an arm's task and wait for its end; the limiter does not act on its motions."""

    arm: ArmName
    routine: str
    unchecked: bool = False

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        side = side_of(self.arm)
        with robot.control.hand_over.holding(side, Commander.RAPID):
            return robot.manager.run_routine(side, self.routine, is_unchecked=self.unchecked)


class LoadModule(_PanelCommand, frozen=True):
    """Write a RAPID module onto the controller and load it into an arm's task."""

    arm: ArmName
    file_name: str
    text: str

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        return robot.manager.load_module(side_of(self.arm), self.file_name, self.text)


class RunModule(_PanelCommand, frozen=True):
    """Load a module and run one of its routines; the limiter does not act on its motions."""

    arm: ArmName
    file_name: str
    text: str
    routine: str
    unchecked: bool = False

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        side = side_of(self.arm)
        with robot.control.hand_over.holding(side, Commander.RAPID):
            return robot.manager.run_module(side, self.file_name, self.text, self.routine, is_unchecked=self.unchecked)


class SetTool(_PanelCommand, frozen=True):
    """Have the next EGM motion of an arm use a tool: its centre point in tool0, and its load."""

    arm: ArmName
    tcp: Pose
    load: Mass

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        return robot.manager.set_tool(side_of(self.arm), self.tcp, self.load)


class SetPayload(_PanelCommand, frozen=True):
    """Have the next EGM motion of an arm carry a payload beside its tool."""

    arm: ArmName
    payload: Mass

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        return robot.manager.set_payload(side_of(self.arm), self.payload)


class ReadSignal(_PanelCommand, frozen=True):
    """The logical value of an I/O signal."""

    lane = Lane.READ

    name: str

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        return robot.manager.panel.read_signal(self.name)


class WriteSignal(_PanelCommand, frozen=True):
    """Write an I/O signal and read it back."""

    lane = Lane.WRITE

    name: str
    value: str

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        robot.manager.write_signal(self.name, self.value)
        return headline(message("signal_is", signal=self.name, value=self.value))


class ReadVariable(_PanelCommand, frozen=True):
    """The value of a RAPID variable as RAPID writes it."""

    lane = Lane.READ

    task: str
    module: str
    name: str

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        return robot.manager.panel.read_variable(self.task, self.module, self.name)


class WriteVariable(_PanelCommand, frozen=True):
    """Write a RAPID variable."""

    lane = Lane.WRITE

    task: str
    module: str
    name: str
    value: str

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        robot.manager.write_variable(self.task, self.module, self.name, self.value)
        return headline(
            message("variable_is", task=self.task, module=self.module, variable=self.name, value=self.value)
        )


COMMANDS: tuple[type[Command[Any]], ...] = (
    GetState,
    GetControllers,
    GetSurroundings,
    DescribeState,
    RobotIsReady,
    SetMode,
    StartEgm,
    StopEgm,
    Recover,
    GiveBack,
    Calibrate,
    Grip,
    Move,
    Follow,
    Jog,
    JogTool,
    Stream,
    Teleoperate,
    SwitchControllers,
    SetSpeedScale,
    SetSpeedRatio,
    AllowCollision,
    MotorsOn,
    MotorsOff,
    StartRapid,
    StopRapid,
    PpToMain,
    RunRoutine,
    LoadModule,
    RunModule,
    SetTool,
    SetPayload,
    ReadSignal,
    WriteSignal,
    ReadVariable,
    WriteVariable,
)
"""All commands; nothing else can be asked of a driver."""


def carry_out(command: Command[R], robot: CommandedRobot, caller: Caller = Caller()) -> R:  # noqa: B008 - it is frozen
    """Check a command and run it, on the thread of the caller.

    Raises:
        YumiError: it is refused, or has failed.
    """
    try:
        command.check()
        robot.check_arms(command.needed_arms(robot))
        with requested_by(caller.commander, caller.client, caller.name):
            return command.run(robot, caller)
    finally:
        if command.lane not in (Lane.READ, Lane.JOG):
            robot.on_change()


def offered_to(*front_ends: FrontEnd) -> tuple[type[Command[Any]], ...]:
    """The commands that these may give."""
    return tuple(kind for kind in COMMANDS if not kind.front_ends.isdisjoint(front_ends))
