"""Planned paths: why there is none, and what planning asks for."""

from __future__ import annotations

from collections.abc import Mapping

from yumi.catalogue.text import Text

PLANNING: Mapping[str, Text] = {
    "no_path": Text(
        "there is no path, as far as complete searches show ({duration:.1f} s): every one that was tried comes too "
        "near to the robot itself or to a box",
        "take a goal with more room about it, or plan in two steps",
    ),
    "no_path_in_time": Text(
        "no path was found in the time given, {duration:.1f} s; there may be one. The planner had a processor for "
        "{share:.0%} of that time",
        "give more time, take a goal with more room about it, or plan in two steps",
    ),
    "no_path_in_time_busy": Text(
        "no path was found in the time given, {duration:.1f} s; there may be one. The planner had a processor for "
        "only {share:.0%} of that time, as other programs keep this machine busy",
        "end some of them and plan again",
    ),
}
