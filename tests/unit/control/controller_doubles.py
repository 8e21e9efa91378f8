"""Controllers that do what a test tells them, and remember what was done to them."""

from __future__ import annotations

from collections.abc import Sequence

from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import ZERO_JOINTS, ArmCommand, ArmState, Joints
from abb_runtime.parameters import Parameter, Values
from yumi.control.controller import Controller

RUNNING = ArmState(1.0, 0.004, 1, ZERO_JOINTS, ZERO_JOINTS, ZERO_JOINTS, is_running=True)
STOPPED = ArmState(1.0, 0.004, 1, ZERO_JOINTS, ZERO_JOINTS, ZERO_JOINTS, is_running=False)
THERE: Joints = (0.1,) * 7


class Double(Controller):
    """Commands ``command`` through the interfaces it is given; what is in ``faults`` raises.

    Args:
        kinds: the interfaces of each joint it claims.
        joints: how many joints it claims, from the body on.
    """

    kind = "test/Double"

    def __init__(self, *kinds: str, joints: int = 7) -> None:
        self.kinds = kinds or ("position",)
        self.joints = joints
        self.command: ArmCommand | None = ArmCommand(THERE)
        self.values: Values = {}
        self.faults: dict[str, Exception] = {}
        self.done: list[str] = []
        self.notices: list[object] = []
        self.orders: list[object] = []
        self.began_at: Joints | None = None

    def parameters(self, joint_names: tuple[str, ...]) -> tuple[Parameter, ...]:
        return (
            Parameter("p", 1.0, 0.0, 2.0, "1/s", "A gain."),
            Parameter("mode", "slow", choices=("slow", "fast"), read_only=True),
        )

    def configure(self, values: Values) -> None:
        self._do("configure")
        self.values = values

    def clean_up(self) -> None:
        self._do("clean_up")

    def activate(self, state: ArmState) -> None:
        self._do("activate")
        self.began_at = state.position

    def deactivate(self) -> None:
        self._do("deactivate")

    def command_interfaces(self, joint_names: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(f"{name}/{kind}" for name in joint_names[: self.joints] for kind in self.kinds)

    def update(self, state: ArmState) -> ArmCommand | None:
        if "update" in self.faults:
            raise self.faults["update"]
        return self.command

    def check(self, message: object, state: ArmState | None) -> None:
        if message == "bad":
            raise CommandRefused("The order is bad; send a good one.")

    def receive(self, message: object, state: ArmState | None) -> None:
        self.orders.append(message)

    def take_reports(self) -> Sequence[object]:
        self._do("take_reports")
        notices, self.notices = self.notices, []
        return notices

    @property
    def reference(self) -> Joints | None:
        return self.command.position if self.command else None

    def _do(self, deed: str) -> None:
        self.done.append(deed)
        if deed in self.faults:
            raise self.faults[deed]


class Watcher(Double):
    is_command = False
    kind = "test/Watcher"

    def command_interfaces(self, joint_names: tuple[str, ...]) -> tuple[str, ...]:
        return ()
