/// The types and the names of channels, as promised to listeners.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <fstream>
#include <imuscope/ins_t.hpp>
#include <imuscope/pose_t.hpp>
#include <regex>
#include <sstream>
#include <tuple>

#include "publish/channel_name.h"
#include "publish/message_values.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

/// Names of the fields of one message type, read from its definition.
std::vector<std::string> fields_of(const std::string& type) {
  std::ifstream file(test::source_path("src/publish/lcm/" + type + ".lcm"));
  EXPECT_TRUE(file.is_open()) << type;
  std::vector<std::string> fields;
  const std::regex declaration(R"(^\s+(?:double|string|int64_t|int32_t|int8_t|boolean)\s+(\w+)\s*;.*)");
  for (std::string line; std::getline(file, line);) {
    std::smatch match;
    if (std::regex_match(line, match, declaration)) fields.push_back(match[1]);
  }
  return fields;
}

std::vector<std::string> words(const std::string& text) {
  std::istringstream stream(text);
  return {std::istream_iterator<std::string>(stream), {}};
}

TEST(MessageTypes, FieldsAreThoseOfTheFilesOfARun) {
  EXPECT_EQ(fields_of("navigation_t"),
            words("utime sequence time_s gps_week gps_tow_s lat_deg lon_deg height_m v_n_mps v_e_mps v_d_mps "
                  "roll_deg pitch_deg heading_deg sd_n_m sd_e_m sd_d_m sd_v_n_mps sd_v_e_mps sd_v_d_mps "
                  "sd_roll_deg sd_pitch_deg sd_heading_deg validity reference_age_s gnss_age_s"));
  EXPECT_EQ(fields_of("error_t"),
            words("utime sequence name regime validity reference_age_s gnss_age_s n_rows"));
  EXPECT_EQ(fields_of("error_row_t"),
            words("utime time_s counter e_gyro_x_radps e_gyro_y_radps e_gyro_z_radps "
                  "e_accel_x_mps2 e_accel_y_mps2 e_accel_z_mps2"));
  EXPECT_EQ(
      fields_of("calibration_t"),
      words(
          "utime sequence name time_s psi_x_deg psi_y_deg psi_z_deg q_w q_x q_y q_z r_x_m r_y_m r_z_m "
          "t_d_ms bg_x_radps bg_y_radps bg_z_radps ba_x_mps2 ba_y_mps2 ba_z_mps2 sg_x sg_y sg_z sa_x "
          "sa_y sa_z sd_psi_x_deg sd_psi_y_deg sd_psi_z_deg sd_r_x_m sd_r_y_m sd_r_z_m sd_t_d_ms "
          "sd_bg_x_radps sd_bg_y_radps sd_bg_z_radps sd_ba_x_mps2 sd_ba_y_mps2 sd_ba_z_mps2 sd_sg_x "
          "sd_sg_y sd_sg_z sd_sa_x sd_sa_y sd_sa_z psi_x_observable psi_y_observable psi_z_observable "
          "r_x_observable r_y_observable r_z_observable t_d_observable goal_sd_psi_deg goal_sd_r_m "
          "goal_sd_t_d_ms weakest_direction weakest_relative_sd advice validity reference_age_s gnss_age_s"));
}

TEST(MessageValues, UtimeIsWholeMicrosecondsRoundedDown) {
  EXPECT_EQ(to_utime(utc_time_from_ns(1'700'000'000'123'456'789)), 1'700'000'000'123'456);
  EXPECT_EQ(to_utime(utc_time_from_ns(999)), 0);
  EXPECT_EQ(to_utime(utc_time_from_ns(-1)), -1);
}

/// A fingerprint as LCM's documentation defines it, from the fields of libbot's types (package and name of a
/// type do not enter it).
std::int64_t fingerprint(const std::vector<std::tuple<std::string, std::string, int>>& fields) {
  std::int64_t v = 0x12345678;
  const auto update = [&](int c) {
    v = static_cast<std::int64_t>(
        ((static_cast<std::uint64_t>(v) << 8U) ^ static_cast<std::uint64_t>(v >> 55)) +
        static_cast<std::uint64_t>(static_cast<std::int64_t>(c)));
  };
  const auto update_string = [&](const std::string& s) {
    update(static_cast<int>(s.size()));
    for (const char c : s) update(c);
  };
  for (const auto& [name, type, size] : fields) {
    update_string(name);
    update_string(type);
    update(size > 0 ? 1 : 0);  // number of dimensions
    if (size == 0) continue;
    update(0);  // a constant size
    update_string(std::to_string(size));
  }
  const auto u = static_cast<std::uint64_t>(v);
  return static_cast<std::int64_t>((u << 1U) + ((u >> 63U) & 1U));
}

TEST(Bridge, HasTheFingerprintsOfLibbotsTypes) {
  EXPECT_EQ(pose_t::getHash(), fingerprint({{"utime", "int64_t", 0},
                                            {"pos", "double", 3},
                                            {"vel", "double", 3},
                                            {"orientation", "double", 4},
                                            {"rotation_rate", "double", 3},
                                            {"accel", "double", 3}}));
  EXPECT_EQ(ins_t::getHash(), fingerprint({{"utime", "int64_t", 0},
                                           {"device_time", "int64_t", 0},
                                           {"gyro", "double", 3},
                                           {"mag", "double", 3},
                                           {"accel", "double", 3},
                                           {"quat", "double", 4},
                                           {"pressure", "double", 0},
                                           {"rel_alt", "double", 0}}));
}

TEST(ChannelName, IsUpperCaseWithUnderscores) {
  EXPECT_EQ(channel_name("IMUSCOPE", "STATUS"), "IMUSCOPE_STATUS");
  EXPECT_EQ(channel_name("CAR2", "ERROR", "mtx-1"), "CAR2_ERROR_MTX_1");
  EXPECT_EQ(channel_name("IMUSCOPE", "RAW", std::string(100, 'x')).size(), 63U);
}

}  // namespace
}  // namespace imuscope
