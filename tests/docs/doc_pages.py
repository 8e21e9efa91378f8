"""Pages of the documentation as something that can be run: fences, and marks that say how.

A fence has a language. Commands are ``bash``; they are run, one after another, as in a terminal, unless an HTML comment
above the fence says otherwise:

================================================ ===================================================================
mark                                             meaning
================================================ ===================================================================
``<!-- not run: REASON -->``                     listed with the reason; ``as in PAGE``: they are run there
``<!-- test: background -->``                    started and left; it ends by itself, or with the page, in order
``<!-- test: background, fails, shows TEXT -->`` the same, but ends with an error; goes on when it has shown TEXT
``<!-- output -->``                              a ``text`` fence: the commands above it have printed these lines
``<!-- output of COMMAND -->``                   the same of a background command that begins so
``<!-- test: Ctrl-C COMMAND -->``                without a fence: ends a background command that begins so
================================================ ===================================================================

``yumi controller`` and ``yumi up`` are background commands by themselves.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import click

from yumi.cli.main import main

ROOT = Path(__file__).parents[2]
LANGUAGES = {"bash", "python", "text", "yaml", "json", "rapid", "mermaid"}
OF_THE_EVALUATION = ("bench", "compare", "evaluate", "measure", "tune")
IN_TEST_COMMANDS = "needs a driver; tests/system/test_commands.py runs it"

LEFT_OUT = {
    r"ros2 ": "needs ros2",
    r".*192\.168\.": "needs a real robot",
    r"yumi demo|yumi evaluate|yumi bench|yumi tune": "takes long; has tests of its own",
    r"yumi compare": "needs a log; tests/unit/evaluation/test_evaluation_comparison.py runs it",
    r"yumi measure": "takes a minute; tests/system/test_measure.py runs it",
    r"yumi doctor --robot 127": "as in docs/how-to/real-robot.md",
    r"yumi fault egm-loss ": "as in docs/how-to/inject-a-fault.md",
    r"yumi rapid check --json": "tests/unit/cli/test_cli_rapid_check.py runs it",
    r"yumi record list$": "as in docs/how-to/read-a-flight-record.md",
    r"yumi record list --folder": "tests/unit/recording/test_recording_refused_files.py runs it",
    r"yumi record (show|export)|yumi up --record": "needs a record; docs/how-to/read-a-flight-record.md shows one",
    r"yumi up --robot 127": "as in docs/tutorials/first-motion.md",
    r"yumi (state|controllers|mode|start|stop|recover|calibrate|grip|move|switch|speed-scale)\b": IN_TEST_COMMANDS,
    r"yumi teleop": "needs a driver and a device; tests/unit/cli/test_cli_teleop.py runs it",
    r"yumi give-back": "as in docs/how-to/who-commands-an-arm.md",
    r"yumi retreat": "needs a driver; tests/unit/cli/test_cli_robot.py runs it",
    r"yumi (topics|echo|call|param)\b": IN_TEST_COMMANDS,
    r"yumi view": "a page for a person; tests/system/test_view_page.py opens it",
    r"virtual-irc5 view": "a page for a person; tests/system/test_view_controller.py opens it",
    r"yumi moveit-config": "writes where it is told; tests/unit/cli/test_cli_moveit.py runs it",
    r"yumi answer": "needs a question; tests/contract/test_rws_dialogs.py answers one",
    r"yumi shell": "a prompt; has tests of its own",
    r"yumi install": "restarts the controller that the other examples use; docs/how-to/real-robot.md has it",
    r"yumi rws (get|set|ls|put|watch|call) ": "tests/unit/cli/test_cli_rws.py has each",
    r"printf .* yumi rapid debug": "docs/how-to/run-your-own-rapid.md has it, for the virtual controller of that page",
    r"yumi completion fish": "needs fish",
}
"""Examples of ``--help`` that are not run, by their beginning."""

_MARKS = re.compile(r"not run: .+|test: background(, fails)?(, shows .+)?|output( of .+)?")
_CTRL_C = re.compile(r"<!-- test: Ctrl-C (.+) -->")
_FENCE = re.compile(r"^ *```(\S*)$")
_COMMENT = re.compile(r"^ *<!-- (.*) -->$")


class BadPage(Exception):
    """A page that says of a fence neither what it is nor how it is run."""


@dataclass(frozen=True)
class Fence:
    """A fenced block, or a Ctrl-C (language "Ctrl-C", the command's beginning as its text).

    Attributes:
        page: where it is, from the clone's root.
        line: its first line.
        language: after the backticks.
        text: what is in it.
        mark: of the comment above it; empty without one.
    """

    page: str
    line: int
    language: str
    text: str
    mark: str = ""

    @property
    def reason(self) -> str:
        """Why it is not run; empty when it is."""
        return self.mark.removeprefix("not run: ") if self.mark.startswith("not run: ") else ""

    @property
    def commands(self) -> list[str]:
        """Its commands: one a line, but for a line that ends with a backslash."""
        lines = self.text.replace("\\\n", " ").splitlines()
        return [line.strip() for line in lines if line.strip() and not line.lstrip().startswith("#")]


def fences_of(page: str, text: str) -> list[Fence]:
    """All fences of a page, in order.

    Raises:
        BadPage: a fence has no language or an unknown one, or a mark is none.
    """
    found: list[Fence] = []
    begin, language, content, mark = 0, "", [], ""
    for number, line in enumerate(text.splitlines(), 1):
        fence, comment = _FENCE.match(line), _COMMENT.match(line)
        if fence and not begin:
            begin, language, content = number, fence[1], []
            if language not in LANGUAGES:
                raise BadPage(f"{page}:{number}: a fence of language {language!r}; it is one of {sorted(LANGUAGES)}.")
        elif fence:
            found.append(Fence(page, begin, language, "\n".join(content), mark))
            begin, mark = 0, ""
        elif begin:
            content.append(line)
        elif end := _CTRL_C.match(line):
            found.append(Fence(page, number, "Ctrl-C", end[1]))
        elif comment and not comment[1].startswith("Written by "):
            mark = comment[1]
            if not _MARKS.fullmatch(mark):
                raise BadPage(f"{page}:{number}: {mark!r} is not a mark of a fence; see {Path(__file__).name}.")
        elif line.strip() and mark:
            raise BadPage(f"{page}:{number}: the mark {mark!r} is not above a fence.")
    return found


def pages() -> list[str]:
    """The pages whose commands must work: README, tutorials and how-tos."""
    return ["README.md", *(str(file.relative_to(ROOT)) for name in ("tutorials", "how-to") for file in _pages_in(name))]


def help_examples() -> Iterator[str]:
    """All commands under "Example" in the help of ``yumi`` and its commands."""
    context = click.Context(main)
    names = [name for name in main.list_commands(context) if name not in OF_THE_EVALUATION]
    own = {f"yumi {name}": main.get_command(context, name) for name in names}
    commands = {"yumi": main, **{path: each for path, each in own.items() if each is not None}}
    for path, group in own.items():
        if isinstance(group, click.Group):
            commands |= {f"{path} {name}": each for name, each in group.commands.items()}
    for path, command in commands.items():
        _, found, examples = (command.help or "").replace("{command}", path).partition("Example")
        for line in examples.splitlines()[1:] if found else ():
            if not line.strip():
                break
            yield re.split(r"\s{2,}", line.strip())[0]


def other_pages() -> list[str]:
    """The other pages: what is fenced in them is not run, and says why."""
    files = (
        *(ROOT / "docs").rglob("*.md"),
        ROOT / "CONTRIBUTING.md",
        ROOT / "packages/abb-protocols/src/abb_protocols/controller_files/README.md",
    )
    return sorted({str(file.relative_to(ROOT)) for file in files} - set(pages()))


def inventory() -> tuple[int, Counter[str]]:
    """How many commands and scripts of all pages and of ``--help`` the tests run, and why the others are not."""
    run, left_out = 0, Counter[str]()
    for page in (*pages(), *other_pages()):
        for fence in read(page):
            count = len(fence.commands) if fence.language == "bash" else int(fence.language == "python")
            if fence.reason:
                left_out[fence.reason] += count
            else:
                run += count
    for command in dict.fromkeys(help_examples()):
        reason = next((reason for pattern, reason in LEFT_OUT.items() if re.match(pattern, command)), "")
        left_out[reason] += bool(reason)
        run += not reason
    del left_out[""]
    return run, left_out


def read(page: str, root: Path = ROOT) -> list[Fence]:
    """The fences of a page of the clone at ``root``."""
    return fences_of(page, (root / page).read_text(encoding="utf-8"))


def _pages_in(folder: str) -> list[Path]:
    return sorted((ROOT / "docs" / folder).glob("*.md"))
