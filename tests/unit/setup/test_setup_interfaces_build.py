from __future__ import annotations

from pathlib import Path

import pytest
from build import Package, find_packages, fingerprints


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


def changed(before: dict[str, str], after: dict[str, str]) -> set[str]:
    return {name for name in before if before[name] != after[name]}


def test_packages_come_after_those_they_depend_on(interfaces: Path) -> None:
    names = [package.name for package in find_packages(interfaces)]
    assert sorted(names) == ["a_msgs", "m_msgs", "z_msgs"]
    assert names.index("z_msgs") < names.index("a_msgs")


def test_folder_without_a_description_is_no_package(interfaces: Path) -> None:
    (interfaces / "notes").mkdir()
    assert "notes" not in {package.name for package in find_packages(interfaces)}


@pytest.mark.parametrize(("touched", "rebuilt"), [("m_msgs", {"m_msgs"}), ("z_msgs", {"z_msgs", "a_msgs"})])
def test_changed_file_rebuilds_its_package_and_the_dependents(
    interfaces: Path, touched: str, rebuilt: set[str]
) -> None:
    before = fingerprints(find_packages(interfaces), b"")
    (interfaces / touched / "msg" / "Thing.msg").write_text("float32 value\n")
    assert changed(before, fingerprints(find_packages(interfaces), b"")) == rebuilt


def test_new_file_rebuilds_its_package(interfaces: Path) -> None:
    before = fingerprints(find_packages(interfaces), b"")
    (interfaces / "m_msgs" / "msg" / "Other.msg").write_text("")
    assert changed(before, fingerprints(find_packages(interfaces), b"")) == {"m_msgs"}


def test_other_recipe_rebuilds_everything(interfaces: Path) -> None:
    packages = find_packages(interfaces)
    assert changed(fingerprints(packages, b"one"), fingerprints(packages, b"two")) == {"a_msgs", "m_msgs", "z_msgs"}


def test_package_is_built_outside_its_sources(interfaces: Path) -> None:
    package = Package("m_msgs", interfaces / "m_msgs", frozenset())
    assert interfaces not in package.tree.parents
