"""For colcon alone, which builds an `ament_python` package by this file; pip builds by pyproject.toml's hatchling."""

import re
from pathlib import Path

from setuptools import find_packages, setup

VERSION = re.search(r'^__version__ = "(.*)"$', Path("src/yumi/__init__.py").read_text(), re.MULTILINE)

distribution = setup(
    version=VERSION[1],
    package_dir={"": "src", "yumi.config": "config"},
    packages=[*find_packages("src"), "yumi.config"],
    package_data={"yumi": ["**/*"], "yumi_evaluation": ["**/*"], "yumi.config": ["*.yaml", "*.xml", "*.json"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/yumi_ros2"]),
        ("share/yumi_ros2", ["package.xml"]),
        ("share/yumi_ros2/meshes", sorted(map(str, Path("src/yumi/robot/meshes").glob("*.stl")))),
        ("share/yumi_ros2/launch", ["launch/yumi.launch.py"]),
    ],
)
# colcon reads what setup() was told back from its text, and a version specifier's text is not a literal.
distribution.python_requires = distribution.metadata.python_requires = None
