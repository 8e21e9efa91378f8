"""What GitHub and pre-commit read: the files can be parsed, and what they run is there."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from doc_pages import ROOT

WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
FORMS = sorted(set((ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml")) - {ROOT / ".github/ISSUE_TEMPLATE/config.yml"})
MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")
VARIABLE = re.compile(r"YUMI_[A-Z_]+")


def parsed(file: Path) -> Any:
    return yaml.safe_load(file.read_text(encoding="utf-8"))


def commands(workflow: Path) -> list[str]:
    return [step["run"] for job in parsed(workflow)["jobs"].values() for step in job["steps"] if "run" in step]


@pytest.mark.parametrize("file", WORKFLOWS, ids=lambda file: file.stem)
def test_target_that_a_workflow_makes_is_there(file: Path) -> None:
    targets = [target for command in commands(file) for target in re.findall(r"\bmake ([\w-]+)", command)]
    assert targets
    assert [target for target in targets if not re.search(rf"^{target}:", MAKEFILE, re.MULTILINE)] == []


@pytest.mark.parametrize("file", WORKFLOWS, ids=lambda file: file.stem)
def test_job_of_a_workflow_is_bounded_and_may_only_read(file: Path) -> None:
    workflow = parsed(file)
    assert workflow["permissions"] == {"contents": "read"}
    assert all(job["timeout-minutes"] <= 180 for job in workflow["jobs"].values())


def test_commands_of_the_readme_run_on_every_supported_python() -> None:
    (job,) = parsed(ROOT / ".github/workflows/test.yml")["jobs"].values()
    first, last = re.search(
        r'requires-python = ">=3\.(\d+),<3\.(\d+)"', (ROOT / "packages/yumi-ros2/pyproject.toml").read_text()
    ).groups()  # type: ignore[union-attr]
    assert job["strategy"]["matrix"]["python"] == [f"3.{minor}" for minor in range(int(first), int(last))]
    (fence,) = re.findall(r"```bash\n(make demo.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    shown = re.findall(r"^make [\w-]+", fence, re.MULTILINE)
    run = [command.partition(" PYTHON=")[0] for command in commands(ROOT / ".github/workflows/test.yml")]
    assert shown[:2] == run == ["make demo", "make test"]


def test_bound_of_a_long_test_that_the_nightly_workflow_sets_is_one() -> None:
    bounds = set(VARIABLE.findall((ROOT / ".github/workflows/nightly.yml").read_text()))
    assert bounds
    assert bounds <= set(VARIABLE.findall((ROOT / "docs/how-to/soak.md").read_text()))


@pytest.mark.parametrize("file", FORMS, ids=lambda file: file.stem)
def test_form_of_an_issue_has_what_github_demands(file: Path) -> None:
    form = parsed(file)
    assert {"name", "description", "body"} <= form.keys()
    inputs = [field for field in form["body"] if field["type"] != "markdown"]
    assert len({field["id"] for field in inputs}) == len(inputs)
    assert all(field["attributes"]["label"] for field in inputs)
    assert {field["type"] for field in inputs} <= {"dropdown", "input", "textarea", "checkboxes"}


def test_form_asks_for_robot_robotware_and_the_report_of_the_doctor() -> None:
    fields = [field.get("id") for field in parsed(ROOT / ".github/ISSUE_TEMPLATE/robot.yml")["body"]]
    assert {"robot", "robotware", "doctor"} <= set(fields)


def test_what_pre_commit_runs_is_there() -> None:
    (repository,) = parsed(ROOT / ".pre-commit-config.yaml")["repos"]
    (hook,) = repository["hooks"]
    target = re.fullmatch(r"make ([\w-]+)", hook["entry"])
    assert target is not None
    assert re.search(rf"^{target[1]}:", MAKEFILE, re.MULTILINE)


def test_dependabot_looks_at_packages_and_actions() -> None:
    assert [each["package-ecosystem"] for each in parsed(ROOT / ".github/dependabot.yml")["updates"]] == [
        "uv",
        "github-actions",
    ]
