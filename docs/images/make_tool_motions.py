"""The pictures of docs/how-to/move-the-tool.md and plan-a-motion.md: what the examples do, in virtual time.

Run it in the clone: `python docs/images/make_tool_motions.py` writes docs/images/tool_*.png.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from math import pi
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
from make_robot import Link, Solid, links_of, render
from numpy.typing import NDArray
from PIL import Image

from abb_protocols.robot.description import FINGERTIPS
from abb_protocols.robot.joints import (
    CYCLE,
    YUMI_LIMITS,
    Joints,
    Pose,
    Side,
    finger_names,
    joint_names,
    joints,
    named_pose,
)
from abb_protocols.robot.kinematics import (
    compose_poses,
    inverse_pose,
    matrix_from_quaternion,
    quaternion_of,
    tool0_to_body,
)
from abb_protocols.robot.urdf import robot_description
from yumi.api.obstacles import boxes_from
from yumi.api.postures import posture_for
from yumi.control.controllers.cartesian import CartesianController
from yumi.control.goals import MemoryBuffer
from yumi.control.loop_events import ControllerReport
from yumi.control.tool_goal import ToolGoal, twist_goal
from yumi.control.trajectory_commands import FollowTrajectory, TrajectoryEnded
from yumi.core.collision import Obstacle
from yumi.planning.planner import Plan, Planner
from yumi.planning.tool_path import LineWaypoint, plan_path
from yumi_evaluation.virtual_time import VirtualArmRig

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
SIDE = Side.RIGHT
LIMITS = YUMI_LIMITS.slowed_to(pi)
Array = NDArray[np.float64]

sys.path.append(str(ROOT / "examples"))


class Arm:
    """The right arm of a virtual robot, with the Cartesian controller."""

    def __init__(self, start: Joints) -> None:
        self.goals = MemoryBuffer[ToolGoal]()
        self.rig = VirtualArmRig(
            {"arm": CartesianController(SIDE, self.goals, MemoryBuffer())}, side=SIDE, position=start
        )
        self.rig.start()
        self.rig.switch_to("arm")
        self.rig.run(0.1)
        self.rig.cycles.clear()

    def follow(self, waypoints: Sequence[Pose], tool: Pose, speed: float, angle: float | None = None) -> None:
        points = [LineWaypoint(each) for each in waypoints[:-1]] + [LineWaypoint(waypoints[-1], angle)]
        start = self.rig.manager.reference
        assert start is not None
        plan = plan_path(SIDE, start, points, LIMITS, tool=tool, speed=speed)
        before = len(self.rig.events)
        self.rig.manager.receive("arm", FollowTrajectory(plan, 1), self.rig.line.state)

        def is_over() -> bool:
            reports = (each.report for each in self.rig.events[before:] if isinstance(each, ControllerReport))
            return any(isinstance(report, TrajectoryEnded) for report in reports)

        self.rig.run_until(is_over, plan.spline.end + 3.0)

    def places(self, tool: Pose) -> Array:
        """Where the tool was measured in each cycle [m], (n, 3)."""
        return np.array([tool0_to_body(SIDE, each.state.position, tool).position for each in self.rig.cycles])


def standing_at(target: Pose, tool: Pose) -> Joints:
    """The posture that the examples reach from ``ready``."""
    return posture_for(SIDE, compose_poses(target, inverse_pose(tool)), None, None, named_pose(SIDE, "ready"), LIMITS)


def line() -> Array:
    """Down on the line of reach_a_pose.py."""
    from reach_a_pose import ABOVE, ON_TABLE  # noqa: PLC0415 - examples are no package

    arm = Arm(standing_at(ABOVE, FINGERTIPS))
    arm.follow([ON_TABLE], FINGERTIPS, 0.1)
    return arm.places(FINGERTIPS)


def square() -> tuple[Array, Array]:
    """The square of draw_a_square.py, and its corners, on the paper [m]."""
    from draw_a_square import CORNERS, PAPER, PEN, on_paper  # noqa: PLC0415

    poses = [compose_poses(PAPER, on_paper(x, y)) for x, y in CORNERS]
    arm = Arm(standing_at(poses[0], PEN))
    arm.follow(poses[1:], PEN, 0.1)
    return arm.places(PEN) - PAPER.position, np.array(CORNERS)


def sticks(seconds: float = 4.0) -> tuple[Array, Array]:
    """What gamepad.py asks for, velocities x, y, z, and the measured ones [m/s]."""
    from gamepad import FASTEST, RATE, START, TURNING, Sticks  # noqa: PLC0415

    arm, wanted, period = Arm(standing_at(START, FINGERTIPS)), [], round(1.0 / RATE / CYCLE)
    for number in range(round((seconds + 0.5) / CYCLE)):
        elapsed = number * CYCLE
        sideways, away, up, turn = Sticks().at(elapsed) if elapsed < seconds else (0.0,) * 4
        twist = joints([FASTEST * away, FASTEST * sideways, FASTEST * up, 0.0, 0.0, TURNING * turn, 0.0])
        wanted.append(twist[:3])
        if elapsed < seconds and number % period == 0:
            arm.goals.write(twist_goal(arm.rig.snapshot.session, twist, FINGERTIPS))
        arm.rig.cycle()
    return np.array(wanted), np.gradient(arm.places(FINGERTIPS), CYCLE, axis=0)


def hand_over() -> tuple[dict[Side, Joints], dict[Side, Joints]]:
    """Both arms of hand_over.py before they come together, and when the rod is in both grippers."""
    from hand_over import APART, NEAR, poses  # noqa: PLC0415

    before, together = {}, {}
    for side in Side:
        before[side] = posture_for(
            side,
            compose_poses(poses(APART)[side.word], inverse_pose(FINGERTIPS)),
            None,
            None,
            named_pose(side, "ready"),
            LIMITS,
        )
        line = plan_path(
            side, before[side], [LineWaypoint(poses(NEAR)[side.word])], LIMITS, tool=FINGERTIPS, speed=0.05
        )
        together[side] = joints(line.spline.last.position)
    return before, together


def around() -> tuple[Plan, Obstacle]:
    """The motion of plan_around.py around the crate; needs RoboPlan."""
    from plan_around import BEHIND, BESIDE, CRATE  # noqa: PLC0415

    (crate,) = boxes_from(CRATE)
    planner = Planner(obstacles=(crate,))
    start = {side: named_pose(side, "ready") for side in Side}
    to_box = planner.plan(start, {Side.RIGHT: BESIDE})
    start[Side.RIGHT] = joints(to_box.points[Side.RIGHT][-1].position)
    return planner.plan(start, {Side.RIGHT: BEHIND}), crate


def picture(positions: Mapping[Side, Joints], things: Sequence[Link]) -> Image.Image:
    """The robot, and what stands about or is held."""
    named = {n: value for side in Side for n, value in zip(joint_names(side), positions[side], strict=True)}
    named |= {finger_names(side)[0]: 0.01 for side in Side}
    links = links_of(ET.fromstring(robot_description().encode()), named)
    image = render([*links, *things], 560, 380)
    page = Image.new("RGB", image.size, "white")
    page.paste(image, mask=image.getchannel("A"))
    return page


def thing(kind: str, size: tuple[float, ...], pose: Pose) -> Link:
    """A solid beside the robot, by its half edges, or radius and half length."""
    to_base = np.eye(4, dtype=np.float32)
    to_base[:3, :3], to_base[:3, 3] = matrix_from_quaternion(pose.orientation), pose.position
    return Link(to_base, (Solid(kind, size, np.eye(4, dtype=np.float32)),), (0.85, 0.62, 0.32))


def main() -> None:
    import matplotlib.pyplot as plt  # noqa: PLC0415 - the figures need none

    plt.rcParams.update({"figure.dpi": 110, "axes.grid": True, "grid.alpha": 0.3, "font.size": 9})

    places = line()
    figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.2), layout="constrained")
    times = np.arange(len(places)) * CYCLE
    left.plot(times, 1e3 * places[:, 2])
    left.set(xlabel="time [s]", ylabel="height of the fingertips [mm]", title="100 mm down at 0.1 m/s")
    off = 1e6 * (places[:, :2] - places[0, :2])
    right.plot(times, off, label=["x", "y"])
    right.set(xlabel="time [s]", ylabel="measured, off the line [µm]", title="straight")
    right.legend()
    figure.savefig(HERE / "tool_line.png")

    drawn, corners = square()
    figure, axes = plt.subplots(figsize=(4.4, 4.2), layout="constrained")
    axes.plot(*(1e3 * corners.T), ":", color="gray", label="corners")
    axes.plot(*(1e3 * drawn[:, :2].T), label="pen, measured")
    axes.set(xlabel="x on the paper [mm]", ylabel="y on the paper [mm]", aspect="equal", title="zone 10 mm")
    axes.legend()
    figure.savefig(HERE / "tool_square.png")

    wanted, measured = sticks()
    figure, axes = plt.subplots(figsize=(8, 3.2), layout="constrained")
    times = np.arange(len(wanted)) * CYCLE
    for column, name in enumerate("xyz"):
        axes.plot(times, 1e3 * wanted[:, column], ":", color=f"C{column}")
        axes.plot(times, 1e3 * measured[:, column], color=f"C{column}", label=name)
    axes.set(xlabel="time [s]", ylabel="velocity [mm/s]", title="sticks (dotted) and fingertips, 50 Hz")
    axes.legend()
    figure.savefig(HERE / "tool_stream.png")

    from hand_over import ROD, X, Z  # noqa: PLC0415

    rod = thing("cylinder", (ROD / 2.0, 0.05), Pose((X, 0.0, Z), quaternion_of((pi / 2.0, 0.0, 0.0))))
    picture(hand_over()[1], [rod]).save(HERE / "tool_hand_over.png", optimize=True)

    plan, crate = around()
    points = plan.points[Side.RIGHT]
    halfway = {**plan.start, Side.RIGHT: joints(points[len(points) // 2].position)}
    x, y, z = (0.5 * edge for edge in crate.size)
    image = picture(halfway, [thing("box", (x, y, z), crate.centre)])
    way, straight = (
        np.array([tool0_to_body(Side.RIGHT, joints(each), FINGERTIPS).position for each in rows])
        for rows in (
            [point.position for point in points],
            np.linspace(points[0].position, points[-1].position, 50).tolist(),
        )
    )
    figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.2), layout="constrained", width_ratios=(1.3, 1))
    left.imshow(image)
    left.axis("off")
    right.add_patch(plt.Rectangle((1e3 * (crate.centre.position[1] - y), 0.0), 2e3 * y, 2e3 * z, color="#d99e52"))
    right.plot(1e3 * straight[:, 1], 1e3 * straight[:, 2], ":", color="gray", label="straight in the joints")
    right.plot(1e3 * way[:, 1], 1e3 * way[:, 2], label="planned")
    right.set(xlabel="y [mm]", ylabel="height of the fingertips [mm]", ylim=(0, 420), title=f"{plan.duration:.1f} s")
    right.legend(loc="upper right")
    figure.savefig(HERE / "tool_around.png")


if __name__ == "__main__":
    main()
