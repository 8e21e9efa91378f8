"""Who commands an arm: a person, a policy, a stream, a planner, a program on the robot, or nothing."""

from __future__ import annotations

from enum import IntEnum


class Commander(IntEnum):
    """Who commands an arm; the number is what shared memory holds.

    PAGE: a person at the page of ``yumi view``.
    HEADSET: a person with a headset or a phone (WebXR).
    DEVICE: a person with a gamepad, a SpaceMouse, a keyboard or a leader arm.
    LEAD_THROUGH: a person who guides the arm by hand.
    TRAJECTORY: a program that sends whole trajectories or goals.
    PLANNER: a planner of paths.
    STREAM: a stream of positions, speeds or poses.
    POLICY: a learned policy that sends chunks of actions.
    RAPID: the program on the robot.
    """

    NONE = 0
    PAGE = 1
    HEADSET = 2
    DEVICE = 3
    LEAD_THROUGH = 4
    TRAJECTORY = 5
    PLANNER = 6
    STREAM = 7
    POLICY = 8
    RAPID = 9

    @property
    def is_person(self) -> bool:
        """Whether a person moves the arm at this moment; a person goes before every program."""
        return Commander.PAGE <= self <= Commander.LEAD_THROUGH
