"""What one reply costs within the control process, stage by stage: both arms kept apart, a Python controller on each.

Both arms of a robot are answered over sockets of this process, which never sleeps: everything is warm. A position
controller follows goals for all joints: as they are sampled in each cycle, at half of the robot's rate, and at random.
It is asked in Python, and sampled by the core.

Run it as ``python benchmarks/reply_in_process.py [cycles]`` in a clone.
"""

from __future__ import annotations

import gc
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import cos
from random import Random

import numpy as np

from abb_protocols.egm.codec import MciState, MotorState, RapidState, RobotCodec, RobotMessage
from abb_protocols.robot.joints import CYCLE, Joints, Side, home, joints, named_pose
from abb_runtime.udp import UdpClient, free_port
from yumi.control.goals import write_goal
from yumi.control.loop import ArmLoop
from yumi.control.stage_times import (
    AFTER_REPLY,
    CYCLE_BEGIN,
    DECODE_STAGE,
    ENCODE_STAGE,
    LIMIT_STAGE,
    RECEIVE_STAGE,
    SEND_STAGE,
    UPDATE_STAGE,
)
from yumi.driver.control_process import ArmBuffers
from yumi.driver.egm_arm import FallbackThread
from yumi.driver.settings import Settings, read_controllers, read_settings
from yumi.driver.wiring import build_arms, plan_egm

STAGES = {
    "receive": RECEIVE_STAGE,
    "decode": DECODE_STAGE,
    "controller": UPDATE_STAGE,
    "limit": LIMIT_STAGE,
    "encode": ENCODE_STAGE,
    "send": SEND_STAGE,
    "after the reply": AFTER_REPLY,
}
POSITION = "joint_position_controller"
REPLY = "reply"
WARM_UP = 500

Goals = Callable[[Side, int], Joints | None]


@dataclass(slots=True)
class Robot:
    """One arm's end of EGM, which is wherever it was told to be."""

    link: UdpClient
    position: Joints
    codec: RobotCodec


def swing(side: Side, cycle: int) -> Joints:
    """All joints back and forth about the pose ``ready``, at up to 0.3 rad/s."""
    return joints([angle + 0.1 * (1.0 - cos(3.0 * cycle * CYCLE)) for angle in named_pose(side, "ready")])


def stream(side: Side, cycle: int) -> Joints | None:
    """The same, but in every second cycle: what the controller makes of it jumps, and the limiter smooths it."""
    return None if cycle % 2 else swing(side, cycle)


def jumps(side: Side, cycle: int) -> Joints | None:
    """In every second cycle a goal up to 0.2 rad from the pose ``ready`` in each joint, drawn anew."""
    draw = Random(f"{side.word} {cycle}")
    return None if cycle % 2 else joints([angle + draw.uniform(-0.2, 0.2) for angle in named_pose(side, "ready")])


MOTIONS: dict[str, Goals] = {"gentle": swing, "a stream": stream, "jumps": jumps}


def loops(
    settings: Settings, buffers: Mapping[Side, ArmBuffers]
) -> tuple[dict[Side, ArmLoop], dict[Side, Robot], FallbackThread]:
    """Both arms as the control process has them, their robots, which follow, and what waits for these."""
    ports = {side: free_port() for side in Side}
    egm = replace(settings.egm, left_port=ports[Side.LEFT], right_port=ports[Side.RIGHT])
    robot = replace(settings.robot, address="127.0.0.1")
    controllers = {side: read_controllers(side) for side in Side}
    plan = plan_egm(replace(settings, egm=egm, robot=robot), controllers)
    connected = build_arms(plan, buffers)
    (waiting,) = {arm.fallback for arm in connected.values() if arm.fallback is not None}
    robots = {side: Robot(UdpClient("127.0.0.1", port), home(side), RobotCodec()) for side, port in ports.items()}
    return {side: arm.loop for side, arm in connected.items()}, robots, waiting


def measure(goals: Goals, cycles: int, *, is_sampled: bool) -> dict[str, list[float]]:
    """How long each stage of each reply took [µs]; the last one is all of the reply.

    Args:
        goals: of the controllers.
        cycles: that count.
        is_sampled: whether the core samples the controllers.
    """
    buffers = {side: ArmBuffers() for side in Side}
    arms, robots, waiting = loops(read_settings(), buffers)
    times: dict[str, list[float]] = {stage: [] for stage in (*STAGES, REPLY)}
    begin = time.monotonic()
    for cycle in range(WARM_UP + cycles):
        while time.monotonic() < begin + cycle * CYCLE:
            pass  # a processor that sleeps forgets
        for side, loop in arms.items():
            command(loop, buffers[side], goals(side, cycle), cycle)
            if is_sampled:
                loop.prepare()
        for robot in robots.values():
            send_state(robot, cycle)
        if is_sampled:
            waiting.wait(-1, 0.0)
        for loop in arms.values():
            loop.run(time.monotonic())
            if cycle >= WARM_UP:
                note(times, loop._stages.marks)
        for robot in robots.values():
            (datagram,) = robot.link.receive()
            robot.position = robot.codec.decode(datagram).position or robot.position  # type: ignore[assignment]
    return times


def command(loop: ArmLoop, buffers: ArmBuffers, goal: Joints | None, cycle: int) -> None:
    """Have the arm's controller active, and give it a new goal."""
    if cycle and not loop.activation:  # of a machine that stood still the session has ended
        loop.manager.switch((POSITION,), (), loop.state)
    if cycle > 1 and goal is not None:
        write_goal(buffers.goals, 1, goal)


def send_state(robot: Robot, cycle: int) -> None:
    here = robot.position
    state = RobotMessage(
        cycle, 0, here, here, None, None, 1.0, 1.0, MotorState.ON, MciState.RUNNING, RapidState.RUNNING, False
    )
    robot.link.send(robot.codec.encode(replace(state, measured_time=1.0 + cycle * CYCLE)))


def note(times: dict[str, list[float]], marks: Sequence[float]) -> None:
    """Add the durations between the marks of one cycle."""
    for stage, mark in STAGES.items():
        times[stage].append(1e6 * (marks[mark] - marks[mark - 1]))
    times[REPLY].append(1e6 * (marks[SEND_STAGE] - marks[CYCLE_BEGIN]))


def main(cycles: int) -> None:
    """Print the median and one cycle of a hundred of each stage."""
    gc.disable()  # as in the control process
    for (name, goals), is_sampled in product(MOTIONS.items(), (False, True)):
        print(f"{name}, both arms, {cycles} cycles, {'sampled by the core' if is_sampled else 'asked in Python'}")
        for stage, taken in measure(goals, cycles, is_sampled=is_sampled).items():
            median, rare = np.percentile(taken, (50.0, 99.0))
            print(f"  {stage:16s} median {median:6.1f} µs, one of a hundred {rare:6.1f} µs")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 2000)
