#!/usr/bin/python3
"""Writes flight.ulg and flight.bin: logs of PX4 and ArduPilot, from the descriptions of their formats.

Usage: make_flight_logs.py FOLDER [--seconds S]
Two IMUs at 100 Hz that turn alike, a receiver at 5 Hz that tells UTC, 20 s without options; programs of others
(tools/mcap_proof) and imuscope read them.
"""
import argparse
import math
import pathlib
import struct

UTC_US = 1_700_000_000_000_000
BOOT_US = 10_000_000
LEAP_S = 18
GPS_EPOCH_S = 315_964_800


def rate(t):
    return [0.3 * math.sin(0.7 * t), 0.2 * math.sin(1.1 * t + 0.3), 0.5 * math.sin(0.5 * t)]


def force(t):
    return [0.4 * math.sin(0.9 * t), 0.3 * math.cos(0.6 * t), -9.80665]


def place(t):
    return 47.0 + 1e-6 * t, 8.0 + 2e-6 * t, 450.0 + 0.1 * t


class Ulog:
    def __init__(self):
        self.bytes = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", BOOT_US)
        self.message("B", bytes(40))

    def message(self, kind, content):
        self.bytes += struct.pack("<HB", len(content), ord(kind)) + content

    def subscribe(self, instance, ident, name):
        self.message("A", struct.pack("<BH", instance, ident) + name.encode())

    def data(self, ident, layout, *values):
        self.message("D", struct.pack("<H", ident) + struct.pack("<" + layout, *values))


def ulog(seconds):
    log = Ulog()
    log.message("F", b"vehicle_imu:uint64_t timestamp;uint64_t timestamp_sample;uint32_t accel_device_id;"
                b"uint32_t gyro_device_id;float[3] delta_angle;float[3] delta_velocity;uint32_t delta_angle_dt;"
                b"uint32_t delta_velocity_dt;uint8_t delta_angle_clipping;uint8_t delta_velocity_clipping;"
                b"uint8_t accel_calibration_count;uint8_t gyro_calibration_count;uint8_t[4] _padding0;")
    log.message("F", b"sensor_combined:uint64_t timestamp;float[3] gyro_rad;uint32_t gyro_integral_dt;"
                b"int32_t accelerometer_timestamp_relative;float[3] accelerometer_m_s2;"
                b"uint32_t accelerometer_integral_dt;")
    log.message("F", b"sensor_gps:uint64_t timestamp;uint64_t time_utc_usec;double latitude_deg;"
                b"double longitude_deg;double altitude_msl_m;double altitude_ellipsoid_m;float s_variance_m_s;"
                b"float eph;float epv;float vel_n_m_s;float vel_e_m_s;float vel_d_m_s;"
                b"int32_t timestamp_time_relative;uint8_t fix_type;bool vel_ned_valid;uint8_t[2] _padding0;")
    log.message("I", b"\x0cchar[3] sys_abc")
    for ident, (instance, name) in enumerate(((0, "vehicle_imu"), (1, "vehicle_imu"), (0, "sensor_combined"),
                                              (0, "sensor_gps"))):
        log.subscribe(instance, ident, name)
    for k in range(int(seconds * 100)):
        us = BOOT_US + (k + 1) * 10_000
        t = (k + 0.5) * 0.01
        if k % 100 == 0:
            log.message("S", bytes((0x2F, 0x73, 0x13, 0x20, 0x25, 0x0C, 0xBB, 0x12)))
        for ident in (0, 1):
            log.data(ident, "QQII6fII4B", us + 300, us, 1, 2, *(0.01 * v for v in rate(t)),
                     *(0.01 * v for v in force(t)), 10_000, 10_000, 0, 0, 0, 0)
        log.data(2, "Q3fIi3fI", us, *rate(t), 10_000, 0, *force(t), 10_000)
        if k % 20 == 0:
            lat, lon, height = place(k * 0.01)
            log.data(3, "QQ4d3f3fiBB2x", us, UTC_US + us - BOOT_US, lat, lon, height - 48.0, height, 0.1, 0.02, 0.03,
                     0.11, 0.15, -0.1, 0, 6, 1)
    return log.bytes


def record(kind, layout, *values):
    return b"\xA3\x95" + bytes((kind,)) + struct.pack("<" + layout, *values)


def described(kind, layout, name, characters, labels):
    return record(128, "BB4s16s64s", kind, 3 + struct.calcsize("<" + layout), name, characters, labels)


def dataflash(seconds):
    imu = "QB6fIIfBBHH"
    gps = "QBBIHBhiiiffffB"
    gpa = "QBHHHHfBIHf"
    log = described(128, "BB4s16s64s", b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")
    log += described(150, imu, b"IMU", b"QBffffffIIfBBHH",
                     b"TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz")
    log += described(130, gps, b"GPS", b"QBBIHBcLLeffffB",
                     b"TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw,U")
    log += described(131, gpa, b"GPA", b"QBCCCCfBIHf", b"TimeUS,I,VDop,HAcc,VAcc,SAcc,YAcc,VV,SMS,Delta,Und")
    for k in range(int(seconds * 100)):
        us = BOOT_US + k * 10_000
        t = k * 0.01
        for instance in (0, 1):
            log += record(150, imu, us, instance, *rate(t), *force(t), 0, 0, 25.0, 1, 1, 1000, 1000)
        if k % 20 == 0:
            lat, lon, height = place(t)
            gps_ms = (UTC_US // 1000 + k * 10) - GPS_EPOCH_S * 1000 + LEAP_S * 1000
            week, ms = divmod(gps_ms, 604_800_000)
            log += record(130, gps, us, 0, 6, ms, week, 14, 80, round(lat * 1e7), round(lon * 1e7),
                          round((height - 48.0) * 100), 0.18, 53.1, -0.1, 0.0, 1)
            log += record(131, gpa, us, 0, 120, 2, 3, 10, 0.0, 1, us // 1000, 200, -48.0)
    return log


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--seconds", type=float, default=20.0)
    options = parser.parse_args()
    (options.folder / "flight.ulg").write_bytes(ulog(options.seconds))
    (options.folder / "flight.bin").write_bytes(dataflash(options.seconds))


main()
