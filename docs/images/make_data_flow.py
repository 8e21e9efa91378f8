"""Draw how data flows between a robot and the programs that use the robot: docs/images/data-flow.svg.

    python docs/images/make_data_flow.py

The names are those of docs/explanation/architecture.md. The picture follows the reader's light or dark screen.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import escape

FILE = Path(__file__).with_name("data-flow.svg")
WIDTH, HEIGHT = 960, 380

STYLE = """
text { font: 14px system-ui, "Segoe UI", "Helvetica Neue", Arial, sans-serif; fill: #1f2328; }
.title { font-weight: 600; } .small { font-size: 12px; fill: #59636e; }
.group { fill: #f6f8fa; stroke: #d1d9e0; } .box { fill: #ffffff; stroke: #59636e; }
.fast { stroke: #0969da; } .slow { stroke: #59636e; } .arrow { fill: none; stroke-width: 2; }
.name { fill: #0969da; font-weight: 600; } #fast { fill: #0969da; } #slow { fill: #59636e; }
@media (prefers-color-scheme: dark) {
  text { fill: #e6edf3; } .small { fill: #9198a1; }
  .group { fill: #151b23; stroke: #3d444d; } .box { fill: #0d1117; stroke: #9198a1; }
  .fast { stroke: #58a6ff; } .slow { stroke: #9198a1; } .name { fill: #58a6ff; }
  #fast { fill: #58a6ff; } #slow { fill: #9198a1; }
}
"""


@dataclass(frozen=True)
class Box:
    """A rectangle with a title and lines below it [pixels]."""

    x: int
    y: int
    width: int
    height: int
    title: str
    lines: tuple[str, ...] = ()

    @property
    def middle(self) -> int:
        return self.x + self.width // 2

    def drawn(self) -> str:
        first = self.y + self.height // 2 - 9 * len(self.lines) + 5
        texts = [text(self.middle, first, self.title, "title")]
        texts += [text(self.middle, first + 19 * number, line, "small") for number, line in enumerate(self.lines, 1)]
        return rectangle(self.x, self.y, self.width, self.height, "box") + "".join(texts)


RAPID = Box(28, 66, 236, 92, "RAPID program", ("state machine, grippers,", "watchdog"))
ARMS = Box(28, 236, 236, 92, "both arms", ("one EGM task each;", "the robot is the clock"))
DRIVER = Box(436, 66, 236, 92, "driver process", ("robot manager, grippers,", "diagnostics, local endpoint"))
CONTROL = Box(436, 236, 236, 92, "control process", ("active controller, then limiter:", "speed, jerk, distances"))
USERS = (
    Box(772, 66, 170, 44, "ROS 2"),
    Box(772, 126, 170, 44, "Python", ("yumi.connect, attach",)),
    Box(772, 186, 170, 44, "command line", ("yumi move, state, …",)),
    Box(772, 246, 170, 44, "browser", ("yumi view",)),
    Box(772, 306, 170, 44, "recordings"),
)


def text(x: int, y: int, words: str, kind: str = "", anchor: str = "middle") -> str:
    return f'<text x="{x}" y="{y}" text-anchor="{anchor}" class="{kind}">{escape(words)}</text>\n'


def rectangle(x: int, y: int, width: int, height: int, kind: str) -> str:
    return f'<rect x="{x}" y="{y}" width="{width}" height="{height}" rx="8" class="{kind}"/>\n'


def arrow(path: str, kind: str, *, both: bool = True) -> str:
    """A line with a tip at the end, or at ``both`` ends; tips are in the colour of the line."""
    start = f' marker-start="url(#to-{kind})"' if both else ""
    return f'<path class="arrow {kind}" d="{path}" marker-end="url(#to-{kind})"{start}/>\n'


def picture() -> str:
    """The picture as SVG."""
    tips = "".join(
        f'<marker id="to-{kind}" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" '
        f'orient="auto-start-reverse"><path id="{kind}" d="M0 0L8 4L0 8z"/></marker>'
        for kind in ("fast", "slow")
    )
    left, right = RAPID.x + RAPID.width + 4, DRIVER.x - 4
    between = (left + right) // 2
    gate = USERS[0].x - 30  # where the lines of the users meet
    middles = [each.y + each.height // 2 for each in USERS]
    parts = [
        rectangle(12, 12, 268, 356, "group"),
        text(28, 38, "Robot: real IRC5, or virtual", "title", "start"),
        text(28, 54, "yumi controller", "name small", "start"),
        rectangle(420, 12, 268, 356, "group"),
        text(436, 38, "One Linux machine", "title", "start"),
        text(436, 54, "yumi up, yumi.connect or yumi view", "name small", "start"),
        text(772, 38, "Who uses the robot", "title", "start"),
        *(box.drawn() for box in (RAPID, ARMS, DRIVER, CONTROL, *USERS)),
        arrow(f"M{left} 112H{right}", "slow"),
        text(between, 88, "Web Services", "title"),
        text(between, 104, "HTTP, WebSocket", "small"),
        text(between, 132, "state, files, grippers", "small"),
        arrow(f"M{left} 282H{right}", "fast"),
        text(between, 258, "EGM", "title"),
        text(between, 274, "UDP, protobuf", "small"),
        text(between, 302, "250 Hz for each arm", "small"),
        arrow("M520 162V232", "fast", both=False),
        text(510, 202, "commands", "small", "end"),
        arrow("M588 232V162", "fast", both=False),
        text(598, 202, "state", "small", "start"),
        text(554, 186, "shared", "small"),
        text(554, 218, "memory", "small"),
        f'<path class="arrow slow" d="M{gate} {middles[0]}V{middles[-1]}"/>\n',
        arrow(f"M{DRIVER.x + DRIVER.width + 4} 112H{gate}", "slow"),
        *(
            arrow(f"M{gate} {middle}H{box.x - 4}", "slow", both=False)
            for middle, box in zip(middles, USERS, strict=True)
        ),
    ]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}">\n'
        f"<style>{STYLE}</style>\n<defs>{tips}</defs>\n{''.join(parts)}</svg>\n"
    )


if __name__ == "__main__":
    FILE.write_text(picture(), encoding="utf-8")
