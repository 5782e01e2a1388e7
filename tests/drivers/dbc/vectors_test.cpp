// Every signal of the published vectors, bit for bit, and a real car's wheel speeds.
#include <gtest/gtest.h>
#include <charconv>
#include <cmath>
#include <fstream>
#include <map>
#include <sstream>

#include "drivers/dbc/parser.h"
#include "tests/drivers/support/streams.h"
#include "tests/support/shared_data.h"

namespace imuscope::dbc {
namespace {

using nlohmann::json;

struct LoggedFrame {
  double time_s = 0.0;
  std::uint32_t id = 0;
  bool is_extended = false;
  std::vector<std::uint8_t> data;
};

/// A data frame as `candump -l` writes it.
LoggedFrame frame_of(const std::string& line) {
  LoggedFrame frame;
  const auto open = line.find('(');
  const auto close = line.find(')');
  frame.time_s = std::stod(line.substr(open + 1, close - open - 1));
  const auto id_at = line.find(' ', close + 2) + 1;
  const auto hash = line.find('#', id_at);
  frame.id = static_cast<std::uint32_t>(std::stoul(line.substr(id_at, hash - id_at), nullptr, 16));
  frame.is_extended = hash - id_at == 8;
  const bool fd = line[hash + 1] == '#';
  for (std::size_t at = hash + (fd ? 3 : 1); at + 1 < line.size(); at += 2)
    frame.data.push_back(static_cast<std::uint8_t>(std::stoul(line.substr(at, 2), nullptr, 16)));
  return frame;
}

Database load(const std::filesystem::path& file) {
  const auto text = read_text(file);
  EXPECT_TRUE(text) << text.error().text();
  auto database = parse(*text, file.filename().string());
  EXPECT_TRUE(database) << database.error().text();
  return std::move(*database);
}

void expect_vectors(const std::string& name, std::size_t count) {
  const json expected = test::load_json(test::source_path("tests/vectors/" + name));
  std::map<std::string, Database> databases;
  std::size_t vectors = 0;
  for (const json& vector : expected["vectors"]) {
    SCOPED_TRACE(vector["line"].get<std::string>());
    const auto dbc = vector["dbc"].get<std::string>();
    if (!databases.contains(dbc)) databases[dbc] = load(test::source_path("tests/vectors/" + dbc));
    const LoggedFrame frame = frame_of(vector["line"]);
    ASSERT_EQ(frame.id, vector["id"].get<std::uint32_t>());
    ASSERT_EQ(frame.is_extended, vector["extended"].get<bool>());
    const Message* message = databases[dbc].find(frame.id, frame.is_extended);
    ASSERT_NE(message, nullptr);
    EXPECT_EQ(message->name, vector["message"]);
    std::size_t present = 0;
    for (std::size_t s = 0; s < message->signals.size(); ++s) {
      const Signal& signal = message->signals[s];
      const auto raw = raw_in_frame(*message, s, frame.data);
      EXPECT_EQ(raw.has_value(), vector["signals"].contains(signal.name)) << signal.name;
      if (!raw) continue;
      ++present;
      const json& value = vector["signals"][signal.name];
      const bool is_plain = signal.layout.factor == 1.0 && signal.layout.offset == 0.0;
      if (is_plain && signal.layout.coding == Coding::kUnsigned) {
        EXPECT_EQ(*raw, value.get<std::uint64_t>()) << signal.name;
      } else if (is_plain && signal.layout.coding == Coding::kSigned) {
        EXPECT_EQ(signed_of(signal.layout, *raw), value.get<std::int64_t>()) << signal.name;
      } else {
        EXPECT_EQ(value_of(signal.layout, *raw), value.get<double>()) << signal.name;
      }
    }
    EXPECT_EQ(present, vector["signals"].size());
    ++vectors;
  }
  EXPECT_EQ(vectors, count);
}

TEST(DbcVectors, EverySignalOfTheOdometryVectorsIsBitExact) { expect_vectors("can_odometry.json", 29); }

TEST(DbcVectors, EverySignalOfTheXsensVectorsIsBitExact) { expect_vectors("can_xsens.json", 16); }

// The published speeds are printed with six decimals.
TEST(DbcVectors, WheelSpeedsOfARealCarEqualThePublishedOnes) {
  IMUSCOPE_NEEDS_SHARED("data/can_car/car.candump.log");
  const Database database = load(test::source_path("config/toyota_rav4.dbc"));
  constexpr std::uint32_t kWheelSpeeds = 0x0AA;
  const Message* message = database.find(kWheelSpeeds, false);
  ASSERT_NE(message, nullptr);
  constexpr double kMpsPerKmph = 1.0 / 3.6;
  std::ifstream log(test::shared_path("data/can_car/car.candump.log"));
  std::ifstream csv(test::shared_path("data/can_car/wheel_speed.csv"));
  std::string row;
  std::getline(csv, row);  // header
  double largest = 0.0;
  std::size_t rows = 0;
  for (std::string line; std::getline(log, line);) {
    const LoggedFrame frame = frame_of(line);
    if (frame.id != kWheelSpeeds) continue;
    ASSERT_TRUE(std::getline(csv, row));
    std::istringstream cells(row);
    std::string cell;
    std::getline(cells, cell, ',');
    EXPECT_NEAR(std::stod(cell), frame.time_s, 1e-6);
    for (const char* wheel : {"FR", "FL", "RR", "RL"}) {
      std::getline(cells, cell, ',');
      const auto index = static_cast<std::size_t>(message->find(wheel) - message->signals.data());
      const auto raw = raw_in_frame(*message, index, frame.data);
      ASSERT_TRUE(raw);
      const double speed_mps = kMpsPerKmph * value_of(message->signals[index].layout, *raw);
      largest = std::max(largest, std::abs(speed_mps - std::stod(cell)));
    }
    ++rows;
  }
  EXPECT_FALSE(std::getline(csv, row));
  EXPECT_GT(rows, 1000U);
  EXPECT_LT(largest, 1e-6);
  RecordProperty("rows", static_cast<int>(rows));
  RecordProperty("largest_difference_mps", std::to_string(largest));
}

}  // namespace
}  // namespace imuscope::dbc
