#include <gtest/gtest.h>

#include <cctype>
#include <cmath>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "base/bytes.h"
#include "drivers/xsens_mt/decoder.h"
#include "drivers/xsens_mt/mtdata2.h"
#include "drivers/xsens_mt/scanner.h"
#include "tests/drivers/support/streams.h"
#include "tests/support/shared_data.h"

namespace imuscope::xsens {
namespace {

using test::Bytes;

std::string recording(int number, const std::string& suffix) {
  return "data/streams/xsens_mtdata2/" + std::to_string(number) + suffix;
}

/// An item of the published decode: its name with frame and format, and its values as text without their
/// names.
struct GoldenItem {
  std::string name;
  std::vector<std::string> values;
};

/// Messages are separated by empty lines, values are indented.
std::vector<std::vector<GoldenItem>> golden_messages(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::vector<std::vector<GoldenItem>> messages(1);
  for (std::string line; std::getline(in, line);) {
    if (line.empty()) {
      messages.emplace_back();
    } else if (line[0] != ' ') {
      messages.back().push_back({line.substr(0, line.size() - 1), {}});
    } else {
      const auto colon = line.find(':');
      const bool is_named = std::isalpha(static_cast<unsigned char>(line[2])) != 0;
      messages.back().back().values.push_back(is_named ? line.substr(colon + 1) : line.substr(2));
    }
  }
  while (!messages.empty() && messages.back().empty()) messages.pop_back();
  return messages;
}

std::vector<double> to_doubles(const std::vector<std::string>& values) {
  std::vector<double> numbers;
  for (const std::string& value : values) numbers.push_back(std::stod(value));
  return numbers;
}

/// "2019-01-20T13:47:24.1219Z"
std::string utc_text(const UtcFields& utc) {
  char text[64];
  std::snprintf(text, sizeof text, "%04d-%02d-%02dT%02d:%02d:%02d.%09u", utc.year, utc.month, utc.day,
                utc.hour, utc.minute, utc.second, utc.nanoseconds);
  std::string out = text;
  while (out.back() == '0') out.pop_back();
  if (out.back() == '.') out.pop_back();
  return out + "Z";
}

const char* format_name(NumberFormat format) {
  constexpr const char* kNames[] = {"Float32", "FP1220", "FP1632", "Float64"};
  return kNames[static_cast<int>(format)];
}

void expect_pvt(const GnssPvt& pvt, const std::vector<std::string>& golden) {
  std::vector<double> values{static_cast<double>(pvt.time_of_week_ms), static_cast<double>(pvt.year)};
  for (const auto v : {pvt.month, pvt.day, pvt.hour, pvt.minute, pvt.second, pvt.valid}) values.push_back(v);
  values.push_back(pvt.time_accuracy_ns);
  values.push_back(pvt.nanoseconds);
  for (const auto v : {pvt.fix_type, pvt.flags, pvt.n_satellites, pvt.reserved}) values.push_back(v);
  for (const auto v : {pvt.longitude_1e7_deg, pvt.latitude_1e7_deg, pvt.height_mm, pvt.height_msl_mm}) {
    values.push_back(v);
  }
  values.push_back(pvt.horizontal_accuracy_mm);
  values.push_back(pvt.vertical_accuracy_mm);
  for (const auto v : pvt.velocity_ned_mmps) values.push_back(v);
  values.push_back(pvt.ground_speed_mmps);
  values.push_back(pvt.course_1e5_deg);
  values.push_back(pvt.speed_accuracy_mmps);
  values.push_back(pvt.course_accuracy_1e5_deg);
  values.push_back(pvt.vehicle_heading_1e5_deg);
  for (const auto v : pvt.dop_centi) values.push_back(v);
  EXPECT_EQ(values, to_doubles(golden));
}

void expect_item(const Item& item, const GoldenItem& golden) {
  const std::map<std::string, std::string> kOtherNames{{"UTCTime", "UtcTime"},
                                                       {"GNSSPVTData", "GnssPvtData"}};
  const std::string bare = golden.name.substr(0, golden.name.find('('));
  const auto other = kOtherNames.find(bare);
  SCOPED_TRACE(golden.name);
  const ItemKind* kind = find_item_kind(item.id);
  ASSERT_NE(kind, nullptr);
  ASSERT_EQ(kind->name, other == kOtherNames.end() ? bare : other->second);
  switch (kind->content) {
    case ItemContent::kU8:
    case ItemContent::kU16:
    case ItemContent::kU32: {
      std::uint64_t value = 0;
      for (const std::uint8_t byte : item.data) value = value << 8U | byte;
      const int base = bare.rfind("Status", 0) == 0 ? 2 : 10;
      EXPECT_EQ(value, std::stoull(golden.values[0], nullptr, base));
      break;
    }
    case ItemContent::kUtc:
      EXPECT_EQ(utc_text(read_utc(item.data)), golden.values[0]);
      break;
    case ItemContent::kGnssPvt: {
      const auto pvt = read_gnss_pvt(item.data);
      ASSERT_TRUE(pvt);
      expect_pvt(*pvt, golden.values);
      break;
    }
    case ItemContent::kNumbers: {
      EXPECT_NE(golden.name.find(format_name(item.format())), std::string::npos);
      const auto expected = to_doubles(golden.values);
      ASSERT_EQ(item.data.size(), expected.size() * size_of(item.format()));
      for (std::size_t i = 0; i < expected.size(); ++i) {
        // The published numbers are the shortest text of the double: equal to the last bit.
        EXPECT_EQ(read_number(item.data, i * size_of(item.format()), item.format()), expected[i]) << i;
      }
      break;
    }
    default:
      FAIL() << "not in these recordings";
  }
}

TEST(MtRecordings, EveryNumberOfTheFourRecordingsEqualsThePublishedDecode) {
  for (int number = 1; number <= 4; ++number) {
    IMUSCOPE_NEEDS_SHARED(recording(number, ".bin"));
    SCOPED_TRACE(number);
    const Bytes bytes = test::load_bytes(test::shared_path(recording(number, ".bin")));
    const auto golden = golden_messages(test::shared_path(recording(number, "_output.golden")));
    ASSERT_EQ(golden.size(), 100U);
    Scanner scanner;
    Frame frame;
    std::span<const std::uint8_t> rest = bytes;
    std::size_t n = 0;
    while (!rest.empty()) {
      rest = rest.subspan(scanner.append(rest, HostTime{}));
      while (scanner.next(frame)) {
        if (frame.nested) continue;
        SCOPED_TRACE(n);
        ASSERT_LT(n, golden.size());
        ItemReader reader(frame.data);
        Item item;
        for (const GoldenItem& expected : golden[n]) {
          ASSERT_TRUE(reader.next(item));
          expect_item(item, expected);
        }
        EXPECT_FALSE(reader.next(item));
        ++n;
      }
    }
    EXPECT_EQ(n, 100U);
    EXPECT_EQ(scanner.counters().bytes_skipped, 0U);
  }
}

// 100 messages of 1 s, four of them GNSS solutions that share packet_counter: 96 samples, none lost.
TEST(MtRecordings, AllInertialMessagesBecomeSamplesAndNoneIsLost) {
  for (int number = 1; number <= 4; ++number) {
    IMUSCOPE_NEEDS_SHARED(recording(number, ".bin"));
    SCOPED_TRACE(number);
    MtDecoderConfig config;
    config.clock = ClockMapConfig::fixed(HostTime{}, 1.0);
    MtDecoder decoder(config);
    test::CollectingSink sink;
    decoder.push(test::load_bytes(test::shared_path(recording(number, ".bin"))), HostTime{}, sink);
    ASSERT_EQ(sink.samples.size(), 96U);
    EXPECT_EQ(decoder.counters().samples_lost, 0U);
    EXPECT_EQ(decoder.counters().bytes_skipped, 0U);
    for (std::size_t i = 1; i < sink.samples.size(); ++i) {
      const Sample& s = sink.samples[i];
      ASSERT_EQ(s.imu.counter, sink.samples[i - 1].imu.counter + 1);
      ASSERT_TRUE(s.has_utc);
      // SampleTimeFine counts 100 us and the samples come every 10 ms, give or take one count.
      ASSERT_NEAR(to_seconds(s.time - sink.samples[i - 1].time), 0.01, 1.1e-4);
      const double force = std::hypot(s.imu.f_mps2[0], s.imu.f_mps2[1], s.imu.f_mps2[2]);
      ASSERT_NEAR(force, 9.81, 0.1) << i;  // held still
    }
  }
}

}  // namespace
}  // namespace imuscope::xsens
