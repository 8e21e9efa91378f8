"""The commands against the whole driver and a virtual robot in memory: only the endpoint's socket is real."""

from __future__ import annotations

import json
import socket
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from math import nan
from pathlib import Path
from threading import Event
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np
import pytest
from click.testing import CliRunner

from abb_protocols.catalogue import from_wire, message, sentence
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import CommandRefused, YumiError
from abb_protocols.robot.description import FINGERTIPS
from abb_protocols.robot.joints import YUMI_LIMITS, Joints, Side, named_pose
from abb_protocols.robot.kinematics import compose_poses, matrix_from_quaternion, tool0_to_body
from abb_runtime.faults import Fault
from refusals import refused
from system.virtual_time_bench import System
from yumi.api.attach import attach
from yumi.api.motion_executor import MotionExecutor
from yumi.api.motion_registry import MotionRegistry
from yumi.cli.main import main
from yumi.control.controllers.cartesian import CartesianController
from yumi.control.controllers.joint_goal import JointGoalController
from yumi.control.controllers.joint_velocity import JointVelocityController
from yumi.control.goals import MemoryBuffer
from yumi.control.hand_over import HandOver
from yumi.driver import motion_commands
from yumi.driver.command import CommandedRobot
from yumi.driver.controller_names import CARTESIAN_CONTROLLER, GOAL_CONTROLLER, JOG_CONTROLLER
from yumi.driver.endpoint import find_driver
from yumi.driver.endpoint_server import EndpointServer
from yumi.driver.motion_commands import JOG_HOLDS
from yumi.web.page_messages import MAX_JOG_ANGULAR, MAX_JOG_JOINT_SPEED, MAX_JOG_LINEAR


class Driver(System):
    """The driver in memory, with its endpoint; time goes by where its robot manager waits, and in :meth:`run`."""

    def __init__(self, *, are_calibrated: bool) -> None:
        self._motions = MotionRegistry(is_script=False)
        super().__init__(are_calibrated=are_calibrated)
        self.speeds = {side: MemoryBuffer() for side in Side}
        self.tool_goals = {side: MemoryBuffer() for side in Side}
        for side, arm in self.arms.items():
            arm.line.manager.load(GOAL_CONTROLLER, JointGoalController(MemoryBuffer()))
            arm.line.manager.configure(GOAL_CONTROLLER)
            jogging = {
                JOG_CONTROLLER: JointVelocityController(self.speeds[side]),
                CARTESIAN_CONTROLLER: CartesianController(side, self.tool_goals[side], MemoryBuffer()),
            }
            for name, controller in jogging.items():
                arm.line.manager.load(name, controller)
                arm.line.manager.configure(name)
        self.buffers = {
            side: SimpleNamespace(
                goals=arm.goals,
                speeds=self.speeds[side],
                tool_goals=self.tool_goals[side],
                trajectory=MemoryBuffer(),
                dual_trajectory=MemoryBuffer(),
                tool_path=MemoryBuffer(),
                deadline=arm.deadline,
            )
            for side, arm in self.arms.items()
        }
        self.mover = MotionExecutor(self, self._motions, tuple(Side), YUMI_LIMITS, self)
        robot = CommandedRobot(
            address="memory",
            manager=self.manager,
            control=self,
            datagram=lambda side: b"",
            grippers=self.grippers,
            gripper_state=self.signals.state,
            force=10.0,
            mover=self.mover,
            recover=self.manager.recover,
            calibrate=lambda sides, check: self.manager.calibrate(*(self.grippers[it] for it in sides), check=check),
        )
        self.server = EndpointServer(robot)

    @property
    def hand_over(self) -> HandOver:
        return self.control.hand_over

    def snapshot(self, side: Side) -> Any:
        return self.control.snapshot(side)

    def call(self, command: Callable[..., Any], /, *args: Any, **options: Any) -> Any:
        with self.http.lock:
            return self.control.call(command, *args, **options)

    def run(self, *arguments: str) -> tuple[int, str, str]:
        """Exit code, output and errors of a command; time goes by meanwhile."""
        with ThreadPoolExecutor(1) as other:
            running = other.submit(CliRunner().invoke, main, arguments)
            while not running.done():
                if arguments[0] == "move":  # what waits for the robot manager lets time go by itself
                    self.wait(0.02)
            result = running.result()
        return result.exit_code, result.stdout, result.stderr

    def done(self, *arguments: str) -> str:
        code, output, errors = self.run(*arguments)
        assert code == 0, errors
        return output

    def refused(self, *arguments: str) -> str:
        code, output, errors = self.run(*arguments)
        assert code != 0, output
        return errors

    def _cycle(self) -> None:
        known = {side: len(arm.events) for side, arm in self.arms.items()}
        super()._cycle()
        for side, arm in self.arms.items():
            for event in arm.events[known[side] :]:
                self._motions.note(event)


def in_shell(code: str, **values: object) -> str:
    """What a command prints of a message."""
    return sentence(message(code, **values), FrontEnd.SHELL)


def poll_until(condition: Callable[[], object]) -> None:
    for _ in range(1000):
        if condition():
            return
        Event().wait(0.01)
    raise AssertionError("the condition did not come true")


@pytest.fixture
def driver(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Driver]:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    driver = Driver(are_calibrated=getattr(request, "param", False))
    driver.client.connect()
    driver.server.start()
    yield driver
    driver.server.stop()
    with suppress(YumiError):
        driver.client.close()


def test_robot_is_brought_to_egm_moved_and_stopped(driver: Driver) -> None:
    assert "motoroff" in driver.done("state")
    assert driver.done("start") == "EGM runs on both arms, the controllers are active\n"
    before = json.loads(driver.done("controllers", "--json"))["right"]
    assert driver.done("move", "right", "ready", "--speed-scale", "1") == "The right arm stands at the goal\n"
    state = json.loads(driver.done("state", "--json"))
    assert state["arms"]["right"]["position"] == pytest.approx(named_pose(Side.RIGHT, "ready"), abs=0.002)
    assert json.loads(driver.done("controllers", "--json"))["right"] == before
    assert driver.done("stop") == "EGM has ended on both arms\n"
    refusal = in_shell("goal_refused", reason=message("arm_without_egm", arm="right"))
    assert driver.refused("move", "right", "home") == f"Error: {refusal}\n"
    assert driver.done("mode", "motors_off") == "The motors are off\n"


def keep_asking(driver: Driver, ask: Callable[[], object], seconds: float) -> None:
    """Ask thirty times a second, as a page does while a key is held."""
    with ThreadPoolExecutor(1) as other:
        for number in range(round(seconds / 0.033)):
            asked = other.submit(ask)
            # Controllers are switched for the first one, which takes the robot's time; the others are answered at once.
            while number == 0 and not asked.done():
                driver.wait(0.004)
            asked.result()
            driver.wait(0.033)


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """The driver ends no jog by its own clock, on which the robot's time may go by slowly: the controllers do."""
    monkeypatch.setattr(motion_commands, "JOG_HOLDS", 60.0)


@pytest.mark.usefixtures("patient")
def test_arm_is_jogged_while_speeds_come_and_stops_by_its_controllers_timeout(driver: Driver) -> None:
    driver.done("start")
    with attach() as attached:
        start, begun = driver.snapshot(Side.LEFT).position, driver.now()
        keep_asking(driver, lambda: attached.jog("left", [0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]), 1.0)
        moved = driver.snapshot(Side.LEFT).position
        assert 0.3 < moved[0] - start[0] < 0.5 * (driver.now() - begun)
        check_stands_soon(driver, Side.LEFT)
        with refused(CommandRefused, "jog_speeds_malformed", count=7):
            attached.jog("left", [0.1] * 6)
        with refused(CommandRefused, "goal_position_not_finite", position=1, value="nan"):
            attached.jog("left", [nan, *[0.0] * 6])


def check_stands_soon(driver: Driver, side: Side) -> None:
    """No request comes any more: 0.2 s later the arm stands, but for what the robot's own filter still settles."""
    driver.wait(0.2)
    stood = driver.snapshot(side)
    assert max(map(abs, stood.velocity)) < 0.03
    driver.wait(0.5)
    assert driver.snapshot(side).position == pytest.approx(stood.position, abs=0.003)


@pytest.mark.parametrize(
    "velocity",
    [
        (0.0, 0.0, MAX_JOG_LINEAR, 0.0, 0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0, 0.0, MAX_JOG_ANGULAR, 0.0, 0.0),
        (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, MAX_JOG_JOINT_SPEED),
        None,
    ],
    ids=["line", "turn", "elbow", "joint"],
)
def test_arm_whose_fastest_jog_is_lost_stands_within_a_fifth_of_a_second(
    driver: Driver, velocity: Joints | None
) -> None:
    driver.done("start")
    driver.done("move", "right", "ready", "--speed-scale", "1")
    owner = object()

    def jog() -> None:
        if velocity is None:
            driver.mover.jog(Side.RIGHT, (MAX_JOG_JOINT_SPEED, *[0.0] * 6), owner)
        else:
            driver.mover.jog_tool(Side.RIGHT, velocity, FINGERTIPS, owner, is_in_tool=False)

    keep_asking(driver, jog, 0.5)
    assert max(map(abs, driver.snapshot(Side.RIGHT).velocity)) > 0.3
    driver.mover.end_jog(Side.RIGHT, owner)  # as the driver does that long after the last message
    driver.wait(0.2 - JOG_HOLDS - 0.01)
    stood = driver.snapshot(Side.RIGHT)
    assert max(map(abs, stood.velocity)) < 0.01
    driver.wait(0.5)
    assert driver.snapshot(Side.RIGHT).position == pytest.approx(stood.position, abs=0.001)


@pytest.mark.usefixtures("patient")
@pytest.mark.parametrize("frame", ["base", "tool"])
def test_fingertips_are_jogged_along_a_line_and_stop_by_their_controllers_timeout(
    driver: Driver, frame: Literal["base", "tool"]
) -> None:
    driver.done("start")
    driver.done("move", "right", "ready", "--speed-scale", "1")
    with attach() as attached:
        before = compose_poses(tool0_to_body(Side.RIGHT, driver.snapshot(Side.RIGHT).position), FINGERTIPS)
        keep_asking(driver, lambda: attached.jog_tool("right", linear=(0.0, 0.0, 0.08), frame=frame), 0.8)
        check_stands_soon(driver, Side.RIGHT)
        after = compose_poses(tool0_to_body(Side.RIGHT, driver.snapshot(Side.RIGHT).position), FINGERTIPS)
    axis = np.array((0.0, 0.0, 1.0)) if frame == "base" else matrix_from_quaternion(before.orientation)[:, 2]
    moved = np.array(after.position) - np.array(before.position)
    assert 0.04 < float(moved @ axis) < 0.4
    assert float(np.linalg.norm(moved - (moved @ axis) * axis)) < 0.001
    assert after.orientation == pytest.approx(before.orientation, abs=0.003)


def test_jog_of_an_arm_that_another_motion_moves_is_refused(driver: Driver) -> None:
    driver.done("start")
    with attach() as attached, ThreadPoolExecutor(1) as other:
        moving = other.submit(CliRunner().invoke, main, ["move", "right", "ready"])
        while max(map(abs, driver.snapshot(Side.RIGHT).velocity)) < 0.05:
            driver.wait(0.004)
        with refused(CommandRefused, "another_move_under_way"):  # time stands still: the arm is on its way
            attached.jog("right", [0.1] * 7)
        while not moving.done():
            driver.wait(0.02)
        assert moving.result().exit_code == 0


def test_grippers_are_calibrated(driver: Driver) -> None:
    driver.done("mode", "ready")
    assert in_shell("gripper_not_calibrated", gripper="left") in driver.refused("grip", "left", "close")
    assert driver.done("calibrate") == "The right and left grippers are calibrated\n"
    assert driver.done("grip", "right", "open", "--width", "0.03") == "The right gripper is in place.\n"


@pytest.fixture(params=["start_egm", "set_mode egm_both", "recover", "calibrate"])
def ask(request: pytest.FixtureRequest) -> Callable[[], socket.socket]:
    """Sends a request that sets something in motion, and returns its connection."""
    method, _, mode = request.param.partition(" ")

    def send() -> socket.socket:
        connection = socket.socket(socket.AF_UNIX)
        connection.connect(str(find_driver()))
        connection.sendall(json.dumps({"method": method, **({"mode": mode} if mode else {})}).encode() + b"\n")
        return connection

    return send


def test_request_of_a_client_that_went_away_while_it_waited_is_not_carried_out(
    driver: Driver, ask: Callable[[], socket.socket]
) -> None:
    driver.done("mode", "ready")
    poll_until(lambda: driver.server._work == driver.server.client_count == 0)  # its client is gone
    driver.steps.clear()
    with driver.manager._turn:
        connection = ask()
        poll_until(lambda: driver.server._work == 1)
        connection.close()
        poll_until(lambda: driver.server.client_count == 0)
    poll_until(lambda: driver.server._work == 0)
    assert driver.steps == []
    assert not any(gripper.is_calibrated() for gripper in driver.grippers.values())


def test_request_ends_before_its_next_step_when_its_client_goes_away(driver: Driver) -> None:
    def go_away(step: str) -> None:
        driver.steps.append(step)
        connection.close()
        poll_until(lambda: driver.server.client_count == 0)

    driver.bringup._reports[0] = go_away
    connection = socket.socket(socket.AF_UNIX)
    connection.connect(str(find_driver()))
    connection.sendall(b'{"method": "start_egm"}\n')
    poll_until(lambda: driver.steps and driver.server._work == 0)
    assert driver.steps == ["switch the motors on"]
    assert "motoroff" in driver.done("state")


def test_motors_are_switched_off_for_a_client_that_is_gone(driver: Driver) -> None:
    driver.done("mode", "ready")
    with driver.manager._turn:
        connection = socket.socket(socket.AF_UNIX)
        connection.connect(str(find_driver()))
        connection.sendall(b'{"method": "set_mode", "mode": "motors_off"}\n')
        poll_until(lambda: [client.pending for client in driver.server._clients] == [1])
        (client,) = driver.server._clients
        connection.close()
        poll_until(lambda: driver.server.client_count == 0)
    poll_until(lambda: client.pending == 0)
    assert "motoroff" in driver.done("state")


@pytest.mark.parametrize("driver", [True], indirect=True)
def test_gripper_says_what_it_holds(driver: Driver) -> None:
    driver.done("mode", "ready")
    assert driver.done("grip", "left", "open") == "The left gripper is open.\n"
    assert driver.done("grip", "left", "close") == "The left gripper is holding something 20.0 mm wide.\n"


def test_collision_is_confirmed_before_anything_moves(driver: Driver) -> None:
    driver.done("start")
    driver.faults.inject(Fault.COLLISION)
    driver.wait(0.5)
    driver.refused("start")
    state = json.loads(driver.done("state", "--json"))
    assert [each["values"]["number"] for each in state["causes"]] == [50204]
    causes = tuple(map(from_wire, state["causes"]))
    refusal = in_shell("confirm_by_option", causes=causes, stop=state["stop"])
    assert driver.refused("recover") == f"Error: {refusal}\n"
    assert "50204" in driver.done("recover", "--confirm", state["stop"])
    assert json.loads(driver.done("state", "--json"))["arms"]["right"]["mode"] == "holding"
