"""Captures from Python: bytes, samples and messages, beside the simulator's files and the program's decoder."""
import json

import imuscope
import numpy as np
import pytest


@pytest.fixture
def capture(drive):
    return imuscope.read_capture(drive / "capture.lcm")


def test_what_was_run(capture, drive):
    assert capture.name == "demo" and capture.bytes_skipped == 0
    assert set(capture.devices) == {"airins", "mtx1", "mtx2", "mtx3", "gnss"}
    assert "[[device]]" in capture.configuration
    assert len(list(capture.messages("IMUSCOPE_RUN"))) == 1
    header = next(capture.messages("IMUSCOPE_RUN")).message
    assert header.configuration == capture.configuration and header.t0_ns == capture.t0_ns


@pytest.mark.parametrize("device, dump", [("mtx1", "mtx1.bin"), ("gnss", "gnss.jps"), ("airins", "airins.bin")])
def test_reads_are_the_bytes_that_the_device_sent(capture, drive, device, dump):
    dumps = [file for file in drive.glob(f"{device}.*") if not file.name.endswith(".csv")]
    assert len(dumps) == 1
    reads = list(capture.reads(device))
    assert b"".join(read.data for read in reads) == dumps[0].read_bytes()
    assert len(reads) == capture.devices[device]["reads"]
    arrivals = [read.arrival_ns for read in reads]
    assert arrivals == sorted(arrivals)


def test_raw_messages_are_the_reads(capture):
    raw = b"".join(bytes(heard.message.bytes) for heard in capture.messages("IMUSCOPE_RAW_MTX1"))
    assert raw == b"".join(read.data for read in capture.reads("mtx1"))


def test_samples_of_an_imu(capture, imuscope_program, drive):
    imu = capture.samples("mtx1")["imu"]
    n = len(imu["time_ns"])
    assert imu["omega_radps"].shape == imu["f_mps2"].shape == (n, 3)
    assert np.array_equal(np.diff(imu["counter"]), np.ones(n - 1))
    # At rest, in the first half minute: gravity, and hardly any rate.
    rest = slice(0, 3000)
    assert np.linalg.norm(imu["f_mps2"][rest].mean(axis=0)) == pytest.approx(9.8, abs=0.15)
    assert np.abs(imu["omega_radps"][rest].mean(axis=0)).max() < 0.05
    assert np.median(np.diff(imu["time_ns"])) == pytest.approx(1e7, rel=1e-3)
    assert np.all(imu["arrival_ns"] >= imu["time_ns"])
    # The program's own decoder, from the dump: the same numbers in the same order.
    dump = next(file for file in drive.glob("mtx1.*") if not file.name.endswith(".csv"))
    status, printed, said = imuscope_program("decode", dump, "--json")
    assert status == 0, said
    first = next(message for message in map(json.loads, printed.splitlines()) if "counter" in json.dumps(message))
    numbers = [value for value in flat(first) if isinstance(value, float)]
    for value in imu["f_mps2"][0]:
        assert min(abs(number - value) for number in numbers) < 1e-5 * max(1.0, abs(value))


@pytest.mark.parametrize("device", ["mtx1", "gnss", "airins"])
def test_messages_of_a_protocol_are_those_of_the_program(capture, imuscope_program, drive, device):
    dump = next(file for file in drive.glob(f"{device}.*") if not file.name.endswith(".csv"))
    status, printed, said = imuscope_program("decode", dump, "--json")
    assert status == 0, said
    theirs = [json.loads(line) for line in printed.splitlines()]
    ours = list(capture.protocol_messages(device))
    assert len(ours) > 100
    arrivals = [message.arrival_ns for message in ours]
    assert arrivals == sorted(arrivals) and arrivals[0] >= capture.devices[device]["first_ns"]
    named = [message for message in theirs if "message" in message]
    assert [message.name for message in ours] == [message["message"] for message in named]
    for message, same in list(zip(ours, named))[::97]:
        assert message.fields.items() <= same.items() or message.fields == same.get("fields")


def test_messages_of_a_device_that_is_not_there(capture):
    with pytest.raises(imuscope.Error, match="no device mtx9"):
        list(capture.protocol_messages("mtx9"))


def flat(value):
    if isinstance(value, dict):
        value = list(value.values())
    return [leaf for element in value for leaf in flat(element)] if isinstance(value, list) else [value]


def test_samples_of_a_reference_and_of_a_receiver(capture, run_folder):
    reference = capture.samples("airins")
    assert {"imu", "attitude"} <= set(reference)
    gnss = capture.samples("gnss")["gnss"]
    navigation = imuscope.read_run(run_folder).navigation
    at = np.interp(gnss["utc_s"], navigation["utc_s"], navigation["lat_deg"])
    known = (gnss["utc_s"] > navigation["utc_s"][0]) & (gnss["utc_s"] < navigation["utc_s"][-1])
    assert known.sum() > 1000
    apart_m = np.abs(np.degrees(gnss["latitude_rad"]) - at)[known] * 111e3
    assert np.median(apart_m) < 3.0  # the antenna is 1.4 m from the R-IMU


def test_what_is_no_capture(tmp_path, capture):
    with pytest.raises(imuscope.Error, match="no device nobody.*mtx1"):
        capture.samples("nobody")
    for name, content in (("text.lcm", b"hello world\n" * 100), ("empty.lcm", b"")):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(imuscope.Error, match=name):
            imuscope.read_capture(tmp_path / name)
    with pytest.raises(imuscope.Error, match="nowhere"):
        imuscope.read_capture(tmp_path / "nowhere.lcm")


def test_a_damaged_capture_tells_its_damage(tmp_path, drive):
    content = bytearray((drive / "capture.lcm").read_bytes()[:3_000_000])
    content[1_000_000:1_000_100] = bytes(100)
    (tmp_path / "capture.lcm").write_bytes(content)
    capture = imuscope.read_capture(tmp_path / "capture.lcm")
    assert capture.bytes_skipped > 0
    assert len(capture.samples("mtx1")["imu"]["time_ns"]) > 1000
