"""What an installation has beside Python: settings, RAPID, configurations, the grammar, the EGM schema."""

from __future__ import annotations

import os
import platform
import re
import subprocess
import sys
import tarfile
from importlib import metadata
from pathlib import Path
from shutil import copy, copytree, ignore_patterns
from zipfile import ZipFile

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from wheel_hook import RECORD

import yumi
from abb_view.robot_model import MESH_FOLDER
from yumi.core import library

ROOT = Path(__file__).resolve().parents[3]
NAME = f"yumi_ros2-{yumi.__version__}"

READ_SETTINGS = (
    "import yumi.driver.settings as s; from abb_protocols.robot.joints import Side; "
    "s.read_settings(); [s.read_controllers(side) for side in Side]; print(s.config_folder())"
)


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the sources, since builders write beside what they build."""
    folder = tmp_path_factory.mktemp("source")
    for name in ("pyproject.toml", "setup.py", "setup.cfg", "README.md", "LICENSE", "package.xml"):
        copy(ROOT / name, folder)
    for name in ("packages", "config", "resource", "launch"):
        copytree(ROOT / name, folder / name, ignore=ignore_patterns("__pycache__", "*.egg-info", "node_modules"))
    (folder / "build").mkdir()
    for name in ("core", "page"):  # made once of the same sources, of which each file has the fingerprint in its name
        (ROOT / "build" / name).mkdir(parents=True, exist_ok=True)
        (folder / "build" / name).symlink_to(ROOT / "build" / name)
    return folder


@pytest.fixture(scope="module")
def wheel(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel of the driver for every Python."""
    return build_wheel(source, tmp_path_factory.mktemp("wheel"))


BUILD_WHEELS = """
import sys
from hatchling.builders.wheel import WheelBuilder
for root in sys.argv[2:]:
    list(WheelBuilder(root).build(directory=sys.argv[1]))
"""


@pytest.fixture(scope="module")
def others(source: Path, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """The wheels of the other packages."""
    packages, folder = sorted((source / "packages").iterdir()), tmp_path_factory.mktemp("wheels")
    roots = [str(each) for each in packages if each.name != "yumi-ros2"]
    run([sys.executable, "-c", BUILD_WHEELS, str(folder), *roots], source)
    wheels = sorted(folder.glob("*.whl"))
    assert len(wheels) == len(roots)
    return wheels


def test_wheel_for_every_python_brings_the_compiled_library(wheel: Path, others: list[Path], tmp_path: Path) -> None:
    assert wheel.name.endswith(f"-py3-none-linux_{platform.machine()}.whl")
    extract(tmp_path, wheel, *others)
    # Neither a compiler nor a folder to write to.
    code = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); from yumi.core import library as it; it.load()"
    loaded = run(
        [sys.executable, "-c", f"{code}; print(it.PACKAGED_LIBRARY)"], tmp_path, PATH="", XDG_CACHE_HOME="/proc"
    )
    assert loaded.strip() == str(tmp_path / "yumi" / "core" / "libcore.so")


def test_sources_contain_what_is_compiled(source: Path, tmp_path: Path) -> None:
    package = source / "packages" / "yumi-ros2"
    run([sys.executable, "-m", "hatchling", "build", "-t", "sdist", "-d", str(tmp_path)], package)
    (archive,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(archive) as files:
        names = files.getnames()
        for file in library.CORE_FOLDER.glob("*.[ch]pp"):
            assert f"{NAME}/src/yumi/core/{file.name}" in names
        for name in ("config/yumi.yaml", "launch/yumi.launch.py", "resource/yumi", "package.xml"):
            assert f"{NAME}/{name}" in names


@pytest.fixture(params=["wheel", "colcon"], scope="module")
def installed(
    request: pytest.FixtureRequest,
    source: Path,
    wheel: Path,
    others: list[Path],
    tmp_path_factory: pytest.TempPathFactory,
) -> Path:
    """The folder where `yumi` would be found, as each of the two builders makes it."""
    folder = tmp_path_factory.mktemp("installed")
    if request.param == "wheel":
        extract(folder, wheel, *others)
    else:
        run([sys.executable, "setup.py", "-q", "build", "-b", f"{folder}-build", "--build-lib", str(folder)], source)
    return folder


def build_wheel(source: Path, folder: Path, **variables: str) -> Path:
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    run(command, source / "packages" / "yumi-ros2", **variables)
    (wheel,) = folder.glob("*.whl")
    return wheel


def extract(folder: Path, *wheels: Path) -> None:
    for each in wheels:
        with ZipFile(each) as archive:
            archive.extractall(folder)


def run(command: list[str], folder: Path, **variables: str) -> str:
    # Nothing of this package may be imported before what was built: with --random-words its catalogue would be.
    environment = {**os.environ, "PYTHONPATH": "", **variables}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def files_of(package: str) -> set[Path]:
    """The files of a package's source, below its `src`."""
    source = ROOT / "packages" / package / "src"
    files = (path for path in source.rglob("*") if path.is_file() and path.suffix != ".pyc")
    return {path.relative_to(source) for path in files if "node_modules" not in path.parts}


@pytest.mark.parametrize("package", sorted(each.name for each in (ROOT / "packages").iterdir()))
def test_installation_has_every_file_of_the_package(
    installed: Path, package: str, request: pytest.FixtureRequest
) -> None:
    files = files_of(package)
    page = {path for path in files if path.is_relative_to("yumi/web/page")}
    if request.node.callspec.params["installed"] == "wheel":  # colcon's are built when they are first needed
        built = {"index.html", "shell.css", "app.js", "LICENSE-three"}
        if page:
            files = files - page | {Path("yumi/web/static") / name for name in built | {"style.css"}}
            assert not (installed / "yumi" / "web" / "page").exists()
        elif package == "abb-view":  # with its sources, on which other pages are built
            files |= {Path("abb_view/static") / name for name in built}
    assert files
    assert [str(path) for path in sorted(files) if not (installed / path).is_file()] == []


def test_packages_have_files_that_are_no_modules() -> None:
    assert Path("yumi/web/page/src/main.ts") in files_of("yumi-ros2")
    shell = {Path("abb_view") / name for name in ("shell/scene.ts", "shell/package-lock.json", "meshes/base.stl")}
    assert shell < files_of("abb-view")
    virtual = {Path("virtual_irc5/rapid/grammar.lark"), Path("virtual_irc5/controller/stock/EIO.cfg")}
    assert virtual < files_of("virtual-irc5")
    modules = {Path("abb_protocols/controller_files") / name for name in ("TRobSG.mod", "TRobSystem.sys")}
    assert modules | {Path("abb_protocols/egm/egm.proto")} < files_of("abb-protocols")
    sources = Path("yumi_evaluation/bench/sources")
    programs = {sources / name for name in ("load_generator.c", "echo.c", "requirements.txt", "abb_robot_egm_loop.py")}
    assert programs | {Path("yumi_evaluation/report.html.jinja")} < files_of("yumi-evaluation")


def test_installation_reads_its_own_settings(installed: Path) -> None:
    code = f"import sys; sys.path.insert(0, {str(installed)!r}); {READ_SETTINGS}"
    assert run([sys.executable, "-c", code], installed).strip() == str(installed / "yumi" / "config")


DATA = f"{NAME}.data/data/"
IN_AMENT_INDEX = {
    "share/ament_index/resource_index/packages/yumi_ros2",
    "share/yumi_ros2/package.xml",
    "share/yumi_ros2/launch/yumi.launch.py",
    "lib/yumi_ros2/yumi",
}


def test_wheel_brings_what_the_tools_of_ros_look_for(wheel: Path) -> None:
    with ZipFile(wheel) as archive:
        data = {name.removeprefix(DATA): archive.getinfo(name) for name in archive.namelist() if name.startswith(DATA)}
    meshes = {f"share/yumi_ros2/meshes/{file.name}" for file in MESH_FOLDER.iterdir()}
    assert set(data) == IN_AMENT_INDEX | meshes
    assert data["lib/yumi_ros2/yumi"].external_attr >> 16 & 0o111  # pip keeps that it can be executed


ASK_INDEX = """
from pathlib import Path
from ament_index_python import get_package_prefix, get_package_share_directory, get_packages_with_prefixes
assert "yumi_ros2" in get_packages_with_prefixes()
print([path.name for path in Path(get_package_share_directory("yumi_ros2")).rglob("*.launch.py")])
print([path.name for path in Path(get_package_prefix("yumi_ros2"), "lib", "yumi_ros2").iterdir()])
"""


def test_package_launch_file_and_command_are_found_through_the_ament_index(wheel: Path, tmp_path: Path) -> None:
    pytest.importorskip("ament_index_python")
    with ZipFile(wheel) as archive:
        archive.extractall(tmp_path)
    found = run([sys.executable, "-c", ASK_INDEX], tmp_path, AMENT_PREFIX_PATH=str(tmp_path / DATA))
    assert found == "['yumi.launch.py']\n['yumi']\n"


def test_command_for_ros_starts_the_one_of_its_environment(tmp_path: Path) -> None:
    for folder in ("bin", "lib/yumi_ros2"):
        (tmp_path / folder).mkdir(parents=True)
    copy(ROOT / "resource" / "yumi", tmp_path / "lib" / "yumi_ros2" / "yumi")
    (tmp_path / "bin" / "yumi").write_text('#!/bin/sh\necho "here: $@"\n')
    (tmp_path / "bin" / "yumi").chmod(0o755)
    assert run([str(tmp_path / "lib" / "yumi_ros2" / "yumi"), "up", "--x"], tmp_path) == "here: up --x\n"


@pytest.mark.skipif(not RECORD.exists(), reason="a sourced ROS 2 brings its own message packages")
def test_wheel_of_a_platform_has_the_message_packages_and_nothing_of_the_machine(source: Path, tmp_path: Path) -> None:
    with ZipFile(build_wheel(source, tmp_path, YUMI_WHEEL_INTERFACES="1")) as archive:
        names = set(archive.namelist())
        texts = {name: archive.read(name) for name in names if not name.endswith(".so")}
        tags = archive.read(f"{NAME}.dist-info/WHEEL").decode()
    for package in sorted(path.parent.name for path in (ROOT / "interfaces").glob("*/package.xml")):
        assert {f"{package}/{name}" for name in ("__init__.py", f"{package}_s__rosidl_typesupport_c.so")} <= names
        loaded = (
            "generator_c",
            "generator_py",
            "typesupport_c",
            "typesupport_fastrtps_c",
            "typesupport_introspection_c",
        )
        assert {f"{DATA}lib/lib{package}__rosidl_{kind}.so" for kind in loaded} <= names
        index = f"{DATA}share/ament_index/resource_index"
        assert {f"{index}/packages/{package}", f"{index}/rosidl_interfaces/{package}"} <= names
    assert {f"{DATA}{name}" for name in IN_AMENT_INDEX} <= names
    suffixes = {Path(name).suffix for name in names if not name.startswith("yumi_evaluation/")}  # it has C programs
    assert suffixes.isdisjoint({".h", ".c", ".cmake", ".sh", ".pyc"})
    assert [name for name, text in texts.items() if str(Path(sys.prefix).resolve()).encode() in text] == []
    python, machine = f"cp{sys.version_info.major}{sys.version_info.minor}", platform.machine()
    assert f"Tag: {python}-{python}-linux_{machine}\n" in tags
    assert "Root-Is-Purelib: false" in tags


@pytest.fixture(scope="module")
def lists(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, str]]:
    """By file that `make wheels` writes beside the wheels: the version of each package, for this Python."""
    folder = tmp_path_factory.mktemp("lists")
    printed = run(["make", "--dry-run", "wheels"], ROOT)
    for command in re.findall(r"^\S*uv (export .*)", printed, re.MULTILINE):
        run([f"{sys.prefix}/bin/uv", "--offline", *command.replace("dist/", f"{folder}/").split()], ROOT)
    found: dict[str, dict[str, str]] = {}
    for file in folder.iterdir():
        lines = [line for line in file.read_text().replace("\\\n", " ").splitlines() if line]
        assert [line for line in lines if "--hash=sha256:" not in line] == []
        requirements = [Requirement(line.partition(" --hash")[0].strip()) for line in lines]
        wanted = [each for each in requirements if each.marker is None or each.marker.evaluate()]
        found[file.name] = {canonicalize_name(each.name): str(each.specifier).removeprefix("==") for each in wanted}
    return found


@pytest.mark.parametrize("name", ["requirements.txt", "requirements-ros.txt"])
def test_each_listed_package_is_what_the_tests_run_with(lists: dict[str, dict[str, str]], name: str) -> None:
    assert lists[name] == {package: metadata.version(package) for package in lists[name]}


def test_all_that_the_wheels_need_is_listed_and_no_more(lists: dict[str, dict[str, str]]) -> None:
    plain, with_ros = lists["requirements.txt"], lists["requirements-ros.txt"]
    assert {"aiohttp", "multidict", "numpy", "click"} <= plain.keys()
    assert not {"pytest", "ros-rclpy", "mcap", "mkdocs", "hatchling"} & plain.keys()
    assert plain.items() < with_ros.items()
    assert {"ros-rclpy", "ros-rmw-fastrtps-cpp", "mcap"} <= with_ros.keys()  # an extra of one names the second
    assert not {"lark-parser", "empy", "pytest", "ros-ament-cmake"} & with_ros.keys()
