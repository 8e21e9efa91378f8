"""The watch over the robot in virtual time: whoever changes something, it is known within 200 ms."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from queue import Queue
from threading import Event

import pytest

from system.recovery_bench import MovingSystem
from yumi.errors import ControllerRefused
from yumi.hardware.manager_state import RobotState
from yumi.hardware.robot_watch import STALE, WHOLE_LOOK
from yumi.hardware.rws_subscription import OnChange, OnLost, Subscription
from yumi.hardware.state_machine import START_JOINT, MachineState
from yumi.robot.joints import Side
from yumi.rws.states import ControllerState, ExecutionState, OperatingMode
from yumi.rws.subscriptions import Change, Resource
from yumi.virtual.fault_names import Fault

NOTICED = 0.2 + 0.004  # and the cycle in which the virtual robot does it


class Watched:
    """A robot whose watch makes its steps whenever they are due.

    Attributes:
        told: each state that the watch has told.
    """

    def __init__(self, system: MovingSystem) -> None:
        self.system = system
        self.watch = system.manager.watch
        self.told: list[RobotState] = []
        self.watch.on_change = self.told.append
        self.step()

    def step(self) -> None:
        """What the thread does: the next step is due after a time, or when the bell rings."""
        self._due = self.system.now() + self.watch.step()

    def wait(self, seconds: float) -> None:
        end = self.system.now() + seconds
        while self.system.now() < end:
            self.system.wait(0.004)
            if self.watch.is_rung or self.system.now() >= self._due:
                self.watch.take_ring()
                self.step()

    def until(self, is_so: Callable[[RobotState], bool], timeout: float = 3.0) -> float:
        """Let time pass until the watch knows it; returns how long it took [s]."""
        begin = self.system.now()
        while not is_so(self.watch.state()):
            assert self.system.now() - begin < timeout, f"unknown after {timeout} s: {self.watch.state()}"
            self.wait(0.004)
        return self.system.now() - begin

    def wait_for_idle_programs(self) -> None:
        """Until the programs of both arms are done with a motion, which takes them some steps, known or not."""
        tasks = self.system.world.controller.tasks
        while any(tasks[side.task].read("TRobMain", "current_state") != "0" for side in Side):
            self.wait(0.004)


@pytest.fixture
def watched() -> Watched:
    watched = Watched(MovingSystem())
    watched.wait(1.0)
    return watched


@pytest.mark.parametrize(
    ("fault", "is_known"),
    [
        (Fault.PROGRAM_STOP, lambda state: state.execution is ExecutionState.STOPPED),
        (Fault.MOTORS_OFF, lambda state: state.controller_state is ControllerState.MOTORS_OFF),
        (Fault.EMERGENCY_STOP, lambda state: state.controller_state is ControllerState.EMERGENCY_STOP),
        (Fault.MANUAL_MODE, lambda state: state.mode is OperatingMode.MANUAL_REDUCED),
        (Fault.COLLISION, lambda state: state.last_event.code in (50204, 10125)),
        (Fault.WARM_RESTART, lambda state: not state.is_connected),
    ],
)
def test_change_from_any_side_is_known_within_200_ms(
    watched: Watched, fault: Fault, is_known: Callable[[RobotState], bool]
) -> None:
    watched.system.faults.happen(fault)
    notice = 0.2 if fault is Fault.WARM_RESTART else 0.0  # the controller goes down so long after it was told to
    assert watched.until(is_known) <= NOTICED + notice


def test_program_that_ended_a_motion_by_itself_is_known_within_200_ms(watched: Watched) -> None:
    watched.system.faults.happen(Fault.EGM_CONVERGENCE)
    watched.wait_for_idle_programs()
    assert watched.until(lambda state: set(state.machines.values()) == {MachineState.IDLE}) <= NOTICED


def test_start_signal_of_another_client_is_known(watched: Watched) -> None:
    system = watched.system
    system.manager.stop_egm()
    watched.until(lambda state: state.machines[Side.LEFT] is MachineState.IDLE)
    system.world.controller.signals.set(START_JOINT, 0)
    watched.wait(0.1)
    system.world.controller.signals.set(START_JOINT, 1)
    assert watched.until(lambda state: state.machines[Side.LEFT] is MachineState.RUN_EGM_ROUTINE) <= NOTICED


def test_watch_knows_the_robot_again_after_a_restart(watched: Watched) -> None:
    watched.system.faults.happen(Fault.WARM_RESTART)
    watched.until(lambda state: not state.is_connected)
    assert watched.until(lambda state: state.is_connected, 25.0) > 19.0
    assert watched.watch.state().reason == "the motors are off"


def test_watch_goes_on_after_its_web_socket_broke(watched: Watched) -> None:
    watched.system.faults.happen(Fault.WEB_SOCKET_DROP)
    watched.wait(0.5)
    watched.system.faults.happen(Fault.MOTORS_OFF)
    assert watched.until(lambda state: state.controller_state is ControllerState.MOTORS_OFF) <= NOTICED


def test_change_that_is_forgotten_while_the_web_socket_opens_is_known(
    watched: Watched, monkeypatch: pytest.MonkeyPatch
) -> None:
    subscribe = watched.system.client.subscribe

    def forget(resources: Sequence[Resource], on_change: OnChange, on_lost: OnLost) -> Subscription:
        told: list[Change] = []
        subscription = subscribe(resources, told.append, on_lost)
        for change in tuple(told):
            on_change(change)
        watched.system.world.controller.set_motors(False)
        return subscription

    monkeypatch.setattr(watched.system.client, "subscribe", forget)
    watched.system.faults.happen(Fault.WEB_SOCKET_DROP)
    assert watched.until(lambda state: state.controller_state is ControllerState.MOTORS_OFF) <= NOTICED
    watched.wait(1.0)
    assert watched.watch.state().controller_state is ControllerState.MOTORS_OFF


def test_watch_that_may_not_subscribe_looks_at_the_event_log(monkeypatch: pytest.MonkeyPatch) -> None:
    system = MovingSystem()

    def refuse(*_: object) -> None:
        raise ControllerRefused("no subscriptions left", status=400)

    monkeypatch.setattr(system.client, "subscribe", refuse)
    watched = Watched(system)
    watched.wait(1.0)
    system.faults.happen(Fault.MOTORS_OFF)
    assert watched.until(lambda state: state.controller_state is ControllerState.MOTORS_OFF) <= 0.5


def test_what_is_told_is_known_before_the_next_request_has_its_turn(watched: Watched) -> None:
    watched.system.client.set_speed_ratio(50)
    watched.system.wait(0.1)
    assert watched.watch.is_rung
    assert watched.watch.state().speed_ratio == 50


def test_reading_that_began_before_a_change_does_not_undo_it(watched: Watched, monkeypatch: pytest.MonkeyPatch) -> None:
    """Who reads waits for the turn of each request; the watch itself looks at what is told meanwhile."""
    client, ask = watched.system.client, watched.system.client.speed_ratio

    def slowly() -> int:
        before = ask()
        client.set_speed_ratio(50)
        watched.wait(0.1)
        return before

    monkeypatch.setattr(client, "speed_ratio", slowly)
    watched.watch.look()
    assert watched.watch.state().speed_ratio == 50


def test_watch_tells_each_change_once(watched: Watched) -> None:
    watched.told.clear()
    watched.system.faults.happen(Fault.PROGRAM_STOP)
    watched.wait(1.0)
    assert watched.told[-1].execution is ExecutionState.STOPPED
    assert all(before != after for before, after in pairwise(watched.told))


def test_watch_asks_little_while_nothing_happens(watched: Watched, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[object] = []
    exchange = watched.system.http.exchange
    monkeypatch.setattr(watched.system.http, "exchange", lambda *request: asked.append(request) or exchange(*request))
    watched.wait(10.0)
    assert len(asked) <= 20


def test_state_that_was_read_too_long_ago_is_unknown(watched: Watched) -> None:
    """Whatever keeps the watch from making its steps, a hung thread or one that is gone."""
    assert watched.watch.state().is_connected
    watched.system.wait(STALE + WHOLE_LOOK)
    state = watched.watch.state()
    assert not state.is_connected
    assert state.execution is None
    assert state.reason.startswith("the robot's state is unknown: it was read ")
    assert str(state).startswith("the robot's state is unknown: it was read ")


def test_state_is_known_for_as_long_as_the_watch_makes_its_steps(watched: Watched) -> None:
    watched.told.clear()
    watched.wait(2.0 * STALE)
    assert all(state.is_connected for state in watched.told)
    assert watched.watch.state().is_connected


def test_watch_goes_on_after_an_unexpected_exception_and_knows_nothing_meanwhile(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    system, told = MovingSystem(), Queue[RobotState]()
    may_go_on = Event()
    watch = system.manager.watch
    watch.start()
    watch.on_change = told.put
    ask = system.client.operating_mode

    def fail() -> OperatingMode:
        if not may_go_on.is_set():
            raise RecursionError("maximum recursion depth exceeded")
        return ask()

    monkeypatch.setattr(system.client, "operating_mode", fail)
    system.advance(WHOLE_LOOK)
    watch.hint()
    while told.get(timeout=10.0).is_connected:
        continue
    assert not watch.state().is_connected
    may_go_on.set()
    while not told.get(timeout=10.0).is_connected:
        continue
    watch.stop()
    failed = [record for record in caplog.records if record.getMessage().startswith("Thread robot-watch failed")]
    assert [record.exc_info is not None for record in failed] == [True]
