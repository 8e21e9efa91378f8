"""The joint position controller: a proportional law on the measured position, as in the thesis.

``command = measured + P · (goal - measured)``; with the robot's own loop behind it the arm approaches the goal as a
first-order lag of 1 / (5 s⁻¹ · P) (design of the virtual robot's dynamics; reference/egm.md §6.1).
"""

from __future__ import annotations

from yumi.control.controller import Controller
from yumi.control.goals import peek_goal
from yumi.control.mailbox import Mailbox
from yumi.control.parameter import Parameter, Values, number
from yumi.robot.joints import Joints
from yumi.robot.values import ArmCommand, ArmState

_GAIN = 1.2


class JointPositionController(Controller):
    """Takes goals for all joints of an arm from a mailbox.

    Args:
        goals: where goals arrive, see :mod:`yumi.control.goals`.
    """

    kind = "yumi_controllers/JointPositionController"

    def __init__(self, goals: Mailbox) -> None:
        self._goals = goals
        self._gain = _GAIN
        self._goal: Joints | None = None
        self._letter = 0

    def parameters(self, joint_names: tuple[str, ...]) -> tuple[Parameter, ...]:
        return (Parameter("p", _GAIN, 0.0, 2.0, "", "Proportional gain; oscillation begins near 2."),)

    def configure(self, values: Values) -> None:
        self._gain = number(values, "p")

    def activate(self, state: ArmState) -> None:
        self._goal = state.position
        letter = self._goals.peek()
        self._letter = letter[0] if letter else 0  # what was sent before belongs to the past

    def update(self, state: ArmState) -> ArmCommand | None:
        letter = self._goals.peek()
        if letter is not None and letter[0] != self._letter:
            self._take(state.session)
        if self._goal is None:
            return None
        p = self._gain
        a, b, c, d, e, f, g = state.position
        ga, gb, gc, gd, ge, gf, gg = self._goal
        return ArmCommand(
            (
                a + p * (ga - a),
                b + p * (gb - b),
                c + p * (gc - c),
                d + p * (gd - d),
                e + p * (ge - e),
                f + p * (gf - f),
                g + p * (gg - g),
            )
        )

    def _take(self, session: int) -> None:
        number, goal = peek_goal(self._goals, session)
        if goal is not None:
            self._letter, self._goal = number, goal

    @property
    def reference(self) -> Joints | None:
        return self._goal
