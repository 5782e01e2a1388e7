"""Live data in Python: what is published is what is heard, on a bus of its own; and what anybody else may send."""
import random
import socket
import struct
import subprocess
import time

import imuscope
import pytest
from conftest import BUILD, DATA
from imuscope import messages

BUS = ("239.255.76.67", 7667)


@pytest.fixture
def example_bus():
    """Publishes a message of every type ten times a second."""
    program = BUILD / "bin" / "example_bus"
    if not program.exists():
        pytest.skip("example_bus is not built")
    bus = subprocess.Popen([program, "60"])
    yield bus
    bus.terminate()
    bus.wait()


def send(channel, data):
    """A datagram as anybody may send it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        sender.sendto(b"LC02" + struct.pack(">I", 1) + channel.encode() + b"\0" + data, BUS)


def test_every_type_is_heard_as_it_was_sent(example_bus):
    heard = {}
    for channel, message, age_s in imuscope.subscribe(timeout_s=10.0):
        heard[channel] = message
        assert 0.0 <= age_s < 5.0
        # What was decoded is what comes out again.
        assert type(message).decode(message.encode()).encode() == message.encode()
        if len(heard) >= 12:
            break
    assert isinstance(heard["IMUSCOPE_STATUS"], messages.status_t)
    assert heard["IMUSCOPE_CALIBRATION_MTX1"].name == "mtx1"
    assert len(heard["IMUSCOPE_ERROR_MTX1"].rows) == heard["IMUSCOPE_ERROR_MTX1"].n_rows > 0
    assert heard["IMUSCOPE_STATUS"].n_devices == len(heard["IMUSCOPE_STATUS"].devices) > 0


def test_one_channel_is_heard_alone(example_bus):
    for count, heard in enumerate(imuscope.subscribe(channel="IMUSCOPE_NAVIGATION", timeout_s=10.0)):
        assert heard.channel == "IMUSCOPE_NAVIGATION"
        if count == 5:
            break


def test_silence_ends_an_iteration_where_that_is_asked_for():
    began = time.monotonic()
    assert list(imuscope.subscribe(timeout_s=0.5)) == []
    assert 0.4 < time.monotonic() - began < 5.0


def test_what_is_heard_from_a_replay_is_in_its_files(tmp_path):
    heard = imuscope.subscribe(channel="IMUSCOPE_CALIBRATION_MTX1", timeout_s=60.0)
    replay = subprocess.Popen([BUILD / "bin" / "imuscope", "replay", DATA / "drive" / "capture.lcm", "--out", tmp_path / "run",
                               "--lcm", imuscope.DEFAULT_LCM_URL], stdout=subprocess.DEVNULL)
    received = []
    for _, message, _ in heard:
        received.append(message)
        if len(received) == 400:
            break
    assert replay.wait(timeout=120) == 0
    table = imuscope.read_run(tmp_path / "run").calibrations["mtx1"]
    places = {round(time_s, 6): i for i, time_s in enumerate(table["time_s"])}
    matched = 0
    for message in received:
        place = places.get(round(message.time_s, 6))
        if place is None:
            continue
        matched += 1
        for name in ("q_w", "sd_psi_x_deg", "sd_r_x_m", "bg_x_radps"):
            value = getattr(message, name)
            if value == value:
                assert value == pytest.approx(table[name][place], rel=1e-9), name
    assert matched > 100


def test_foreign_messages_are_passed_over():
    heard = imuscope.subscribe(channel="IMUSCOPE_EVENT", timeout_s=2.0)
    good = messages.event_t()
    good.text = "gravel"
    for data in (b"", b"\0" * 8, b"junk" * 100, good.encode()[:-1], good.encode() + b"x",
                 good.encode()[:8] + b"\xff" * 40, good.encode()):
        send("IMUSCOPE_EVENT", data)
    send("OTHER_EVENT", good.encode())
    assert [message.text for _, message, _ in heard] == ["gravel"]


def test_damage_ends_in_no_message_and_takes_no_memory(example_bus):
    originals = []
    for channel, message, _ in imuscope.subscribe(timeout_s=10.0):
        originals.append(message.encode())
        if len(originals) == 12:
            break
    chance = random.Random(1)
    for original in originals:
        for _ in range(300):
            damaged = bytearray(original)
            for _ in range(chance.randint(1, 8)):
                damaged[chance.randrange(8, len(damaged))] = chance.choice((0, 1, 127, 128, 255, chance.randrange(256)))
            cut = damaged[:chance.randint(0, len(damaged))] if chance.random() < 0.3 else damaged
            message = imuscope.decode(bytes(cut))
            assert message is None or isinstance(message, tuple(imuscope.live._TYPES.values()))


@pytest.mark.parametrize("url, channel, words", [
    ("tcpq://localhost", "IMUSCOPE_STATUS", "udpm"), ("udpm://1.2.3.4:7667", "IMUSCOPE_STATUS", "."),
    (imuscope.DEFAULT_LCM_URL, "STATUS", "prefix"), (imuscope.DEFAULT_LCM_URL, "A_" + "X" * 80, "63"),
])
def test_what_cannot_be_listened_to(url, channel, words):
    with pytest.raises(imuscope.Error, match=words):
        imuscope.subscribe(url, channel)
