#!/usr/bin/python3
"""Writes bag_none.bag, bag_lz4.bag and bag_bz2.bag with Debian's python3-rosbag, which is not ours.

Usage: make_bags.py FOLDER
Half a second of an IMU at 100 Hz, of a receiver at 10 Hz, of wheels at 50 Hz and of UTC at 1 Hz, numbers that tests/logs/rosbag
computes again. tools/mcap_proof/write_bags.py makes bags of a whole drive in the same way.
"""
import argparse
import math
import pathlib

import genpy
import genpy.dynamic
import rosbag

LINE = "=" * 80 + "\n"
HEADER = LINE + "MSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"
VECTOR = LINE + "MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
QUATERNION = LINE + "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
POINT = LINE + "MSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n"
TWIST = LINE + "MSG: geometry_msgs/Twist\ngeometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n" + VECTOR
DEFINITIONS = {
    "sensor_msgs/Imu": "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\n"
    "float64[9] orientation_covariance\ngeometry_msgs/Vector3 angular_velocity\n"
    "float64[9] angular_velocity_covariance\ngeometry_msgs/Vector3 linear_acceleration\n"
    "float64[9] linear_acceleration_covariance\n" + HEADER + QUATERNION + VECTOR,
    "sensor_msgs/NavSatFix": "std_msgs/Header header\nsensor_msgs/NavSatStatus status\nfloat64 latitude\n"
    "float64 longitude\nfloat64 altitude\nfloat64[9] position_covariance\nuint8 position_covariance_type\n"
    + HEADER + LINE + "MSG: sensor_msgs/NavSatStatus\nint8 status\nuint16 service\n",
    "sensor_msgs/TimeReference": "std_msgs/Header header\ntime time_ref\nstring source\n" + HEADER,
    "geometry_msgs/TwistStamped": "std_msgs/Header header\ngeometry_msgs/Twist twist\n" + HEADER + TWIST,
    "nav_msgs/Odometry": "std_msgs/Header header\nstring child_frame_id\n"
    "geometry_msgs/PoseWithCovariance pose\ngeometry_msgs/TwistWithCovariance twist\n" + HEADER
    + LINE + "MSG: geometry_msgs/PoseWithCovariance\ngeometry_msgs/Pose pose\nfloat64[36] covariance\n"
    + LINE + "MSG: geometry_msgs/Pose\ngeometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"
    + POINT + QUATERNION
    + LINE + "MSG: geometry_msgs/TwistWithCovariance\ngeometry_msgs/Twist twist\nfloat64[36] covariance\n" + TWIST,
}
TYPES = {}
for name, text in DEFINITIONS.items():
    TYPES.update(genpy.dynamic.generate_dynamic(name, text))
BEGIN_NS = 1_700_000_000_250_000_000


def time_of(ns):
    return genpy.Time(ns // 10**9, ns % 10**9)


def stamped(name, ns, frame):
    message = TYPES[name]()
    message.header.stamp = time_of(ns)
    message.header.frame_id = frame
    return message


def imu(ns, rate, force):
    message = stamped("sensor_msgs/Imu", ns, "imu_link")
    message.orientation_covariance[0] = -1.0
    for vector, values in ((message.angular_velocity, rate), (message.linear_acceleration, force)):
        vector.x, vector.y, vector.z = values
    return message


def messages(seconds):
    """Topic, message and stamp."""
    for k in range(int(seconds * 100)):
        ns = BEGIN_NS + k * 10_000_000
        yield "/imu/data", imu(ns, (0.01 * k, -0.5, math.sin(0.1 * k)), (0.1, 0.2 * k, 9.81)), ns
        if k % 2 == 0:
            odometry = stamped("nav_msgs/Odometry", ns, "odom")
            odometry.child_frame_id = "base_link"
            odometry.twist.twist.linear.x = 0.25 * k
            yield "/odom", odometry, ns
        if k % 10 == 0:
            twist = stamped("geometry_msgs/TwistStamped", ns, "map")
            twist.twist.linear.x, twist.twist.linear.y, twist.twist.linear.z = 1.0, 2.0, 3.0
            yield "/vel", twist, ns
            fix = stamped("sensor_msgs/NavSatFix", ns, "gps")
            fix.status.status, fix.latitude, fix.longitude, fix.altitude = 2, 45.0 + 1e-6 * k, 7.5, 300.0 + k
            fix.position_covariance[0] = fix.position_covariance[4] = 1e-4
            fix.position_covariance[8] = 4e-4
            fix.position_covariance_type = 2
            yield "/fix", fix, ns
        if k % 100 == 0:
            reference = stamped("sensor_msgs/TimeReference", ns, "")
            reference.time_ref = time_of(ns - 252_000_000)
            yield "/time", reference, ns


def write(folder, messages_of, chunk_bytes):
    """bag_none.bag, bag_lz4.bag and bag_bz2.bag of (topic, message, stamp); recorded 2 ms behind the stamp."""
    for compression in ("none", "lz4", "bz2"):
        with rosbag.Bag(folder / f"bag_{compression}.bag", "w", compression=compression,
                        chunk_threshold=chunk_bytes) as bag:
            for topic, message, ns in messages_of():
                bag.write(topic, message, time_of(ns + 2_000_000))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=pathlib.Path)
    write(parser.parse_args().folder, lambda: messages(0.5), 8 * 1024)


if __name__ == "__main__":
    main()
