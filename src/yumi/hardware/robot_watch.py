"""The watch: keeps what is known of the robot fresh, whoever changes it.

A thread looks at the newest number of the event log, which every change of mode, motors and program raises, and reads
the rest when it has changed, or when it was not read for a while.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from threading import Lock
from typing import Protocol

from yumi.control.snapshot import Snapshot
from yumi.errors import ControllerRefused, ProtocolError, YumiError
from yumi.hardware.manager_state import EGM_OFF, EGM_RUNNING, EGM_STREAMING, RobotState, why_not_ready
from yumi.hardware.rws_client import RwsClient
from yumi.hardware.state_machine import MAIN, MachineState
from yumi.hardware.state_machines import read_machine_state
from yumi.robot.joints import Side

Listener = Callable[[RobotState], None]
"""Told the robot's state after a change."""


class Snapshots(Protocol):
    """What is needed of the fast lines."""

    def snapshot(self, side: Side) -> Snapshot:
        """What is known of an arm."""


class RobotWatch:
    """What is known of one robot.

    Args:
        client: a connected client.
        fast_lines: where the arms' datagrams arrive.
    """

    def __init__(self, client: RwsClient, fast_lines: Snapshots) -> None:
        self._client = client
        self._fast_lines = fast_lines
        self._lock = Lock()
        self._state = RobotState()

    def state(self) -> RobotState:
        """What was known last, with EGM as it is now."""
        with self._lock:
            return self._completed(self._state)

    def look(self) -> RobotState:
        """Read all of it now; a controller that does not answer is a state, too."""
        try:
            found = self._read()
        except YumiError:
            found = RobotState()
        with self._lock:
            self._state = found
        return self._completed(found)

    def _read(self) -> RobotState:
        client = self._client
        events = client.events(count=1)
        return RobotState(
            is_connected=True,
            mode=client.operating_mode(),
            controller_state=client.controller_state(),
            execution=client.execution(),
            machines={side: self._machine(side) for side in Side},
            speed_ratio=client.speed_ratio(),
            last_event=events[0] if events else None,
        )

    def _machine(self, side: Side) -> MachineState | None:
        try:
            return read_machine_state(self._client.symbol(side.task, MAIN, "current_state"))
        except (ControllerRefused, ProtocolError):
            return None

    def _completed(self, state: RobotState) -> RobotState:
        live = replace(state, egm=egm_states(self._fast_lines))
        return replace(live, reason=why_not_ready(live))


def egm_states(fast_lines: Snapshots) -> Mapping[Side, str]:
    """EGM of each arm in a word."""
    return {side: _egm(fast_lines.snapshot(side)) for side in Side}


def _egm(snapshot: Snapshot) -> str:
    return EGM_RUNNING if snapshot.is_running else EGM_STREAMING if snapshot.is_streaming else EGM_OFF
