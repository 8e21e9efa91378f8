"""What a plain installation imports is among its dependencies; what an extra brings is imported where it is needed."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from importlib.metadata import packages_distributions
from pathlib import Path

import installation
import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[3]


OF_EXTRAS = ("yumi/ros/", "yumi/testing/", "virtual_irc5/testing/", "yumi/cli/rapid_command.py")
"""Files that are imported by ROS's commands, by tests and by the plug-in alone."""

DRIVER = ROOT / "packages" / "yumi-ros2"
PACKAGES = sorted((ROOT / "packages").iterdir())


def declared(package: Path) -> set[str]:
    """The distributions that `pip install` of a package brings without an extra, as its pyproject.toml lists them."""
    table = re.search(r"^dependencies = \[(.*?)^\]", (package / "pyproject.toml").read_text(), re.MULTILINE | re.DOTALL)
    assert table is not None
    return {canonicalize_name(Requirement(each).name) for each in re.findall(r'^  "([^"]+)"', table[1], re.MULTILINE)}


def imported(file: Path) -> Iterator[str]:
    """The top-level modules of others that are imported as soon as the file is, types alone left out."""
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Import):
            yield from (name.name.partition(".")[0] for name in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield (node.module or "").partition(".")[0]


@cache
def distributions_of_modules() -> dict[str, list[str]]:
    """The distributions that have a top-level module."""
    ours = {each.name.replace("-", "_"): [each.name] for each in PACKAGES} | {"yumi": ["yumi-ros2"]}
    # Python 3.10 does not find out whose a namespace package is.
    return {"google": ["protobuf"], **packages_distributions(), **ours}


PRODUCTS = [each for each in PACKAGES if each.name != "yumi-evaluation"]


@pytest.mark.parametrize("package", PRODUCTS, ids=lambda package: package.name)
def test_every_package_that_is_imported_at_once_is_a_dependency(package: Path) -> None:
    distributions, source, missing = distributions_of_modules(), package / "src", []
    needed = declared(package)
    for file in sorted(source.rglob("*.py")):
        path = str(file.relative_to(source))
        if path.startswith(OF_EXTRAS) or "/bench/sources/" in path:
            continue
        for module in set(imported(file)) - set(sys.stdlib_module_names) - {path.partition("/")[0]}:
            names = {canonicalize_name(each) for each in distributions.get(module, [module])}
            if not names & needed:
                missing.append(f"{path} imports {module}")
    assert missing == []


def test_every_extra_that_a_sentence_names_can_be_installed() -> None:
    named = {("virtual-irc5", "robotware7"), ("yumi-ros2", "robotware7")}  # of certificates: a caller names its product
    texts = {file: file.read_text(encoding="utf-8") for file in sorted((ROOT / "packages").rglob("*.py"))}
    for file, text in texts.items():
        for node in ast.walk(ast.parse(text)) if "missing_extra" in text else ():
            is_call = isinstance(node, ast.Call) and getattr(node.func, "id", "") == "missing_extra"
            if is_call and file.name != "certificate.py":
                package, extra = (ast.literal_eval(each) for each in node.args[1:])
                named.add((package, extra))
    assert {extra for _, extra in named} >= {"planning", "data", "plot", "record", "evaluation", "virtual"}
    for package, extra in named:
        pyproject = ROOT / "packages" / package / "pyproject.toml"
        assert extra in installation.parts_of(pyproject, "project.optional-dependencies"), package
        assert extra in installation.parts_of(ROOT / "pyproject.toml")


@pytest.mark.parametrize("target", ["demo", "check", "test", "test-real-time", "soak", "docs", "wheels"])
def test_every_part_that_make_installs_is_in_pyproject(target: str) -> None:
    printed = subprocess.run(["make", "--dry-run", target], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    parts = [part for line in re.findall(r"-E -S setup(.*)", printed) for part in line.split()]
    known = set(installation.parts_of(ROOT / "pyproject.toml"))
    assert "-E -S setup" in printed
    assert set(parts) <= known


def test_demonstration_installs_no_part_of_its_own() -> None:
    printed = subprocess.run(["make", "--dry-run", "demo"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert re.findall(r"-E -S setup(.*)", printed) == [""]
