"""Names of the controllers that motions of the driver, of scripts and of ROS actions use."""

from __future__ import annotations

GOAL_CONTROLLER = "joint_goal_controller"
"""Takes an arm to single points."""

STREAM_CONTROLLER = "joint_position_controller"
"""Follows a stream of points; commands an arm after EGM has started, unless another controller is named."""

JOG_CONTROLLER = "joint_velocity_controller"
"""Follows speeds, and stops where none come."""

TRAJECTORY_CONTROLLER = "joint_trajectory_controller"
"""Follows points with times."""

CARTESIAN_CONTROLLER = "cartesian_controller"
"""Moves the tool on straight lines and after streams."""

DUAL_ARM_CONTROLLER = "dual_arm_trajectory_controller"
"""Of the controllers that follow one trajectory together, and of the node with their action."""
