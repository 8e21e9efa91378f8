"""Writes docs/reference/limiter-states.md and its picture from the table that the limiter runs by.

.venv/bin/python setup/limiter_states.py
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from textwrap import wrap

from yumi.control import loop_events
from yumi.control.limiter_state import (
    LIMITER_EVENT_MEANINGS,
    LIMITER_STATE_MEANINGS,
    TRANSITIONS,
    LimiterEvent,
    LimiterState,
)

DOCS = Path(__file__).resolve().parent.parent / "docs"
PAGE = DOCS / "reference" / "limiter-states.md"
PICTURE = DOCS / "images" / "limiter-states.svg"

BEFORE = (LimiterState.NO_SESSION, LimiterState.BEGINNING, LimiterState.ENTERING)
"""States in which the arm is not in a session yet, as the picture shows them from top to bottom."""

INSIDE = tuple(state for state in LimiterState if state not in BEFORE)

REPORTS: Mapping[type[loop_events.Happened], str] = {
    loop_events.SessionLost: "DISCONNECTED",
    loop_events.RobotStoppedFollowing: "STANDBY, after a state in which the robot followed",
    loop_events.ReferencesIgnored: "IGNORED",
    loop_events.ImplausibleFeedback: "DOUBTED and LOST",
    loop_events.ControllersLate: "UNANSWERED, about once a second",
}
"""What the control loop reports, and where."""

_WIDE, _HIGH, _GAP = 300, 126, 14
_LETTERS = 44  # as many fit into a line of a box
_ACROSS = 250  # from the states before a session to those in one
_STYLE = """<style>
text { font: 13px system-ui, "Segoe UI", "Helvetica Neue", Arial, sans-serif; fill: #1f2328; }
.title { font-weight: 600; } .small { font-size: 11px; fill: #59636e; }
.group { fill: #f6f8fa; stroke: #d1d9e0; } .box { fill: #ffffff; stroke: #59636e; }
.arrow { fill: none; stroke: #0969da; stroke-width: 2; } #head { fill: #0969da; }
@media (prefers-color-scheme: dark) {
  text { fill: #e6edf3; } .small { fill: #9198a1; }
  .group { fill: #151b23; stroke: #3d444d; } .box { fill: #0d1117; stroke: #9198a1; }
  .arrow { stroke: #58a6ff; } #head { fill: #58a6ff; }
}
</style>
<defs><marker id="to" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto"><path \
id="head" d="M0 0L8 4L0 8z"/></marker></defs>"""


def page() -> str:
    """The page: both enumerations, the table and the picture."""
    groups: dict[tuple[LimiterState | None, ...], list[LimiterState]] = {}
    for state in LimiterState:
        groups.setdefault(tuple(TRANSITIONS[state].get(event) for event in LimiterEvent), []).append(state)
    lines = [
        "# What the limiter does with an arm",
        "",
        "The limiter is the last step before a command leaves for the robot.",
        "What the limiter does with an arm follows from one state.",
        "This page is made from the table that the limiter runs by (`setup/limiter_states.py`).",
        "",
        "A command is sent only as the reply to a datagram.",
        "An event comes with each datagram that a session has taken, so that a state which follows on itself stays;",
        "of several that hold at once the one that stands first in the table of events counts.",
        "INTERRUPTION and CONNECTION_LOST alone come without a datagram; the 2 ms of UNANSWERED count from a datagram.",
        "",
        "Controllers are deactivated in IGNORED, LOST and DISCONNECTED, when a robot that followed stops following,",
        "and at the begin of a session, after its first reply.",
        "Once controllers are deactivated, nothing is desired until a person or a program activates controllers.",
        "A deactivated arm stands, and goes from HOLDING to SETTLING and back.",
        "An arm that was in SETTLING, IGNORED, LOST or DISCONNECTED has to settle:",
        "whatever states come between, and whatever controllers desire, its event is UNDESIRED in place of DESIRED",
        "until BACK or SESSION_NEW.",
        "",
        "A session is judged by what the last command does to the robot, not by whether the arm moves:",
        "an arm that something else moves begins with SESSION_NEW, where the arm is measured,",
        "or with SESSION_CONTINUED less than about 1 s after a command.",
        "The event of a session comes again with each datagram until the session has begun, after a silence too.",
        "A silence begins no session: a robot that counts on after a silence is in the same session.",
        "A robot that counts anew is in a new session.",
        "",
        "The *plan* is the position that the robot reports as planned.",
        "A command *leads* the robot while the command differs from the plan.",
        "A position is compared with the last one that was believed, by what the joints can move in the time since;",
        "of a robot that follows, only what was sent explains a motion.",
        "So an arm that stays where no joint could have come is believed again once the robot does not follow,",
        "or once EGM is started again, which begins a session.",
        "A robot that ignores commands goes on when its plan moves: what has to be done there (motors, RAPID, EGM)",
        "is the remedy in the driver's report.",
        "The robot itself does not say that it ignores commands: its plan shows it.",
        "FIRST_SENT belongs to BEGINNING alone: after SESSION_CONTINUED the first command is one of SETTLING.",
        "",
        "![The states of the limiter, with the events that lead to each](../images/limiter-states.svg)",
        "",
        "## States",
        "",
        "| state | what is done with the arm |",
        "|---|---|",
        *(f"| {state.name} | {LIMITER_STATE_MEANINGS[state]} |" for state in LimiterState),
        "",
        "## Events",
        "",
        "| event | what was seen |",
        "|---|---|",
        *(f"| {event.name} | {LIMITER_EVENT_MEANINGS[event]} |" for event in LimiterEvent),
        "",
        "## Reports",
        "",
        "What the control loop reports of this (`yumi.control.loop_events`): the driver adds the cause and the remedy.",
        "",
        "| report | where | what happened |",
        "|---|---|---|",
        *(
            f"| `{each.__name__}` | {where} | {(each.__doc__ or '').splitlines()[0]} |"
            for each, where in REPORTS.items()
        ),
        "",
        "## What follows",
        "",
        "A row for each event, a column for the states in which the same follows.",
        "An event without an entry is forbidden in that state: the program is wrong, and the cycle gets no reply,",
        "so that the robot keeps its last reference.",
        "The driver deactivates the arm's controllers and reports the fault.",
        "",
        f"| event | {' | '.join(', '.join(state.name for state in group) for group in groups.values())} |",
        f"|---{'|---' * len(groups)}|",
    ]
    for event in LimiterEvent:
        following = [row[event] for row in groups]
        lines.append(f"| {event.name} | {' | '.join(each.name if each is not None else '' for each in following)} |")
    return "\n".join([*lines, ""])


def picture() -> str:
    """The states as boxes with the events that lead to them, as SVG."""
    rows = -(-len(INSIDE) // 2)
    left = _GAP + _WIDE + _ACROSS
    width, height = left + 2 * _WIDE + 4 * _GAP, rows * (_HIGH + _GAP) + 54
    middle = _GAP + _WIDE / 2
    places = {state: (_GAP, 54 + (_HIGH + 3 * _GAP) * row) for row, state in enumerate(BEFORE)}
    for index, state in enumerate(INSIDE):
        places[state] = (left + _GAP + (_WIDE + _GAP) * (index // rows), 40 + (_HIGH + _GAP) * (index % rows))
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}">',
        _STYLE,
        f'<rect x="{left}" y="8" width="{2 * _WIDE + 3 * _GAP}" height="{height - 16}" rx="8" class="group"/>',
        f'<text x="{left + _GAP}" y="29" class="title">An arm in a session</text>',
        *_arrow((middle, 20), (middle, 52), ""),
    ]
    for state, place in places.items():
        parts += _box(state, place)
    begins, enters = places[LimiterState.BEGINNING], places[LimiterState.ENTERING]
    right = _GAP + _WIDE
    parts += _arrow((middle, 54 + _HIGH), (middle, begins[1] - 2), "")
    for state, place in ((LimiterState.BEGINNING, begins), (LimiterState.ENTERING, enters)):
        there, back = place[1] + 24, place[1] + 76
        parts += _arrow((right, there), (left - 2, there), _ways((state,), INSIDE))
        parts += _arrow((left, back), (right + 2, back), _ways(INSIDE, (state,)))
    return "\n".join([*parts, "</svg>", ""])


def _ways(starts: Sequence[LimiterState], ends: Sequence[LimiterState]) -> str:
    """The events that lead from some states to some others; interruptions may come at any time, and are left out."""
    found = {event for start in starts for event, end in TRANSITIONS[start].items() if end in ends}
    found -= {LimiterEvent.INTERRUPTION, LimiterEvent.CONNECTION_LOST}
    return ", ".join(event.name for event in sorted(found))


def _box(state: LimiterState, place: tuple[int, int]) -> Iterator[str]:
    """A state, and the events that lead there, with the states in which they do not."""
    x, y = place
    yield f'<rect x="{x}" y="{y}" width="{_WIDE}" height="{_HIGH}" rx="6" class="box"/>'
    yield f'<text x="{x + 12}" y="{y + 22}" class="title">{state.name}</text>'
    alike = INSIDE if state in INSIDE else tuple(LimiterState)
    number = 0
    for event in LimiterEvent:
        starts = [start for start in LimiterState if TRANSITIONS[start].get(event) is state]
        if not starts:
            continue
        inside = [start for start in alike if start in starts]
        others = [start for start in alike if start not in starts]
        note = ""
        if inside and len(others) < len(inside) and others and state in INSIDE:
            note = f", not in {', '.join(each.name for each in others)}"
        elif len(starts) <= 4:
            note = f" in {', '.join(each.name for each in starts)}"
        for line in wrap(event.name + note, _LETTERS, subsequent_indent="\N{EM SPACE}"):
            yield f'<text x="{x + 12}" y="{y + 40 + 15 * number}" class="small">{line}</text>'
            number += 1


def _arrow(start: tuple[float, float], end: tuple[float, float], words: str) -> Iterator[str]:
    (x, y), (to_x, to_y) = start, end
    yield f'<path d="M{x:g} {y:g}L{to_x:g} {to_y:g}" class="arrow" marker-end="url(#to)"/>'
    if words:
        yield f'<text x="{(x + to_x) / 2:g}" y="{y - 6:g}" text-anchor="middle" class="small">{words}</text>'


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    PICTURE.write_text(picture(), encoding="utf-8")
