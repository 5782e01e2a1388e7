"""Live data: the messages that a run publishes over LCM."""
from __future__ import annotations

import io
import time
from typing import Any, Iterator, NamedTuple, Optional

from . import _imuscope, messages
from ._imuscope import Error

_ANY_ENDING = ".*"
_WAIT_MS = 100
"""Between two looks at Ctrl-C."""

_TYPES = {getattr(messages, name)._get_packed_fingerprint(): getattr(messages, name)
          for name in dir(messages) if isinstance(getattr(messages, name), type)}


class _Whole(io.BytesIO):
    """Bytes of which a decoder gets as many as it asks for, or none: lcm-gen's takes what there is for the whole."""

    def read(self, size: Optional[int] = -1, /) -> bytes:
        data = super().read(size)
        if size is None or size < 0 or len(data) != size:
            raise EOFError
        return data


class Heard(NamedTuple):
    """A message of a channel."""

    channel: str
    message: Any
    """Of a type of imuscope.messages, whose fields are those of docs/live_data.md."""
    age_s: float
    """How long it had waited to be read, s."""


def decode(data: bytes) -> Optional[Any]:
    """The message that the bytes are: of a type of imuscope.messages, told by its fingerprint. None for anything else;
    bytes come from a network, and anybody may send some."""
    kind = _TYPES.get(data[:8])
    if kind is None:
        return None
    stream = _Whole(data)
    try:
        message = kind.decode(stream)
    except Exception:  # of what damaged lengths can do to a decoder, no list would be whole
        return None
    return message if stream.tell() == len(data) else None


def matches(pattern: str, channel: str) -> bool:
    """Whether a channel has this name, or this beginning where the pattern ends in ".*"."""
    if pattern.endswith(_ANY_ENDING):
        return channel.startswith(pattern[:-len(_ANY_ENDING)])
    return channel == pattern


def subscribe(url: str = _imuscope.default_lcm_url, channel: str = "IMUSCOPE_.*",
              timeout_s: Optional[float] = None) -> Iterator[Heard]:
    """Messages as they come, decoded: for channel, message, age_s in subscribe(channel="IMUSCOPE_STATUS"): ...

    url: udpm://ADDRESS:PORT?ttl=N; with ttl=0 this PC alone is heard. channel: one, or all with a beginning:
    "IMUSCOPE_CALIBRATION_.*". timeout_s: the iteration ends where nothing came for so long; None: never. The socket is
    open from the call on. What is no message of imuscope is passed over. One thread at a time.
    """
    prefix, separator, kind = channel.partition("_")
    if not separator or not prefix:
        raise Error(f"the channel {channel} has no prefix; write IMUSCOPE_STATUS, IMUSCOPE_.* or the like")
    listener = _imuscope.Listener(url, prefix)
    listener.subscribe(kind)
    return _heard(listener, timeout_s)


def _heard(listener: _imuscope.Listener, timeout_s: Optional[float]) -> Iterator[Heard]:
    last = time.monotonic()
    while timeout_s is None or time.monotonic() - last < timeout_s:
        for name, data, age_s in listener.wait(_WAIT_MS):
            message = decode(data)
            if message is not None:
                yield Heard(name, message, age_s)
                last = time.monotonic()
