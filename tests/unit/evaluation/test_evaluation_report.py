"""The report as a page: its sections can be reached, and what scrolls sideways takes nothing else with it."""

from __future__ import annotations

import re

import pytest

from yumi_evaluation.experiments import System, proportional, step
from yumi_evaluation.report import Table, Verdict, keep_units, made, render
from yumi_evaluation.results import Results
from yumi_evaluation.virtual_time import run_virtually


@pytest.fixture(scope="module")
def page() -> str:
    results = Results(settings={"versions": {"script": "<b>1 & 2</b>"}})
    results.add(System.BARE, run_virtually(step(proportional(1.2), duration=1.0), System.BARE))
    results.failures["networked/step"] = "The arm took 5 s."
    return render(results)


def test_page_lists_its_sections_above_the_first_one(page: str) -> None:
    links = re.findall('<a href="#(.*?)">(.*?)</a>', page)
    assert ("where-our-figures-differ-and-why", "Where our figures differ, and why") in links
    assert [anchor for anchor, _ in links] == re.findall('<h2 id="(.*?)">', page)
    assert page.index("<table") < page.index("<nav") < page.index('<h2 id="')


def test_caption_of_a_table_stands_outside_of_what_scrolls(page: str) -> None:
    assert "</tbody></table></div><figcaption>Ours: without the limiter" in page


def test_columns_of_text_are_told_from_those_of_numbers(page: str) -> None:
    row = next(row for row in re.findall("<tr>.*?</tr>", page) if "5.1a" in row)
    cells = re.findall('<td(?: class="([a-z ]*)")?[^>]*>(.*?)</td>', row)
    assert cells[1:5] == [("text", "5.1a"), ("", "0.80&nbsp;s"), ("", "0.78&nbsp;s"), ("", "0.97")]


def test_line_of_the_page_does_not_end_between_a_number_and_its_unit(page: str) -> None:
    text = "P = 1.2 takes 0.9 s, 15 % more, at 600 rad/s³ and 0.2 Hz; 5 steps."
    kept = "P&nbsp;=&nbsp;1.2 takes 0.9&nbsp;s, 15&nbsp;% more, at 600&nbsp;rad/s³ and 0.2&nbsp;Hz; 5 steps."
    assert keep_units(text) == kept
    assert "networked/step could not be run: The arm took 5&nbsp;s." in page


def test_text_is_escaped(page: str) -> None:
    assert "&lt;b&gt;1 &amp; 2&lt;/b&gt;" in page


def test_page_needs_no_other_file_and_its_pictures_are_described(page: str) -> None:
    first, steps = re.findall('<svg role="img" aria-label="(.*?)"', page)
    assert first.startswith("Ours divided by what is published")
    assert steps.startswith("Steps of 10° at full speed")
    assert "dashed" not in steps.lower()  # networked was not run
    assert page.count("var(--ink)") > 5
    assert not re.search('(src|href)="[^#"]', page)


def test_page_begins_with_the_verdict_and_tells_not_run_from_missed(page: str) -> None:
    verdicts = re.findall(r'<div class="verdict (\w+)"><b>(.*?)</b>\s*(.*?)</div>', page)
    assert verdicts == [
        ("unknown", "1 of 1", "published figures reproduced within a tenth; 8 not run"),
        ("unknown", "not run", "indicators inside their limits, as shipped"),
        ("unknown", "not run", "indicators inside their limits, networked"),
    ]
    assert page.index('class="verdict') < page.index("<svg") < page.index("<p>")
    assert '<td class="text unknown" data-label="verdict">not run</td>' in page


@pytest.mark.parametrize(
    ("verdict", "kind"),
    [
        (Verdict("", 7, 0, 0), "good"),
        (Verdict("", 6, 1, 0), "bad"),
        (Verdict("", 6, 0, 1), "unknown"),
        (Verdict("", 0, 0, 7), "unknown"),
        (Verdict("", 6, 3, 0, is_demand=False), "differs"),
    ],
)
def test_verdict_has_a_colour(verdict: Verdict, kind: str) -> None:
    assert verdict.kind == kind


def test_page_says_when_with_what_and_where_it_was_made() -> None:
    settings = {
        "evaluation": {"date": "2026-01-31 12:00", "mode": "virtual time", "robot": "virtual"},
        "versions": {"yumi-ros2": "0.1.0", "commit": "abc"},
        "machine": {"system": "Linux", "cpus": 2, "load": 0.5},
    }
    assert made(settings) == (
        "2026-01-31 12:00 · yumi-ros2 0.1.0 · commit abc · virtual time, virtual robot · Linux, 2 processors, load 0.5"
    )
    assert made({}) == ""


def test_column_without_any_text_is_left_out() -> None:
    table = Table(("", "figure", "lag"), (("Sine", "", "163 ms"),), "Lags.", (0, 1))
    assert table.without_empty(1) == Table(("", "lag"), (("Sine", "163 ms"),), "Lags.", (0,))
