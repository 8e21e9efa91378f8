"""Makes sure that a program runs once on this machine, and knows which process is the one."""

from __future__ import annotations

import socket
import struct
import sys

from yumi.errors import RobotNotReady

_PEER_CREDENTIALS = struct.Struct("3i")  # pid, uid, gid


class Only:
    """The one of its ``name`` on this machine, from ``claim`` to ``release`` or the end of the process.

    It is a socket with a name of its own and no file (Linux); other systems do not supervise it.

    Args:
        name: what there shall be one of.
        refusal: what another one is told; ``{owner}`` in it becomes the process that is the one.
    """

    def __init__(self, name: str, refusal: str) -> None:
        self._refusal = refusal
        self._address = f"\0{name}"
        self._socket: socket.socket | None = None

    def claim(self) -> None:
        """Become the one.

        Raises:
            RobotNotReady: another process is; the message names it.
        """
        if sys.platform != "linux":
            return
        claimed = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            claimed.bind(self._address)
        except OSError as error:
            claimed.close()
            raise RobotNotReady(self._refusal.format(owner=self._owner())) from error
        claimed.listen()
        self._socket = claimed

    def release(self) -> None:
        """Let another be the one."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _owner(self) -> str:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as visitor:
            try:
                visitor.connect(self._address)
                credentials = visitor.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _PEER_CREDENTIALS.size)
            except OSError:
                return "it is ending"
        return f"process {_PEER_CREDENTIALS.unpack(credentials)[0]}"
