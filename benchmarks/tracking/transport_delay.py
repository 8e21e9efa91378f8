"""Prints the delay from command to motion of each arm in a recording: what ``tracking.delay`` should be set to.

Record while the arm moves, on the real robot or the virtual one (``yumi up --record FILE``), then::

    python benchmarks/tracking/transport_delay.py FILE

Each command is a position and a speed that the robot's position loop (reference/egm.md §6.1), which is closed over the
position that the robot reports, makes a motion of. That motion is calculated from the recorded commands and reports,
and the measured one is laid over it at the delay where the two agree best. The arm has to have moved in a way that does
not repeat itself within the longest delay looked for: a few goals, or a slow sine, on any joint.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from math import degrees, sqrt
from pathlib import Path
from typing import NamedTuple

import numpy as np

from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import CYCLE, joint_names
from yumi.control.flight_recorder import RecordedCycle
from yumi.control.motion.robot_response import EGM_GAIN
from yumi.recording.reader import read_recording
from yumi_evaluation.metrics import minimum

LONGEST = 0.150
"""No longer delay is looked for [s]."""

USE = 2.0 * CYCLE
"""From a command until EGM uses it, with what the robot reports by then: it takes the command after one cycle, and uses
it after another one [s]."""

_FEWEST = 250
_LEAST_MOTION = 0.02  # [rad]


class TransportDelay(NamedTuple):
    """The delay of an arm.

    Attributes:
        delay: from the moment a command is sent to the middle of the motion it makes [s].
        error: root mean square of what the delay does not explain [rad].
        joint: index of the joint that moved most, which it was taken from.
    """

    delay: float
    error: float
    joint: int


def transport_delay(cycles: Iterable[RecordedCycle], gain: float = EGM_GAIN) -> TransportDelay:
    """The delay of an arm with which the ``cycles`` are explained best.

    Args:
        cycles: in order, from one session, while the arm moved.
        gain: of the robot's position loop, PosCorrGain times 5 [1/s].

    Raises:
        CommandRefused: there are too few cycles, or the arm hardly moved.
    """
    rows = [cycle for cycle in cycles if cycle.is_running]
    if len(rows) < _FEWEST:
        raise CommandRefused(f"There are {len(rows)} cycles in which the robot followed; a delay needs {_FEWEST}.")
    positions = np.array([row.position for row in rows])
    spans = np.ptp(positions, axis=0)
    joint = int(spans.argmax())
    if spans[joint] < _LEAST_MOTION:
        raise CommandRefused(
            f"The arm moved by {spans[joint]:.4f} rad; a delay needs a motion of {_LEAST_MOTION:g} rad."
        )
    times = np.array([row.time for row in rows])

    # Where the commands would have the joint if they worked at once, each for its own cycle around its time.
    steps = np.minimum(np.diff(times), LONGEST)
    sent = np.array([row.sent[joint] for row in rows[:-1]])
    fed = np.array([row.sent_velocity[joint] for row in rows[:-1]])
    reported = np.interp(times[:-1] + USE, times, positions[:, joint])
    speeds = gain * (sent - reported) + fed
    path = rows[0].planned[joint] + np.concatenate(([0.0], np.cumsum(speeds * steps)))
    due = times[0] - 0.5 * CYCLE + np.concatenate(([0.0], np.cumsum(steps)))
    later = times > times[0] + LONGEST

    def mismatch(delay: float) -> float:
        """Variance [rad²]: a constant difference does not count, the two began at different delays."""
        return float(np.var(positions[later, joint] - np.interp(times[later] - delay, due, path)))

    delay = minimum(mismatch, 0.0, LONGEST)
    return TransportDelay(delay, sqrt(mismatch(delay)), joint)


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
