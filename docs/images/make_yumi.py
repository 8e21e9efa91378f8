"""Draw the robot for the first picture of README and site: both arms and the fingers of the grippers move.

A recording is written from a few poses and opened with `yumi view`; of the page the robot alone is drawn, time by time,
so that a slow machine draws the same pictures. Needs Debian's chromium and playwright.

    python docs/images/make_yumi.py              # docs/images/yumi.webp
    python docs/images/make_yumi.py /tmp/x.webp  # elsewhere
"""

from __future__ import annotations

import argparse
import io
import os
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import fields
from itertools import pairwise
from math import cos, pi
from pathlib import Path
from typing import NamedTuple

from make_view import ARGUMENTS
from PIL import Image
from playwright.sync_api import sync_playwright

import yumi
from abb_protocols.robot.gripper_values import GripperState, ServoState
from abb_protocols.robot.joints import POSES, ZERO_JOINTS, Joints, Side, joints
from abb_runtime.process.command_process import CommandProcess
from yumi.control.flight_recorder import RecordedCycle
from yumi.control.stage_times import StageTimes
from yumi.recording.writer import RecordingWriter

SIZE = (800, 600)  # of the page [pixels]
SHOWN = (520, 390)
CLOSER = -330  # of the mouse wheel [pixels]
PERIOD = 0.08  # between two pictures [s]
OPEN, PART, CLOSED = 0.025, 0.010, 0.0  # of each finger from the middle [m]

ROBOT_ALONE = """
* { visibility: hidden !important; }
.stage { position: fixed !important; inset: 0; }
canvas#scene { visibility: visible !important; background: radial-gradient(circle at 50% 40%, #ffffff, #dfe4ea); }
"""

SHOW = """(slider, time) => {
  slider.value = time;
  slider.dispatchEvent(new Event("input", { bubbles: true }));
  return new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
}"""


class Stop(NamedTuple):
    """Where the arms go and their fingers stand, how long they take [s], and how long they stay."""

    right: Joints
    left: Joints
    fingers: tuple[float, float]
    takes: float
    stays: float


HOME = {side: POSES["home"](side) for side in Side}
READY = {side: POSES["ready"](side) for side in Side}
# Those of the demonstration.
RIGHT_GOAL = yumi.degrees(42.1, -118.4, -92.1, 46.5, -143.6, 42.5, 36.1)
LEFT_GOAL = yumi.degrees(-39.0, -104.1, 80.0, 8.0, 31.0, 93.0, 57.0)
STOPS = (
    Stop(HOME[Side.RIGHT], HOME[Side.LEFT], (CLOSED, CLOSED), 0.0, 0.3),
    Stop(READY[Side.RIGHT], READY[Side.LEFT], (OPEN, OPEN), 1.2, 0.2),
    Stop(RIGHT_GOAL, LEFT_GOAL, (OPEN, OPEN), 2.0, 0.2),
    Stop(RIGHT_GOAL, LEFT_GOAL, (CLOSED, PART), 0.6, 0.4),
    Stop(READY[Side.RIGHT], READY[Side.LEFT], (CLOSED, PART), 2.0, 0.2),
    Stop(HOME[Side.RIGHT], HOME[Side.LEFT], (CLOSED, CLOSED), 1.2, 0.1),
)


def between(before: Sequence[float], after: Sequence[float], share: float) -> list[float]:
    """Smoothly from one to the other, as ``share`` goes from 0 to 1."""
    eased = 0.5 - 0.5 * cos(pi * share)
    return [a + eased * (b - a) for a, b in zip(before, after, strict=True)]


def moments() -> Iterator[tuple[float, dict[Side, Joints], dict[Side, float]]]:
    """Time [s], joint positions [rad] and fingers [m] of each picture."""
    time = 0.0
    for before, after in pairwise((STOPS[0], *STOPS)):
        count = round((after.takes + after.stays) / PERIOD)
        for index in range(count):
            share = min(1.0, index * PERIOD / after.takes) if after.takes else 1.0
            right, left = between(before.right, after.right, share), between(before.left, after.left, share)
            fingers = between(before.fingers, after.fingers, share)
            yield time, {Side.RIGHT: joints(right), Side.LEFT: joints(left)}, dict(zip(Side, fingers, strict=True))
            time += PERIOD


def write_recording(file: Path) -> list[float]:
    """Write the recording; the times of the pictures [s]."""
    times, stages = [], StageTimes(*[0.0] * len(fields(StageTimes)))
    with RecordingWriter(file, 1.8e9) as writer:
        for number, (time, positions, fingers) in enumerate(moments(), 1):
            times.append(time)
            for side, position in positions.items():
                at_rest = (position, ZERO_JOINTS, position, position, position, ZERO_JOINTS, position, stages)
                writer.add_frame(side, RecordedCycle(number, time, PERIOD, 1, True, *at_rest))
                state = GripperState(ServoState.READY, 0, True, fingers[side], 0.0, 0.0)
                writer.add_value(f"{side.value}/gripper", time, state)
    return times


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path, nargs="?", default=Path(__file__).parent / "yumi.webp")
    file: Path = parser.parse_args().file
    pictures: list[Image.Image] = []
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        os.environ["XDG_RUNTIME_DIR"] = folder
        times = write_recording(Path(folder) / "yumi.mcap")
        options = ("view", str(Path(folder) / "yumi.mcap"), "--port", "0")
        with CommandProcess("yumi view", "yumi", options, Path(folder) / "view.log") as command:
            browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=ARGUMENTS)
            page = browser.new_page(viewport=dict(zip(("width", "height"), SIZE, strict=True)), bypass_csp=True)
            page.goto(command.wait_until_ready(120.0))
            slider = page.get_by_label("Time in the recording")
            slider.wait_for(timeout=120_000)
            for name in ("traces", "tool frames"):
                page.get_by_label(name).set_checked(False)
            page.add_style_tag(content=ROBOT_ALONE)
            page.mouse.move(SIZE[0] / 2, SIZE[1] / 2)
            page.mouse.wheel(0, CLOSER)
            page.wait_for_timeout(3000)  # for the meshes
            for time in times:
                slider.evaluate(SHOW, time)
                shot = Image.open(io.BytesIO(page.screenshot(timeout=120_000))).convert("RGB")
                pictures.append(shot.resize(SHOWN, Image.Resampling.LANCZOS))
            browser.close()
    first, *others = pictures
    first.save(file, save_all=True, append_images=others, duration=round(PERIOD * 1000), loop=0, quality=55, method=4)


if __name__ == "__main__":
    main()
