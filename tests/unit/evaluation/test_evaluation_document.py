"""The document as a page: its sections can be reached, and what scrolls sideways takes nothing else with it."""

from __future__ import annotations

import re

from yumi_evaluation.document import Block, Heading, Paragraph, Picture, Table, to_html, to_markdown

BLOCKS: list[Block] = [
    Heading("Evaluation", 1),
    Table(("", "figure", "lag"), (("Sine of 10°", "5.3", "163 ms"),), "Lags < 0.2 s.", (0, 1)),
    Heading("What a user gets"),
    Paragraph("P & I."),
    Heading("Sine of 60°", 3),
    Picture("figures/lags.svg", "figures/lags_dark.svg", 'The "lags".'),
]


def test_page_lists_its_sections_above_the_first_one() -> None:
    page = to_html(BLOCKS, "Evaluation")
    assert re.findall('<a href="#(.*?)">(.*?)</a>', page) == [("what-a-user-gets", "What a user gets")]
    assert page.index("<table>") < page.index("<nav") < page.index('<h2 id="what-a-user-gets">')
    assert '<h3 id="sine-of-60">Sine of 60°</h3>' in page


def test_page_without_sections_lists_none() -> None:
    page = to_html(BLOCKS[:2], "Evaluation")
    assert "<nav" not in page
    assert "<table>" in page


def test_caption_of_a_table_stands_outside_of_what_scrolls() -> None:
    assert "</table></div><figcaption>Lags &lt; 0.2&nbsp;s.</figcaption></figure>" in to_html(BLOCKS, "Evaluation")


def test_columns_of_text_are_told_from_those_of_numbers() -> None:
    row = '<td class="text">Sine of 10°</td><td class="text">5.3</td><td>163&nbsp;ms</td>'
    assert row in to_html(BLOCKS, "Evaluation")
    assert "| --- | --- | ---: |" in to_markdown(BLOCKS)


def test_line_of_the_page_does_not_end_between_a_number_and_its_unit() -> None:
    text = "P = 1.2 takes 0.9 s, 15 % more, at 600 rad/s³ and 0.2 Hz; 5 steps."
    page = to_html([Paragraph(text)], "Evaluation")
    assert "P&nbsp;=&nbsp;1.2 takes 0.9&nbsp;s, 15&nbsp;% more, at 600&nbsp;rad/s³ and 0.2&nbsp;Hz; 5 steps." in page
    assert text in to_markdown([Paragraph(text)])


def test_picture_is_told_in_words_on_the_page_and_in_markdown() -> None:
    for text in (to_html(BLOCKS, "Evaluation"), to_markdown(BLOCKS)):
        assert 'alt="The &quot;lags&quot;."' in text
        assert 'srcset="figures/lags_dark.svg"' in text
