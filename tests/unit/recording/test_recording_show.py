from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner
from matplotlib.figure import Figure

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import Side
from flight import LOST, SENTENCE, flown, write_flight_record
from refusals import refused
from yumi.cli.main import main
from yumi.recording.message_types import recorded_event
from yumi.recording.pictures import draw_recording
from yumi.recording.reader import Recording, read_recording
from yumi.recording.tables import RECORDING_GAP, quantile, recording_gaps

PNG = b"\x89PNG\r\n"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    frames = flown(100).frames()
    lost = recorded_event(LOST, frames[-1].time + 0.052)
    write_flight_record(tmp_path / "flight.mcap", 0.0, lost, {Side.RIGHT: frames})
    return tmp_path / "flight.mcap"


@pytest.fixture
def runner(monkeypatch: pytest.MonkeyPatch) -> CliRunner:
    monkeypatch.setenv("COLUMNS", "140")
    return CliRunner()


def test_show_prints_the_event_and_the_cycles_before_it(runner: CliRunner, file: Path) -> None:
    result = runner.invoke(main, ["record", "show", str(file), "--cycles", "3"])
    lines = result.output.splitlines()
    assert " ".join(lines[:2]).split()[: len(SENTENCE.split())] == SENTENCE.split()
    assert lines[2].startswith("Right arm: 100 cycles in 0.40 s, sessions 1 to 1, longest gap")
    rows = [line.split("│")[1:3] for line in lines if line.startswith("│") and "yes" in line]
    assert [(number.strip(), time.strip()) for number, time in rows] == [
        ("98", "-60.0"),
        ("99", "-56.0"),
        ("100", "-52.0"),
    ]


def test_show_needs_a_line_a_cycle_in_a_terminal_of_80_columns(
    runner: CliRunner, file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    lines = runner.invoke(main, ["record", "show", str(file), "--cycles", "3"]).output.splitlines()
    rows = [line for line in lines if line.startswith("│") and "yes" in line]
    number = lines.index(rows[0])
    assert lines[number : number + 3] == rows
    assert lines[number + 3].startswith("└")
    assert all(len(line) <= 80 for line in lines)
    # ABB's axis 6 is the last of the chain, and the farthest behind in this motion.
    assert rows[0].split("│")[5].strip().endswith("(6)")


def test_show_prints_where_the_time_of_a_cycle_goes(runner: CliRunner, file: Path) -> None:
    output = runner.invoke(main, ["record", "show", str(file)]).output
    stages = {line.split("│")[1].strip(): line.split("│")[2].strip() for line in output.splitlines() if "│" in line}
    assert (stages["send"], stages["after reply"], stages["reply"]) == ("80.0", "20.0", "80.0")


def test_show_prints_hold_where_nothing_was_wanted(runner: CliRunner, file: Path) -> None:
    assert runner.invoke(main, ["record", "show", str(file), "--cycles", "100"]).output.count(" hold ") == 1


def test_show_draws_a_picture(runner: CliRunner, file: Path, tmp_path: Path) -> None:
    picture = tmp_path / "stop.png"
    result = runner.invoke(main, ["record", "show", str(file), "--picture", str(picture)])
    assert f"Picture: {picture}" in result.output
    assert picture.read_bytes().startswith(PNG)


def test_picture_draws_what_moved_and_puts_the_event_in_the_middle(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    figures = []
    monkeypatch.setattr(
        "yumi.recording.pictures._figure", lambda width, height: figures.append(Figure((width, height))) or figures[-1]
    )
    draw_recording(read_recording(file), Side.RIGHT, tmp_path / "stop.png")
    panels = figures[0].axes
    titles = [panel.get_title() for panel in panels]
    # Axis 1 of the motion stands still; the chain order is 1 2 7 3 4 5 6.
    assert titles[:6] == [f"axis {axis} [°]" for axis in (2, 7, 3, 4, 5, 6)]
    assert titles[6:] == ["error: sent − measured [°]", "stages of a cycle [µs]"]
    for panel in panels:
        begin, end = panel.get_xlim()
        assert begin == -end


def test_gap_is_where_no_cycle_was_recorded() -> None:
    frames = flown(30).frames()
    kept = (*frames[:10], *frames[20:])
    assert recording_gaps(frames) == []
    assert recording_gaps(kept) == [(frames[9].time, frames[20].time)]
    assert frames[20].time - frames[9].time > RECORDING_GAP


def test_show_says_that_the_other_arm_is_not_recorded(runner: CliRunner, file: Path) -> None:
    result = runner.invoke(main, ["record", "show", str(file), "--arm", "left"])
    assert str(message("no_cycle_of_arm", arm="left")) in result.output


def test_show_refuses_a_file_of_another_kind(runner: CliRunner, tmp_path: Path) -> None:
    (tmp_path / "x.mcap").write_text("not at all")
    result = runner.invoke(main, ["record", "show", str(tmp_path / "x.mcap")])
    assert result.exit_code == 1
    said = message("recording_damaged", file=str(tmp_path / "x.mcap"), reason=message("not_mcap"))
    assert result.output == f"Error: {said}\n"


def test_list_prints_what_stopped_each_motion(runner: CliRunner, file: Path) -> None:
    result = runner.invoke(main, ["record", "list", "--folder", str(file.parent)])
    assert result.output.startswith(f"{file}  {SENTENCE}")


def test_list_says_that_there_is_nothing(runner: CliRunner, tmp_path: Path) -> None:
    result = runner.invoke(main, ["record", "list", "--folder", str(tmp_path)])
    assert result.output == f"There are no records in {tmp_path}.\n"


def test_picture_of_nothing_is_refused(tmp_path: Path) -> None:
    with refused(CommandRefused, "no_cycle_of_arm", arm="right"):
        draw_recording(Recording(), Side.RIGHT, tmp_path / "x.png")


@pytest.mark.parametrize(("share", "value"), [(0.0, 1.0), (0.5, 2.0), (0.75, 3.0), (0.99, 4.0), (1.0, 4.0)])
def test_quantile_is_the_smallest_value_that_so_many_do_not_exceed(share: float, value: float) -> None:
    assert quantile([1.0, 2.0, 3.0, 4.0], share) == value
