"""README, the tutorial and every how-to work as they are written: their commands are run, from a clone of its own."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from doc_pages import LEFT_OUT, ROOT, BadPage, Fence, fences_of, help_examples, pages, read
from terminals import SERVER, Pages, Terminals, has_lines

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import SettingsError
from abb_protocols.robot.joints import Side
from refusals import assert_says
from yumi.driver.initial_controllers import check_controllers
from yumi.driver.settings import config_folder, read_controllers, read_settings

in_real_time = [pytest.mark.ros, pytest.mark.real_time, pytest.mark.timeout(300)]

NEEDS = {"docs/how-to/read-a-flight-record.md": "docs/tutorials/first-motion.md"}
"""Pages that go on where another one ended."""

ALONE = {"docs/how-to/real-robot.md"}
"""Pages that measure: the robot of that one sends ten times as often as a real one, and losses end its installation."""


@pytest.mark.parametrize(
    "page",
    [pytest.param(page, marks=[*in_real_time, *([pytest.mark.alone] if page in ALONE else [])]) for page in pages()],
)
def test_page_works_as_it_is_written(documentation: Pages, page: str) -> None:
    if page in NEEDS:
        documentation.run(NEEDS[page])
    documentation.run(page)


EXAMPLES = [
    ("docs/how-to/script-without-ros.md", "script_move_and_grip.py", "left gripper: holding at 20 mm"),
    ("docs/how-to/script-without-ros.md", "script_both_arms.py", "right arm: holding, left arm: holding"),
    ("docs/how-to/follow-a-stream.md", "stream_both_arms.py", "right arm: "),
    ("docs/how-to/plan-a-motion.md", "plan_around.py", "back at home"),
    ("docs/how-to/run-a-policy.md", "run_policy.py", " points replaced, "),
    ("docs/tutorials/first-motion.md", "move_one_joint.py", "EGM has ended on both arms"),
    ("docs/tutorials/first-motion.md", "bad_goal.py", "its range is -143.5° to 43.5°."),
    ("docs/tutorials/first-motion.md", "grip.py", "left gripper: holding, 20.0 mm between the fingers"),
]


@pytest.mark.parametrize(("page", "name", "says"), [pytest.param(*each, marks=in_real_time) for each in EXAMPLES])
def test_example_that_a_page_runs_does_what_it_says(documentation: Pages, page: str, name: str, says: str) -> None:
    """The page is run once for all tests."""
    outputs = documentation.run(page).outputs
    assert says in next(output for command, output in outputs.items() if name in command)


@pytest.mark.parametrize("page", pages())
def test_command_that_is_run_on_another_page_is_there(page: str) -> None:
    for fence in read(page):
        if fence.reason.startswith("as in "):
            there = [_bare(command) for each in read(fence.reason.removeprefix("as in ")) for command in each.commands]
            assert [command for command in fence.commands if _bare(command) not in there] == []


def test_example_of_help_that_is_run_on_a_page_is_there() -> None:
    for pattern, reason in LEFT_OUT.items():
        if reason.startswith("as in "):
            fences = [each for each in read(reason.removeprefix("as in ")) if not each.reason]
            commands = [_bare(command) for each in fences for command in each.commands]
            assert any(re.match(pattern, command) for command in commands), pattern


@pytest.mark.parametrize("page", pages())
def test_page_shows_python_that_is_run_and_settings_that_can_be_read(page: str, tmp_path: Path) -> None:
    fences = read(page)
    commands = " ".join(command for each in fences if each.language == "bash" for command in each.commands)
    for fence in fences:
        if fence.language == "yaml":
            read_yaml(fence.text, tmp_path)
        if fence.language == "python":
            compile(fence.text, page, "exec")
            examples = [file for file in (ROOT / "examples").glob("*.py") if fence.text in file.read_text()]
            is_run = not examples or any(f"examples/{file.name}" in commands for file in examples)
            assert is_run or fence.reason, f"{page}:{fence.line}: the page does not run the example it shows."


def read_yaml(text: str, folder: Path) -> None:
    """Read settings, or nodes of controllers.yaml in place of the delivered ones, as the driver does."""
    if not text.startswith("/"):
        (folder / "yumi.yaml").write_text(text)
        read_settings(folder / "yumi.yaml")
        return
    delivered = yaml.safe_load((config_folder() / "controllers.yaml").read_text())
    (folder / "controllers.yaml").write_text(yaml.safe_dump({**delivered, **yaml.safe_load(text)}))
    check_controllers({side: read_controllers(side, folder / "controllers.yaml") for side in Side})


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("gripper:\n  middle: servo", message("setting_unknown", place="yumi.yaml: gripper", setting="middle")),
        (
            "/**/joint_position_controller:\n  ros__parameters:\n    tracking.feed: true",
            message("controller_parameter_unknown", controller="joint_position_controller", parameter="tracking.feed"),
        ),
        (
            "/r/joint_controller:\n  ros__parameters:\n    p: 1.0",
            message("section_of_no_node", name="/r/joint_controller"),
        ),
    ],
)
def test_settings_that_the_driver_refuses_are_found(text: str, said: Message, tmp_path: Path) -> None:
    with pytest.raises(SettingsError) as refusal:
        read_yaml(text, tmp_path)
    found = refusal.value.said
    if found.code == "setting_refused":  # with its place
        found = found.values["reason"]
    assert_says(found, said.code, **said.values)


@pytest.fixture
def terminals(documentation: Pages, tmp_path: Path) -> Iterator[Terminals]:
    terminals = Terminals(documentation.clone, tmp_path)
    yield terminals
    terminals.close()


RESTART = "yumi fault warm-restart"


def examples_in_order() -> list[str]:
    """Each example of ``--help`` once: first the controller that the others ask, last what restarts the controller.

    0.2 s after a restart was asked for, the controller breaks every connection, and answers nothing for 20 s.
    """
    examples = dict.fromkeys(help_examples())
    return sorted(examples, key=lambda each: (each.startswith(RESTART), not each.startswith("yumi controller --left")))


def test_no_example_of_help_asks_a_controller_that_another_one_has_just_restarted() -> None:
    first, *_, last = (
        each for each in examples_in_order() if not any(re.match(left_out, each) for left_out in LEFT_OUT)
    )
    assert first.startswith("yumi controller --left")
    assert last.startswith(RESTART)


@pytest.mark.ros
@pytest.mark.real_time
@pytest.mark.timeout(120)
def test_examples_of_help_work(documentation: Pages, terminals: Terminals) -> None:
    examples = examples_in_order()
    assert len(examples) > 15
    ports = documentation.clone.ports
    (documentation.clone.root / "pick.mod").write_text("MODULE pick\nENDMODULE\n", encoding="utf-8")
    for command in examples:
        own = re.sub(rf"\b({'|'.join(ports)})\b", lambda port: ports[port[1]], command)
        reason = next((reason for pattern, reason in LEFT_OUT.items() if re.match(pattern, command)), "")
        if SERVER.match(own) and terminals.ran:
            reason = reason or "its port is taken by the one before"
        terminals.run(Fence("yumi --help", 1, "bash", own, f"not run: {reason}" if reason else ""))
    documentation.add("yumi --help", terminals)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("```\nyumi up\n```", "p:1: a fence of language ''"),
        ("```sh\nyumi up\n```", "p:1: a fence of language 'sh'"),
        ("<!-- not run -->\n```bash\nyumi up\n```", "p:1: 'not run' is not a mark of a fence"),
        (
            "<!-- not run: no reason -->\nText.\n```bash\nyumi up\n```",
            "p:2: the mark 'not run: no reason' is not above",
        ),
    ],
)
def test_fence_that_is_neither_run_nor_marked_is_found(text: str, sentence: str) -> None:
    with pytest.raises(BadPage, match=re.escape(sentence)):
        fences_of("p", text)


def test_marks_and_commands_of_a_page_are_read() -> None:
    text = """
<!-- not run: needs ros2 -->

```bash
ros2 topic list  # all
ros2 topic \\
  echo
```

<!-- test: Ctrl-C yumi up -->
"""
    first, last = fences_of("p", text)
    assert (first.reason, first.commands) == ("needs ros2", ["ros2 topic list  # all", "ros2 topic    echo"])
    assert (last.language, last.text) == ("Ctrl-C", "yumi up")


class Folder:
    """In place of a clone, where there is nothing of ours to run."""

    def __init__(self, root: Path) -> None:
        (root / "examples").mkdir()
        self.root = root
        self.environment = dict(os.environ)


def typed(folder: Path, text: str) -> Terminals:
    terminals = Terminals(Folder(folder), folder)
    try:
        for fence in fences_of("p", text):
            terminals.run(fence)
    finally:
        terminals.close()
    return terminals


ENDLESS = "python3 -c 'import time; print(\"waits\", flush=True); time.sleep(60)'"
ORDERLY = ENDLESS.replace("import time;", "import signal, time; signal.signal(2, lambda *_: exit());")


def test_commands_of_a_page_are_typed_in_order_and_their_output_is_compared(tmp_path: Path) -> None:
    page = (
        """
```bash
export WORD=hello
echo "$WORD after 1.25 s" > file.txt
cat file.txt  # shows it
```

<!-- output -->
```text
hello … 3 s
```

<!-- test: background, shows waits -->
```bash
"""
        + ORDERLY
        + """
```

<!-- test: Ctrl-C python3 -->

<!-- not run: needs ros2 -->
```bash
ros2 topic list
```
"""
    )
    terminals = typed(tmp_path, page)
    assert len(terminals.ran) == 4
    assert terminals.left_out == [("ros2 topic list", "needs ros2")]


@pytest.mark.parametrize(
    ("printed", "wanted"),
    [
        ("the arm moved by 3.1400 rad", "the arm moved by 0.0000 rad"),
        ("the arm moved by 0.0001 rad", "the arm moved by 0.0000 rad"),
        ("largest joint error 0.00210 rad", "largest joint error 0.00170 rad"),
        ("yumi_joint_3_r is 229.2°", "yumi_joint_2_r is 229.2°"),
        ("12 parts", "2 parts"),
        ("20 parts", "2 parts"),
        ("first\nsecond", "second\nfirst"),
        ("first", "first\nfirst"),
    ],
)
def test_output_that_says_something_else_is_found(printed: str, wanted: str) -> None:
    assert not has_lines(printed, wanted)


@pytest.mark.parametrize(
    ("printed", "wanted"),
    [
        ("[INFO] the arm moved by 0.0000 rad", "the arm moved by 0.0000 rad"),
        ("largest joint error 0.00158 rad", "largest joint error 0.00170 rad"),
        ("arrived after 12.7 s with 3 cycles", "arrived after 2.0 s with 3 cycles"),
        ("its range is -143.5° to 43.5°.", "its range is -143.5° to 43.5°."),
        ("zero\nfirst, then 1\nbetween\nsecond", "\n  first, … 1\nsecond"),
    ],
)
def test_output_may_differ_in_times_and_slightly_in_what_is_measured(printed: str, wanted: str) -> None:
    assert has_lines(printed, wanted)


@pytest.mark.parametrize(
    ("page", "sentence"),
    [
        ("```bash\nfalse\n```", "false ended with status 1"),
        ("```bash\necho 'Traceback (most recent call last):'\n```", "Traceback"),
        ("```bash\necho one\n```\n<!-- output -->\n```text\ntwo\n```", "p:5: not in the output:\none"),
        (f"<!-- test: background, shows waits -->\n```bash\n{ENDLESS}\n```", "KeyboardInterrupt"),
        (f"<!-- test: background, fails, shows waits -->\n```bash\n{ORDERLY}\n```", "ended with status 0"),
        ("<!-- test: background, shows never -->\n```bash\necho 1\n```", "ended without 'never'"),
    ],
)
def test_page_that_does_not_work_is_found(tmp_path: Path, page: str, sentence: str) -> None:
    with pytest.raises(AssertionError) as failure:
        typed(tmp_path, page)
    assert sentence in str(failure.value)


def _bare(command: str) -> str:
    """Without the comment."""
    return command.partition(" #")[0].strip()
