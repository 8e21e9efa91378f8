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
from prerequisites import Machine, inspect_machine

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def machine() -> Machine:
    return inspect_machine(())._replace(sourced=None, python=(3, 12))


class Ended:
    """A command that has succeeded at once."""

    def wait(self, _timeout: float | None = None) -> int:
        return 0

    def kill(self) -> None:
        pass


PACKAGES = "build interfaces products record ros"
"""The parts of every clone where no ROS 2 is sourced."""


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The steps that set-up took, in place of taking them; what is built is left out: the builders know what is new."""
    taken: list[str] = []

    def make_venv(clone: installation.Clone, _machine: Machine) -> None:
        taken.append("venv")
        shutil.rmtree(clone.venv, ignore_errors=True)
        clone.python.parent.mkdir(parents=True, exist_ok=True)
        clone.python.touch()

    monkeypatch.setattr(installation, "_make_venv", make_venv)
    monkeypatch.setattr(installation, "_install", lambda _clone, _machine, parts: taken.append(" ".join(parts)))
    monkeypatch.setattr(installation, "start", lambda *_: Ended())
    monkeypatch.setattr(installation, "_extend_activation", lambda *_: taken.append("activation"))
    monkeypatch.setattr(installation, "_build_interfaces", lambda *_: None)
    return taken


PYPROJECT = """\
# a clone
[dependency-groups]
products = ["yumi-ros2"]
planning = ["pin"]
record = [
  "mcap>=1",
]
test = ["pytest"]

[tool.ruff]
line-length = 100
"""


@pytest.fixture
def clone(tmp_path: Path, machine: Machine, steps: list[str]) -> Path:
    """A clone that has been set up."""
    (tmp_path / "uv.lock").write_text("version = 1\n")
    (tmp_path / "pyproject.toml").write_text(PYPROJECT)
    installation.install(str(tmp_path), machine)
    assert steps == ["venv", PACKAGES, "activation"]
    steps.clear()
    return tmp_path


def test_setup_does_nothing_the_second_time(clone: Path, machine: Machine, steps: list[str]) -> None:
    installation.install(str(clone), machine)
    assert steps == []


@pytest.mark.parametrize(
    ("file", "text", "expected"),
    [
        ("uv.lock", "version = 2\n", [PACKAGES]),
        ("pyproject.toml", PYPROJECT.replace("pytest", "tox"), [PACKAGES]),
        ("pyproject.toml", PYPROJECT.replace("100", "120"), []),
        ("package.xml", "<package/>\n", [PACKAGES]),
        ("packages/driver/pyproject.toml", PYPROJECT, [PACKAGES]),
    ],
)
def test_setup_repeats_only_what_changed(
    clone: Path, machine: Machine, steps: list[str], file: str, text: str, expected: list[str]
) -> None:
    (clone / file).parent.mkdir(parents=True, exist_ok=True)
    (clone / file).write_text(text)
    installation.install(str(clone), machine)
    assert steps == expected


@pytest.mark.parametrize("change", [{"python": (3, 13)}, {"sourced": "jazzy"}])
def test_setup_starts_anew_for_another_python_or_ros(
    clone: Path, machine: Machine, steps: list[str], change: dict[str, object]
) -> None:
    installation.install(str(clone), machine._replace(**change))
    assert steps[0] == "venv"
    assert steps[2] == "activation"


def test_setup_starts_anew_when_the_venv_is_gone(clone: Path, machine: Machine, steps: list[str]) -> None:
    (clone / ".venv" / "bin" / "python").unlink()
    installation.install(str(clone), machine)
    assert steps == ["venv", PACKAGES, "activation"]


def test_parts_that_were_asked_for_stay(clone: Path, machine: Machine, steps: list[str]) -> None:
    installation.install(str(clone), machine, ["planning"])
    installation.install(str(clone), machine, ["test"])
    installation.install(str(clone), machine)
    with_planning = "build interfaces planning products record ros"
    assert steps == [with_planning, f"{with_planning} test"]


def test_parts_stay_where_the_environment_is_made_anew(clone: Path, machine: Machine, steps: list[str]) -> None:
    installation.install(str(clone), machine, ["planning"])
    steps.clear()
    installation.install(str(clone), machine._replace(python=(3, 13)))
    assert steps == ["venv", "build interfaces planning products record ros", "activation"]


def test_core_and_message_packages_are_asked_for_each_time(
    clone: Path, machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []
    monkeypatch.setattr(installation, "start", lambda command, *_: asked.append(command[-1]) or Ended())
    monkeypatch.setattr(installation, "_build_interfaces", lambda *_: asked.append("interfaces"))
    installation.install(str(clone), machine)
    assert asked == ["egm", "yumi.core.library", "interfaces"]


def test_part_that_does_not_exist_is_refused_before_anything_is_done(
    clone: Path, machine: Machine, steps: list[str]
) -> None:
    with pytest.raises(
        commands.InstallationFailed, match=r"no part 'planing'; there are: planning, products, record, test$"
    ):
        installation.install(str(clone), machine, ["planing"])
    assert steps == []


def test_part_that_is_no_longer_in_pyproject_is_forgotten(clone: Path, machine: Machine, steps: list[str]) -> None:
    installation.install(str(clone), machine, ["planning"])
    (clone / "pyproject.toml").write_text(PYPROJECT.replace("planning =", "plans ="))
    installation.install(str(clone), machine)
    assert steps == ["build interfaces planning products record ros", PACKAGES]


def test_sourced_ros_needs_none_from_the_index(clone: Path, machine: Machine, steps: list[str]) -> None:
    installation.install(str(clone), machine._replace(sourced="jazzy"))
    assert steps == ["venv", "build products record", "activation"]


def test_core_that_cannot_be_compiled_ends_set_up(
    clone: Path, machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("abb-protocols/src", "yumi-ros2/src/yumi/core", "yumi-ros2/src/yumi/texts"):
        shutil.copytree(
            ROOT / "packages" / name, clone / "packages" / name, ignore=shutil.ignore_patterns("libcore.so")
        )
    shutil.copy(ROOT / "packages/yumi-ros2/src/yumi/__init__.py", clone / "packages/yumi-ros2/src/yumi")
    monkeypatch.setattr(installation, "start", commands.start)
    monkeypatch.setenv("CXX", "no-such-compiler")
    for _ in range(2):
        with pytest.raises(commands.InstallationFailed, match="the core could not be compiled"):
            installation.install(str(clone), machine)


def test_failed_step_is_not_recorded(clone: Path, machine: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise commands.InstallationFailed("uv could not install the packages")

    monkeypatch.setattr(installation, "_install", fail)
    (clone / "uv.lock").write_text("version = 2\n")
    before = json.loads((clone / ".venv" / "yumi-setup.json").read_text())
    with pytest.raises(commands.InstallationFailed, match="uv could not install"):
        installation.install(str(clone), machine)
    assert json.loads((clone / ".venv" / "yumi-setup.json").read_text()) == before


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("error: Failed to fetch: `https://x`\n  Caused by: error sending request for url", "index cannot be reached"),
        ("  Caused by: failed to write: No space left on device (os error 28)", "the disk is full"),
        ("error: Hash mismatch for `x==1`", "is not the one that uv.lock has the hash of"),
        ("error: x==1 has no wheel for this platform", "it failed; see"),
    ],
)
def test_failing_command_is_told_in_one_sentence(tmp_path: Path, words: str, sentence: str) -> None:
    log = tmp_path / "step.log"
    command = [sys.executable, "-c", f"print({words!r}); raise SystemExit(1)"]
    with pytest.raises(commands.InstallationFailed, match=sentence) as refusal:
        commands.run(command, log, "it failed", {})
    assert str(log) in str(refusal.value)
    assert words in log.read_text()


def test_setup_tells_when_it_is_done(
    clone: Path, machine: Machine, steps: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    installation.install(str(clone), machine)
    assert steps == []
    (clone / "uv.lock").write_text("version = 2\n")
    capsys.readouterr()
    installation.install(str(clone), machine)
    assert capsys.readouterr().out == "setup: done in 0 s\n"


@pytest.fixture
def venv(tmp_path: Path) -> Path:
    """An empty environment whose activation set-up has extended."""
    clone = installation.Clone(tmp_path)
    run([f"{sys.prefix}/bin/uv", "venv", "--no-project", "--python", sys.executable, str(clone.venv)])
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


def test_variables_of_make_do_not_reach_the_tools(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MAKEFLAGS", "-j8")
    code = "import os; print(os.environ.get('MAKEFLAGS'), os.environ['OTHER'])"
    commands.run([sys.executable, "-c", code], tmp_path / "log", "it failed", {"OTHER": "here"})
    assert (tmp_path / "log").read_text() == "None here\n"


@pytest.mark.parametrize("sourced", [None, "jazzy"])
def test_uv_installs_what_is_locked_and_leaves_numpy_to_a_sourced_ros(
    tmp_path: Path, machine: Machine, monkeypatch: pytest.MonkeyPatch, sourced: str | None
) -> None:
    ran: list[list[str]] = []
    monkeypatch.setattr(installation, "_uv", lambda _clone, _program, command, *_: ran.append(command))
    (tmp_path / "pyproject.toml").write_text(PYPROJECT)
    installation._install(installation.Clone(tmp_path), machine._replace(sourced=sourced), ["planning", "test"])
    (command,) = ran
    assert command[:2] == ["sync", "--frozen"]
    assert {"--only-group=planning", "--only-group=test"} < set(command)
    assert ("--no-install-package=numpy" in command) == (sourced is not None)


LOCK = (ROOT / "uv.lock").read_text()


def test_every_file_of_the_lock_has_a_hash() -> None:
    files = re.findall(r"\{ url = .*", LOCK)
    assert len(files) > 1000
    assert [file for file in files if 'hash = "sha256:' not in file] == []


def test_lock_is_of_the_pyproject_that_is_here() -> None:
    """`make lock` writes both; what each names is compared, since uv may not be there."""
    _, _, groups = LOCK.partition("\n[manifest.dependency-groups]\n")
    names = re.findall(r"^([\w-]+) = \[", groups.partition("\n\n[")[0], re.MULTILINE)
    assert sorted(names) == sorted(installation.parts_of(ROOT / "pyproject.toml"))
    members = re.search(r"^members = \[(.*?)^\]", LOCK, re.MULTILINE | re.DOTALL)
    assert members is not None
    folders = sorted(each.name for each in (ROOT / "packages").iterdir())
    assert sorted(re.findall(r'"(.*)"', members[1])) == folders


def test_the_two_larks_are_not_installed_over_each_other() -> None:
    assert '\nname = "lark"\n' in LOCK
    assert '\nname = "lark-parser"\n' not in LOCK
