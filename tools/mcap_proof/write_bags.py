#!/usr/bin/python3
"""The tables of a drive (read_mcap.mjs) as bags of ROS 1, by Debian's python3-rosbag: none, lz4 and bz2.

Usage: write_bags.py CSV_FOLDER BAG_FOLDER TESTS_VECTORS
Exits with 77 where python3-rosbag is not installed.
"""
import csv
import pathlib
import sys
from decimal import Decimal

tables, bags, vectors = map(pathlib.Path, sys.argv[1:4])
sys.dont_write_bytecode = True
sys.path.insert(0, str(vectors))
try:
    import make_bags  # noqa: E402
except ModuleNotFoundError as missing:
    if missing.name not in ("genpy", "rosbag"):
        raise
    print("write_bags: without bags of ROS 1, as there is no python3-rosbag", file=sys.stderr)
    sys.exit(77)


def rows(name):
    with open(tables / f"{name}.csv", newline="") as lines:
        for row in list(csv.reader(lines))[1:]:
            yield make_bags.BEGIN_NS + int(Decimal(row[0]) * 10**9), [float(cell) for cell in row[1:]]


def messages():
    everything = []
    for name in ("airins", "mtx1", "mtx2", "mtx3"):
        everything += [(ns, f"/imu/{name}/raw", make_bags.imu(ns, v[:3], v[3:])) for ns, v in rows(name)]
    for ns, (lat, lon, height, north, east, down, *sd) in rows("gnss"):
        twist = make_bags.stamped("geometry_msgs/TwistStamped", ns, "map")
        twist.twist.linear.x, twist.twist.linear.y, twist.twist.linear.z = east, north, -down
        everything.append((ns, "/gnss/gnss/velocity", twist))
        fix = make_bags.stamped("sensor_msgs/NavSatFix", ns, "gnss")
        fix.status.status, fix.latitude, fix.longitude, fix.altitude = 2, lat, lon, height
        for place, value in zip((4, 0, 8), sd):
            fix.position_covariance[place] = value * value
        fix.position_covariance_type = 2
        everything.append((ns, "/gnss/gnss/fix", fix))
    everything.sort(key=lambda one: one[0])
    for ns, topic, message in everything:
        yield topic, message, ns


bags.mkdir(exist_ok=True)
make_bags.write(bags, messages, 768 * 1024)
