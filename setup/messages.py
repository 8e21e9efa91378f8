"""The page of all messages: ``python setup/messages.py > docs/reference/messages.md``."""

from __future__ import annotations

import sys
from string import Formatter

import abb_runtime
import abb_view
import virtual_irc5
import yumi
import yumi_evaluation
from abb_protocols.catalogue import subjects
from abb_protocols.catalogue.actions import ACTIONS

PACKAGES = (abb_runtime, abb_view, virtual_irc5, yumi, yumi_evaluation)
"""Each gives the catalogue its texts when it is imported."""

_HEAD = """\
# Messages

<!-- Written by `python setup/messages.py` from the `texts` of each package; do not edit. -->

Every refusal, reason and cause of a stop is a message: a code with values, and a sentence in the words of its reader.
Programs decide by the code, which stays; the sentence may change.

- Python: `error.said.code` and `error.said.values` of any `YumiError`.
- ROS: the field `code` of a service's or an action's answer, and `reason_codes` and `cause_codes` of a robot's state.
- The local endpoint and `--json`: `code`, `values`, `sentence` and `actions` of `said`, `reasons` and `causes`.

Words in angle brackets are values, words in bold are actions.
"""


def page() -> str:
    """The page, in Markdown."""
    lines = [_HEAD, "## Actions", "", "What a person can do, in the words of each reader.", ""]
    readers = list(next(iter(ACTIONS.values())))
    lines += [f"| action | {' | '.join(each.replace('_', ' ') for each in readers)} |", f"|---|{'---|' * len(readers)}"]
    for action, words in ACTIONS.items():
        lines.append(f"| **{action}** | {' | '.join(_shown(words[each].do) for each in readers)} |")
    for subject, of_subject in sorted(subjects().items()):  # which package was loaded first is chance
        lines += ["", f"## {subject}", "", "| code | text | what to do |", "|---|---|---|"]
        lines += [f"| `{code}` | {_shown(text.what)} | {_shown(text.remedy)} |" for code, text in of_subject.items()]
    return "\n".join([*lines, ""])


def _shown(template: str) -> str:
    """A text with its values as `<name>` and its actions in bold."""
    parts = []
    for words, name, _, _ in Formatter().parse(template):
        parts.append(words.replace("|", "\\|").replace("<", "&lt;"))
        if name is not None:
            parts.append(f"**{name}**" if name.lower() in ACTIONS else f"&lt;{name}&gt;")
    return "".join(parts)


if __name__ == "__main__":
    sys.stdout.write(page())
