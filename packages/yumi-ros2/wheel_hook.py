"""Puts what is compiled or built into a wheel, so that installing it needs neither a compiler nor Node.js.

A build hook of Hatch. Every wheel contains the page of `yumi view` and the compiled core, and is for the platform that
it was made on. Where YUMI_WHEEL_INTERFACES is set, as `make wheels` does, it also contains the message packages that
`make setup` has built, and is for the Python of these, too.
"""

from __future__ import annotations

import os
import sys
import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.config import BuilderConfig
from hatchling.builders.hooks.plugin.interface import BuildHookInterface

RECORD = Path(sys.prefix) / "share" / "yumi_message_packages"
"""The files of the message packages in the environment; see interfaces/build.py."""


IN_AMENT_INDEX = {
    "resource/yumi_ros2": "share/ament_index/resource_index/packages/yumi_ros2",
    "resource/yumi": "lib/yumi_ros2/yumi",
    "package.xml": "share/yumi_ros2/package.xml",
    "launch": "share/yumi_ros2/launch",
    "packages/abb-view/src/abb_view/meshes": "share/yumi_ros2/meshes",
}
"""Of the clone, and where `ros2 pkg`, `ros2 run` and `ros2 launch` look in the environment; setup.py for colcon."""


class CompiledHook(BuildHookInterface[BuilderConfig]):
    """Adds page and core, and the message packages of the environment whose Python builds the wheel."""

    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Add the files and name the platform; an editable installation compiles when it needs to.

        Raises:
            RuntimeError: the environment has no message packages.
        """
        root = Path(self.root)
        clone = root if (root / "package.xml").exists() else root.parents[1]  # the sources have the folders themselves
        for name, place in IN_AMENT_INDEX.items():
            build_data["shared_data"][str(clone / name)] = place
        if version != "standard":
            return
        others = [root.parent / name / "src" for name in ("abb-protocols", "abb-view")]
        sys.path[:0] = [str(each) for each in (root / "src", *others) if each.exists()]
        from abb_view.page_build import built  # noqa: PLC0415
        from yumi.core import library as core  # noqa: PLC0415 - those of the sources the wheel is made of
        from yumi.web.page_build import ROBOT_PAGE  # noqa: PLC0415

        build_data["force_include"][str(clone / "config")] = "yumi/config"  # where yumi.driver.settings looks first
        library = root / "build" / "core" / "wheel.so"
        core.compile_to(library, core.PORTABLE_LIBRARY)
        build_data["force_include"][str(library)] = core.PACKAGED_LIBRARY.relative_to(root / "src").as_posix()
        page = ROBOT_PAGE.packaged.relative_to(root / "src").as_posix()
        build_data["force_include"][str(built(ROBOT_PAGE, self.app.display_info))] = page
        platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{platform}"
        if os.environ.get("YUMI_WHEEL_INTERFACES"):
            self._add_interfaces(build_data)
            python = f"cp{sys.version_info.major}{sys.version_info.minor}"
            build_data["tag"] = f"{python}-{python}-{platform}"

    def _add_interfaces(self, build_data: dict[str, Any]) -> None:
        if not RECORD.exists():
            raise RuntimeError(
                f"{sys.prefix} has no message packages; run `make setup` first, without a sourced ROS 2."
            )
        packages = Path(sysconfig.get_path("platlib")).relative_to(sys.prefix)
        for path in map(Path, RECORD.read_text().splitlines()[1:]):
            if path.is_relative_to(packages):
                build_data["force_include"][f"{sys.prefix}/{path}"] = path.relative_to(packages).as_posix()
            else:
                build_data["shared_data"][f"{sys.prefix}/{path}"] = path.as_posix()
