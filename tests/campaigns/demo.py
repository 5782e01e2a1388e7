#!/usr/bin/env python3
"""The vehicle of config/demo.toml, changed as a campaign wants it: read and written as TOML, never patched as text.

Usage: tests/campaigns/demo.py FILE [--study NAME]...
  --study NAME  only these S-IMUs (all)
Writes the vehicle to FILE.
"""
import argparse
import datetime
import json
import pathlib
import re
import sys
import tomllib

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
# Roughly the demo's mountings: with them every S-IMU is estimated from the first seconds on.
TURNS_DEG = {"mtx1": [0.0, 0.0, 0.0], "mtx2": [0.0, 0.0, 91.0], "mtx3": [179.0, 0.0, 0.0]}


def demo(*, ports=None, duration_s=None, start_utc=None, studies=None, with_priors=False):
    """The demo's tables. ports: the folder of its pseudo-terminals. start_utc: a datetime. studies: the names of the S-IMUs that stay."""
    vehicle = tomllib.loads((ROOT / "config" / "demo.toml").read_text())
    simulation = vehicle["simulation"]
    if studies is not None:
        unknown = set(studies) - set(TURNS_DEG)
        if unknown:
            raise ValueError(f"the demo has no S-IMU {', '.join(sorted(unknown))}; it has {', '.join(TURNS_DEG)}")
        vehicle["device"] = [device for device in vehicle["device"] if device["role"] != "study" or device["name"] in studies]
        simulation["imu"] = [imu for imu in simulation["imu"] if imu["name"] in studies]
    for device in vehicle["device"]:
        if ports is not None:
            device["transport"]["port"] = str(pathlib.Path(ports) / device["name"])
        if with_priors and device["role"] == "study":
            device["prior"] = {"rotation_vector_b_s_deg": TURNS_DEG[device["name"]], "boresight_sd_deg": 3.0,
                               "lever_arm_sd_m": 0.5, "time_offset_ms": 0.0, "time_offset_sd_ms": 10.0}
    if duration_s is not None:
        simulation["duration_s"] = float(duration_s)
    if start_utc is not None:
        simulation["start_utc"] = start_utc
    return vehicle


def _value(value):
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_value(entry)}" for key, entry in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, (bool, str)):
        return json.dumps(value)  # TOML's strings take JSON's escapes
    if isinstance(value, datetime.datetime):
        return value.isoformat().replace("+00:00", "Z")
    return repr(value)


def toml(tables, path=""):
    """The text of tables that tomllib has read."""
    lines, below = [], []
    for key, value in tables.items():
        if not re.fullmatch(r"[A-Za-z0-9_-]+", key):
            raise ValueError(f"a key that TOML has to quote: {key!r}")
        name = f"{path}{key}"
        if isinstance(value, list) and value and all(isinstance(entry, dict) for entry in value):
            below += [f"\n[[{name}]]\n{toml(entry, name + '.')}" for entry in value]
        elif isinstance(value, dict) and key not in ("transport", "prior"):
            below.append(f"\n[{name}]\n{toml(value, name + '.')}")
        else:
            lines.append(f"{key} = {_value(value)}\n")
    return "".join(lines + below)


def write(vehicle, file):
    pathlib.Path(file).write_text(toml(vehicle).lstrip("\n"))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=pathlib.Path)
    parser.add_argument("--study", action="append")
    options = parser.parse_args()
    write(demo(studies=options.study), options.file)


if __name__ == "__main__":
    sys.exit(main())
