"""What the driver writes down: a flight record when the robot is lost, and the whole session when it is asked for."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from ros_bench import TIMEOUT, Client, Robot
from std_srvs.srv import Trigger

from yumi.process.supervision import Command
from yumi.recording.mcap import read_recording
from yumi.recording.tables import rows
from yumi.robot.joints import Side

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]


@pytest.fixture
def driver(ros: None, robot: Robot, tmp_path: Path) -> Iterator[Command]:
    settings = tmp_path / "mine.yaml"
    settings.write_text(f"recorder: {{folder: {tmp_path / 'flights'}}}\n")
    where = ["--robot", f"127.0.0.1:{robot.rws_port}", *robot.egm_options]
    what = ["--config", str(settings), "--record", str(tmp_path / "session.mcap")]
    with Command("driver", ["up", *where, *what], tmp_path / "driver.log") as command:
        command.wait_until_ready(TIMEOUT)
        yield command
    robot.start()


@pytest.fixture
def client(driver: Command) -> Iterator[Client]:
    client = Client()
    yield client
    client.close()


def test_power_cut_leaves_flight_records_of_both_arms_and_the_recording_goes_on(
    client: Client, robot: Robot, driver: Command, tmp_path: Path
) -> None:
    assert client.call(Trigger, "yumi_robot_manager/start_egm").success
    robot.kill()
    client.until(lambda: sum("s of the" in sentence for sentence in client.sentences) == 2)
    flights = {side: read_recording(*(tmp_path / "flights").glob(f"*_{side.word}.mcap")) for side in Side}
    driver.stop()
    session = read_recording(tmp_path / "session.mcap")
    assert session.is_complete
    for side, flight in flights.items():
        assert flight.stop in session.events
        assert flight.stop is not None
        assert flight.stop.kind == "SessionLost"
        assert flight.frames[side][-1] == session.frames[side][-1]
        assert all(frame.stages.reply > 0.0 for frame in flight.frames[side])
    # Beside the cycles it holds what became of the robot and its grippers.
    states = list(rows(tmp_path / "session.mcap", "state"))
    assert {row["egm.r"] for row in states} >= {"off", "running"}
    assert [row["is_connected"] for row in states][-1] is False
    assert {row["arm"] for row in rows(tmp_path / "session.mcap", "grippers")} == {"right", "left"}
