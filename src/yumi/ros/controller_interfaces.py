"""What controllers offer on their nodes besides parameters, by their type: topics and actions."""

from __future__ import annotations

from collections.abc import Mapping

from yumi.ros.controller_nodes import MakeInterface

CONTROLLER_INTERFACES: Mapping[str, MakeInterface] = {}
