"""The virtual robot in virtual time with a sensor on each arm: what the state machine tests drive, without sockets."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from abb_protocols.egm.codec import RobotMessage, SensorCodec, SensorMessage
from abb_protocols.robot.joints import CYCLE, Joints, Side
from virtual_irc5.world import World, WorldSettings

ARMS = (Side.RIGHT, Side.LEFT)

# Where the fields are in the text of TRobEGM/settings (reference/statemachine.md §3.1).
EGM_FIELDS = {
    "allow_egm_motions": (0,),
    "use_presync": (1,),
    "setup_uc.use_filtering": (2, 0),
    "setup_uc.comm_timeout": (2, 1),
    "activate.cond_min_max": (3, 4),
    "activate.lp_filter": (3, 5),
    "activate.sample_rate": (3, 6),
    "activate.max_speed_deviation": (3, 7),
    "run.cond_time": (4, 0),
    "run.ramp_in_time": (4, 1),
    "run.pos_corr_gain": (4, 3),
    "stop.ramp_out_time": (5, 0),
}


@dataclass
class Sensor:
    """Answers every datagram of one arm, unless it is silent; orders ``goal`` or the measured position."""

    goal: Joints | None = None
    is_silent: bool = False
    heard: list[RobotMessage] = field(default_factory=list)
    codec: SensorCodec = field(default_factory=SensorCodec)

    def answer(self, datagram: bytes) -> list[bytes]:
        message = self.codec.decode(datagram)
        self.heard.append(message)
        if self.is_silent:
            return []
        return [self.codec.encode(SensorMessage(message.seqno, self.goal or message.measured))]


class Bench:
    """Drives a world and remembers what its arms said."""

    def __init__(self, settings: WorldSettings | None = None) -> None:
        self.world = World(settings or WorldSettings())
        self.controller = self.world.controller
        self.sensors = {side: Sensor() for side in ARMS}
        self._inboxes: dict[Side, list[bytes]] = {}

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / CYCLE)):
            self._cycle()

    def run_until(self, condition: Callable[[], bool], limit: float) -> None:
        """Let time pass until the condition holds; fails after ``limit`` [s]."""
        for _ in range(round(limit / CYCLE)):
            if condition():
                return
            self._cycle()
        raise AssertionError(f"not within {limit} s; states {self.states}, screen {self.screen(Side.RIGHT)[-3:]}")

    def bring_up(self) -> None:
        """Motors on, RAPID from main, until both arms idle."""
        self.controller.set_motors(True)
        self.controller.move_pp_to_main()
        self.controller.start_rapid()
        self.run_until(lambda: self.states == (0, 0), limit=1.0)

    def pulse(self, signal: str) -> None:
        """A rising edge, left high, as abb_librws does it."""
        self.controller.signals.set(signal, 0)
        self.controller.signals.set(signal, 1)
        self.controller.settle()

    def read(self, side: Side, module: str, symbol: str) -> str:
        return self.controller.tasks[side.task].read(module, symbol)

    def write(self, side: Side, module: str, symbol: str, value: str) -> None:
        self.controller.tasks[side.task].write(module, symbol, value)

    def egm_setting(self, side: Side, field_name: str) -> str:
        """One field of an arm's EGM settings, e.g. ``run.cond_time``."""
        value = split(self.read(side, "TRobEGM", "settings"))
        for index in EGM_FIELDS[field_name]:
            value = value[index]
        return str(value)

    def set_egm(self, field_name: str, value: str, sides: tuple[Side, ...] = ARMS) -> None:
        """Write one field of the EGM settings, as clients do: read the record, change it, write it back."""
        *outer, last = EGM_FIELDS[field_name]
        for side in sides:
            settings = split(self.read(side, "TRobEGM", "settings"))
            part = settings
            for index in outer:
                part = part[index]
            part[last] = value
            self.write(side, "TRobEGM", "settings", joined(settings))

    def screen(self, side: Side) -> tuple[str, ...]:
        """What the task wrote to the FlexPendant."""
        return self.controller.screens[side.task]

    @property
    def states(self) -> tuple[int, int]:
        right, left = (int(self.read(side, "TRobMain", "current_state")) for side in ARMS)
        return right, left

    @property
    def actions(self) -> tuple[int, int]:
        right, left = (int(self.read(side, "TRobEGM", "current_action")) for side in ARMS)
        return right, left

    def _cycle(self) -> None:
        datagrams = self.world.cycle(self._inboxes)
        self._inboxes = {side: self.sensors[side].answer(datagram) for side, datagram in datagrams.items()}


def split(literal: str) -> Any:
    """A RAPID record as nested lists of texts."""
    return json.loads(re.sub(r"[^\[\],]+", lambda atom: json.dumps(atom.group()), literal))


def joined(value: Any) -> str:
    """Nested lists of texts as a RAPID record."""
    return value if isinstance(value, str) else f"[{','.join(joined(item) for item in value)}]"
