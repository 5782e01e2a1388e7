#pragma once

/// Campaigns without studies: captures of a few bytes, and results as studies would have left them.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>

#include "fleet/fleet_file.h"
#include "fleet/plan.h"

namespace imuscope::test {

inline constexpr const char* kMadeProgram = "1.0+made";

/// Writes `content` into `file`, whose folder is made.
void write_file(const std::filesystem::path& file, const std::string& content);

/// fleet.toml of `units` vehicles with one unit "unitNN" (device "imu") each, and `drives` captures of each.
fleet::FleetFile make_fleet(const std::filesystem::path& folder, int units, int drives);

/// A study's result with one measurement of each quantity.
/// @param value  of a quantity, by its name: a logarithm of "angle random walk", deg/s of "gyro bias"
nlohmann::json made_result(const fleet::StudyTask& task, int day,
                           const std::function<double(const std::string&)>& value);

/// Puts the result in its place.
void publish(const fleet::StudyTask& task, const nlohmann::json& result);

}  // namespace imuscope::test
