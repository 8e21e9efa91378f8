"""Motions around the robot itself and what stands about it, and the files MoveIt needs to plan them."""
