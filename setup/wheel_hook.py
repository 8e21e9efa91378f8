"""Puts what is compiled into a wheel, so that installing it needs no compiler.

A build hook of Hatch. Every wheel contains the library that keeps the arms apart, and is for the platform it was made
on. Where YUMI_WHEEL_INTERFACES is set, as `make wheels` does, it also contains the message packages that `make setup`
has built, and is for the Python of these, too.
"""

from __future__ import annotations

import os
import sys
import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.config import BuilderConfig
from hatchling.builders.hooks.plugin.interface import BuildHookInterface

RECORDS = Path(sys.prefix) / "share" / "yumi_interface_records"
"""Which files each message package has installed; see interfaces/build.py."""

INDEX = ("packages", "rosidl_interfaces", "package_run_dependencies")
"""Resources of the ament index without paths of the machine they were made on."""

DEFINITIONS = (".msg", ".srv", ".action", ".idl", ".json")


def destination(file: Path, packages: Path, prefix: Path) -> tuple[str, str] | None:
    """Where an installed file goes in the wheel; None for what only compiling against the package needs.

    Args:
        file: as it is installed in `prefix`.
        packages: the folder of the installed Python packages in `prefix`.
        prefix: of the environment.

    Returns:
        "force_include" for the Python packages or "shared_data" for the environment's prefix, and the path there.
    """
    if file.is_relative_to(packages):
        is_loaded = file.suffix in {".py", ".so"} and not file.parts[len(packages.parts)].endswith(".egg-info")
        return ("force_include", file.relative_to(packages).as_posix()) if is_loaded else None
    path = file.relative_to(prefix)
    is_loaded = (
        (path.parts[0] == "lib" and path.suffix == ".so")
        or (path.parts[:3] in {("share", "ament_index", "resource_index")} and path.parts[3] in INDEX)
        or (path.parts[0] == "share" and (path.suffix in DEFINITIONS or path.name == "package.xml"))
    )
    return ("shared_data", path.as_posix()) if is_loaded else None


class CompiledHook(BuildHookInterface[BuilderConfig]):
    """Adds the library, and the message packages of the environment whose Python builds the wheel."""

    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Add the files and name the platform; an editable installation has them in its environment already.

        Raises:
            RuntimeError: the environment has no message packages.
        """
        if version != "standard":
            return
        sys.path.insert(0, str(Path(self.root) / "src"))
        from yumi.robot import collision_library  # noqa: PLC0415 - that of the sources the wheel is made of

        packaged = collision_library.PACKAGED.relative_to(Path(self.root) / "src")
        library = Path(self.root) / "build" / "collision" / "wheel.so"
        collision_library.compile_to(library, *collision_library.PORTABLE)
        build_data["force_include"][str(library)] = packaged.as_posix()
        platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{platform}"
        if os.environ.get("YUMI_WHEEL_INTERFACES"):
            self._add_interfaces(build_data)
            python = f"cp{sys.version_info.major}{sys.version_info.minor}"
            build_data["tag"] = f"{python}-{python}-{platform}"

    def _add_interfaces(self, build_data: dict[str, Any]) -> None:
        # Resolved, since .venv may be a link.
        prefix, packages = Path(sys.prefix).resolve(), Path(sysconfig.get_path("platlib")).resolve()
        lines = [line for record in sorted(RECORDS.glob("*")) for line in record.read_text().splitlines()[1:]]
        files = [Path(line).resolve() for line in lines if line]
        if not files:
            raise RuntimeError(f"{prefix} has no message packages; run `make setup` first, without a sourced ROS 2.")
        for file in files:
            goes = destination(file, packages, prefix)
            if goes:
                build_data[goes[0]][str(file)] = goes[1]
