"""Provokes stops and refusals in virtual time, and writes the page of what is said of each of them.

``make pages`` writes docs/reference/stops-and-refusals.md
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import takewhile
from math import nan
from os import environ
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any, NamedTuple
from unittest.mock import patch

from abb_protocols.catalogue import Message, said_by, sentence
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import YumiError
from abb_protocols.robot.description import HAND
from abb_protocols.robot.gripper_values import FINGER_TRAVEL, GripDirection, GripperGoal, finger_position_goal, grip
from abb_protocols.robot.joints import YUMI_LIMITS, Joints, Pose, Side, home, joint_names, joints
from abb_protocols.rws.values import ControllerState
from abb_runtime.clock import ManualClock
from abb_runtime.faults import Fault, FaultDirection
from abb_runtime.rws.client import RwsClient
from abb_runtime.udp import free_port
from memory_http import MemoryHttp
from system.virtual_time_bench import System
from virtual_irc5.controller.installed_system import ROBOTS, factory_system
from virtual_irc5.world import World, WorldSettings
from yumi.api.motion_executor import MotionExecutor
from yumi.api.motion_registry import MotionRegistry
from yumi.cli.up import _only_under_name
from yumi.control.controllers.cartesian import CartesianController
from yumi.control.controllers.joint_goal import JointGoalController
from yumi.control.controllers.joint_trajectory import JointTrajectoryController
from yumi.control.controllers.joint_velocity import JointVelocityController
from yumi.control.goals import MemoryBuffer
from yumi.control.loop_commands import Commands
from yumi.control.loop_events import (
    ControllerReport,
    Event,
    RobotFollows,
    RobotStoppedFollowing,
    SessionLost,
    SessionStarted,
    is_fault,
)
from yumi.driver.controller_names import CARTESIAN_CONTROLLER, GOAL_CONTROLLER, JOG_CONTROLLER, TRAJECTORY_CONTROLLER
from yumi.driver.endpoint import find_driver
from yumi.driver.launch_checks import LaunchChecks
from yumi.driver.stops import Cause
from yumi.planning.planner import Planner

RIGHT, LEFT = Side.RIGHT, Side.LEFT
GRIPPERS = ("gripper", "object")
"""How the names of faults begin that no arm stops for."""
HERE = home(RIGHT)
THERE = joints([*HERE[:6], HERE[6] + 1.0])
TOOL0 = Pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
CLOSE, OPEN = grip(GripDirection.INWARDS, 10.0), finger_position_goal(FINGER_TRAVEL)


class Row(NamedTuple):
    """One stop or refusal.

    Attributes:
        what: was done.
        said: what is said of it, in this order.
    """

    what: str
    said: tuple[Message, ...]


class Driver(System):
    """A driver whose arms get goals as a script gives them.

    Attributes:
        events: what happened to the right arm, but for beginnings and ends that were asked for.
        lines: what the robot's monitor has logged.
    """

    def __init__(self) -> None:
        self.motions = MotionRegistry()
        self.unexplained: list[Callable[[Cause], None]] = []
        self.motions.explain = self._explain_later
        self.events: list[Event] = []
        self.lines: list[Message] = []
        super().__init__(are_calibrated=True)
        speeds, tool_goals = ({side: MemoryBuffer() for side in Side} for _ in range(2))
        for side, arm in self.arms.items():
            controllers = {
                GOAL_CONTROLLER: JointGoalController(MemoryBuffer()),
                JOG_CONTROLLER: JointVelocityController(speeds[side]),
                TRAJECTORY_CONTROLLER: JointTrajectoryController(side, MemoryBuffer()),
                CARTESIAN_CONTROLLER: CartesianController(side, tool_goals[side], MemoryBuffer()),
            }
            for name, controller in controllers.items():
                arm.line.manager.load(name, controller)
                arm.line.manager.configure(name)
        self.arms[Side.RIGHT].line._limiter.pair(self.arms[Side.LEFT].line._limiter)
        self.control.buffers = {
            side: SimpleNamespace(
                goals=arm.goals,
                speeds=speeds[side],
                tool_goals=tool_goals[side],
                trajectory=MemoryBuffer(),
                dual_trajectory=MemoryBuffer(),
                tool_path=MemoryBuffer(),
            )
            for side, arm in self.arms.items()
        }
        self.mover = MotionExecutor(self.control, self.motions, tuple(Side), YUMI_LIMITS, self)
        self.manager.monitor.log.report = self._hear_line

    def move(self, goal: Any = None) -> None:
        """The right arm goes somewhere; it is on its way afterwards."""
        at = self.arms[RIGHT].snapshot.position
        away = max((THERE, HERE), key=lambda pose: abs(pose[6] - at[6]))
        self.motion = self.mover.move({RIGHT: away if goal is None else goal}, None, None)[0]

    def _explain_later(self, then: Callable[[Cause], None]) -> None:
        self.unexplained.append(then)

    def hear(self, seconds: float) -> list[Message]:
        """What is reported within a time, with its cause: of the right arm, or else of the robot."""
        self.events.clear()
        self.lines.clear()
        steps = max(2, round(seconds / 0.15))
        for _ in range(steps):
            self.wait(seconds / steps)
            self.manager.monitor.step()
        heard: list[Message] = []
        for event in self.events:
            self.manager.monitor.describe(event, heard.append)
        for then in self.unexplained:
            then(self.manager.monitor.cause())
        self.unexplained.clear()
        return heard or self.lines

    def restore(self) -> None:
        """Both arms in EGM again, whatever stopped them; a person confirms it."""
        state = self.manager.state()
        if state.is_stopped:
            self.hear(0.9)  # what is logged late
        self.manager.recover(_quietly, confirmed=state.stop)
        self.motions.clear_faults()

    def _hear_line(self, level: int, said: Message | str) -> None:
        if isinstance(said, Message):
            self.lines.append(said)

    def _cycle(self) -> None:
        known = {side: len(arm.events) for side, arm in self.arms.items()}
        super()._cycle()
        for side, arm in self.arms.items():
            for event in arm.events[known[side] :]:
                self.motions.note(event)
                is_quiet = isinstance(event, SessionStarted | SessionLost | RobotStoppedFollowing) and not is_fault(
                    event
                )
                if side is RIGHT and not is_quiet and not isinstance(event, RobotFollows | ControllerReport):
                    self.events.append(event)


# Of each fault: to both arms or the right one, how long it lasts and how strong it is, where its own are not taken.
_OF_FAULT: Mapping[Fault, tuple[float | None, float | None, FaultDirection | None]] = {
    Fault.EGM_SILENCE: (0.4, None, None),
    Fault.EGM_LOSS: (0.3, None, FaultDirection.TO_ROBOT),
    Fault.EGM_DELAY: (0.4, None, None),
    Fault.EGM_DUPLICATE: (0.3, None, None),
    Fault.EGM_REORDER: (0.3, None, None),
    Fault.EGM_TRUNCATE: (0.3, 20.0, None),
    Fault.EGM_OFFSET: (0.3, None, None),
    Fault.EGM_SWAP_ARMS: (0.3, None, None),
    Fault.EGM_FOREIGN_PORT: (0.3, None, None),
    Fault.WARM_RESTART: (1.0, None, None),
    Fault.RWS_BUSY: (1.0, None, None),
}
_AFTER = {  # what undoes another fault is a fault after that one
    Fault.EGM_REPAIR: Fault.EGM_SILENCE,
    Fault.EMERGENCY_STOP_RESET: Fault.EMERGENCY_STOP,
    Fault.AUTO_MODE: Fault.MANUAL_MODE,
    Fault.RIGHT_PROGRAM: Fault.WRONG_PROGRAM,
}
_LATE = {
    Fault.EGM_FORGE_OLD: 1.5,
    Fault.EGM_FORGE_AHEAD: 1.5,
    Fault.RWS_BUSY: 1.5,
    Fault.EMERGENCY_STOP: 0.75,
    Fault.MANUAL_MODE: 0.75,
    Fault.WRONG_PROGRAM: 0.75,
}
_REFUSED_AFTER = {Fault.EMERGENCY_STOP, Fault.MANUAL_MODE, Fault.COLLISION, Fault.WRONG_PROGRAM}


def _fault_rows(driver: Driver) -> Iterator[Row]:
    for fault in Fault:
        if fault in _AFTER or fault.value.name.startswith(GRIPPERS):
            continue
        driver.move()
        driver.hear(0.1)
        duration, amount, way = _OF_FAULT.get(fault, (None, None, None))
        driver.faults.inject(fault, RIGHT if fault.value.has_side else None, duration, amount, way)
        said = driver.hear(max(_LATE.get(fault, 0.3), (duration or 0.0) + 0.2))
        if fault in _REFUSED_AFTER:
            said = [*said, _refused(lambda: driver.manager.recover(_quietly))]
        yield Row(_command(fault), tuple(said))
        assert said or driver.arms[RIGHT].snapshot.is_commanded, fault
        after = next((each for each, before in _AFTER.items() if before is fault), None)
        if after is not None:
            driver.faults.inject(after, RIGHT if after.value.has_side else None)
            driver.hear(0.15)
            yield Row(f"then {_command(after)}", driver.manager.state().reasons)
        driver.restore()


def _command(fault: Fault) -> str:
    return f"`{fault.value.name}`: {fault.value.meaning}"


def _refused(request: Callable[[], object]) -> Message:
    """Why a request is refused."""
    try:
        request()
    except YumiError as error:
        return said_by(error)
    raise AssertionError("it was not refused")


def _quietly(step: str) -> None:
    """Takes the steps of a request."""


def _gripper_rows(driver: Driver) -> Iterator[Row]:
    driver.manager.stop_egm()
    driver.manager.make_ready()
    gripper, left = driver.grippers[RIGHT], driver.grippers[LEFT]

    def do(goal: GripperGoal) -> object:
        gripper.begin(goal)
        return gripper.wait(goal)

    for fault in (Fault.GRIPPER_NOT_CALIBRATED, Fault.GRIPPER_ERROR):
        driver.faults.inject(fault, RIGHT)
        driver.wait(0.1)
        yield Row(f"{_command(fault)}; then `yumi grip right close`", (_refused(lambda: do(CLOSE)),))
        if fault is Fault.GRIPPER_NOT_CALIBRATED:
            driver.manager.calibrate(gripper)
    gripper.clear_error()
    do(OPEN)
    for fault in (Fault.OBJECT_PLACED, Fault.OBJECT_UNDER_CUPS, Fault.OBJECT_LOST):
        driver.faults.inject(fault, RIGHT)
        yield Row(_command(fault), ())
    with left.alone():
        yield Row("grip while the gripper carries out another command", (_refused(lambda: left.alone().__enter__()),))
    yield Row("switch a vacuum that the gripper has not", (_refused(lambda: left.check_vacuum(3)),))
    yield Row("open a gripper by 80 mm", (_refused(lambda: finger_position_goal(0.04)),))
    yield Row("grip with 30 N", (_refused(lambda: grip(GripDirection.INWARDS, 30.0)),))


def _motion_rows(driver: Driver) -> Iterator[Row]:
    """In EGM, at rest."""
    mover, call = driver.mover, driver.control.call
    away = {"j1": HERE[0] + 0.5}

    def trajectory(*points: tuple[float, Joints]) -> object:
        return mover.follow({RIGHT: points})

    def switch(*names: str) -> object:
        return call(Commands.switch_controllers, RIGHT, names)

    def pose(*position: float) -> object:
        return mover.move_tools({RIGHT: position}, dict.fromkeys(Side, TOOL0), None, None, None, is_linear=False)

    call(Commands.switch_controllers, RIGHT, [TRAJECTORY_CONTROLLER], mover.commanding(RIGHT))
    far = joints([*HERE[:6], HERE[6] + 2.0])
    requests: Mapping[str, Callable[[], object]] = {
        "move joint `j9`": lambda: driver.move({"j9": 0.1}),
        "move a joint of the other arm": lambda: driver.move({joint_names(LEFT)[0]: 0.1}),
        "move `j1` to 4 rad": lambda: driver.move({"j1": 4.0}),
        "move `j1` to 90, in degrees": lambda: driver.move({"j1": 90.0}),
        "move `j1` to nan": lambda: driver.move({"j1": nan}),
        "move to six positions": lambda: driver.move([0.0] * 6),
        "move to the pose “table”": lambda: driver.move("table"),
        "move with twice the speed": lambda: mover.move({RIGHT: away}, 2.0, None),
        "move the tool out of reach": lambda: pose(0.9, 0.0, 0.3),
        "move the tool to millimetres": lambda: pose(400.0, 0.0, 300.0),
        "follow points whose times decrease": lambda: trajectory((1.0, HERE), (0.5, HERE)),
        "follow a trajectory that begins elsewhere": lambda: trajectory((0.0, far), (2.0, HERE)),
        "follow a trajectory that is too fast": lambda: trajectory((0.0, HERE), (0.1, far)),
        "jog with six speeds": lambda: mover.jog(RIGHT, [0.1] * 6, driver),
        "set `speed_scale` to 2": lambda: driver.manager.speed.set(2.0),
        "switch to a controller that is not loaded": lambda: switch("my_controller"),
        "switch to a second controller": lambda: switch(JOG_CONTROLLER),
        "move the program pointers during EGM": driver.manager.pp_to_main,
        "run a RAPID routine during EGM": lambda: driver.manager.run_routine(LEFT, "runMoveJ"),
        "calibrate a gripper during EGM": lambda: driver.manager.calibrate(driver.grippers[LEFT]),
        "set the tool during EGM": lambda: driver.manager.set_tool(LEFT, TOOL0, HAND),
    }
    for what, request in requests.items():
        yield Row(what, (_refused(request),))
    driver.move()
    driver.wait(0.1)
    yield Row("jog an arm that moves", (_refused(lambda: mover.jog(RIGHT, [0.1] * 7, driver)),))
    driver.manager.stop_egm()
    driver.wait(0.1)
    yield Row("move after EGM was stopped", (_refused(lambda: driver.move(HERE)),))
    driver.manager.start_egm()


def _robot_rows(driver: Driver) -> Iterator[Row]:
    """Without EGM, the program running."""
    manager, controller = driver.manager, driver.world.controller
    requests: Mapping[str, Callable[[], object]] = {
        "set a speed ratio of 101 %": lambda: manager.set_speed_ratio(101),
        "read a signal that is not there": lambda: manager.panel.read_signal("nothing"),
        "write a signal that is read only": lambda: manager.write_signal("OUTPUT_STATIONARY_ROB_L", "0"),
        "read a variable that is not there": lambda: manager.panel.read_variable("T_ROB_L", "TRobSG", "nothing"),
        "run a routine named `2nd`": lambda: manager.run_routine(LEFT, "2nd"),
        "load a module from `Pick.txt`": lambda: manager.load_module(LEFT, "Pick.txt", "MODULE Pick\nENDMODULE\n"),
        "set a payload without a tool": lambda: manager.set_payload(LEFT, HAND),
        "set a payload of 2 kg": lambda: (
            manager.set_tool(LEFT, TOOL0, HAND),
            manager.set_payload(LEFT, replace(HAND, mass=2.0)),
        ),
        "recover, and stop meanwhile": lambda: manager.recover(lambda step: manager.interrupt()),
    }
    for what, request in requests.items():
        yield Row(what, (_refused(request),))
    driver.faults.inject(Fault.PROGRAM_STOP)
    driver.wait(0.1)
    yield Row("run a routine, the program stopped", (_refused(lambda: manager.run_routine(LEFT, "runMoveJ")),))
    driver.faults.inject(Fault.MOTORS_OFF)
    driver.wait(0.1)
    yield Row("start the program, the motors off", (_refused(manager.start_rapid),))
    driver.faults.inject(Fault.MANUAL_MODE)
    driver.wait(0.1)
    yield Row("start EGM in manual", (_refused(manager.start_egm),))
    driver.faults.inject(Fault.AUTO_MODE)
    manager.make_ready()
    driver.faults.inject(Fault.COLLISION, RIGHT)
    driver.wait(0.1)
    yield Row("start EGM after a collision", (_refused(manager.start_egm),))
    yield Row("the robot's state after a collision", (*manager.state().reasons, *manager.state().causes))
    yield Row("ask whether the robot is ready after a collision", (_refused(manager.check_ready),))
    yield Row("confirm another stop", (_refused(lambda: manager.recover(_quietly, confirmed="50204-1-0a1b2c")),))
    driver.faults.inject(Fault.EMERGENCY_STOP)
    driver.wait(0.1)
    stop = manager.state().stop
    yield Row("confirm a stop that is still pressed", (_refused(lambda: manager.recover(_quietly, confirmed=stop)),))
    yield Row("the robot's state while it is pressed", manager.state().reasons)
    driver.faults.inject(Fault.EMERGENCY_STOP_RESET)
    manager.recover(_quietly, confirmed=manager.state().stop)
    controller.controller_state = ControllerState.GUARD_STOP
    yield Row("start EGM in a guard stop", (_refused(manager.start_egm),))


def _planning_rows() -> Iterator[Row]:
    at_home = {side: home(side) for side in Side}
    planner = Planner()
    into_body = joints([HERE[0] - 0.3, *HERE[1:]])
    yield Row("plan to a goal in the body", (_refused(lambda: planner.plan(at_home, {RIGHT: into_body})),))
    far = joints([4.0, *HERE[1:]])
    yield Row("plan to a goal out of a joint's range", (_refused(lambda: planner.plan(at_home, {RIGHT: far})),))
    away = Pose((2.0, 0.0, 0.5), TOOL0.orientation)
    yield Row("plan to a pose out of reach", (_refused(lambda: planner.plan(at_home, {RIGHT: away})),))


def _connection_rows() -> Iterator[Row]:
    yield Row("connect where nothing listens", (_refused(lambda: RwsClient(f"127.0.0.1:{free_port()}").connect()),))
    clock = ManualClock()
    client = RwsClient(MemoryHttp(World(WorldSettings(system=factory_system(ROBOTS["irb120"]))).controller, clock))
    client.connect()
    yield Row("connect to another robot", (_refused(LaunchChecks(client).run),))
    client.close()
    with TemporaryDirectory() as folder, patch.dict(environ, XDG_RUNTIME_DIR=folder):
        yield Row("`yumi state` without a driver", (_refused(find_driver),))
        first = _only_under_name("/cell")
        first.claim()
        yield Row("`yumi up` beside another driver", (_refused(_only_under_name("/cell").claim),))
        first.release()


class Unsteady:
    """A value that is another one each time: shown as an ellipsis."""

    def __format__(self, spec: str) -> str:
        return "…"

    def __str__(self) -> str:
        return "…"


def _steady(value: Any, name: str = "") -> Any:
    """A message without what is another one each time."""
    if isinstance(value, Message):
        return Message(value.code, {name: _steady(each, name) for name, each in value.values.items()})
    if isinstance(value, tuple):
        return tuple(_steady(each) for each in value)
    if name == "stop" and value:
        return f"{value.partition('-')[0]}-…"
    if name == "address" and value.startswith("127.0.0.1:"):
        return "127.0.0.1:…"
    return Unsteady() if name in {"duration", "share", "process"} else value


_READERS = {
    FrontEnd.SHELL: "terminal",
    FrontEnd.PAGE: "page",
    FrontEnd.VIRTUAL_PAGE: "page of a virtual robot",
    FrontEnd.ROS: "ROS",
    FrontEnd.SCRIPT: "exception",
}


def _shown(said: Message) -> str:
    """A message in Markdown: its codes, its text, and the words in which the readers' texts differ."""
    codes = " ← ".join(f"`{code}`" for code in dict.fromkeys(_codes(said)))
    texts = {reader: _escaped(sentence(_steady(said), reader)) for reader in _READERS}
    words = [text.split(" ") for text in texts.values()]
    begin = _agreeing(words)
    end = _agreeing([each[begin:][::-1] for each in words])
    if len(set(texts.values())) == 1:
        return f"{codes}<br>{texts[FrontEnd.ROS]}"
    differing = {reader: " ".join(each[begin : len(each) - end]) for reader, each in zip(texts, words, strict=True)}
    if differing[FrontEnd.VIRTUAL_PAGE] == differing[FrontEnd.PAGE]:
        del differing[FrontEnd.VIRTUAL_PAGE]
    text = " ".join([*words[0][:begin], "**[…]**", *words[0][len(words[0]) - end :]])
    own = "<br>".join(f"**{_READERS[reader]}:** {each}" for reader, each in differing.items())
    return f"{codes}<br>{text}<br>{own}"


def _agreeing(texts: Sequence[Sequence[str]]) -> int:
    """How many words all of them begin with."""
    return sum(1 for _ in takewhile(lambda words: len(set(words)) == 1, zip(*texts, strict=False)))


def _codes(said: Message) -> Iterator[str]:
    yield said.code
    for value in said.values.values():
        for each in value if isinstance(value, tuple) else (value,):
            if isinstance(each, Message):
                yield from _codes(each)


def _escaped(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


_HEAD = """\
# Stops and refusals

<!-- Written by `make pages` from `tests/system/provoked_stops.py`; do not edit. -->

Each row was provoked on a virtual robot, and shows what is said of it on the terminal, on the page, by ROS and in a
Python exception.
The texts are the same but for what the reader can do: where they differ, **[…]** stands for the words below the text.
Before a text stand its codes (see [messages](messages.md)).
An ellipsis stands for what is another value each time.
`tests/system/test_stops_table.py` provokes all of them again and compares.
"""


def sections() -> dict[str, tuple[Row, ...]]:
    """All of it, by the headings of the page."""
    driver = Driver()
    driver.manager.start_egm()
    motions = tuple(_motion_rows(driver))
    faults = tuple(_fault_rows(driver))
    grippers = tuple(_gripper_rows(driver))
    return {
        "Faults while the right arm moves": faults,
        "Requests to the robot": tuple(_robot_rows(driver)),
        "Goals and controllers": motions,
        "Grippers": grippers,
        "Planned paths": tuple(_planning_rows()),
        "Connections": tuple(_connection_rows()),
    }


def page(found: Mapping[str, Sequence[Row]]) -> str:
    """The page, in Markdown."""
    lines, number = [_HEAD], 0
    for heading, rows in found.items():
        lines += [f"## {heading}", "", "| | what was done | what is said |", "|---|---|---|"]
        for row in rows:
            number += 1
            said = "<br>".join(map(_shown, row.said)) or "nothing: the robot goes on"
            lines.append(f"| {number} | {row.what} | {said} |")
        lines.append("")
    return "\n".join(lines)


if __name__ == "__main__":
    logging.disable()
    sys.stdout.write(page(sections()))
