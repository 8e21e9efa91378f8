"""Programs and clients that would hang a naive controller: EGM and HTTP of ``yumi controller`` go on beside them."""

from __future__ import annotations

import logging
import socket
import struct
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass
from http.client import HTTPConnection
from itertools import pairwise
from pathlib import Path
from select import select
from threading import Event, Thread
from typing import NamedTuple

import pytest

from abb_protocols.egm.codec import SensorCodec, SensorMessage
from abb_protocols.robot.joints import CYCLE, Side
from abb_runtime.process.command_process import CommandProcess
from abb_runtime.rws.client import RwsClient
from stalls import waited_for_a_processor

pytestmark = [pytest.mark.real_time, pytest.mark.alone]

LATENCY = 0.02
"""How late a datagram or an answer may be at most, whatever a program does [s].

What the controller computed meanwhile counts, not what it waited for a processor: another program of the machine may
take any time of that, and takes most from who computes most.
"""

FEWEST = 20.0
"""Datagrams, and answers, in a second, however little of its processors the machine has left; EGM sends 496."""

_TIMESTAMP = socket.SO_TIMESTAMPNS if hasattr(socket, "SO_TIMESTAMPNS") else 35

PATIENCE = 20.0  # [s]
log = logging.getLogger(__name__)
BOMBS = """MODULE bombs
    VAR string s;
    PROC textBomb()
        WHILE TRUE DO
            s:=NumToStr(1,3E8);
        ENDWHILE
    ERROR
        TRYNEXT;
    ENDPROC
    PROC moveBomb()
        VAR jointtarget here;
        here:=CJointT();
        MoveAbsJ here,v1000,fine,tool0;
        WHILE TRUE DO
            MoveAbsJ here,v1000,fine,tool0;
        ENDWHILE
    ENDPROC
    PROC arrayBomb()
        WHILE TRUE DO
            Load\\Dynamic,"HOME:/array.mod";
        ENDWHILE
    ERROR
        TRYNEXT;
    ENDPROC
    PROC longBomb()
        Load\\Dynamic,"HOME:/long.mod";
        %"long"%;
        UnLoad "HOME:/long.mod";
    ENDPROC
ENDMODULE
"""
ARRAY = "MODULE arr VAR num a{30000,30000}; ENDMODULE"
TARGET = "[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
TARGETS = {
    "array": f"MODULE targets CONST robtarget p{{1000}}:=[{','.join([TARGET] * 1000)}]; ENDMODULE",
    "lines": f"MODULE targets {''.join(f'CONST robtarget p{n}:={TARGET};' for n in range(4000))} ENDMODULE",
}
LONG = "MODULE long\nVAR num x;\nPROC long()\n" + "x := x + 1.0;\n" * 20_000 + "ENDPROC\nENDMODULE\n"


class Heard(NamedTuple):
    """When the kernel got a datagram [s], and how much the controller had computed when we did [s]."""

    time: float
    computed: float

    def since(self, before: Heard) -> float:
        """How long the controller let us wait [s]; this process, too, may wait for a processor."""
        return min(self.time - before.time, self.computed - before.computed)


class Arms:
    """Answers the datagrams of both arms where they are, and notes when the kernel got each.

    Attributes:
        pid: of the controller that sends them.
        heard: the datagrams so far.
    """

    def __init__(self) -> None:
        self.pid = 0
        self._sockets = {side: socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for side in Side}
        for each in self._sockets.values():
            each.bind(("127.0.0.1", 0))
            each.setsockopt(socket.SOL_SOCKET, _TIMESTAMP, 1)
        self._is_over = Event()
        self.heard: dict[Side, list[Heard]] = {side: [] for side in Side}
        self._thread = Thread(target=self._serve, name="arms")
        self._thread.start()

    def port(self, side: Side) -> int:
        port: int = self._sockets[side].getsockname()[1]
        return port

    def computed(self) -> float:
        """How much processor time the controller has taken, all its threads together [s]."""
        return time.clock_gettime(~self.pid << 3 | 2)  # clock_getcpuclockid(3)

    def close(self) -> None:
        self._is_over.set()
        self._thread.join()
        for each in self._sockets.values():
            each.close()

    def gaps(self, begin: Heard, end: Heard) -> list[float]:
        """Between two datagrams of an arm, or one and the ends of the interval [s]."""
        heard = [[begin, *(each for each in self.heard[side] if begin < each < end), end] for side in Side]
        return [new.since(old) for each in heard for old, new in pairwise(each)]

    def _serve(self) -> None:
        codec = SensorCodec()
        while not self._is_over.is_set():
            for ready in select(list(self._sockets.values()), [], [], 0.1)[0]:
                datagram, ancillary, _, peer = ready.recvmsg(2048, 64)
                side = next(side for side, each in self._sockets.items() if each is ready)
                seconds, nanoseconds = struct.unpack("qq", ancillary[0][2])
                self.heard[side].append(Heard(seconds + nanoseconds * 1e-9, self.computed()))
                message = codec.decode(datagram)
                ready.sendto(codec.encode(SensorMessage(message.seqno, message.measured)), peer)


@dataclass
class Latencies:
    """Gaps between datagrams, none where none are sent, and times until answers, in some seconds [s]."""

    egm: list[float]
    http: list[float]
    seconds: float

    def check(self) -> None:
        """Whether all is prompt enough."""
        for name, values in (("EGM", self.egm), ("HTTP", self.http)):
            if not values:
                continue
            longest = max(values)
            log.info("%s: %d times, all within %.1f ms", name, len(values), longest * 1e3)
            assert longest < LATENCY, f"{name}: {longest * 1e3:.1f} ms"
            assert len(values) > FEWEST * self.seconds, f"{name}: {len(values)} times in {self.seconds:.1f} s"


class Robot:
    """A running virtual controller with sensors on both arms."""

    def __init__(self, address: str, client: RwsClient, arms: Arms) -> None:
        self.arms, self.client, self._address = arms, client, address

    def start(self) -> None:
        """The state machine from its beginning, idle."""
        self.client.set_motors(True)
        self.client.move_pp_to_main()
        self.client.start_rapid()
        self.until(lambda: all(self.client.symbol(side.task, "TRobMain", "current_state") == "0" for side in Side))

    def stream(self) -> None:
        """Both arms send their positions, whatever their tasks do."""
        self.client.pulse_signal("EGM_START_STREAM")
        self.until_heard()

    def guide(self) -> None:
        """EGM guides both arms."""
        self.client.pulse_signal("EGM_START_JOINT")
        self.until_heard()

    def run(self, routine: str, *sides: Side) -> None:
        for side in sides or Side:
            self.client.set_symbol(side.task, "TRobRAPID", "routine_name_input", f'"{routine}"')
        self.client.pulse_signal("RUN_RAPID_ROUTINE")

    def until_heard(self) -> None:
        begin = time.time()
        self.until(lambda: all(self.arms.heard[side][-1:] > [Heard(begin + 0.2, 0.0)] for side in Side))

    def until(self, condition: Callable[[], bool]) -> None:
        end = time.time() + PATIENCE
        while not condition():
            assert time.time() < end

    def watch(self, seconds: float) -> Latencies:
        """The gaps between datagrams, and how long many requests take, in the next ``seconds``."""
        begin, answers = self._now(), []
        with closing(HTTPConnection(self._address, timeout=PATIENCE)) as connection:
            while time.time() - begin.time < seconds:
                answers.append(self._asked(connection))
                time.sleep(CYCLE)
        end = self._now()
        return Latencies(self.arms.gaps(begin, end), answers, end.time - begin.time)

    def _now(self) -> Heard:
        return Heard(time.time(), self.arms.computed())

    def _asked(self, connection: HTTPConnection) -> float:
        """How long a request takes that needs the lock of the world, as all do [s]."""
        begin, waited = self._now(), waited_for_a_processor(self.arms.pid)
        connection.request("GET", "/virtual/faults")
        reply = connection.getresponse()
        reply.read()
        assert reply.status == 200
        return max(0.0, self._now().since(begin) - (waited_for_a_processor(self.arms.pid) - waited))


@pytest.fixture(scope="module")
def arms() -> Iterator[Arms]:
    with closing(Arms()) as arms:
        yield arms


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory, arms: Arms) -> Iterator[str]:
    ports = [f"--{side.word}-egm-port={arms.port(side)}" for side in Side]
    log = tmp_path_factory.mktemp("controller") / "log"
    with CommandProcess("controller", "yumi", ["controller", "--rws-port", "0", *ports], Path(log)) as command:
        address = command.wait_until_ready(PATIENCE).rpartition("/")[2]
        arms.pid = command.pid
        yield address
        assert command.exit_code is None
    assert "Traceback" not in log.read_text()


@pytest.fixture
def robot(address: str, arms: Arms) -> Iterator[Robot]:
    with RwsClient(address, timeout=PATIENCE) as client:
        client.stop_rapid()
        client.move_pp_to_main()
        for name, text in (("bombs", BOMBS), ("array", ARRAY), ("long", LONG)):
            client.upload(f"HOME:/{name}.mod", text)
        for side in Side:
            client.load_module(side.task, "HOME:/bombs.mod", replace=True)
        robot = Robot(address, client, arms)
        robot.start()
        yield robot
        client.stop_rapid()


@pytest.mark.parametrize("bomb", ["textBomb", "arrayBomb", "moveBomb"])
def test_egm_and_http_go_on_beside_a_program_that_takes_all_it_gets(robot: Robot, bomb: str) -> None:
    robot.stream()
    robot.run(bomb)
    robot.watch(2.0).check()


def test_egm_and_http_go_on_while_a_task_loads_and_runs_a_long_module(robot: Robot) -> None:
    robot.stream()
    robot.run("longBomb", Side.RIGHT)
    robot.watch(5.0).check()


def test_guided_arms_go_on_while_a_long_module_is_loaded(robot: Robot) -> None:
    for side in Side:
        robot.client.set_symbol(side.task, "TRobRAPID", "module_file_path_input", '"HOME:/long.mod"')
    robot.guide()
    robot.run("runModuleLoad")
    robot.watch(5.0).check()
    robot.until(lambda: all("long" in names(robot, side) for side in Side))
    robot.client.stop_rapid()
    for side in Side:
        robot.client.unload_module(side.task, "long")


def test_http_goes_on_while_a_client_loads_a_long_module_and_compiles_it(robot: Robot) -> None:
    robot.client.stop_rapid()
    with ThreadPoolExecutor(1) as others:
        loading = others.submit(robot.client.load_module, "T_ROB_R", "HOME:/long.mod")
        compiling = others.submit(robot.client.move_pp_to_main)
        latencies = robot.watch(3.0)
        while not compiling.done():
            more = robot.watch(0.2)
            latencies = Latencies([], latencies.http + more.http, latencies.seconds + more.seconds)
        loading.result()
    Latencies([], latencies.http, latencies.seconds).check()
    assert "long" in names(robot, Side.RIGHT)
    robot.client.unload_module("T_ROB_R", "long")


@pytest.mark.parametrize("text", TARGETS.values(), ids=TARGETS)
def test_http_goes_on_while_a_client_loads_many_targets(robot: Robot, text: str) -> None:
    robot.client.stop_rapid()
    robot.client.upload("HOME:/targets.mod", text)
    with ThreadPoolExecutor(1) as others:
        loading = others.submit(robot.client.load_module, "T_ROB_R", "HOME:/targets.mod")
        latencies = robot.watch(3.0)
        while not loading.done():
            more = robot.watch(0.2)
            latencies = Latencies([], latencies.http + more.http, latencies.seconds + more.seconds)
        loading.result()
    Latencies([], latencies.http, latencies.seconds).check()
    robot.client.unload_module("T_ROB_R", "targets")


def names(robot: Robot, side: Side) -> list[str]:
    """Of the modules in a task."""
    return [module.name for module in robot.client.modules(side.task)]
