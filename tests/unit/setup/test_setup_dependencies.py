"""What a plain installation imports is among its dependencies; what an extra brings is imported where it is needed."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from importlib.metadata import packages_distributions
from pathlib import Path

import installation
import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[3]


SOURCE = ROOT / "src" / "yumi"
OF_EXTRAS = ("ros/", "testing/pytest_plugin.py")
"""Files that are imported by ROS's commands and by pytest alone."""


def declared() -> set[str]:
    """The distributions that `pip install` brings without an extra."""
    table = re.search(r"^dependencies = \[(.*?)^\]", (ROOT / "pyproject.toml").read_text(), re.MULTILINE | re.DOTALL)
    assert table is not None
    return {canonicalize_name(Requirement(each).name) for each in re.findall(r'^  "([^"]+)"', table[1], re.MULTILINE)}


def imported(file: Path) -> Iterator[str]:
    """The top-level modules of others that are imported as soon as the file is, types alone left out."""
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Import):
            yield from (name.name.partition(".")[0] for name in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield (node.module or "").partition(".")[0]


def test_every_package_that_is_imported_at_once_is_a_dependency() -> None:
    # Python 3.10 does not find out whose a namespace package is.
    distributions, missing = {"google": ["protobuf"], **packages_distributions()}, []
    for file in sorted(SOURCE.rglob("*.py")):
        path = str(file.relative_to(SOURCE))
        if path.startswith(OF_EXTRAS):
            continue
        for module in set(imported(file)) - set(sys.stdlib_module_names) - {"yumi"}:
            names = {canonicalize_name(each) for each in distributions.get(module, [module])}
            if not names & declared():
                missing.append(f"{path} imports {module}")
    assert missing == []


def test_every_extra_that_a_sentence_names_can_be_installed() -> None:
    named = set()
    for file in sorted((ROOT / "src").rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "missing_extra":
                (extra,) = (each.value for each in node.args[1:] if isinstance(each, ast.Constant))
                named.add(extra)
    assert {"planning", "data", "plot", "record", "robotware7", "evaluation"} <= named
    assert named <= set(installation.parts_of(ROOT / "pyproject.toml", "project.optional-dependencies"))


@pytest.mark.parametrize("target", ["demo", "check", "test", "test-real-time", "soak", "docs", "wheels"])
def test_every_part_that_make_installs_is_in_pyproject(target: str) -> None:
    printed = subprocess.run(["make", "--dry-run", target], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    parts = [part for line in re.findall(r"-E -S setup(.*)", printed) for part in line.split()]
    known = {part for table in installation.TABLES for part in installation.parts_of(ROOT / "pyproject.toml", table)}
    assert "-E -S setup" in printed
    assert set(parts) <= known


def test_demonstration_installs_no_part_of_its_own() -> None:
    printed = subprocess.run(["make", "--dry-run", "demo"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert re.findall(r"-E -S setup(.*)", printed) == [""]
