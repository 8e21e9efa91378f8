"""Drive an ABB IRB 14000 YuMi from ROS 2 or plain Python."""

__version__ = "0.1.0"
