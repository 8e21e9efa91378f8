from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import build
import pytest
from build import Build, BuildFailed, cache_folder, compiler_command, find_packages, fingerprint

ROOT = Path(__file__).resolve().parents[3]


def write_package(folder: Path, name: str, *dependencies: str) -> None:
    (folder / name / "msg").mkdir(parents=True)
    depends = "".join(f"<depend>{dependency}</depend>" for dependency in dependencies)
    (folder / name / "package.xml").write_text(f"<package><name>{name}</name>{depends}</package>")
    (folder / name / "msg" / "Thing.msg").write_text("float64 value\n")


@pytest.fixture
def interfaces(tmp_path: Path) -> Path:
    """Three packages: a_msgs needs z_msgs, and m_msgs needs nothing."""
    write_package(tmp_path, "a_msgs", "std_msgs", "z_msgs")
    write_package(tmp_path, "m_msgs")
    write_package(tmp_path, "z_msgs")
    return tmp_path


def test_packages_come_after_those_they_depend_on(interfaces: Path) -> None:
    names = [package.name for package in find_packages(interfaces)]
    assert sorted(names) == ["a_msgs", "m_msgs", "z_msgs"]
    assert names.index("z_msgs") < names.index("a_msgs")


def test_folder_without_a_description_is_no_package(interfaces: Path) -> None:
    (interfaces / "notes").mkdir()
    assert "notes" not in {package.name for package in find_packages(interfaces)}


@pytest.mark.parametrize(
    ("file", "text"),
    [("m_msgs/msg/Thing.msg", "float32 value\n"), ("m_msgs/msg/Other.msg", ""), ("m_msgs/package.xml", "<package/>")],
)
def test_changed_definition_is_built_anew(interfaces: Path, file: str, text: str) -> None:
    before = fingerprint(find_packages(interfaces), b"")
    (interfaces / file).write_text(text)
    assert fingerprint(find_packages(interfaces), b"") != before


def test_other_tools_build_anew(interfaces: Path) -> None:
    packages = find_packages(interfaces)
    assert fingerprint(packages, b"one") != fingerprint(packages, b"two")


def test_note_beside_the_definitions_builds_nothing(interfaces: Path) -> None:
    before = fingerprint(find_packages(interfaces), b"")
    (interfaces / "m_msgs" / "README.md").write_text("about\n")
    assert fingerprint(find_packages(interfaces), b"") == before


def test_cache_is_in_the_folder_that_the_user_names(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", "/elsewhere")
    assert cache_folder() == Path("/elsewhere/yumi-ros2/messages")
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", "/home/someone")
    assert cache_folder() == Path("/home/someone/.cache/yumi-ros2/messages")


def test_missing_compiler_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CXX", raising=False)
    monkeypatch.setenv("PATH", "")
    with pytest.raises(BuildFailed, match=r"^no C\+\+ compiler was found; .*apt install g\+\+"):
        compiler_command()


def test_compiler_with_its_arguments_is_taken_from_cxx(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CXX", "ccache g++")
    assert compiler_command() == ["ccache", "g++"]


@pytest.fixture
def environment(tmp_path: Path, interfaces: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An environment for the message packages of a folder, with a cache of its own, where nothing is compiled."""
    prefix = tmp_path / "venv"
    (prefix / "share").mkdir(parents=True)
    monkeypatch.setattr(build, "PREFIX", prefix)
    monkeypatch.setattr(build, "SOURCES", interfaces)
    monkeypatch.setattr(build, "_tools", lambda _compiler: b"")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))

    def run(made: Build) -> None:
        for package in made.packages:
            library = made.result / "lib" / f"lib{package.name}.so"
            library.parent.mkdir(parents=True, exist_ok=True)
            library.write_bytes(b"")

    monkeypatch.setattr(Build, "run", run)
    return prefix


@pytest.mark.parametrize("name", ["ros_std_msgs", "numpy"])
def test_other_version_of_what_is_compiled_against_is_another_fingerprint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    site_packages = tmp_path / build.SITE_PACKAGES
    (site_packages / f"{name}-1.0.dist-info").mkdir(parents=True)
    (site_packages / "rich-1.0.dist-info").mkdir()
    monkeypatch.setattr(build, "PREFIX", tmp_path)
    before = build._tools(["true"])
    (site_packages / "rich-1.0.dist-info").rename(site_packages / "rich-2.0.dist-info")
    assert build._tools(["true"]) == before
    (site_packages / f"{name}-1.0.dist-info").rename(site_packages / f"{name}-2.0.dist-info")
    assert build._tools(["true"]) != before


def libraries(environment: Path) -> list[str]:
    return sorted(path.name for path in (environment / "lib").iterdir())


def test_second_environment_takes_from_the_cache_what_the_first_has_compiled(
    environment: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    build.build(tmp_path / "log")
    assert libraries(environment) == ["liba_msgs.so", "libm_msgs.so", "libz_msgs.so"]
    second = tmp_path / "second"
    (second / "share").mkdir(parents=True)
    monkeypatch.setattr(build, "PREFIX", second)
    monkeypatch.setattr(Build, "run", lambda _made: pytest.fail("compiled once more"))
    build.build(tmp_path / "log")
    assert libraries(second) == libraries(environment)


def test_package_that_is_gone_is_taken_out_of_the_environment(
    environment: Path, interfaces: Path, tmp_path: Path
) -> None:
    build.build(tmp_path / "log")
    (interfaces / "m_msgs" / "package.xml").unlink()
    build.build(tmp_path / "log")
    assert libraries(environment) == ["liba_msgs.so", "libz_msgs.so"]


def test_nothing_is_left_in_the_cache_by_a_build_that_fails(
    environment: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_made: Build) -> None:
        raise BuildFailed("c++ failed")

    monkeypatch.setattr(Build, "run", fail)
    with pytest.raises(BuildFailed, match="failed"):
        build.build(tmp_path / "log")
    assert list(cache_folder().iterdir()) == []
    assert not (environment / build.RECORD).exists()


def test_cache_that_cannot_be_written_is_named(
    environment: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    with pytest.raises(BuildFailed, match=r"/file/.*; name a folder that can be written in XDG_CACHE_HOME"):
        build.build(tmp_path / "log")


@pytest.mark.skipif(not (Path(sys.prefix) / build.RECORD).exists(), reason="a sourced ROS 2 brings its own")
def test_message_is_generated_compiled_and_loaded(tmp_path: Path) -> None:
    """A package of one message that depends on another one of this folder, in the environment of the tests."""
    write_package(tmp_path, "z_test_msgs")
    write_package(tmp_path, "a_test_msgs", "z_test_msgs", "std_msgs")
    message = "std_msgs/Header header\nz_test_msgs/Thing[] things\nfloat64[7] joints\n"
    (tmp_path / "a_test_msgs" / "msg" / "Thing.msg").write_text(message)
    code = (
        "import sys; from pathlib import Path; import build; work = Path(sys.argv[1]); (work / 'work').mkdir(); "
        "build.Build(build.find_packages(work), build.compiler_command(), work / 'work', work / 'log').run()"
    )
    run([sys.executable, "-c", code, str(tmp_path)], PYTHONPATH=str(ROOT / "interfaces"))
    result = tmp_path / "work" / "result"
    asked = (
        "from rclpy.serialization import deserialize_message, serialize_message; from a_test_msgs.msg import Thing; "
        "from z_test_msgs.msg import Thing as Part; "
        "sent = Thing(things=[Part(value=2.0)], joints=[float(n) for n in range(7)]); "
        "print(deserialize_message(serialize_message(sent), Thing) == sent)"
    )
    libraries = f"{result / 'lib'}:{os.environ.get('LD_LIBRARY_PATH', '')}"
    modules = str(result / build.SITE_PACKAGES)
    variables = {"PYTHONPATH": modules, "LD_LIBRARY_PATH": libraries, "AMENT_PREFIX_PATH": str(result)}
    assert run([sys.executable, "-c", asked], **variables) == "True\n"


def run(command: list[str], **variables: str) -> str:
    done = subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, **variables})
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_colcon_finds_the_package_that_no_ros_has() -> None:
    """Its CMakeLists.txt is read by colcon alone, and takes every definition of the folder."""
    text = (ROOT / "interfaces" / "yumi_interfaces" / "CMakeLists.txt").read_text()
    assert re.search(r"^project\(yumi_interfaces ", text, re.MULTILINE)
    assert all(f"{kind}/*.{kind}" in text for kind in ("msg", "srv", "action"))
