"""Replaces every sentence of the catalogue by random words, in each Python that starts with this folder on its path.

The values stay, in other places: whoever needs more of a message than its code and values fails. See ``--random-words``
in the tests' conftest.
"""

from __future__ import annotations

import random
from string import Formatter, ascii_lowercase

import abb_runtime
import abb_view
import virtual_irc5
import yumi
import yumi_evaluation
from abb_protocols import catalogue
from abb_protocols.catalogue.text import Text

PACKAGES = (abb_runtime, abb_view, virtual_irc5, yumi, yumi_evaluation)
"""Each gives the catalogue its texts when it is imported."""


def _random_words(template: str, chance: random.Random) -> str:
    fields = [
        "{" + name + (f"!{conversion}" if conversion else "") + (f":{spec}" if spec else "") + "}"
        for _, name, spec, conversion in Formatter().parse(template)
        if name is not None
    ]
    words = [
        "".join(chance.choices(ascii_lowercase, k=chance.randint(3, 9))) for _ in range(max(template.count(" "), 1))
    ]
    return " ".join(chance.sample(words + fields, len(words) + len(fields))) if template else ""


def _replace_all() -> None:
    texts = catalogue.all_texts()
    for code, text in texts.items():
        if code != "text":
            chance = random.Random(code)
            texts[code] = Text(*(_random_words(part, chance) for part in text))


if not hasattr(catalogue, "are_random"):  # a process of pytest-xdist has loaded this already when it is configured
    _replace_all()
    vars(catalogue)["are_random"] = True
