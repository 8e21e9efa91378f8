"""What can go wrong on the lines between the arms and the driver, datagram by datagram."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees

import pytest

from abb_protocols.egm import egm_pb2 as pb
from abb_protocols.egm.codec import RobotMessage, SensorCodec, parse_egm
from abb_protocols.robot.joints import CYCLE, Side
from abb_runtime.faults import Fault, FaultDirection
from virtual_irc5.mechanics.arm import VirtualArm
from virtual_irc5.mechanics.egm_client import EgmClient
from virtual_irc5.mechanics.egm_motion import EgmRun
from virtual_irc5.mechanics.egm_network import EgmNetwork, OutgoingDatagram, field_borders

LEFT, RIGHT = Side.LEFT, Side.RIGHT


class Bench:
    """Both arms send, and nobody answers; what an arm hears is a number for each cycle."""

    def __init__(self, seed: int = 0) -> None:
        self.network = EgmNetwork(seed=seed)
        self.heard: list[bytes] = []
        self._clients = {side: _client(side) for side in Side}
        self._cycle = 0

    def run(self, cycles: int) -> list[list[OutgoingDatagram]]:
        """What leaves in each of the next cycles."""
        return [self._run() for _ in range(cycles)]

    def numbers(self, cycles: int, side: Side = LEFT) -> list[list[int]]:
        """The numbers of what goes to the port of an arm in each of the next cycles."""
        return [[_read(each.datagram).seqno for each in leaving if each.side is side] for leaving in self.run(cycles)]

    def _run(self) -> list[OutgoingDatagram]:
        self._cycle += 1
        self.network.advance(CYCLE)
        arriving = self.network.arriving({LEFT: (b"%d" % self._cycle,)})
        self.heard += arriving[LEFT]
        datagrams = {side: client.cycle() for side, client in self._clients.items()}
        return self.network.leaving({side: each for side, each in datagrams.items() if each is not None})


def _client(side: Side) -> EgmClient:
    arm = VirtualArm(side)
    arm.switch_motors_on()
    client = EgmClient(arm)
    client.get_id()
    client.setup(comm_timeout=100.0)
    client.run_joint(EgmRun())
    return client


def _read(datagram: bytes) -> RobotMessage:
    return SensorCodec(axes=7).decode(datagram)


@pytest.fixture
def bench() -> Bench:
    bench = Bench()
    assert bench.numbers(3) == [[0], [1], [2]]
    bench.heard.clear()
    return bench


def test_loss_takes_a_share_of_one_direction(bench: Bench) -> None:
    bench.network.inject(Fault.EGM_LOSS, LEFT, 50.0, FaultDirection.TO_ROBOT)
    assert bench.numbers(200) == [[3 + number] for number in range(200)]
    assert 70 < len(bench.heard) < 130


def test_loss_ends_after_its_time(bench: Bench) -> None:
    bench.network.inject(Fault.EGM_LOSS, LEFT, 100.0, FaultDirection.FROM_ROBOT, duration=3.5 * CYCLE)
    assert bench.numbers(5) == [[], [], [], [6], [7]]
    assert len(bench.heard) == 5


def test_loss_leaves_the_other_arm_alone(bench: Bench) -> None:
    bench.network.inject(Fault.EGM_LOSS, LEFT, 100.0)
    assert bench.numbers(2, RIGHT) == [[3], [4]]
    assert bench.heard == []


def test_delay_is_rounded_up_to_cycles_and_both_ways(bench: Bench) -> None:
    bench.network.inject(Fault.EGM_DELAY, LEFT, 10.0)
    assert bench.numbers(5) == [[], [], [], [3], [4]]
    assert bench.heard == [b"4", b"5"]


def test_duplicates_arrive_with_the_datagram(bench: Bench) -> None:
    bench.network.inject(Fault.EGM_DUPLICATE, LEFT, 2.0, FaultDirection.FROM_ROBOT)
    assert bench.numbers(2) == [[3, 3, 3], [4, 4, 4]]


def test_reordered_datagrams_overtake_each_other_by_so_many_at_most_and_none_is_lost(bench: Bench) -> None:
    bench.network.inject(Fault.EGM_REORDER, LEFT, 3.0, FaultDirection.FROM_ROBOT)
    arrived = [number for each in bench.numbers(200) for number in each]
    bench.network.inject(Fault.EGM_REORDER, LEFT, 0.0)
    arrived += [number for each in bench.numbers(4) for number in each]
    assert sorted(arrived) == list(range(3, 207))
    assert arrived != sorted(arrived)
    assert max(max(arrived[: place + 1]) - number for place, number in enumerate(arrived)) <= 3


def test_stale_datagram_is_the_one_so_many_before(bench: Bench) -> None:
    bench.run(40)
    bench.network.inject(Fault.EGM_STALE, LEFT, 30.0)
    assert bench.numbers(2) == [[43, 13], [44]]


@pytest.mark.parametrize(
    ("fault", "number"), [(Fault.EGM_FORGE, 121), (Fault.EGM_FORGE_OLD, 20), (Fault.EGM_FORGE_AHEAD, 1120)]
)
def test_forged_datagram_has_its_number_a_newer_clock_and_all_joints_elsewhere(
    bench: Bench, fault: Fault, number: int
) -> None:
    bench.run(117)
    bench.network.inject(fault, LEFT, 5.0)
    true, forged = map(_read, _left(bench.run(1)))
    assert (true.seqno, forged.seqno) == (120, number)
    assert forged.measured_time - true.measured_time == pytest.approx(CYCLE, abs=2e-6)
    for one, other in ((true.measured, forged.measured), (true.planned, forged.planned)):
        assert [degrees(b - a) for a, b in zip(one, other, strict=True)] == pytest.approx([5.0] * 7)
    assert bench.numbers(1) == [[121]]


def test_offset_moves_the_positions_and_nothing_else(bench: Bench) -> None:
    before = _read(_left(bench.run(1))[0])
    bench.network.inject(Fault.EGM_OFFSET, LEFT, -20.0)
    after = _read(_left(bench.run(1))[0])
    assert (after.seqno, after.measured_time > before.measured_time) == (before.seqno + 1, True)
    assert degrees(after.measured[0] - before.measured[0]) == pytest.approx(-20.0)


def test_every_second_datagram_is_cut_after_so_many_bytes(bench: Bench) -> None:
    bench.network.inject(Fault.EGM_TRUNCATE, LEFT, 10.0)
    assert [len(each) == 10 for each in _left(bench.run(6))] == [False, True] * 3


def test_every_second_datagram_is_cut_between_two_fields(bench: Bench) -> None:
    bench.network.inject(Fault.EGM_TRUNCATE, LEFT)
    datagrams = _left(bench.run(40))
    for whole, cut in zip(datagrams[::2], datagrams[1::2], strict=True):
        assert _read(whole).seqno
        assert not parse_egm(pb.EgmRobot, cut).HasField(
            "rapidExecState"
        )  # the last field; a cut inside one would raise
    assert len({len(cut) for cut in datagrams[1::2]}) > 4


def test_arms_are_swapped(bench: Bench) -> None:
    leaving = bench.run(1)
    before = {side: _read(_of(side, leaving)[0]).measured for side in Side}
    for side in Side:
        bench.network.inject(Fault.EGM_SWAP_ARMS, side)
    leaving = bench.run(1)
    right, left = (_read(_of(side, leaving)[0]).measured for side in (RIGHT, LEFT))
    assert (right, left) == (before[LEFT], before[RIGHT])
    assert right != left


def test_foreign_port_is_the_first_to_send(bench: Bench) -> None:
    bench.network.inject(Fault.EGM_FOREIGN_PORT, LEFT)
    copies = [each for each in bench.run(1)[0] if each.side is LEFT]
    assert [each.is_foreign for each in copies] == [True, False]
    assert copies[0].datagram == copies[1].datagram


def test_repair_ends_everything_and_forgets_what_is_under_way(bench: Bench) -> None:
    bench.network.inject(Fault.EGM_DELAY, LEFT, 20.0)
    bench.run(3)
    bench.network.inject(Fault.EGM_FORGE, LEFT, 5.0)
    bench.network.repair(LEFT)
    assert bench.numbers(8) == [[6 + number] for number in range(8)]


def test_chance_is_the_same_each_time() -> None:
    runs = []
    for _ in range(2):
        bench = Bench(seed=7)
        bench.network.inject(Fault.EGM_LOSS, LEFT, 30.0)
        bench.network.inject(Fault.EGM_REORDER, LEFT, 5.0)
        runs.append(bench.numbers(100))
    assert runs[0] == runs[1] != [[number] for number in range(100)]


def test_fields_end_where_protocol_buffers_say(bench: Bench) -> None:
    datagram = _left(bench.run(1))[0]
    borders = field_borders(datagram)
    tags = [datagram[at] >> 3 for at in (0, *borders)]
    assert tags[:6] == [1, 2, 3, 4, 5, 6]
    assert field_borders(b"") == [0]


def _left(cycles: Sequence[Sequence[OutgoingDatagram]]) -> list[bytes]:
    return _of(LEFT, cycles)


def _of(side: Side, cycles: Sequence[Sequence[OutgoingDatagram]]) -> list[bytes]:
    return [each.datagram for leaving in cycles for each in leaving if each.side is side]
