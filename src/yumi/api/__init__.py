"""The Python API: a robot in a script or notebook, without ROS. Everything a script needs is in :mod:`yumi` itself."""
