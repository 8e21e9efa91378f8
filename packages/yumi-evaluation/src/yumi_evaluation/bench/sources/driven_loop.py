"""The control loops as the driver starts them, with both arms' position controllers held on the benchmark's goal."""

from __future__ import annotations

import json
import multiprocessing
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from dataclasses import fields, replace
from functools import partial
from math import radians
from statistics import median
from threading import Event as Flag
from threading import Thread

from parent import say_ready

from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import Joints, Side, chain_from_abb
from abb_runtime.parameters import ParameterFileEntry
from yumi.control.flight_recorder import RecordedCycle
from yumi.control.goals import write_goal
from yumi.control.loop_commands import Commands
from yumi.control.loop_events import Event
from yumi.control.shared_state import read_snapshot
from yumi.control.stage_times import StageTimes
from yumi.driver.control_process import ControlProcess, WakeMode
from yumi.driver.settings import Settings, read_controllers, read_settings
from yumi.driver.wiring import EgmPlan, build_arms, plan_egm

POSITION = "joint_position_controller"
PROCESS = "yumi-control"
POLL_PERIOD = 0.25
"""How often each arm is checked for a new session, whose controller must be activated [s]."""


def read_arguments() -> Namespace:
    parser = ArgumentParser()
    parser.add_argument("--ports", type=int, nargs=2, required=True, help="of the right and the left arm")
    parser.add_argument("--gain", type=float, required=True)
    parser.add_argument("--goal", required=True, help="axes 1-6 and 7 [deg], separated by commas")
    parser.add_argument("--wake", default="blocking", help="the setting egm.wake")
    parser.add_argument("--busy", action="store_true", help="ROS graph: with a callback that computes")
    return parser.parse_args()


def read_plan(arguments: Namespace) -> tuple[Settings, EgmPlan]:
    """The delivered settings and controllers, at the benchmark's ports, with its wake-up and its gain."""
    right, left = arguments.ports
    settings = read_settings()
    egm = replace(settings.egm, wake=WakeMode(arguments.wake), left_port=left, right_port=right)
    settings = replace(settings, robot=replace(settings.robot, address="127.0.0.1"), egm=egm)
    gain = ParameterFileEntry(arguments.gain, "--gain", is_general=False)
    controllers = {
        side: tuple(
            replace(entry, entries={**entry.entries, "p": gain}) if entry.name == POSITION else entry
            for entry in read_controllers(side)
        )
        for side in Side
    }
    return settings, plan_egm(settings, controllers)


class DrivenLoop:
    """It drives each arm towards the goal in every session, from the first datagram on."""

    def __init__(self, settings: Settings, plan: EgmPlan, goal_deg: str) -> None:
        self.control = ControlProcess(partial(build_arms, plan), self._report, settings.egm.wake)
        axes = [radians(float(value)) for value in goal_deg.split(",")]
        self._goal: Joints = chain_from_abb(axes[:6], axes[6])

    def start(self) -> None:
        self.control.start()
        print(self.control.started_as, file=sys.stderr, flush=True)

    def run(self) -> None:
        """Keep both arms driven until standard input ends."""
        is_over = Flag()
        Thread(target=_wait_for_end_of_input, args=(is_over,), daemon=True).start()
        say_ready(*(each.pid or 0 for each in multiprocessing.active_children() if each.name.startswith(PROCESS)))
        while not is_over.wait(POLL_PERIOD):
            for side in Side:
                self._drive(side)
        stages = stage_medians(self.control.recorders[Side.RIGHT].frames())
        limited = {side.word: read_snapshot(self.control.buffers[side].snapshots).limiter for side in Side}
        self.control.stop()
        print("stages", json.dumps(stages), flush=True)
        unanswered = {arm: counters.unanswered for arm, counters in limited.items() if counters.unanswered}
        print("unanswered", json.dumps(unanswered), flush=True)

    def _drive(self, side: Side) -> None:
        snapshot = read_snapshot(self.control.buffers[side].snapshots)
        if not snapshot.is_running or snapshot.is_commanded:
            return
        try:
            self.control.call(Commands.switch_controllers, side, (POSITION,))
        except CommandRefused as refusal:  # the session ended in this moment; the next poll tries again
            print(refusal, file=sys.stderr, flush=True)
        else:
            write_goal(self.control.buffers[side].goals, snapshot.session, self._goal)

    def _report(self, event: Event) -> None:
        print(event, file=sys.stderr, flush=True)


def stage_medians(frames: Sequence[RecordedCycle]) -> dict[str, float]:
    """The median of each stage of a reply, by its name [µs]; nothing without frames."""
    names = [each.name for each in fields(StageTimes)] if frames else []
    return {name: 1e6 * median(getattr(frame.stages, name) for frame in frames) for name in names}


def _wait_for_end_of_input(is_over: Flag) -> None:
    sys.stdin.read()
    is_over.set()
