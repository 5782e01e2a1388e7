#include <gtest/gtest.h>

#include "firmware_sim/devices/greis_encoder.h"
#include "firmware_sim/devices/stdbin_encoder.h"
#include "firmware_sim/devices/xsens_encoder.h"
#include "tests/firmware_sim/vectors.h"

namespace imusim {
namespace {

using nlohmann::json;
using test::load_vectors;
using test::Vector;

Bytes from_hex(const std::string& text) {
  Bytes bytes;
  for (std::size_t i = 0; i + 1 < text.size(); i += 2)
    bytes.push_back(static_cast<std::uint8_t>(std::stoul(text.substr(i, 2), nullptr, 16)));
  return bytes;
}

Eigen::Vector3d vector3(const json& numbers) {
  return {numbers[0].get<double>(), numbers[1].get<double>(), numbers[2].get<double>()};
}

TEST(XsensEncoder, FramesEveryControlMessageAsTheVectorsDo) {
  int compared = 0;
  for (const auto& [name, vector] : load_vectors("xsens_control")) {
    if (!vector.meaning.contains("mid") || !vector.meaning.contains("data")) continue;
    const Bytes data = from_hex(vector.meaning["data"].get<std::string>());
    EXPECT_EQ(xsens::frame(vector.meaning["mid"].get<std::uint8_t>(), data,
                           vector.meaning["bid"].get<std::uint8_t>()),
              vector.bytes)
        << name;
    ++compared;
  }
  EXPECT_GE(compared, 40);
}

/// Sample of a vector's expected values.
xsens::MtSample sample_of(const json& expected) {
  xsens::MtSample sample;
  if (expected.contains("temp_degC")) sample.temperature_degC = expected["temp_degC"];
  if (expected.contains("acc_ms2")) sample.acc_mps2 = vector3(expected["acc_ms2"]);
  if (expected.contains("gyr_rads")) sample.gyr_radps = vector3(expected["gyr_rads"]);
  if (expected.contains("mag_au")) sample.mag = vector3(expected["mag_au"]);
  if (expected.contains("euler_deg")) sample.euler_deg = vector3(expected["euler_deg"]);
  if (expected.contains("quat")) {
    const json& q = expected["quat"];
    sample.sensor_to_world =
        Eigen::Quaterniond(q[0].get<double>(), q[1].get<double>(), q[2].get<double>(), q[3].get<double>());
  }
  if (expected.contains("status")) sample.status = expected["status"];
  if (expected.contains("sample_counter")) sample.counter = expected["sample_counter"];
  return sample;
}

TEST(XsensEncoder, EncodesLegacyDataInAllNumberFormatsAsTheVectorsDo) {
  int compared = 0;
  for (const auto& [name, vector] : load_vectors("xsens_mtdata")) {
    const json& meaning = vector.meaning;
    if (!meaning.contains("output_mode") || name == "stream_wrap_and_gap") continue;
    const auto mode = meaning["output_mode"].get<std::uint16_t>();
    const auto settings = meaning["output_settings"].get<std::uint32_t>();
    // Auxiliary inputs, position, velocity and raw data are not this firmware's; a matrix comes from a
    // quaternion here, which rounds: it has a test of its own.
    const bool other = (mode & ~xsens::kKnownModes) != 0 || meaning["expected"].contains("matrix");
    if (other) continue;
    const Bytes payload = xsens::mtdata_payload(sample_of(meaning["expected"]), mode, settings);
    EXPECT_EQ(xsens::frame(xsens::kMtData, payload), vector.bytes) << name;
    ++compared;
  }
  EXPECT_GE(compared, 14);
}

TEST(XsensEncoder, SendsTheRotationMatrixDownItsColumns) {
  // 30 degrees about z: R = [c -s 0; s c 0; 0 0 1], on the wire c s 0, -s c 0, 0 0 1.
  xsens::MtSample sample;
  sample.sensor_to_world = Eigen::AngleAxisd(0.52359877559829887, Eigen::Vector3d::UnitZ());
  const Bytes payload =
      xsens::mtdata_payload(sample, xsens::kModeOrientation, xsens::kSettingsMatrix | xsens::kSettingsDouble);
  ASSERT_EQ(payload.size(), 72U);
  const auto element = [&](std::size_t index) {
    return std::bit_cast<double>(get_be<std::uint64_t>(std::span(payload).subspan(8 * index)));
  };
  EXPECT_NEAR(element(0), 0.86602540378443865, 1e-12);
  EXPECT_NEAR(element(1), 0.5, 1e-12);
  EXPECT_NEAR(element(3), -0.5, 1e-12);
  EXPECT_NEAR(element(8), 1.0, 1e-12);
}

TEST(StdbinEncoder, EncodesEmptyAndAttitudeTelegramsAsTheVectorsDo) {
  const auto vectors = load_vectors("ixblue_stdbin");
  for (const std::string name : {"v3_min_no_block", "v3_attitude_only"}) {
    const Vector& vector = vectors.at(name);
    const json& expected = vector.meaning["expected"];
    stdbin::Telegram telegram;
    telegram.validity_100us = expected["validity_100us"];
    telegram.counter = expected["counter"];
    if (expected["blocks"].contains("attitude_heading")) {
      const json& block = expected["blocks"]["attitude_heading"];
      telegram.heading_roll_pitch_deg =
          Eigen::Vector3d(block["heading_deg"], block["roll_deg"], block["pitch_deg"]);
    }
    EXPECT_EQ(stdbin::encode(telegram), vector.bytes) << name;
  }
}

TEST(StdbinEncoder, EveryBlockItSendsEqualsThatOfTheFullVector) {
  const Vector full = load_vectors("ixblue_stdbin").at("v3_all_nav");
  const json& blocks = full.meaning["expected"]["blocks"];
  // Sizes of the navigation blocks 0 to 30 and the extended blocks 0 to 2, as the protocol sheet lists them.
  constexpr std::array kSizes = {12, 12, 16, 8, 12, 12, 12, 21, 16, 12, 12, 8,  8,  4,  8,  16, 12,
                                 4,  4,  12, 4, 12, 12, 12, 8,  12, 16, 12, 12, 12, 12, 12, 12, 12};
  constexpr std::size_t kHeader = 25;
  const auto block_of_vector = [&](std::size_t index) {
    std::ptrdiff_t offset = kHeader;
    for (std::size_t i = 0; i < index; ++i) offset += kSizes[i];
    return Bytes(full.bytes.begin() + offset, full.bytes.begin() + offset + kSizes[index]);
  };
  const auto block_of_encoder = [&](const stdbin::Telegram& telegram) {
    const Bytes bytes = stdbin::encode(telegram);
    return Bytes(bytes.begin() + kHeader, bytes.end() - 4);
  };
  const auto three = [](const json& block, const char* a, const char* b, const char* c) {
    return Eigen::Vector3d(block[a], block[b], block[c]);
  };

  stdbin::Telegram sd;
  sd.heading_roll_pitch_sd_deg =
      three(blocks["attitude_heading_std"], "heading_deg", "roll_deg", "pitch_deg");
  EXPECT_EQ(block_of_encoder(sd), block_of_vector(1));
  stdbin::Telegram position;
  const json& p = blocks["position"];
  position.position = stdbin::Position{p["lat_deg"], p["lon_deg"], p["alt_m"]};
  EXPECT_EQ(block_of_encoder(position), block_of_vector(7));
  stdbin::Telegram position_sd;
  const json& s = blocks["position_std"];
  position_sd.position_sd = stdbin::PositionSd{s["north_m"], s["east_m"], s["ne_corr"], s["alt_m"]};
  EXPECT_EQ(block_of_encoder(position_sd), block_of_vector(8));
  stdbin::Telegram speed;
  speed.speed_neu_mps = three(blocks["speed_geo"], "north", "east", "up");
  EXPECT_EQ(block_of_encoder(speed), block_of_vector(9));
  stdbin::Telegram speed_sd;
  speed_sd.speed_sd_neu_mps = three(blocks["speed_geo_std"], "north", "east", "up");
  EXPECT_EQ(block_of_encoder(speed_sd), block_of_vector(10));
  stdbin::Telegram date;
  const json& d = blocks["system_date"];
  date.date = stdbin::Date{d["day"], d["month"], d["year"]};
  EXPECT_EQ(block_of_encoder(date), block_of_vector(13));
  stdbin::Telegram sensor;
  sensor.sensor_status = {blocks["sensor_status"]["s1"], blocks["sensor_status"]["s2"]};
  EXPECT_EQ(block_of_encoder(sensor), block_of_vector(14));
  stdbin::Telegram user;
  user.user_status = blocks["ins_user_status"]["s"].get<std::uint32_t>();
  EXPECT_EQ(block_of_encoder(user), block_of_vector(17));
  stdbin::Telegram force;
  force.raw_acceleration_mps2 = three(blocks["raw_accel_vessel"], "x1", "x2", "x3");
  EXPECT_EQ(block_of_encoder(force), block_of_vector(28));
  stdbin::Telegram angular;
  angular.rotation_acceleration_degps2 = three(blocks["rotation_accel_vessel"], "x1", "x2", "x3");
  EXPECT_EQ(block_of_encoder(angular), block_of_vector(31));
  stdbin::Telegram rate;
  rate.raw_rotation_rate_degps = three(blocks["raw_rotation_rate_vessel"], "x1_dps", "x2_dps", "x3_dps");
  EXPECT_EQ(block_of_encoder(rate), block_of_vector(33));
}

TEST(StdbinEncoder, SetsTheMaskBitsAndTheSizeOfWhatItSends) {
  stdbin::Telegram telegram;
  telegram.heading_roll_pitch_deg = Eigen::Vector3d::Zero();
  telegram.raw_acceleration_mps2 = Eigen::Vector3d::Zero();
  telegram.raw_rotation_rate_degps = Eigen::Vector3d::Zero();
  const Bytes bytes = stdbin::encode(telegram);
  EXPECT_EQ(get_be<std::uint32_t>(std::span(bytes).subspan(3)), (1U << 0U) | (1U << 28U));
  EXPECT_EQ(get_be<std::uint32_t>(std::span(bytes).subspan(7)), 1U << 2U);
  EXPECT_EQ(get_be<std::uint16_t>(std::span(bytes).subspan(15)), bytes.size());
  EXPECT_EQ(bytes.size(), 25U + 36U + 4U);
}

TEST(GreisEncoder, EncodesEveryMessageItSendsAsTheVectorsDo) {
  const auto vectors = load_vectors("greis");
  const auto fields = [&](const char* name) { return vectors.at(name).meaning["fields"]; };
  greis::Solution solution;
  solution.time_of_day_ms = fields("RT")["tod_ms"];
  const json date = fields("RD");
  solution.year = date["year"];
  solution.month = date["month"];
  solution.day = date["day"];
  solution.date_base = date["base"];
  const json place = fields("PG");
  solution.latitude_rad = place["lat_rad"];
  solution.longitude_rad = place["lon_rad"];
  solution.height_m = place["alt_m"];
  solution.position_sd_m = place["psigma"];
  solution.type = place["soltype"];
  const json velocity = fields("VG");
  solution.north_mps = velocity["north"];
  solution.east_mps = velocity["east"];
  solution.up_mps = velocity["up"];
  solution.velocity_sd_mps = velocity["vsigma"];
  const json sigmas = fields("SG");
  solution.horizontal_position_sd_m = sigmas["hpos"];
  solution.vertical_position_sd_m = sigmas["vpos"];
  solution.horizontal_velocity_sd_mps = sigmas["hvel"];
  solution.vertical_velocity_sd_mps = sigmas["vvel"];
  const json dop = fields("DP");
  solution.hdop = dop["hdop"];
  solution.vdop = dop["vdop"];
  solution.tdop = dop["tdop"];
  solution.edop = dop["edop"];
  for (const char* name : {"RT", "RD", "ST", "PG", "VG", "SG", "DP", "ET"})
    EXPECT_EQ(greis::encode(name, solution), vectors.at(name).bytes) << name;
}

TEST(GreisEncoder, AnUnknownMessageIsEmpty) { EXPECT_TRUE(greis::encode("XX", {}).empty()); }

}  // namespace
}  // namespace imusim
