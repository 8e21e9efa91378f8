"""The command topics of forward controllers: one for each of them, under its name, as long as it is loaded."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from yumi.control.requests import ListControllers
from yumi.controllers.forward_command import FORWARDERS
from yumi.hardware.fast_lines import FastLines
from yumi.robot.joints import Side
from yumi.ros.command_topics import ForwardTopic
from yumi.ros.controller_nodes import MakeInterface


def forward_interfaces(
    nodes: Mapping[Side, Any], fast_lines: FastLines, now: Callable[[], float]
) -> Mapping[str, MakeInterface]:
    """What forward controllers offer, by their type.

    Args:
        nodes: each arm's node for topics alone, whose executor has no services.
        fast_lines: where the controllers live.
        now: tells the time on the machine's monotonic clock [s].
    """

    def active(side: Side) -> frozenset[str]:
        infos = fast_lines.ask(ListControllers(side)).controllers
        return frozenset(info.name for info in infos if info.claimed)

    def make(_: Any, side: Side, name: str) -> ForwardTopic:
        boxes = fast_lines.boxes[side]
        return ForwardTopic(
            nodes[side],
            side,
            (boxes.forward_positions, boxes.forward_speeds),
            partial(fast_lines.snapshot, side),
            now,
            name,
            partial(active, side),
        )

    return {controller.kind: make for controller in FORWARDERS}
