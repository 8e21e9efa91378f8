"""The driver as a program: connect, bring the robot to ready, serve ROS until it is asked to end."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from threading import Event as Flag
from threading import Thread

from yumi.clock import SystemClock
from yumi.control.requests import Event, HoldArm
from yumi.driver.control_process import FastLines
from yumi.driver.robot_manager import RobotManager
from yumi.driver.settings import Settings
from yumi.driver.watchdog import RobotConnection
from yumi.driver.wiring import Controllers, DriverParts, make_parts, only_at_robot
from yumi.errors import YumiError
from yumi.process.realtime import brisk_threads, release_process, settle_memory
from yumi.process.single_instance import Only
from yumi.process.supervision import start_thread
from yumi.recording.recorder import Recorder
from yumi.robot.joints import Side
from yumi.rws.client import RwsClient

TELL_CONTROLLER = 3.0
"""A driver that is to end gives up telling the controller after this time [s]: the network may be dead."""

END = 4.5
"""A driver that has not ended this long after it was asked to is ended by force [s]."""

_GLANCE = 0.05  # [s]


def run_driver(
    settings: Settings,
    controllers: Controllers,
    is_over: Flag,
    on_ready: Callable[[str], None],
    record: Path | None = None,
) -> None:
    """The driver: connect, bring the robot to ready, serve ROS until ``is_over``; leaves the robot without EGM.

    Without ``ros.autostart`` it only serves ROS: connecting and what follows are left to who leads its managed nodes.
    Without ``ros.bringup`` it connects and reads, and changes nothing on the robot until it is asked to.

    Args:
        settings: where the robot is, and how it shall move.
        controllers: what runs on each arm.
        is_over: set when it shall end.
        on_ready: called when ROS is served and the robot was brought to ready; told why it is not, or nothing.
        record: file for every cycle of both arms.

    Raises:
        YumiError: the robot cannot be reached or used; nothing was started.
    """
    from yumi.ros.driver import RosDriver, close_ros, open_ros  # noqa: PLC0415 - yumi works without ROS
    from yumi.ros.gripper import HandParts  # noqa: PLC0415

    clock = SystemClock()

    def on_event(event: Event) -> None:
        records.on_event(event, clock.now(), time.time())
        parts.manager.note(event)
        ros.tell(event)

    with brisk_threads(), ExitStack() as stack:
        stack.callback(release_process)
        for only in (_only_in_ros_domain(), only_at_robot(settings)):
            only.claim()
            stack.callback(only.release)
        parts = make_parts(
            settings,
            controllers,
            on_event,
            lambda step: ros.say(f"Bring-up: {step}"),
            warn=lambda remark: ros.warn(f"Bring-up: {remark}"),
        )
        stack.enter_context(_ending_in_time(parts.client, parts.manager, is_over))
        stack.callback(parts.client.close)
        connection = _connection_of(parts)
        if settings.ros.autostart:
            connection.check()
        hands = HandParts(parts.grippers, parts.signals, settings.gripper)
        open_ros()
        stack.callback(close_ros)
        fast_lines, manager, plan, rate = parts.fast_lines, parts.manager, parts.plan, settings.ros.merged_rate
        ros = RosDriver(fast_lines, plan.controllers, manager, connection, hands, rate, clock, plan.limits)
        stack.callback(ros.stop)
        records = Recorder(Path(settings.recorder.folder), settings.recorder.keep, fast_lines.recorders, ros.say)
        stack.callback(records.close)
        if record:
            records.record_all(record, time.time() - clock.now())
        manager.watch.reports.report = ros.report
        fast_lines.start()
        stack.callback(fast_lines.stop)
        stack.callback(connection.disconnect)
        stack.callback(_end_motion, manager, fast_lines, connection, ros.say)
        ros.start()
        ros.say(fast_lines.started_as)
        ros.say(f"{manager.speed} Change it with yumi_robot_manager/set_speed_scale or the setting robot.speed_scale.")
        reason = ros.bring_up(is_reading_only=not settings.ros.bringup) if settings.ros.autostart else ""
        settle_memory()
        on_ready(reason)
        is_over.wait()


def _connection_of(parts: DriverParts) -> RobotConnection:
    check = partial(parts.bringup.check_controller, parts.plan.addresses)
    return RobotConnection(parts.client, check, parts.manager, parts.signals.close)


def _only_in_ros_domain() -> Only:
    return Only(
        f"yumi-driver-in-ros-domain-{os.environ.get('ROS_DOMAIN_ID', '0')}",
        "Another driver runs on this machine in the same ROS domain ({owner}); stop it or give one of the two its own "
        "ROS_DOMAIN_ID.",
    )


@contextmanager
def _ending_in_time(client: RwsClient, manager: RobotManager, is_over: Flag) -> Iterator[None]:
    """Once ``is_over``, what is being done to the robot ends at its next step, and the controller is soon given up."""
    has_ended = Flag()

    def watch() -> None:
        while not is_over.wait(_GLANCE):
            if has_ended.is_set():
                return
        manager.give_way()
        if not has_ended.wait(TELL_CONTROLLER):
            client.abandon()

    thread = Thread(target=watch, name="end-in-time", daemon=True)
    start_thread(thread)
    try:
        yield
    finally:
        has_ended.set()
        thread.join()


def _end_motion(
    manager: RobotManager, fast_lines: FastLines, connection: RobotConnection, say: Callable[[str], None]
) -> None:
    """Hold the arms, whatever the network does, and have the controller end EGM, if it can be told."""
    for side in Side:
        if fast_lines.snapshot(side).is_commanded:
            with suppress(YumiError):  # a fast line that is gone: the other arm is held all the same
                fast_lines.ask(HoldArm(side))
    try:
        if connection.is_open and manager.has_acted:  # else EGM, if it runs, is another program's
            manager.end_motion()
    except YumiError as error:
        say(f"The robot could not be told to end EGM: {error}")


def end_by_force(is_over: Flag) -> None:
    """End the process :data:`END` after ``is_over`` is set, should it still be there; the arms' processes hold then.

    Something may wait for what never comes: a user who has asked the driver to end needs no other program for it.
    """

    def end() -> None:
        is_over.wait()
        time.sleep(END)
        busy = [each.name for each in threading.enumerate() if not each.daemon and each is not threading.main_thread()]
        words = f"; these threads had not ended: {', '.join(sorted(busy))}" if busy else ""
        sys.stderr.write(f"Error: the driver did not end within {END:g} s and is ended by force{words}.\n")
        sys.stderr.flush()
        os._exit(1)

    start_thread(Thread(target=end, name="forced-end", daemon=True))
