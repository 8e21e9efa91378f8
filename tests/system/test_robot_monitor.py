"""The monitor of the robot in virtual time: whatever changes something, it is known within 200 ms."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from queue import Queue
from threading import Event

import pytest

from abb_protocols.catalogue import Message, clause, message, remedy_of
from abb_protocols.errors import ControllerRefused, RobotNotReady
from abb_protocols.robot.gripper_values import FINGER_TRAVEL, ServoCommand, ServoState
from abb_protocols.robot.joints import Side
from abb_protocols.rws.values import ControllerState, EventType, ExecutionState, OperatingMode, Resource
from abb_runtime.clock import ManualClock
from abb_runtime.faults import Fault
from abb_runtime.rws.client import Change, OnChange, OnLost, Subscription
from abb_runtime.rws.transport import EXCHANGE_INTERVAL
from refusals import assert_says, numbers_in
from system.recovery_bench import MovingSystem
from system.virtual_time_bench import System
from yumi.control.loop_events import Event as ArmEvent
from yumi.control.loop_events import is_fault
from yumi.driver.monitor import JOINTS_POLL, MOTORS_OFF_CHANGE, PROGRAM_STOPPED_CHANGE, STALE_STATE, WHOLE_POLL
from yumi.driver.robot_state import RobotMode, RobotState
from yumi.driver.state_machine import START_JOINT_SIGNAL, MachineState
from yumi.driver.stops import Cause
from yumi.recording.reader import read_recording
from yumi.recording.recorder import Recorder

NOTICED = 0.2 + 0.004  # and the cycle in which the virtual robot does it


class Monitored:
    """A robot whose monitor makes its steps whenever they are due.

    Attributes:
        told: each state that the monitor has reported.
        lines: what it has logged, with the level.
    """

    def __init__(self, system: System) -> None:
        self.system = system
        self.monitor = system.manager.monitor
        self.told: list[RobotState] = []
        self.monitor.on_change = self.told.append
        self.lines: list[tuple[int, Message]] = []
        self.monitor.log.report = self.write_line
        self.step()

    def write_line(self, level: int, said: Message | str) -> None:
        self.lines.append((level, said if isinstance(said, Message) else message("text", text=said)))

    def step(self) -> None:
        """What the thread does: the next step is due after a time, or when the bell rings."""
        self._due = self.system.now() + self.monitor.step()

    def wait(self, seconds: float) -> None:
        end = self.system.now() + seconds
        while self.system.now() < end:
            self.system.wait(0.004)
            if self.monitor.take_wake() or self.system.now() >= self._due:
                self.step()

    def until(self, is_so: Callable[[RobotState], bool], timeout: float = 3.0) -> float:
        """Let time pass until the monitor knows it; returns how long it took [s]."""
        begin = self.system.now()
        while not is_so(self.monitor.state()):
            assert self.system.now() - begin < timeout, f"unknown after {timeout} s: {self.monitor.state()}"
            self.wait(0.004)
        return self.system.now() - begin

    def wait_for_idle_programs(self) -> None:
        """Until the programs of both arms are done with a motion, which takes them some steps, known or not."""
        tasks = self.system.world.controller.tasks
        while any(tasks[side.task].read("TRobMain", "current_state") != "0" for side in Side):
            self.wait(0.004)


def ready_system() -> System:
    """A robot whose program runs, without EGM: its time passes several times as fast as with it."""
    system = System(request_interval=EXCHANGE_INTERVAL)
    system.manager.make_ready()
    return system


def watched(system: System) -> Monitored:
    """A robot and its monitor, whose first requests no longer delay those that follow."""
    monitored = Monitored(system)
    monitored.wait(0.4)
    return monitored


@pytest.fixture
def monitored() -> Monitored:
    """A robot that is ready, with its monitor."""
    return watched(ready_system())


@pytest.fixture
def guided() -> Monitored:
    """A robot that moves in EGM, with its monitor."""
    return watched(MovingSystem())


@pytest.mark.parametrize(
    ("fault", "is_known"),
    [
        (Fault.PROGRAM_STOP, lambda state: state.execution is ExecutionState.STOPPED),
        (Fault.MOTORS_OFF, lambda state: state.controller_state is ControllerState.MOTORS_OFF),
        (Fault.EMERGENCY_STOP, lambda state: state.controller_state is ControllerState.EMERGENCY_STOP),
        (Fault.MANUAL_MODE, lambda state: state.operating_mode is OperatingMode.MANUAL_REDUCED),
        (Fault.COLLISION, lambda state: state.last_event.code in (50204, 10125)),
        (Fault.WARM_RESTART, lambda state: not state.is_connected),
    ],
)
def test_change_from_any_side_is_known_within_200_ms(
    monitored: Monitored, fault: Fault, is_known: Callable[[RobotState], bool]
) -> None:
    monitored.system.faults.inject(fault)
    notice = 0.2 if fault is Fault.WARM_RESTART else 0.0  # the controller goes down so long after it was told to
    assert monitored.until(is_known) <= NOTICED + notice


@pytest.mark.parametrize("is_read", [True, False])
def test_what_a_request_reads_during_a_step_that_fails_after_it_stays_known(
    monitored: Monitored, monkeypatch: pytest.MonkeyPatch, is_read: bool
) -> None:
    def fail(_: float) -> float:
        monitored.system.wait(0.004)
        if is_read:
            monitored.monitor.read()
        raise RobotNotReady(message("text", text="as any step may fail"))

    monkeypatch.setattr(monitored.monitor, "_follow", fail)
    monitored.step()
    assert monitored.monitor.state().is_connected is is_read
    monkeypatch.undo()
    monitored.until(lambda state: state.is_connected)


def test_program_that_ended_a_motion_by_itself_is_known_within_200_ms(guided: Monitored) -> None:
    guided.system.faults.inject(Fault.EGM_CONVERGENCE)
    guided.wait_for_idle_programs()
    assert guided.until(lambda state: set(state.machines.values()) == {MachineState.IDLE}) <= NOTICED


@pytest.mark.parametrize("fault", [Fault.COLLISION, Fault.EMERGENCY_STOP])
@pytest.mark.parametrize(
    "jog",
    [
        lambda system: system.grippers[Side.RIGHT].jog(opens=True),
        lambda system: system.manager.write_signal("hand_CmdGripper_R", ServoCommand.JOG_OPEN),
    ],
    ids=["jog", "write_signal"],
)
def test_jog_ends_when_a_stop_comes_that_a_person_must_confirm(
    monitored: Monitored, fault: Fault, jog: Callable[[System], None]
) -> None:
    system, right = monitored.system, monitored.system.grippers[Side.RIGHT]
    jog(system)
    monitored.wait(0.2)
    assert right.state().state is ServoState.JOG_OPEN
    system.faults.inject(fault)
    monitored.wait(0.3)
    assert right.state().state is ServoState.READY
    assert 0.0 < right.position() < FINGER_TRAVEL


def test_stop_that_needs_no_confirmation_ends_no_jog(monitored: Monitored) -> None:
    right = monitored.system.grippers[Side.RIGHT]
    right.jog(opens=True)
    monitored.system.faults.inject(Fault.PROGRAM_STOP)
    monitored.wait(0.3)
    assert right.state().state is ServoState.JOG_OPEN


def test_fingers_can_be_stopped_by_their_signal_while_a_stop_is_open(monitored: Monitored) -> None:
    monitored.system.faults.inject(Fault.COLLISION)
    monitored.wait(0.3)
    monitored.system.manager.write_signal("hand_CmdGripper_R", str(int(ServoCommand.GO_TO_READY)))


def test_start_signal_of_another_client_is_known(monitored: Monitored) -> None:
    system = monitored.system
    assert monitored.monitor.state().machines[Side.LEFT] is MachineState.IDLE
    system.world.controller.signals.set(START_JOINT_SIGNAL, 1)
    assert monitored.until(lambda state: state.machines[Side.LEFT] is MachineState.RUN_EGM_ROUTINE) <= NOTICED


def test_monitor_knows_the_robot_again_after_a_restart(monitored: Monitored) -> None:
    monitored.system.faults.inject(Fault.WARM_RESTART)
    monitored.until(lambda state: not state.is_connected)
    assert monitored.until(lambda state: state.is_connected, 25.0) > 19.0
    assert monitored.monitor.state().reasons == (message("motors_off"),)


def fail_to_look(monitored: Monitored, monkeypatch: pytest.MonkeyPatch) -> None:
    """The look after a request meets a controller that is busy for a moment."""

    def refuse() -> OperatingMode:
        raise ControllerRefused("The controller is busy.", status=503)

    with monkeypatch.context() as patch:
        patch.setattr(monitored.system.client, "operating_mode", refuse)
        monitored.monitor.refresh()


def test_robot_is_known_again_soon_after_one_look_that_failed(
    monitored: Monitored, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(monitored.monitor, "_thread", object())  # its steps are made by this test
    fail_to_look(monitored, monkeypatch)
    assert not monitored.monitor.state().is_connected
    assert monitored.until(lambda state: state.is_connected) <= 1.0


def test_stop_is_explained_although_a_look_has_failed(monitored: Monitored, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(monitored.monitor, "_thread", object())
    causes: list[Cause] = []
    monitored.system.faults.inject(Fault.COLLISION)
    monitored.system.wait(0.02)
    fail_to_look(monitored, monkeypatch)
    monitored.monitor.explain(causes.append)
    monitored.monitor._answer_unexplained()
    assert not causes
    while not causes:
        monitored.wait(0.004)
    assert numbers_of(causes[0]) == [50204]
    assert causes[0].stop


def test_monitor_goes_on_after_its_web_socket_broke(monitored: Monitored) -> None:
    monitored.system.faults.inject(Fault.WEB_SOCKET_DROP)
    monitored.wait(0.5)
    monitored.system.faults.inject(Fault.MOTORS_OFF)
    assert monitored.until(lambda state: state.controller_state is ControllerState.MOTORS_OFF) <= NOTICED


def test_change_that_is_forgotten_while_the_web_socket_opens_is_known(
    guided: Monitored, monkeypatch: pytest.MonkeyPatch
) -> None:
    subscribe = guided.system.client.subscribe

    def forget(resources: Sequence[Resource], on_change: OnChange, on_lost: OnLost) -> Subscription:
        told: list[Change] = []
        subscription = subscribe(resources, told.append, on_lost)
        for change in tuple(told):
            on_change(change)
        guided.system.world.controller.set_motors(False)
        return subscription

    monkeypatch.setattr(guided.system.client, "subscribe", forget)
    guided.system.faults.inject(Fault.WEB_SOCKET_DROP)
    assert guided.until(lambda state: state.controller_state is ControllerState.MOTORS_OFF) <= NOTICED
    guided.wait(1.0)
    assert guided.monitor.state().controller_state is ControllerState.MOTORS_OFF


def test_monitor_that_may_not_subscribe_looks_at_the_event_log(monkeypatch: pytest.MonkeyPatch) -> None:
    system = ready_system()

    def refuse(*_: object) -> None:
        raise ControllerRefused("no subscriptions left", status=400)

    monkeypatch.setattr(system.client, "subscribe", refuse)
    monitored = Monitored(system)
    monitored.wait(1.0)
    system.faults.inject(Fault.MOTORS_OFF)
    assert monitored.until(lambda state: state.controller_state is ControllerState.MOTORS_OFF) <= 0.5


def test_what_is_reported_is_known_before_the_next_request_has_its_turn(monitored: Monitored) -> None:
    monitored.system.client.set_speed_ratio(50)
    monitored.system.wait(0.1)
    assert monitored.monitor.take_wake()
    assert monitored.monitor.state().speed_ratio == 50


def test_reading_that_began_before_a_change_does_not_undo_it(
    monitored: Monitored, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Who reads waits for the turn of each request; the monitor itself handles what is reported meanwhile."""
    client, ask = monitored.system.client, monitored.system.client.speed_ratio

    def slowly() -> int:
        before = ask()
        client.set_speed_ratio(50)
        monitored.wait(0.1)
        return before

    monkeypatch.setattr(client, "speed_ratio", slowly)
    monitored.monitor.read()
    assert monitored.monitor.state().speed_ratio == 50


def test_monitor_reports_each_change_once(guided: Monitored) -> None:
    guided.told.clear()
    guided.system.faults.inject(Fault.PROGRAM_STOP)
    guided.wait(1.0)
    assert guided.told[-1].execution is ExecutionState.STOPPED
    assert all(before != after for before, after in pairwise(guided.told))


def requests(monitored: Monitored, monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """The requests from now on."""
    asked: list[object] = []
    exchange = monitored.system.http.handle_request
    monkeypatch.setattr(
        monitored.system.http, "handle_request", lambda *request: asked.append(request) or exchange(*request)
    )
    return asked


def test_monitor_asks_little_while_nothing_happens(monitored: Monitored, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = requests(monitored, monkeypatch)
    monitored.wait(1.1 * WHOLE_POLL)
    assert len(asked) <= 11


def test_monitor_asks_nothing_while_egm_runs_until_all_is_read_again(
    guided: Monitored, monkeypatch: pytest.MonkeyPatch
) -> None:
    guided.monitor.read()
    asked = requests(guided, monkeypatch)
    guided.wait(1.0)
    assert asked == []


def test_request_of_ours_is_left_most_of_the_requests_a_second(
    guided: Monitored, monkeypatch: pytest.MonkeyPatch
) -> None:
    client = guided.system.client
    client.set_symbol(Side.RIGHT.task, "TRobMain", "current_state", "1")  # about to change from now on
    guided.monitor.request_poll()
    guided.wait(0.5)
    asked: list[object] = []
    symbol = client.symbol
    monkeypatch.setattr(client, "symbol", lambda *name: asked.append(name) or symbol(*name))
    with guided.monitor.log.requested(frozenset()):
        guided.wait(2.0)
    assert 2 <= len(asked) <= 5
    guided.wait(0.5)
    asked.clear()
    guided.wait(2.0)
    assert len(asked) >= 15


def numbers_of(cause: Cause) -> list[int]:
    """The numbers of the events that a cause names."""
    return [each.values["number"] for each in cause.causes]


def changed(change: str) -> tuple[int, Message]:
    """The line of the log that says what has changed for the better."""
    return logging.INFO, message("robot_changed", changes=(change,))


STOPS = [
    (Fault.COLLISION, logging.ERROR, 50204),
    (Fault.EMERGENCY_STOP, logging.ERROR, 10013),
    (Fault.MANUAL_MODE, logging.WARNING, 10015),
    (Fault.MOTORS_OFF, logging.WARNING, 10010),
    (Fault.PROGRAM_STOP, logging.WARNING, 10125),
]


@pytest.mark.parametrize(("fault", "level", "number"), [*STOPS, (Fault.DYNAMIC_LOAD, logging.ERROR, 50375)])
def test_stop_of_egm_is_logged_once_with_its_cause(guided: Monitored, fault: Fault, level: int, number: int) -> None:
    check_is_logged_once(guided, fault, level, number)


@pytest.mark.parametrize(("fault", "level", "number"), STOPS)
def test_stop_without_egm_is_logged_once_with_its_cause(
    monitored: Monitored, fault: Fault, level: int, number: int
) -> None:
    check_is_logged_once(monitored, fault, level, number)


def check_is_logged_once(monitored: Monitored, fault: Fault, level: int, number: int) -> None:
    monitored.lines.clear()
    monitored.system.faults.inject(fault)
    monitored.wait(1.5)
    assert [line[0] for line in monitored.lines] == [level], monitored.lines
    assert numbers_in(monitored.lines[0][1]) == {number}
    monitored.monitor.read()
    monitored.step()
    monitored.wait(0.5)
    assert len(monitored.lines) == 1


def test_stop_that_a_person_must_confirm_is_logged_with_its_id(monitored: Monitored) -> None:
    monitored.system.faults.inject(Fault.COLLISION)
    monitored.wait(1.0)
    (stop,) = {state.stop for state in monitored.told if state.stop}
    assert_says(monitored.lines[-1][1], "changed_by_stop", stop=stop)


def test_what_was_requested_is_logged_without_alarm(monitored: Monitored) -> None:
    monitored.lines.clear()
    monitored.system.manager.motors_off()
    monitored.wait(1.0)
    monitored.system.manager.make_ready()
    monitored.wait(1.0)
    assert monitored.lines, "a change is logged whoever made it"
    assert {level for level, _ in monitored.lines} == {logging.INFO}
    assert any(said.code == "robot_changed_as_requested" and "Motors off" in str(said) for _, said in monitored.lines)
    assert any("Motors on" in str(said) for _, said in monitored.lines)


def test_each_change_for_the_better_is_logged_whoever_made_it(monitored: Monitored) -> None:
    """At the robot: the key is turned, motors and program are started again; and the cable is back."""
    system = monitored.system
    controller = system.world.controller
    system.faults.inject(Fault.MANUAL_MODE)
    monitored.wait(1.0)
    monitored.lines.clear()
    controller.select_mode(OperatingMode.AUTO)
    monitored.wait(1.0)
    assert changed("operating mode AUTO") in monitored.lines
    controller.set_motors(on=True)
    monitored.wait(1.0)
    assert changed("motors on") in monitored.lines
    controller.start_rapid()
    monitored.wait(1.0)
    assert changed("RAPID program running") in monitored.lines
    monitored.lines.clear()
    system.faults.inject(Fault.WARM_RESTART)
    monitored.until(lambda state: not state.is_connected)
    monitored.until(lambda state: state.is_connected, timeout=60.0)
    monitored.wait(1.0)
    answers = "the controller answers"
    assert [line for line in monitored.lines if answers in line[1].values.get("changes", ())] == [changed(answers)]


def test_emergency_stop_during_a_request_is_an_alarm(monitored: Monitored) -> None:
    monitored.lines.clear()
    with monitored.monitor.log.requested(frozenset({MOTORS_OFF_CHANGE, PROGRAM_STOPPED_CHANGE})):
        monitored.system.faults.inject(Fault.EMERGENCY_STOP)
        monitored.wait(1.0)
    assert [level for level, _ in monitored.lines] == [logging.ERROR]


@pytest.mark.parametrize("fault", [Fault.MOTORS_OFF, Fault.PROGRAM_STOP])
def test_stop_that_no_request_has_made_is_an_alarm_also_right_after_one(guided: Monitored, fault: Fault) -> None:
    guided.system.manager.go_to(RobotMode.READY, print)
    guided.lines.clear()
    guided.system.faults.inject(fault)
    guided.wait(1.0)
    assert [level for level, _ in guided.lines if level > logging.INFO] == [logging.WARNING]


def test_error_event_that_stops_nothing_is_logged_once(monitored: Monitored) -> None:
    monitored.lines.clear()
    events = monitored.system.world.controller.events
    events.append(112755, "ERR_HAND_NOTCALIBRATED", "The hand is not calibrated.", EventType.ERROR)
    monitored.wait(6.0)
    assert len(monitored.lines) == 1
    assert monitored.lines[0][0] == logging.ERROR
    assert_says(monitored.lines[0][1], "controller_reports_event")
    assert numbers_in(monitored.lines[0][1]) == {112755}


def test_old_error_is_not_the_cause_of_a_later_stop(monitored: Monitored) -> None:
    events = monitored.system.world.controller.events
    events.append(112755, "ERR_HAND_NOTCALIBRATED", "The hand is not calibrated.", EventType.ERROR)
    monitored.wait(10.0)
    monitored.system.faults.inject(Fault.MOTORS_OFF)
    monitored.wait(1.0)
    assert monitored.monitor.state().causes[0].code == "event_10010"


@pytest.mark.parametrize(
    ("fault", "numbers", "has_stop"),
    [
        (Fault.EMERGENCY_STOP, [10013], True),
        (Fault.COLLISION, [50204], True),
        (Fault.MANUAL_MODE, [10015], False),
        (Fault.PROGRAM_STOP, [10125], False),
        (Fault.EGM_CONVERGENCE, [], False),
    ],
)
def test_end_of_egm_is_explained_within_half_a_second(
    guided: Monitored, monkeypatch: pytest.MonkeyPatch, fault: Fault, numbers: list[int], has_stop: bool
) -> None:
    """EGM's end is known before the controller's event is."""
    monkeypatch.setattr(guided.monitor, "_thread", object())  # its steps are made by this test
    causes: list[Cause] = []
    guided.system.faults.inject(fault)
    guided.system.wait(0.02)
    begin = guided.system.now()
    guided.monitor.explain(causes.append)
    while not causes:
        guided.wait(0.004)
    assert guided.system.now() - begin < 0.8
    assert numbers_of(causes[0]) == numbers
    assert bool(causes[0].stop) is has_stop


def test_flight_record_of_a_stop_by_the_controller_has_its_cause(
    guided: Monitored, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(guided.monitor, "_thread", object())  # its steps are made by this test
    system, arm = guided.system, guided.system.arms[Side.RIGHT]
    clock, described = ManualClock(system.now()), list[Message]()

    def describe(event: ArmEvent, then: Callable[[Message], None]) -> None:
        def hear(said: Message) -> None:
            described.append(said)
            then(said)

        guided.monitor.describe(event, hear)

    records = Recorder(tmp_path, 50, {Side.RIGHT: arm.recorder}, lambda sentence: None, clock, describe)
    arm.events.clear()
    system.faults.inject(Fault.COLLISION)
    system.until(lambda: any(map(is_fault, arm.events)), 0.5)
    stop = next(filter(is_fault, arm.events))
    records.on_event(stop, system.now(), 1_800_000_000.0)
    guided.wait(1.0)
    records.close()
    recorded = read_recording(next(tmp_path.glob("*.mcap"))).stop
    assert recorded is not None
    (said,) = described
    assert recorded.sentence == str(said)
    assert_says(said, "explained_stop", event=stop.said)
    (cause,) = said.values["causes"]
    assert (cause.values["number"], cause.values["title"]) == (50204, "Motion supervision")
    assert clause(stop.said)[1:] in recorded.sentence
    assert remedy_of(stop.said) not in recorded.sentence  # the cause says what to do
    assert recorded.sentence.count(said.values["stop"]) == 1


def test_stop_is_explained_to_all_who_wait_although_one_of_them_fails(
    monitored: Monitored, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(cause: Cause) -> None:
        raise ValueError("a fault of ours")

    monkeypatch.setattr(monitored.monitor, "_thread", object())  # its steps are made by this test
    causes: list[Cause] = []
    monitored.system.faults.inject(Fault.COLLISION)
    monitored.monitor.explain(fail)
    monitored.monitor.explain(causes.append)
    with caplog.at_level(logging.ERROR):
        monitored.wait(1.0)
    (cause,) = causes
    assert numbers_of(cause) == [50204]
    assert caplog.messages == ["Reporting what stopped the robot failed with ValueError: a fault of ours"]


def test_state_that_was_read_too_long_ago_is_unknown(monitored: Monitored) -> None:
    """Whatever keeps the monitor from making its steps, a hung thread or one that is gone."""
    assert monitored.monitor.state().is_connected
    monitored.system.advance(STALE_STATE + WHOLE_POLL)
    state = monitored.monitor.state()
    assert not state.is_connected
    assert state.execution is None
    assert [each.code for each in state.reasons] == ["state_is_old"]
    assert state.reasons[0].values["age"] >= STALE_STATE + WHOLE_POLL
    assert str(state).startswith(clause(state.reasons[0]))


def test_state_is_known_for_as_long_as_the_monitor_makes_its_steps(monitored: Monitored) -> None:
    monitored.told.clear()
    monitored.wait(1.2 * STALE_STATE)
    assert all(state.is_connected for state in monitored.told)
    assert monitored.monitor.state().is_connected


def test_monitor_goes_on_after_an_unexpected_exception_and_knows_nothing_meanwhile(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    system, told = ready_system(), Queue[RobotState]()
    may_go_on = Event()
    monitor = system.manager.monitor
    monitor.start()
    monitor.on_change = told.put
    ask = system.client.operating_mode

    def fail() -> OperatingMode:
        if not may_go_on.is_set():
            raise RecursionError("maximum recursion depth exceeded")
        return ask()

    monkeypatch.setattr(system.client, "operating_mode", fail)
    system.advance(WHOLE_POLL)
    monitor.request_poll()
    while told.get(timeout=10.0).is_connected:
        continue
    assert not monitor.state().is_connected
    may_go_on.set()
    while not told.get(timeout=10.0).is_connected:
        continue
    monitor.stop()
    failed = [record for record in caplog.records if record.getMessage().startswith("Thread robot-monitor failed")]
    assert [record.exc_info is not None for record in failed] == [True]


AGE = JOINTS_POLL + 0.1  # and the time of the requests


def measured(monitored: Monitored, side: Side) -> tuple[float, tuple[float, ...]]:
    """How old the joints are that were read [s], and what they are [rad]."""
    state = monitored.monitor.joints(side)
    assert state is not None
    return monitored.system.now() - state.time, state.position


def test_joints_are_read_while_egm_reports_none_and_never_unasked(guided: Monitored) -> None:
    guided.system.manager.stop_egm()
    guided.wait(1.0)
    assert guided.monitor.joints(Side.RIGHT) is None
    guided.monitor.reads_joints = True
    guided.step()
    for _ in range(20):
        guided.wait(0.1)
        for side in Side:
            age, position = measured(guided, side)
            assert age <= AGE
            assert position == pytest.approx(guided.system.world.arms[side].position, abs=1e-4)


def test_joints_are_read_from_a_stop_on_and_not_while_egm_reports_them(guided: Monitored) -> None:
    guided.monitor.reads_joints = True
    guided.wait(1.0)
    assert guided.monitor.joints(Side.RIGHT) is None
    guided.system.faults.inject(Fault.EMERGENCY_STOP)
    guided.wait(0.3 + AGE)
    for _ in range(20):
        assert all(measured(guided, side)[0] <= AGE for side in Side)
        guided.wait(0.1)


def test_joints_of_an_arm_that_the_other_one_keeps_clear_of_are_read_once_and_while_that_has_egm(
    monitored: Monitored,
) -> None:
    manager, monitor = monitored.system.manager, monitored.monitor
    monitor.keeps_apart = True
    monitored.step()
    monitored.wait(1.0)
    for side in Side:
        assert measured(monitored, side)[0] > 0.5
    before = {side: monitor.joints(side) for side in Side}
    monitored.wait(2.0)
    assert {side: monitor.joints(side) for side in Side} == before
    manager.start_egm([Side.RIGHT])
    monitored.wait(AGE)
    for _ in range(20):
        assert measured(monitored, Side.LEFT)[0] <= AGE
        monitored.wait(0.1)


def test_what_a_request_of_ours_has_read_is_not_read_again_at_once(
    monitored: Monitored, monkeypatch: pytest.MonkeyPatch
) -> None:
    client = monitored.system.client
    monitored.wait(0.6 * WHOLE_POLL)
    monitored.monitor.read()
    asked: list[float] = []
    mode = client.operating_mode
    monkeypatch.setattr(client, "operating_mode", lambda: asked.append(monitored.system.now()) or mode())
    begin = monitored.system.now()
    monitored.wait(2.5 * WHOLE_POLL)
    assert [round((when - begin) / WHOLE_POLL, 1) for when in asked] == [1.0, 2.0]
