"""The cycle of the robot's motion control: how often it sends a datagram and takes a reference."""

CYCLE = 0.004032
"""Period of the motion control of a real controller [s] (reference/egm.md §2.5)."""
