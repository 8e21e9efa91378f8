from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import commands
import installation
import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from prerequisites import Machine, inspect_machine

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def machine() -> Machine:
    return inspect_machine(())._replace(sourced=None, python=(3, 12))


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The steps that set-up took, in place of taking them."""
    taken: list[str] = []

    def make_venv(clone: installation.Clone, _machine: Machine) -> None:
        taken.append("venv")
        shutil.rmtree(clone.venv, ignore_errors=True)
        clone.python.parent.mkdir(parents=True, exist_ok=True)
        clone.python.touch()

    monkeypatch.setattr(installation, "_make_venv", make_venv)
    monkeypatch.setattr(installation, "_install_packages", lambda *_: taken.append("packages"))
    monkeypatch.setattr(installation, "_install_clone", lambda *_: taken.append("clone"))
    monkeypatch.setattr(installation, "_compile_library", lambda *_: taken.append("library"))
    monkeypatch.setattr(installation, "_extend_activation", lambda *_: taken.append("activation"))
    monkeypatch.setattr(installation, "_build_interfaces", lambda *_: taken.append("interfaces"))
    return taken


@pytest.fixture
def clone(tmp_path: Path, machine: Machine, steps: list[str]) -> Path:
    """A clone that has been set up."""
    (tmp_path / "interfaces" / "a_msgs" / "msg").mkdir(parents=True)
    (tmp_path / "interfaces" / "a_msgs" / "msg" / "Thing.msg").write_text("float64 value\n")
    (tmp_path / "src" / "yumi" / "robot").mkdir(parents=True)
    (tmp_path / "constraints.txt").write_text("numpy==2.0\nros-rclpy==7.1.6\n")
    (tmp_path / "pyproject.toml").write_text('[project]\nname = "x"\n\n[tool.ruff]\nline-length = 100\n')
    installation.install(str(tmp_path), machine)
    assert steps == ["venv", "packages", "clone", "library", "activation", "interfaces"]
    steps.clear()
    return tmp_path


def test_setup_does_nothing_the_second_time(clone: Path, machine: Machine, steps: list[str]) -> None:
    installation.install(str(clone), machine)
    assert steps == []


@pytest.mark.parametrize(
    ("file", "text", "expected"),
    [
        ("constraints.txt", "numpy==2.1\n", ["packages"]),
        ("pyproject.toml", '[project]\nname = "y"\n', ["clone"]),
        ("pyproject.toml", '[project]\nname = "x"\n\n[tool.ruff]\nline-length = 120\n', []),
        ("package.xml", "<package/>\n", ["clone"]),
        ("src/yumi/robot/collision.cpp", "// another\n", ["library"]),
        ("interfaces/a_msgs/msg/Thing.msg", "float32 value\n", ["interfaces"]),
    ],
)
def test_setup_repeats_only_what_changed(
    clone: Path, machine: Machine, steps: list[str], file: str, text: str, expected: list[str]
) -> None:
    (clone / file).write_text(text)
    installation.install(str(clone), machine)
    assert steps == expected


@pytest.mark.parametrize("change", [{"python": (3, 13)}, {"sourced": "jazzy"}])
def test_setup_starts_anew_for_another_python_or_ros(
    clone: Path, machine: Machine, steps: list[str], change: dict[str, object]
) -> None:
    installation.install(str(clone), machine._replace(**change))
    assert steps[:5] == ["venv", "packages", "clone", "library", "activation"]


def test_setup_starts_anew_when_the_venv_is_gone(clone: Path, machine: Machine, steps: list[str]) -> None:
    (clone / ".venv" / "bin" / "python").unlink()
    installation.install(str(clone), machine)
    assert steps == ["venv", "packages", "clone", "library", "activation", "interfaces"]


def test_failed_step_is_not_recorded(clone: Path, machine: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise commands.InstallationFailed("pip could not install the packages")

    monkeypatch.setattr(installation, "_install_packages", fail)
    (clone / "constraints.txt").write_text("numpy==2.1\n")
    before = json.loads((clone / ".venv" / "yumi-setup.json").read_text())
    with pytest.raises(commands.InstallationFailed, match="pip could not install"):
        installation.install(str(clone), machine)
    assert json.loads((clone / ".venv" / "yumi-setup.json").read_text()) == before


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (
            "Retrying (Retry(total=0) after connection broken by 'NewConnectionError(",
            "pip cannot reach the package index",
        ),
        ("OSError: [Errno 28] No space left on device", "the disk is full"),
        ("ERROR: THESE PACKAGES DO NOT MATCH THE HASHES FROM THE REQUIREMENTS FILE.", "is not the one that"),
        ("ERROR: No matching distribution found for x==1", "it failed; its words are in"),
    ],
)
def test_failing_command_is_told_in_one_sentence(tmp_path: Path, words: str, sentence: str) -> None:
    log = tmp_path / "step.log"
    command = [sys.executable, "-c", f"print({words!r}); raise SystemExit(1)"]
    with pytest.raises(commands.InstallationFailed, match=sentence) as refusal:
        commands.run(command, log, "it failed")
    assert str(log) in str(refusal.value)
    assert words in log.read_text()


def test_long_command_tells_how_far_it_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = [sys.executable, "-c", "print('Collecting x==1\\n' * 81)"]
    commands.run(command, tmp_path / "step.log", "it failed")
    assert capsys.readouterr().out == "setup: 40 packages fetched\nsetup: 80 packages fetched\n"


def test_setup_tells_when_it_is_done(
    clone: Path, machine: Machine, steps: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    installation.install(str(clone), machine)
    assert steps == []
    (clone / "constraints.txt").write_text("numpy==2.1\n")
    capsys.readouterr()
    installation.install(str(clone), machine)
    assert capsys.readouterr().out == "setup: done in 0 s\n"


@pytest.fixture
def venv(tmp_path: Path) -> Path:
    """An empty environment whose activation set-up has extended."""
    clone = installation.Clone(tmp_path)
    run([sys.executable, "-m", "venv", "--without-pip", str(clone.venv)])
    installation._extend_activation(clone)
    return clone.venv


def run(command: list[str], **variables: str) -> str:
    environment = {"PATH": os.environ["PATH"], **variables}
    return subprocess.run(command, capture_output=True, text=True, check=True, env=environment).stdout


SHOW = 'echo "${AMENT_PREFIX_PATH-unset} ${ROS_DISTRO-unset}"'


def test_activation_sets_what_the_tools_of_ros_need_and_deactivation_takes_it_back(venv: Path) -> None:
    script = f"set -eu; . {venv}/bin/activate; {SHOW}; . {venv}/bin/activate; {SHOW}; deactivate; {SHOW}"
    assert run(["bash", "-c", script]).splitlines() == [f"{venv} jazzy", f"{venv} jazzy", "unset unset"]


def test_activation_goes_before_a_sourced_ros_and_leaves_it_afterwards(venv: Path) -> None:
    script = f". {venv}/bin/activate; {SHOW}; deactivate; {SHOW}"
    sourced = {"AMENT_PREFIX_PATH": "/opt/ros/kilted", "ROS_DISTRO": "kilted"}
    assert run(["bash", "-c", script], **sourced).splitlines() == [
        f"{venv}:/opt/ros/kilted kilted",
        "/opt/ros/kilted kilted",
    ]


def test_activation_is_extended_once_however_often_set_up_does_it(venv: Path) -> None:
    before = (venv / "bin" / "activate").read_text()
    installation._extend_activation(installation.Clone(venv.parent))
    assert (venv / "bin" / "activate").read_text() == before


def test_pip_is_kept_to_the_virtual_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MAKEFLAGS", "-j8")
    given = commands.environment()
    assert (given["PIP_REQUIRE_VIRTUALENV"], given["PIP_USER"]) == ("1", "0")
    assert "MAKEFLAGS" not in given


@pytest.mark.parametrize("sourced", [None, "jazzy"])
def test_pip_is_given_every_pin_with_its_hashes_and_refuses_others(
    tmp_path: Path, machine: Machine, monkeypatch: pytest.MonkeyPatch, sourced: str | None
) -> None:
    runs: list[tuple[list[str], str]] = []

    def note(_python: Path, arguments: list[str], _log: Path) -> None:
        runs.append((arguments, Path(arguments[-1]).read_text()))

    monkeypatch.setattr(installation, "pip_install", note)
    (tmp_path / "constraints.txt").write_text(
        "# all\nclick==8.5.1 \\\n    --hash=sha256:aa \\\n    --hash=sha256:bb\n"
        "numpy==2.0 ; python_full_version < '3.11' \\\n    --hash=sha256:cc\n"
        "ros-rclpy==7.1.6 \\\n    --hash=sha256:dd\n"
    )
    clone = installation.Clone(tmp_path)
    clone.logs.mkdir(parents=True)
    installation._install_packages(clone, machine._replace(sourced=sourced))
    arguments, text = runs[-1]
    assert {"--require-hashes", "--no-deps", "--requirement"} <= set(arguments)
    expected = ["click==8.5.1 --hash=sha256:aa --hash=sha256:bb"]
    if sourced is None:
        expected += ["numpy==2.0 ; python_full_version < '3.11' --hash=sha256:cc", "ros-rclpy==7.1.6 --hash=sha256:dd"]
    assert text.splitlines() == expected


def test_every_pin_has_hashes() -> None:
    pins = installation.pins(installation.Clone(ROOT))
    assert len(pins) > 100
    assert [pin for pin in pins if "--hash=sha256:" not in pin] == []


def pinned() -> dict[str, list[Requirement]]:
    """Each package of constraints.txt with its pins, one per range of Python versions."""
    pins: dict[str, list[Requirement]] = {}
    for line in (ROOT / "constraints.txt").read_text().splitlines():
        if "==" in line:
            requirement = Requirement(line.rstrip(" \\"))
            pins.setdefault(canonicalize_name(requirement.name), []).append(requirement)
    return pins


def declared() -> list[Requirement]:
    """What pyproject.toml asks for, without what a clone leaves out (``setup/excluded.txt``)."""
    excluded = (ROOT / "setup" / "excluded.txt").read_text().split("\n")
    tables = re.search(r"(?ms)^dependencies = \[.*?^\[tool", (ROOT / "pyproject.toml").read_text())
    assert tables is not None
    found = [Requirement(words) for words in re.findall(r'^(?:plot = \[|  )"([^"]+)"', tables[0], re.MULTILINE)]
    return [requirement for requirement in found if requirement.name not in excluded]


@pytest.mark.parametrize("requirement", declared(), ids=lambda requirement: requirement.name)
def test_every_declared_package_is_pinned_within_its_range(requirement: Requirement) -> None:
    pins = pinned()[canonicalize_name(requirement.name)]
    versions = [next(iter(pin.specifier)).version for pin in pins]
    assert all(requirement.specifier.contains(version) for version in versions)


def test_the_two_larks_are_not_installed_over_each_other() -> None:
    assert "lark" in pinned()
    assert "lark-parser" not in pinned()
