"""For colcon alone, which builds an `ament_python` package by this file; pip builds by the packages' pyproject.toml.

One package of ROS, yumi_ros2, has the Python packages of all distributions.
"""

import re
from pathlib import Path

from setuptools import find_packages, setup

SOURCES = [
    f"packages/{name}/src"
    for name in ("abb-protocols", "abb-runtime", "abb-view", "virtual-irc5", "yumi-ros2", "yumi-evaluation")
]
VERSION = re.search(
    r'^__version__ = "(.*)"$', Path("packages/yumi-ros2/src/yumi/__init__.py").read_text(), re.MULTILINE
)
FOLDERS = {name: f"{source}/{name}" for source in SOURCES for name in find_packages(source) if "." not in name}


def commands() -> "dict[str, list[str]]":
    """What the packages offer to others: tables of strings in their pyproject.toml."""
    found = {}
    for source in SOURCES:
        text = Path(source, "..", "pyproject.toml").read_text()
        for table, body in re.findall(
            r'^\[project\.(scripts|entry-points\.[^\]]+)\]\n((?:[\w-]+ = ".*"\n)+)', text, re.MULTILINE
        ):
            group = "console_scripts" if table == "scripts" else table.partition(".")[2].strip('"')
            found.setdefault(group, []).extend(line.replace('"', "") for line in body.splitlines())
    return found


setup(
    name="yumi_ros2",
    version=VERSION[1],
    package_dir={**FOLDERS, "yumi.config": "config"},
    packages=[*(name for source in SOURCES for name in find_packages(source)), "yumi.config"],
    package_data={**{name: ["**/*"] for name in FOLDERS}, "yumi.config": ["*.yaml", "*.xml", "*.json"]},
    entry_points=commands(),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/yumi_ros2"]),
        ("share/yumi_ros2", ["package.xml"]),
        ("share/yumi_ros2/meshes", sorted(map(str, Path("packages/abb-view/src/abb_view/meshes").glob("*.stl")))),
        ("share/yumi_ros2/launch", ["launch/yumi.launch.py"]),
    ],
)
