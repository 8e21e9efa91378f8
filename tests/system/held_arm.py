"""The sensor of one arm that holds it where it is, and what the robot has sent."""

from __future__ import annotations

import selectors
import socket
import time
from threading import Event

from abb_protocols.egm.codec import SensorCodec, SensorMessage


class HeldArm:
    """The sensor of one arm, which holds it where it is.

    Attributes:
        numbers: of the robot's datagrams.
        times: when they came [s].
    """

    def __init__(self, port: int) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", port))
        self.numbers: list[int] = []
        self.times: list[float] = []
        self._codec = SensorCodec(axes=7)

    def answer(self) -> None:
        datagram, sender = self.socket.recvfrom(2048)
        message = self._codec.decode(datagram)
        self.numbers.append(message.seqno)
        self.times.append(time.perf_counter())
        reply = SensorMessage(seqno=message.seqno, position=message.planned)
        self.socket.sendto(self._codec.encode(reply), sender)


def answer_all(arms: list[HeldArm], is_over: Event) -> None:
    """Hold arms until it is over."""
    with selectors.DefaultSelector() as selector:
        for arm in arms:
            selector.register(arm.socket, selectors.EVENT_READ, arm)
        while not is_over.is_set():
            for key, _ in selector.select(0.1):
                key.data.answer()
