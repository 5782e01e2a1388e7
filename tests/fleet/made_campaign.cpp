#include "made_campaign.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <fstream>

#include "fleet/study_summary.h"

namespace imuscope::test {

using nlohmann::json;

void write_file(const std::filesystem::path& file, const std::string& content) {
  std::filesystem::create_directories(file.parent_path());
  std::ofstream(file, std::ios::binary) << content;
}

fleet::FleetFile make_fleet(const std::filesystem::path& folder, int units, int drives) {
  std::string toml = "[fleet]\ncaptures = [\"captures\"]\n";
  for (int u = 0; u < units; ++u) {
    toml += fmt::format(
        "[[mounting]]\nvehicle = \"van {0}\"\nname = \"spring\"\ncaptures = [\"v{0:02}/*\"]\nunits "
        "= {{ imu = \"unit{0:02}\" }}\n",
        u);
    for (int d = 0; d < drives; ++d)
      write_file(folder / "captures" / fmt::format("v{:02}", u) / fmt::format("d{:02}.lcm", d),
                 fmt::format("{} {}", u, d));
  }
  write_file(folder / "fleet.toml", toml);
  auto fleet = fleet::read_fleet_file(folder / "fleet.toml");
  EXPECT_TRUE(fleet) << fleet.error().text();
  return *fleet;
}

json made_result(const fleet::StudyTask& task, int day,
                 const std::function<double(const std::string&)>& value) {
  const std::string utc = fmt::format("2026-{:02}-{:02}T10:00:00.000000Z", 1 + day / 28, 1 + day % 28);
  json measurements = json::array();
  for (const char* axis : {"gyro_x", "gyro_y", "gyro_z"})
    measurements.push_back(
        {"angle random walk", "static", axis, "deg/sqrt(h)", true, value("angle random walk"), 0.05});
  measurements.push_back({"gyro bias", "", "x", "deg/s", false, value("gyro bias"), 0.02});
  const json imu{{"device", "imu"},
                 {"status", "calibrated"},
                 {"usability", "usable"},
                 {"temperature_degC", nullptr},
                 {"data_sheet", {{"gyro_density_degps_per_sqrt_hz", 1.0 / 60.0}}},
                 {"measurements", measurements},
                 {"models", json::array()},
                 {"C_b_s", {1, 0, 0, 0, 1, 0, 0, 0, 1}},
                 {"boresight_sd_deg", {0.01, 0.01, 0.01}},
                 {"r_bs_b_m", {0.1, 0.2, 0.3}},
                 {"r_bs_b_sd_m", {0.001, 0.001, 0.001}},
                 {"t_d_s", 0.0},
                 {"t_d_sd_s", 1e-4}};
  return {{"schema", fleet::kStudySchema},
          {"key", task.key},
          {"program", kMadeProgram},
          {"state", "studied"},
          {"reason", ""},
          {"summary",
           {{"t0_utc", utc},
            {"duration_s", 900.0},
            {"gnss_used", 9000},
            {"distance_m", 5000.0},
            {"track", {{46.5, 6.5}, {46.51, 6.51 + 0.001 * day}}},
            {"findings", json::array()},
            {"warnings", 0},
            {"devices", json::array()},
            {"imus", {imu}}}}};
}

void publish(const fleet::StudyTask& task, const json& result) {
  write_file(task.out / "studies" / task.key / "result.json", result.dump());
}

}  // namespace imuscope::test
