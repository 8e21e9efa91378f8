"""A picture of the paths that joints took: one panel an arm, one line a joint."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import degrees
from pathlib import Path

from yumi.errors import MissingPrerequisite
from yumi.robot.joints import CHAIN_AXES, Joints, Side

JointPath = Sequence[tuple[float, Joints]]
"""Times [s] and positions [rad] of one arm."""


def draw_joint_paths(paths: Mapping[Side, JointPath], file: Path) -> None:
    """Draw ``paths`` over the time since the first of all and save the picture as ``file``.

    Raises:
        MissingPrerequisite: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure  # noqa: PLC0415 - an extra; nothing else needs it
    except ImportError as error:
        raise MissingPrerequisite("Pictures need matplotlib; install yumi-ros2[plot].") from error
    figure = Figure(figsize=(10.0, 4.5), layout="constrained")
    panels = figure.subplots(1, len(paths), sharex=True, sharey=True, squeeze=False)[0]
    begin = min(time for path in paths.values() for time, _ in path)
    for panel, (side, path) in zip(panels, paths.items(), strict=True):
        _draw_arm(panel, path, begin)
        panel.set_title(f"{side.word.capitalize()} arm")
    panels[0].set_ylabel("joint position [°]")
    panels[-1].legend(title="ABB axis", loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    figure.savefig(file, dpi=150)


def _draw_arm(panel: object, path: JointPath, begin: float) -> None:
    times = [time - begin for time, _ in path]
    for index, axis in enumerate(CHAIN_AXES):
        panel.plot(times, [degrees(position[index]) for _, position in path], label=str(axis))  # type: ignore[attr-defined]
    panel.grid(alpha=0.3)  # type: ignore[attr-defined]
    panel.set_xlabel("time [s]")  # type: ignore[attr-defined]
