"""The wire of openpi's policy servers, without their client: MessagePack, in which arrays are maps of bytes.

`openpi-client` 0.1.2 does the same, and needs NumPy 1; where you have that, take its `WebsocketClientPolicy`.
"""

import msgspec
import numpy as np


def _packed(value: object) -> object:
    if isinstance(value, np.ndarray) and value.dtype.kind not in "VOc":
        return {b"__ndarray__": True, b"data": value.tobytes(), b"dtype": value.dtype.str, b"shape": value.shape}
    if isinstance(value, np.generic):
        return {b"__npgeneric__": True, b"data": value.item(), b"dtype": value.dtype.str}
    raise TypeError(f"{type(value).__name__} cannot be sent")


def _unpacked(value: object) -> object:
    if isinstance(value, list):
        return [_unpacked(each) for each in value]
    if not isinstance(value, dict):
        return value
    if b"__ndarray__" in value:
        return np.frombuffer(value[b"data"], np.dtype(value[b"dtype"])).reshape(value[b"shape"])
    if b"__npgeneric__" in value:
        return np.dtype(value[b"dtype"]).type(value[b"data"])
    return {key: _unpacked(each) for key, each in value.items()}


def pack(message: dict) -> bytes:
    return msgspec.msgpack.encode(message, enc_hook=_packed)


def unpack(data: bytes) -> dict:
    return _unpacked(msgspec.msgpack.decode(data))
