#!/usr/bin/env python3
"""Reads the folder of a run with nothing but Python: the mountings, and the size of each error at rest and in motion.

Usage: read_run.py RUN
"""
import csv
import json
import math
import sys
from collections import defaultdict
from pathlib import Path

run = Path(sys.argv[1])
AXES = ["e_gyro_x_radps", "e_gyro_y_radps", "e_gyro_z_radps", "e_accel_x_mps2", "e_accel_y_mps2", "e_accel_z_mps2"]

for imu in json.loads((run / "calibration.json").read_text())["imus"]:
    name = imu["name"]
    arm_mm = ", ".join(f"{1e3 * r:.1f} +- {1e3 * sd:.1f}" for r, sd in zip(imu["r_bs_b_m"], imu["r_bs_b_sd_m"]))
    print(f"{name}: lever arm {arm_mm} mm")

    # Root mean square about the mean, by axis and regime, in one pass over the file (Welford 1962).
    count, mean, squares = (defaultdict(float) for _ in range(3))
    with open(run / f"errors_{name}.csv", newline="") as rows:
        for row in csv.DictReader(rows):
            for axis in AXES:
                if row["regime"] == "" or row[axis] == "":  # near a change of regime it belongs to neither
                    continue
                key = (row["regime"], axis)
                value = float(row[axis])
                count[key] += 1
                step = value - mean[key]
                mean[key] += step / count[key]
                squares[key] += step * (value - mean[key])
    for regime in sorted({regime for regime, _ in count}):
        rms = ", ".join(f"{axis[2:]} {math.sqrt(squares[regime, axis] / count[regime, axis]):.3g}" for axis in AXES
                        if count[regime, axis])
        print(f"  {regime}: {rms}")
