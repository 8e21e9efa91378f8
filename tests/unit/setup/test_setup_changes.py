"""A change that users can notice brings a fragment for the changelog."""

from __future__ import annotations

import subprocess
from pathlib import Path

import check_changes
import pytest

ROOT = Path(__file__).resolve().parents[3]


class Repository:
    """A clone with a branch that begins at ``main``."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.git("init", "--quiet", "--initial-branch", "main")
        self.commit(
            "Begin",
            {"packages/yumi-ros2/src/yumi/arm.py": "1", "pyproject.toml": (ROOT / "pyproject.toml").read_text()},
        )
        self.git("switch", "--quiet", "--create", "branch")

    def git(self, *arguments: str) -> None:
        identity = ("-c", "user.name=Test", "-c", "user.email=test@example.org")
        subprocess.run(["git", *identity, *arguments], cwd=self.root, check=True)

    def commit(self, message: str, files: dict[str, str]) -> None:
        for name, text in files.items():
            (self.root / name).parent.mkdir(parents=True, exist_ok=True)
            (self.root / name).write_text(text)
        self.git("add", "--all")
        self.git("commit", "--quiet", "--message", message)

    def missing(self) -> str:
        return check_changes.missing_fragment(self.root)


@pytest.fixture
def repository(tmp_path: Path) -> Repository:
    return Repository(tmp_path)


def test_changed_package_without_a_fragment_is_refused(repository: Repository) -> None:
    repository.commit("Move faster", {"packages/yumi-ros2/src/yumi/arm.py": "2"})
    assert repository.missing().startswith(
        "packages/yumi-ros2/src/yumi/arm.py has changed since main, and changelog.d/ has no new fragment. Write "
        "changelog.d/NUMBER.KIND.md (KIND is added, changed, removed, fixed or security), or put the line “Changelog: "
    )


def test_removed_file_of_the_package_without_a_fragment_is_refused(repository: Repository) -> None:
    (repository.root / "packages/yumi-ros2/src/yumi/arm.py").unlink()
    repository.commit("Remove the arm", {})
    assert repository.missing().startswith("packages/yumi-ros2/src/yumi/arm.py has changed")


@pytest.mark.parametrize(
    "commits",
    [
        [
            (
                "Move faster",
                {"packages/yumi-ros2/src/yumi/arm.py": "2", "changelog.d/31.changed.md": "The arm moves faster."},
            )
        ],
        [
            ("Move faster", {"packages/yumi-ros2/src/yumi/arm.py": "2"}),
            ("List it", {"changelog.d/31.changed.md": "Faster."}),
        ],
        [("Release", {"packages/yumi-ros2/src/yumi/__init__.py": "2", "CHANGELOG.md": "## 1.0.0"})],
        [("Name the joint\n\nChangelog: none", {"packages/yumi-ros2/src/yumi/arm.py": "2"})],
        [("Explain the arm", {"docs/index.md": "2", "tests/test_arm.py": "2"})],
        [],
    ],
    ids=["with a fragment", "fragment in another commit", "release", "said to be unnoticed", "pages and tests", "none"],
)
def test_change_that_needs_no_other_fragment_passes(
    repository: Repository, commits: list[tuple[str, dict[str, str]]]
) -> None:
    for message, files in commits:
        repository.commit(message, files)
    assert repository.missing() == ""


def test_page_about_fragments_is_none(repository: Repository) -> None:
    repository.commit(
        "Move faster", {"packages/yumi-ros2/src/yumi/arm.py": "2", "changelog.d/README.md": "# Fragments"}
    )
    assert "no new fragment" in repository.missing()


def test_removed_fragment_is_none(repository: Repository) -> None:
    repository.git("switch", "--quiet", "main")
    repository.commit("List", {"changelog.d/30.added.md": "A gripper."})
    repository.git("switch", "--quiet", "branch")
    repository.git("merge", "--quiet", "main")
    (repository.root / "changelog.d/30.added.md").unlink()
    repository.commit("Move faster", {"packages/yumi-ros2/src/yumi/arm.py": "2"})
    assert "no new fragment" in repository.missing()


def test_archive_without_git_has_nothing_to_compare_with(tmp_path: Path) -> None:
    (tmp_path / ".git").write_text("gitdir: /nonexistent\n")
    assert check_changes.missing_fragment(tmp_path) == ""


@pytest.mark.parametrize(
    ("name", "text", "sentence"),
    [
        ("31.md", "Faster.", "changelog.d/31.md: name it NUMBER.KIND.md or +WORDS.KIND.md; KIND is added, "),
        ("31.feature.md", "Faster.", "changelog.d/31.feature.md: name it NUMBER.KIND.md"),
        ("31.added.md", "\n", "changelog.d/31.added.md: write one or two sentences"),
        (
            "31.added.md",
            "- Faster.",
            "changelog.d/31.added.md: write one or two sentences, without a heading",
        ),
        ("+faster.added.md", "f" * 301, "changelog.d/+faster.added.md: 301 characters; a line of the changelog has at"),
    ],
)
def test_fragment_that_is_no_line_of_a_changelog_is_refused(
    repository: Repository, name: str, text: str, sentence: str
) -> None:
    repository.commit("Fast", {f"changelog.d/{name}": text, "changelog.d/README.md": "# Fragments"})
    (found,) = check_changes.unfit_fragments(repository.root)
    assert found.startswith(sentence)


def test_fragments_of_this_clone_are_fit() -> None:
    assert check_changes.unfit_fragments() == []
    assert check_changes.kinds() == ["added", "changed", "removed", "fixed", "security"]
