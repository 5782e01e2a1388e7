"""The PC that emulates another one (tools/systemd_vm): starts it, does what the scenarios in it ask for, counts."""

import argparse
import re
import socket
import subprocess
import sys
import threading
import time

# What the scenarios may ask for, in the words of QEMU's monitor.
DEEDS = {
    "plug": "device_add usb-serial,chardev=line,id=adapter,bus=usb.0,always-plugged=on",
    "unplug": "device_del adapter",
}


def say_to_monitor(path, words):
    with socket.socket(socket.AF_UNIX) as line:
        line.connect(path)
        line.sendall(words.encode() + b"\n")
        time.sleep(0.5)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, required=True)
    parser.add_argument("--console", required=True)
    parser.add_argument("--monitor", required=True)
    parser.add_argument("command", nargs="+")
    options = parser.parse_args()
    began = time.monotonic()
    passed = failed = 0
    done = False
    pc = subprocess.Popen(options.command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    timer = threading.Timer(options.seconds, pc.kill)
    timer.start()
    with open(options.console, "w", encoding="utf-8") as console:
        for raw in pc.stdout:
            text = raw.decode(errors="replace").rstrip()
            console.write(f"{time.monotonic() - began:7.1f} {text}\n")
            console.flush()
            asked = re.search(r"HOST: (\w+)", text)
            if asked and asked.group(1) in DEEDS:
                say_to_monitor(options.monitor, DEEDS[asked.group(1)])
            seen = re.search(r"SCENARIO (.*) (passed|FAILED): (.*)", text)
            if seen:
                passed += seen.group(2) == "passed"
                failed += seen.group(2) == "FAILED"
                print(f"{seen.group(2):7} {seen.group(1)}: {seen.group(3)}", flush=True)
            done = done or "GUEST DONE" in text
    timer.cancel()
    pc.wait()
    if not done:
        print(f"systemd_vm: the emulated PC ended before its scenarios did; see {options.console}")
        failed += 1
    print(f"systemd_vm: {time.monotonic() - began:.0f} s")
    print(f"{passed} passed, {failed} failed")
    return 0 if passed and not failed else 1


sys.exit(main())
