"""What a capture holds: what was run, the bytes of every device, their samples, the messages beside them."""
from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import Any, Iterator, Mapping, NamedTuple, Optional, Union

import numpy as np
from numpy.typing import NDArray

from . import _imuscope
from .live import Heard, decode, matches

_NO_UTC = np.iinfo(np.int64).min


class Read(NamedTuple):
    """Bytes of one read from a device, or of one write to it."""

    device: str
    arrival_ns: int
    """On the PC's clock (CLOCK_MONOTONIC), ns."""
    is_read: bool
    data: bytes


class ProtocolMessage(NamedTuple):
    """One message that a device sent, in the words of its protocol's documents."""

    arrival_ns: int
    """Of the read in which it began, on the PC's clock, ns."""
    name: str
    """Such as "MTData2", "NAV-PVT" or "GGA"."""
    fields: dict[str, Any]


class Samples(Mapping[str, NDArray[Any]]):
    """Samples of one kind of one device, column by column, SI and radians; NaN: not valid in that sample.

    Of every kind: time_ns (time of validity on the PC's clock, ns), arrival_ns, utc_s (as the device tags it, s since
    1970-01-01; NaN where it does not). imu: omega_radps and f_mps2 (n x 3, in the device's axes as configured),
    temperature_degC, counter, flags. gnss: latitude_rad, longitude_rad, height_m, v_n_mps (n x 3, north-east-down),
    sd_position_m, sd_velocity_mps, solution (0 none, 1 single, 2 differential, 3 float, 4 fixed). attitude: roll_rad,
    pitch_rad, heading_rad, sd_rpy_rad. odometry: speed_mps. pulse: wall_ns.
    """

    def __init__(self, columns: Mapping[str, NDArray[Any]]) -> None:
        self._columns = dict(columns)
        utc_ns = self._columns.pop("utc_ns")
        self._columns["utc_s"] = np.where(utc_ns == _NO_UTC, np.nan, utc_ns * 1e-9)

    def __getitem__(self, column: str) -> NDArray[Any]:
        return self._columns[column]

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        """Columns; len(samples["time_ns"]) counts the samples."""
        return len(self._columns)


@dataclass(frozen=True)
class Capture:
    """A recording of a live run, of imusim or of `imuscope import`."""

    file: str
    name: str
    """Of the run."""
    version: str
    """Of the program that recorded."""
    configuration: str
    """Text of the configuration file; empty in a log by another recorder."""
    t0_ns: int
    """Cut of tick 0 on the PC's clock, ns."""
    devices: dict[str, dict[str, int]]
    """By name: reads, writes, bytes_read, first_ns, last_ns (arrivals)."""
    events: list[tuple[int, str]]
    """What a person marked: (time on the PC's clock in ns, text)."""
    bytes_skipped: int
    """That belong to no whole record: damage."""

    def samples(self, device: str, configuration: Optional[Union[str, os.PathLike[str]]] = None) -> dict[str, Samples]:
        """The samples of a device by kind: {"imu": ...}; a device may have several, such as imu and attitude.

        configuration: a file instead of the one that the capture holds.
        """
        file = None if configuration is None else os.fspath(configuration)
        found = _imuscope.samples([self.file], file, device)
        return {kind: Samples(columns) for kind, columns in found.items()}

    def reads(self, device: str = "") -> Iterator[Read]:
        """Every read and write of a device, or of all, in the order of arrival."""
        reads = _imuscope.CapturedReads(self.file, device)
        while batch := reads.next():
            yield from map(Read._make, batch)

    def protocol_messages(self, device: str) -> Iterator[ProtocolMessage]:
        """Every message of a device as it was sent, whether it became a sample or not; as `imuscope decode` has them."""
        for arrival_ns, name, fields in _imuscope.protocol_messages(self.file, device):
            yield ProtocolMessage(arrival_ns, name, json.loads(fields))

    def messages(self, channel: str = ".*") -> Iterator[Heard]:
        """The LCM messages of the capture, decoded, in the order of the file: the bytes of devices (raw_t), what was
        run, what a person marked, and what was published where the configuration has that recorded.

        channel: "IMUSCOPE_EVENT", or with any ending: "IMUSCOPE_RAW_.*". Messages of other types are passed over.
        """
        log = _imuscope.CapturedMessages(self.file)
        while batch := log.next():
            for name, _, data in batch:
                message = decode(data) if matches(channel, name) else None
                if message is not None:
                    yield Heard(name, message, 0.0)


def read_capture(file: Union[str, os.PathLike[str]]) -> Capture:
    """Opens a capture (the first of its files) and reads through it once; samples and messages are read on demand."""
    path = os.fspath(file)
    seen = _imuscope.summarise(path)
    return Capture(path, seen["name"], seen["version"], seen["configuration"], seen["t0_ns"], seen["devices"],
                   seen["events"], seen["bytes_skipped"])
