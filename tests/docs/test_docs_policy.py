"""The examples of a policy on the network speak the wire of openpi, and the picture shows what chunks make of it."""

from __future__ import annotations

import socket
import sys
from collections.abc import Iterator
from threading import Thread
from unittest.mock import MagicMock, PropertyMock

import numpy as np
import pytest
from chunk_runs import steps_of
from doc_pages import ROOT
from websockets.exceptions import ConnectionClosedError, ConnectionClosedOK
from websockets.frames import Close
from websockets.sync.client import connect
from websockets.sync.server import serve

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from yumi.control.hand_over import Commander
from yumi.driver.reports import CommandingReport

sys.path += [str(ROOT / "docs" / "images"), str(ROOT / "examples")]

import make_chunks
import policy_server
import run_policy
from policy_wire import pack, unpack

# {"a": np.arange(6, dtype=np.float32).reshape(2, 3), "s": np.float64(1.5), "t": "x", "l": [1, np.zeros(2)]} as
# openpi_client 0.1.2 packs it.
PACKED = bytes.fromhex(
    "84a16184c40b5f5f6e6461727261795f5fc3c40464617461c418000000000000803f0000004000004040000080400000a040c4056474797065a3"
    "3c6634c4057368617065920203a173cb3ff8000000000000a174a178a16c920184c40b5f5f6e6461727261795f5fc3c40464617461c410000000"
    "00000000000000000000000000c4056474797065a33c6638c405736861706591"
    "02"
)


def test_what_openpi_packs_is_read() -> None:
    message = unpack(PACKED)
    assert message["a"].tolist() == [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]]
    assert message["a"].dtype == np.float32
    assert (message["s"], message["t"], message["l"][0]) == (1.5, "x", 1)
    assert message["l"][1].tolist() == [0.0, 0.0]


def test_arrays_come_as_they_were_sent() -> None:
    sent = {"image": np.arange(24, dtype=np.uint8).reshape(2, 4, 3), "n": np.float32(2.5), "t": "grasp", "l": [[1], {}]}
    got = unpack(pack(sent))
    assert np.array_equal(got["image"], sent["image"])
    assert got["image"].dtype == np.uint8
    assert (got["n"], got["n"].dtype, got["t"], got["l"]) == (2.5, np.float32, "grasp", [[1], {}])
    with pytest.raises(TypeError, match="complex cannot be sent"):
        pack({"s": 1j})


@pytest.fixture
def port() -> Iterator[int]:
    with serve(policy_server.answer, "127.0.0.1", 0, compression=None, max_size=None) as server:
        thread = Thread(target=server.serve_forever)
        thread.start()
        yield server.socket.getsockname()[1]
        server.shutdown()
        thread.join()


def test_server_gives_chunks_that_begin_where_the_arms_are_and_lead_back_to_the_wave(port: int) -> None:
    start, position = np.zeros(14), np.full(14, 0.05)
    with connect(f"ws://127.0.0.1:{port}", compression=None, max_size=None) as server:
        metadata = unpack(server.recv())
        assert metadata["period"] == 0.02
        for time in (0.0, 1.0):
            server.send(pack({"start": start, "position": position, "time": time}))
            actions = unpack(server.recv())["actions"]
            assert actions.shape == (50, 16)
            assert actions[0, :14] == pytest.approx(position)
            wave = policy_server.SWING * (1.0 - np.cos(policy_server.RATE * (time + 0.98)))
            assert abs(actions[-1, 0] - wave[0]) < 0.4 * abs(0.05 - wave[0]) + 0.04
            assert set(actions[:, 14:].ravel().tolist()) <= {0.0, 1.0}


def test_left_arm_waves_as_the_mirrored_right_one() -> None:
    actions = policy_server.infer({"start": np.zeros(14), "position": np.zeros(14), "time": 0.0})
    assert actions[-1, 0] > 0.05
    assert actions[:, 7:14] == pytest.approx(actions[:, :7] * [-1, 1, -1, 1, -1, 1, -1])


def test_server_ends_an_answer_when_its_client_is_killed() -> None:
    connection = MagicMock()
    connection.__iter__.side_effect = ConnectionClosedError(None, None)
    policy_server.answer(connection)
    assert unpack(connection.send.call_args.args[0])["name"] == "wave"


def test_robot_is_left_as_it_is_when_no_policy_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = MagicMock()
    monkeypatch.setattr(run_policy.yumi, "connect", robot)
    with socket.socket() as deaf:
        deaf.bind(("127.0.0.1", 0))
        server = f"127.0.0.1:{deaf.getsockname()[1]}"
        with pytest.raises(SystemExit, match=f"the policy server at {server} does not answer"):
            run_policy.main(1.0, "memory", server)
    robot.assert_not_called()


@pytest.mark.parametrize(
    ("ending", "says"),
    [(ConnectionClosedOK(Close(1001, ""), None), "does not answer, the arms hold"), (KeyboardInterrupt(), "Stopped.")],
)
def test_program_ends_with_a_sentence(
    monkeypatch: pytest.MonkeyPatch, port: int, ending: BaseException, says: str
) -> None:
    monkeypatch.setattr(run_policy.yumi, "connect", MagicMock())
    monkeypatch.setattr(run_policy, "run", MagicMock(side_effect=ending))
    with pytest.raises(SystemExit, match=says):
        run_policy.main(1.0, "memory", f"127.0.0.1:{port}")


@pytest.fixture
def commands(monkeypatch: pytest.MonkeyPatch) -> PropertyMock:
    """What both arms of a robot show of who commands them, one for each look; a policy follows until it is refused."""
    monkeypatch.setattr(run_policy, "unpack", lambda data: {"period": 0.02})
    monkeypatch.setattr(run_policy.time, "sleep", lambda seconds: None)
    return PropertyMock()


def test_policy_goes_on_when_a_person_has_given_the_arms_back(
    monkeypatch: pytest.MonkeyPatch, commands: PropertyMock, capsys: pytest.CaptureFixture[str]
) -> None:
    robot, refusal = MagicMock(), CommandRefused(message("chunks_taken_over", arm="right"))
    person, reserved, free = CommandingReport(who="device"), CommandingReport(is_reserved=True), CommandingReport()
    # The right arm first; the left one where that is no person's.
    commands.side_effect = [person, free, reserved, free, free]
    type(robot.right.state).command = type(robot.left.state).command = commands
    follow = MagicMock(side_effect=[refusal, KeyboardInterrupt])
    monkeypatch.setattr(run_policy, "follow", follow)
    with pytest.raises(KeyboardInterrupt):
        run_policy.run(robot, MagicMock(), 60.0)
    assert follow.call_count == 2
    assert commands.call_count == 5
    assert "Waiting until a person gives the arms back." in capsys.readouterr().out


@pytest.mark.parametrize("who", Commander)
def test_arm_is_a_persons_while_one_commands_it_or_has_not_given_it_back(who: Commander) -> None:
    assert CommandingReport(who=who.value).is_of_person is who.is_person
    assert CommandingReport(is_reserved=True).is_of_person


def test_refusal_without_a_person_ends_the_policy(monkeypatch: pytest.MonkeyPatch, commands: PropertyMock) -> None:
    robot = MagicMock()
    commands.return_value = CommandingReport(who="policy")
    type(robot.right.state).command = type(robot.left.state).command = commands
    monkeypatch.setattr(
        run_policy, "follow", MagicMock(side_effect=CommandRefused(message("chunks_taken_over", arm="left")))
    )
    with pytest.raises(CommandRefused):
        run_policy.run(robot, MagicMock(), 60.0)


def test_picture_shows_one_motion_here_and_steps_upstream() -> None:
    ours, theirs = make_chunks.runs()
    assert ours.exhausted
    assert ours.lost > 0
    assert steps_of(ours.desired).share < 1.0 + 1e-5 < steps_of(theirs.desired).share
