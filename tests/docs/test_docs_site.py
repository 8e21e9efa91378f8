"""The pages as a site: navigation and links are complete, and every command has a test or a reason."""

from __future__ import annotations

import re
import sys
from functools import cache
from importlib import import_module
from inspect import signature
from pathlib import Path

import click
import pytest
import yaml
from doc_pages import ROOT, inventory, other_pages, pages, read

sys.path.append(str(ROOT / "setup"))

import docs_site

import yumi
from abb_protocols.robot.joints import Side, joint_names
from yumi.cli.main import main
from yumi.control.controllers.trajectory_parameters import trajectory_parameters
from yumi.driver.bringup import BRINGUP_ANNOUNCEMENT
from yumi.driver.launch_checks import REQUIRED_OPTIONS
from yumi.driver.settings import Settings
from yumi.driver.speed_setting import FIRST_SPEED_SCALE

DOCS = ROOT / "docs"
REAL_ROBOT = "docs/how-to/real-robot.md"
SCRIPT = "docs/how-to/script-without-ros.md"
FILES = sorted(DOCS.rglob("*.md"))
_LINK = re.compile(r"(?<!`)\[[^\]]*\]\(([^)\s]+)\)")


def _text(page: str) -> str:
    return (ROOT / page).read_text(encoding="utf-8")


def navigation() -> list[str]:
    """The pages that mkdocs.yml names, and those that the hook adds."""

    def flat(entry: object) -> list[str]:
        if isinstance(entry, str):
            return [entry]
        parts = entry.values() if isinstance(entry, dict) else entry if isinstance(entry, list) else ()
        return [page for part in parts for page in flat(part)]

    class Loader(yaml.SafeLoader):
        """mkdocs.yml may name Python objects."""

    return [*flat(yaml.load((ROOT / "mkdocs.yml").read_text(), Loader)["nav"]), *docs_site.decisions().values()]


def anchors(text: str) -> set[str]:
    """The anchors of a page's headings, as Markdown makes them."""
    titles = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.replace("`", "").lower()).strip().replace(" ", "-") for title in titles}


def test_navigation_names_every_page_once() -> None:
    named = navigation()
    assert sorted(named) == sorted(
        {*(str(file.relative_to(DOCS)) for file in DOCS.rglob("*.md")), *docs_site.GENERATED}
    )


def test_links_of_a_page_lead_somewhere() -> None:
    pages = (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *FILES)
    assert {str(page): found for page in pages if (found := broken(page))} == {}


def broken(page: Path) -> list[str]:
    """The links of a page that lead nowhere."""
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    lost = []
    for target in _LINK.findall(text):
        file, _, anchor = target.partition("#")
        if "://" in target or target.startswith("mailto:"):
            continue
        place = (page.parent / file).resolve() if file else page
        generated = str(place).removeprefix(f"{DOCS}/") in docs_site.GENERATED
        found = generated or place.exists()
        if found and anchor and not generated and place.suffix == ".md":
            found = anchor in anchors(place.read_text(encoding="utf-8"))
        if not found:
            lost.append(target)
    return lost


def test_page_about_the_real_robot_says_which_options_are_needed_and_which_are_not() -> None:
    rows = re.findall(r"^\| option (\S+) ([^|]+?) \| (.*) \|$", _text(REAL_ROBOT), re.MULTILINE)
    needed = {f"{number} {name}" for number, name, text in rows if text.startswith("needed: ")}
    assert needed == {option.partition(" (")[0] for option in REQUIRED_OPTIONS}
    others = {number: text for number, name, text in rows if f"{number} {name}" not in needed}
    assert others.pop("604-1").startswith("needed, and part of every YuMi")
    assert sorted(others) == ["616-1", "623-1"]
    assert all(text.startswith("not needed: ") for text in others.values())


def test_page_about_the_real_robot_begins_with_what_was_never_tried_and_leads_to_a_slow_first_motion() -> None:
    text, settings = _text(REAL_ROBOT), Settings()
    title, first, *_ = text.split("\n\n")
    assert title.startswith("# ")
    assert first.startswith("**None of this has run on a real controller yet.**")
    parts = dict(re.findall(r"^## (.*)\n((?:(?!^## ).*\n?)*)", text, re.MULTILINE))
    assert f"sudo ufw allow {settings.egm.left_port}:{settings.egm.right_port}/udp" in parts["Network"]
    assert "yumi doctor --robot 192.168.125.1" in parts["Steps"]
    assert "**Look without touching**: `yumi up --robot 192.168.125.1` connects" in parts["Steps"]
    assert "**Bring it up**: `yumi up --robot 192.168.125.1 --bringup`" in parts["Steps"]
    moves = parts["What moves at `yumi up`"]
    assert BRINGUP_ANNOUNCEMENT in moves
    for step in ("Motors on", "Program pointers to main, start", "Calibrate a gripper", "End the EGM motion"):
        assert f"- *{step}" in moves
    motion = " ".join(parts["The first motion"].split())
    assert f"Everything moves at a tenth of its speed at first (`speed_scale` is {FIRST_SPEED_SCALE:g})" in motion
    assert "keep the emergency stop within reach" in motion


def test_page_about_security_says_how_to_use_sros_2_and_what_no_setting_protects() -> None:
    text = " ".join(_text("docs/how-to/secure-ros.md").split())
    before, _, sros = text.partition("## SROS 2")
    assert "EGM and Robot Web Services are not encrypted" in before
    assert "who overhears a request can send it again for five minutes" in before
    for command in ("create_keystore", "create_enclave", "create_permission", "generate_policy"):
        assert f"ros2 security {command}" in sros
    assert "ROS_SECURITY_ENABLE=true ROS_SECURITY_STRATEGY=Enforce" in sros


def test_picture_of_a_page_is_described() -> None:
    for file in (ROOT / "README.md", *DOCS.rglob("*.md")):
        assert "![](" not in file.read_text(encoding="utf-8"), file


def test_link_out_of_the_pages_becomes_the_name_of_the_file() -> None:
    page = DOCS / "reference" / "egm.md"
    assert (
        docs_site.rewritten("see [`egm.proto`](../../packages/abb-protocols/src/abb_protocols/egm/egm.proto).", page)
        == "see `egm.proto`."
    )
    named = docs_site.rewritten("see [the schema](../../packages/abb-protocols/src/abb_protocols/egm/egm.proto)", page)
    assert named == "see the schema `packages/abb-protocols/src/abb_protocols/egm/egm.proto`"
    shown = docs_site.rewritten(
        '[`EGMReset`](../../packages/abb-protocols/src/abb_protocols/egm/egm.proto "Reset"), [`Stop`](../../LICENSE)',
        page,
    )
    file = "packages/abb-protocols/src/abb_protocols/egm/egm.proto"
    assert shown == f'`EGMReset`{{ title="{file}: Reset" }}, `Stop`{{ title="LICENSE" }}'
    for kept in ("[x](egm.md#a)", "[x](https://example.org/a)"):
        assert docs_site.rewritten(kept, page) == kept


def test_chart_of_the_pages_is_drawn_without_another_host() -> None:
    (source,) = re.findall(r"```mermaid\n(.*?)```", _text("docs/reference/readiness.md"), re.DOTALL)
    drawn = docs_site.chart(source)
    assert drawn.count("<rect") == 2 * source.count("{") + 1
    for words in ("the motors are on?", "call start_egm", "EGM can start"):
        assert words in drawn
    with pytest.raises(ValueError, match="a chain of questions, which this is none of: a --> b"):
        docs_site.chart("flowchart TD\n  a --> b\n")


def test_what_belongs_to_a_list_item_stays_in_the_list() -> None:
    """MkDocs ends a list at a block that is not four columns in, and counts from 1 again."""
    text = (
        "1. One\n   goes on.\n\n   ```bash\n   - x\n     y\n   ```\n\n2. Two\n   - inner\n     more\n\nText\n"
        "```\n   code\n```\n"
    )
    assert docs_site.indented(text) == (
        "1. One\n    goes on.\n\n    ```bash\n    - x\n      y\n    ```\n\n2. Two\n    - inner\n        more\n\nText\n"
        "```\n   code\n```\n"
    )


def test_no_link_of_the_site_leads_out_of_the_pages() -> None:
    """`make docs` would end with it."""
    outside = []
    for file in FILES:
        text = re.sub(r"```.*?```", "", docs_site.rewritten(file.read_text(encoding="utf-8"), file), flags=re.DOTALL)
        targets = [each.partition("#")[0] for each in re.findall(r"\]\(([^)\s]+)", text) if "://" not in each]
        outside += [(file, each) for each in targets if not (file.parent / each).resolve().is_relative_to(DOCS)]
    assert outside == []


def test_first_page_begins_as_the_readme_does() -> None:
    page = docs_site.with_readme((ROOT / "docs" / "index.md").read_text(encoding="utf-8"))
    assert "](images/yumi.webp)" in page
    assert "](images/view.webp)](how-to/view-and-operate.md)" in page
    assert page.index('Drive an ABB IRB 14000 "YuMi"') < page.index("make demo") < page.index("| you want to | read |")
    assert "<!-- Written" not in page
    assert page.count("\n# ") + page.startswith("# ") == 1
    for target in re.findall(r"\]\(([^)#]+)", docs_site.rewritten(page, ROOT / "docs" / "index.md")):
        assert "://" in target or (ROOT / "docs" / target).exists() or target in docs_site.GENERATED, target


def test_readme_shows_the_page_of_a_virtual_robot_before_the_tests() -> None:
    commands = re.findall(r"^(?:make \w+|\.venv/bin/yumi [\w -]*\w)", _text("README.md"), re.MULTILINE)
    assert commands[:3] == ["make demo", ".venv/bin/yumi view --virtual", "make test"]


def test_python_api_has_a_page_for_each_class() -> None:
    def classes(page: Path) -> list[str]:
        """The classes that mkdocstrings writes into a page."""
        found = re.findall(r"^::: ([\w.]+)\.(\w+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
        return [name for module, name in found if isinstance(getattr(import_module(module), name, None), type)]

    assert classes(DOCS / "reference" / "python-api.md") == []
    named = {page.stem: classes(page) for page in (DOCS / "reference" / "python").glob("*.md")}
    assert {"Robot", "Arm", "Gripper", "Motion", "RunningDriver"} <= {name for each in named.values() for name in each}
    assert {page: each for page, each in named.items() if len(each) > 2} == {}


@pytest.mark.parametrize("name", ["up", "controller", "doctor"])
def test_command_with_many_options_has_them_as_a_list_and_each_is_one_of_its_own(name: str) -> None:
    text = _text("docs/reference/command-line.md")
    (row,) = re.findall(rf"^\| `yumi {name}` \|.*$", text, re.MULTILINE)
    assert row.count("--") == 0
    (listed,) = re.findall(rf"^Options of `yumi {name}`.*:\n\n((?:(?:- |  ).*\n)+)", text, re.MULTILINE)
    command = main.get_command(click.Context(main), name)
    assert command is not None
    own = {option for each in command.params for option in (*each.opts, *each.secondary_opts)}
    assert listed.count("\n- ") > 1
    assert set(re.findall(r"`(--[\w-]+)", listed)) - own <= {"--ros-args"}  # which ROS takes


def test_factors_that_multiply_are_a_table_with_the_defaults_of_connect() -> None:
    rows = dict(re.findall(r"^\| `(\w+)` \|.*\| ([^|]+) \| `connect\(", _text(SCRIPT), re.MULTILINE))
    given = signature(yumi.connect).parameters
    assert {name: float(rows[name]) for name in ("default_speed_scale", "acceleration")} == {
        name: given[name].default for name in ("default_speed_scale", "acceleration")
    }
    assert rows["speed_scale"] == f"1 on this machine, {FIRST_SPEED_SCALE:g} elsewhere"


def test_page_about_streams_has_python_and_slow_streams() -> None:
    text = _text("docs/how-to/follow-a-stream.md")
    parts = dict(re.findall(r"^## (.*)\n((?:(?!^## ).*\n?)*)", text, re.MULTILINE))
    assert next(iter(parts)) == "How late, and how smoothly"
    assert "robot.stream(" in text.partition("## ")[0]  # Python first
    assert "30 Hz" in parts["How late, and how smoothly"]
    named = set(re.findall(r"`(positions_upsampling\.\w+)`", parts["Send what is known in advance as chunks"]))
    parameters = {each.name for each in trajectory_parameters(joint_names(Side.RIGHT))}
    assert named
    assert named <= parameters


def test_no_link_of_the_contributing_page_leads_out_of_the_pages() -> None:
    page = docs_site.contributing_page()
    assert "](explanation/architecture.md#where-a-change-goes)" in page
    text = docs_site.rewritten(page, DOCS / docs_site.CONTRIBUTING)
    assert "changelog.d `changelog.d/README.md`" in text
    targets = [each.partition("#")[0] for each in re.findall(r"\]\(([^)\s]+)", text)]
    assert [each for each in targets if not (DOCS / each).is_file()] == []


@cache
def shown(page: str) -> str:
    """A page of the reference as the site has it."""
    return str(docs_site.rewritten(docs_site.with_tables(_text(f"docs/reference/{page}")), DOCS / "reference" / page))


@pytest.mark.parametrize(
    ("page", "row"),
    [
        ("rapid-coverage.md", "\n| Functions | "),
        ("rapid-coverage.md", "`GetSysInfo`{ title="),
        ("rws-coverage.md", "\n| `GET /rw/panel/ctrlstate` | "),
    ],
)
def test_page_gets_its_tables_when_the_site_is_built(page: str, row: str) -> None:
    source = _text(f"docs/reference/{page}")
    assert row not in source
    assert len(source) < 4000
    assert row in shown(page)
    assert "when the site is built. -->" not in shown(page)


def test_bars_in_the_code_of_a_table_lose_the_backslash_that_github_wants() -> None:
    text = "| `a\\|b` | c \\| d |\n`e\\|f`"
    assert docs_site.rewritten(text, ROOT / "docs" / "index.md") == "| `a|b` | c \\| d |\n`e\\|f`"


def test_role_of_a_name_in_a_docstring_is_left_out() -> None:
    html = "<p>::</p><p>See :attr:<code>a.b</code>, :class:<code>C</code>.</p>"
    assert docs_site.on_page_content(html, None, None, None) == "<p>See <code>a.b</code>, <code>C</code>.</p>"


def test_command_or_script_of_a_page_that_is_not_run_has_a_reason() -> None:
    fences = [fence for page in other_pages() for fence in read(page) if fence.language in {"bash", "python"}]
    assert [f"{fence.page}:{fence.line}" for fence in fences if not fence.reason] == []


def test_inventory_counts_what_runs_and_gives_a_reason_for_the_rest() -> None:
    run, left_out = inventory()
    assert run > len(pages())
    assert all(len(reason) > 5 for reason in left_out)
