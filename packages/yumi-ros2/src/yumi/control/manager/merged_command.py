"""The command that several controllers make together."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from abb_protocols.robot.joints import ArmCommand, ArmState, Joints, joints
from yumi.control.manager.loaded_controller import LoadedController


class MergedCommand:
    """Asks several commanding controllers; who gives which value is settled when controllers are switched.

    A joint's position is the one of the controller that claims it; where none does, of the one that claims the
    joint's velocity, which has to say where its motion leads. Velocities likewise. When one of them holds, the arm
    holds.

    Attributes:
        asked: index of the controller that was asked last, for the case that it failed.
        times: how long each one's update took in the last cycle [s].

    Args:
        members: the controllers, at least one.
        joint_names: the arm's joints, chain order.
        now: the time [s], for ``times`` alone.
    """

    def __init__(
        self, members: Sequence[LoadedController], joint_names: tuple[str, ...], now: Callable[[], float]
    ) -> None:
        self.asked = 0
        self.times = [0.0] * len(members)
        self._updates = tuple(member.controller.update for member in members)
        self._now = now
        self._positions = _owners(members, joint_names, ("position", "velocity"))
        self._velocities = _owners(members, joint_names, ("velocity", "position"))

    def update(self, state: ArmState) -> ArmCommand | None:
        """The merged command for ``state``; None holds."""
        commands = []
        begin = self._now()
        for index, update in enumerate(self._updates):
            self.asked = index
            command = update(state)
            end = self._now()
            self.times[index], begin = end - begin, end
            if command is None:
                return None
            commands.append(command)
        position = _gathered([command.position for command in commands], self._positions)
        return ArmCommand(position, _gathered([command.velocity for command in commands], self._velocities))


def _owners(
    members: Sequence[LoadedController], joint_names: tuple[str, ...], kinds: tuple[str, ...]
) -> tuple[int, ...]:
    """For each joint the index of the controller that claims the first of ``kinds`` that is claimed."""
    claims = {interface: index for index, member in enumerate(members) for interface in member.required}
    wanted = [[claims.get(f"{joint}/{kind}") for kind in kinds] for joint in joint_names]
    return tuple(next((index for index in choices if index is not None), 0) for choices in wanted)


def _gathered(values: Sequence[Joints], owners: tuple[int, ...]) -> Joints:
    """One value for each joint; the very tuple where all come from one controller."""
    first = owners[0]
    if owners.count(first) == len(owners):
        return values[first]
    return joints([values[owner][joint] for joint, owner in enumerate(owners)])
