# A disk for nbdkit's python plugin that writes down what it is asked: every write with its bytes and every flush,
# each with the time (CLOCK_MONOTONIC) at which it was done. tools/power_cuts makes of that what a disk holds after a
# cut of the power.
# Entries: one byte 'W' or 'F', a double of seconds, and of a write its offset and length (64 bits each) and its bytes,
# all little-endian.
import struct
import time

import nbdkit

API_VERSION = 2

disk = bytearray()
journal = None


def thread_model():
    return nbdkit.THREAD_MODEL_SERIALIZE_ALL_REQUESTS


def config(key, value):
    global disk, journal
    if key == "size":
        disk = bytearray(int(value))
    elif key == "journal":
        journal = open_file(value, "wb", buffering=0)
    else:
        raise RuntimeError(f"unknown parameter {key}")


open_file = open


def open(readonly):  # noqa: A001 - the name that nbdkit asks for
    return 1


def get_size(handle):
    return len(disk)


def can_fua(handle):
    return nbdkit.FUA_EMULATE


def pread(handle, buffer, offset, flags):
    buffer[:] = disk[offset : offset + len(buffer)]


def pwrite(handle, buffer, offset, flags):
    disk[offset : offset + len(buffer)] = buffer
    journal.write(b"W" + struct.pack("<dQQ", time.monotonic(), offset, len(buffer)) + bytes(buffer))


def flush(handle, flags):
    journal.write(b"F" + struct.pack("<d", time.monotonic()))
