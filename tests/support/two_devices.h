#pragma once

namespace imuscope::test {

/// A reference (device 0) and an S-IMU (device 1), with nothing else said of them. What follows in the text is of the
/// S-IMU.
inline constexpr const char* kTwoDevices = R"(
[[device]]
name = "r"
role = "reference"
protocol = "csv_imu"
[[device]]
name = "s"
role = "study"
protocol = "csv_imu"
)";

}  // namespace imuscope::test
