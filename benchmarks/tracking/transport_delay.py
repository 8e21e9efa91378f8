"""Prints the delay from command to motion of each arm in a recording: what ``tracking.delay`` should be set to.

Record while the arm moves, on the real robot or the virtual one (``yumi up --record FILE``), then::

    python benchmarks/tracking/transport_delay.py FILE
"""

from __future__ import annotations

import argparse
from math import degrees
from pathlib import Path

from yumi.control.motion import EGM_GAIN
from yumi.errors import CommandRefused
from yumi.recording.mcap import read_recording
from yumi.robot.joints import joint_names
from yumi_evaluation.transport_delay import transport_delay


def main() -> None:
    parser = argparse.ArgumentParser(description="The delay from command to motion, from a recording.")
    parser.add_argument("file", type=Path, help="what yumi up --record wrote, or a flight record")
    parser.add_argument("--pos-corr-gain", type=float, default=1.0, help="of egm_motion (default: 1)")
    parser.add_argument("--last", type=float, default=20.0, metavar="SECONDS", help="how much of its end counts")
    options = parser.parse_args()
    for side, frames in read_recording(options.file, before=options.last).frames.items():
        newest = [frame for frame in frames if frame.session == frames[-1].session]
        try:
            found = transport_delay(newest, EGM_GAIN * options.pos_corr_gain)
        except CommandRefused as refusal:
            print(f"{side.word} arm: {refusal}")
            continue
        print(
            f"{side.word} arm: {found.delay * 1e3:.1f} ms, which leaves {degrees(found.error):.3f}° unexplained "
            f"({joint_names(side)[found.joint]})"
        )


if __name__ == "__main__":
    main()
