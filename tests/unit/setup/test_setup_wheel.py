"""What an installation has beside Python: settings, RAPID, configurations, the grammar, the EGM schema."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from shutil import copy, copytree, ignore_patterns
from zipfile import ZipFile

import pytest

from conftest import ROOT

READ_SETTINGS = (
    "import yumi.driver.settings as s; from yumi.robot.joints import Side; "
    "s.read_settings(); [s.read_controllers(side) for side in Side]; print(s.config_folder())"
)


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the sources, since builders write beside what they build."""
    folder = tmp_path_factory.mktemp("source")
    for name in ("pyproject.toml", "setup.py", "setup.cfg", "README.md", "LICENSE", "package.xml"):
        copy(ROOT / name, folder)
    for name in ("src", "config", "resource", "launch"):
        copytree(ROOT / name, folder / name, ignore=ignore_patterns("__pycache__", "*.egg-info"))
    return folder


@pytest.fixture(params=["wheel", "colcon"])
def installed(request: pytest.FixtureRequest, source: Path, tmp_path: Path) -> Path:
    """The folder where `yumi` would be found, as each of the two builders makes it."""
    if request.param == "wheel":
        run([sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)], source)
        (wheel,) = tmp_path.glob("*.whl")
        with ZipFile(wheel) as archive:
            archive.extractall(tmp_path / "lib")
    else:
        lib = ["--build-lib", str(tmp_path / "lib")]
        run(
            [sys.executable, "setup.py", "-q", "build", "-b", str(tmp_path), *lib],
            source,
        )
    return tmp_path / "lib"


def run(command: list[str], folder: Path) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_installation_has_every_file_of_the_package(installed: Path) -> None:
    package = ROOT / "src" / "yumi"
    files = {path.relative_to(package) for path in package.rglob("*") if path.is_file() and path.suffix != ".pyc"}
    assert {Path("rapid/grammar.lark"), Path("egm/egm.proto"), Path("virtual/controller/stock/EIO.cfg")} < files
    assert {Path("controller_files/TRobSG.mod"), Path("controller_files/TRobSystem.sys")} < files
    assert [str(path) for path in sorted(files) if not (installed / "yumi" / path).is_file()] == []


def test_installation_has_the_programs_of_the_benchmark_and_the_template_of_the_report(installed: Path) -> None:
    package = ROOT / "src" / "yumi_evaluation"
    files = {path.relative_to(package) for path in package.rglob("*") if path.is_file() and path.suffix != ".pyc"}
    sources = Path("bench/sources")
    assert {sources / "load_generator.c", sources / "echo.c", sources / "requirements.txt"} < files
    assert {sources / "abb_robot_egm_loop.py", Path("report.html.jinja")} < files
    assert [str(path) for path in sorted(files) if not (installed / "yumi_evaluation" / path).is_file()] == []


def test_installation_reads_its_own_settings(installed: Path) -> None:
    code = f"import sys; sys.path.insert(0, {str(installed)!r}); {READ_SETTINGS}"
    assert run([sys.executable, "-c", code], installed).strip() == str(installed / "yumi" / "config")
