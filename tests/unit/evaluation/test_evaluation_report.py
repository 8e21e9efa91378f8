"""The report as a page: its sections can be reached, and what scrolls sideways takes nothing else with it."""

from __future__ import annotations

import re

import pytest

from yumi_evaluation.experiments import System, proportional, step
from yumi_evaluation.report import Table, keep_units, render
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
    assert page.index("<table>") < page.index("<nav") < page.index('<h2 id="')


def test_caption_of_a_table_stands_outside_of_what_scrolls(page: str) -> None:
    assert "</tbody></table></div><figcaption>Ours: without the limiter" in page


def test_columns_of_text_are_told_from_those_of_numbers(page: str) -> None:
    assert '<td class="text">5.1a</td><td>0.80&nbsp;s</td><td>0.77&nbsp;s</td><td>0.97</td>' in page


def test_line_of_the_page_does_not_end_between_a_number_and_its_unit(page: str) -> None:
    text = "P = 1.2 takes 0.9 s, 15 % more, at 600 rad/s³ and 0.2 Hz; 5 steps."
    kept = "P&nbsp;=&nbsp;1.2 takes 0.9&nbsp;s, 15&nbsp;% more, at 600&nbsp;rad/s³ and 0.2&nbsp;Hz; 5 steps."
    assert keep_units(text) == kept
    assert "networked/step could not be run: The arm took 5&nbsp;s." in page


def test_text_is_escaped(page: str) -> None:
    assert "&lt;b&gt;1 &amp; 2&lt;/b&gt;" in page


def test_page_needs_no_other_file_and_its_pictures_are_described(page: str) -> None:
    (label,) = re.findall('<svg role="img" aria-label="(.*?)"', page)
    assert label.startswith("Steps of 10° at full speed")
    assert page.count("var(--ink)") > 5
    assert not re.search('(src|href)="[^#"]', page)


def test_column_without_any_text_is_left_out() -> None:
    table = Table(("", "figure", "lag"), (("Sine", "", "163 ms"),), "Lags.", (0, 1))
    assert table.without_empty(1) == Table(("", "lag"), (("Sine", "163 ms"),), "Lags.", (0,))
