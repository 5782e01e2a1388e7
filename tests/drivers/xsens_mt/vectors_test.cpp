#include <gtest/gtest.h>

#include "base/bytes.h"
#include "drivers/xsens_mt/decoder.h"
#include "drivers/xsens_mt/messages.h"
#include "drivers/xsens_mt/mtdata.h"
#include "drivers/xsens_mt/mtdata2.h"
#include "tests/drivers/support/streams.h"
#include "tests/support/shared_data.h"

namespace imuscope::xsens {
namespace {

using nlohmann::json;
using test::Bytes;

/// The data of the only frame in `bytes`; keeps the bytes alive.
std::vector<std::uint8_t> data_of(const Bytes& bytes) {
  Scanner scanner;
  scanner.append(bytes, HostTime{});
  Frame frame;
  if (!scanner.next(frame, true)) return {};
  return {frame.data.begin(), frame.data.end()};
}

template <typename Values>
void expect_values(const Values& values, const json& expected) {
  ASSERT_EQ(values.size(), expected.size());
  for (std::size_t i = 0; i < values.size(); ++i) EXPECT_EQ(values[i], expected[i]) << "element " << i;
}

/// Every expected field is there with its value, and no field is there that is not expected.
void expect_mtdata(const MtData& data, const json& expected) {
  std::uint32_t fields = 0;
  const auto check = [&](Field field, const char* name, const auto& values) {
    if (!expected.contains(name)) return;
    SCOPED_TRACE(name);
    fields |= static_cast<std::uint32_t>(field);
    expect_values(values, expected[name]);
  };
  const auto check_one = [&](Field field, const char* name, auto value) {
    if (!expected.contains(name)) return;
    fields |= static_cast<std::uint32_t>(field);
    EXPECT_EQ(value, expected[name]) << name;
  };
  check(Field::kRaw, "raw_acc", data.raw.acceleration);
  check(Field::kRaw, "raw_gyr", data.raw.rate);
  check(Field::kRaw, "raw_mag", data.raw.field);
  check_one(Field::kRaw, "raw_temp", data.raw.temperature);
  check_one(Field::kTemperature, "temp_degC", data.temperature_degc);
  check(Field::kAcceleration, "acc_ms2", data.acceleration_mps2);
  check(Field::kRate, "gyr_rads", data.rate_radps);
  check(Field::kMagneticField, "mag_au", data.field_au);
  check(Field::kQuaternion, "quat", data.quaternion);
  check(Field::kEuler, "euler_deg", data.euler_deg);
  check(Field::kMatrix, "matrix", data.matrix_as_sent);
  check_one(Field::kAnalogue1, "ain1", data.analogue[0]);
  check_one(Field::kAnalogue2, "ain2", data.analogue[1]);
  check(Field::kPosition, "pos", data.position);
  check(Field::kVelocity, "vel", data.velocity_mps);
  check_one(Field::kStatus, "status", data.status);
  check_one(Field::kCounter, "sample_counter", data.counter);
  EXPECT_EQ(data.fields, fields);
}

void expect_configuration(const Configuration& c, const json& expected) {
  EXPECT_EQ(c.master_id, expected["master_did"]);
  EXPECT_EQ(c.period, expected["period"]);
  EXPECT_EQ(c.rate_hz(), expected["rate_hz"]);
  EXPECT_EQ(c.skip_factor, expected["skip"]);
  EXPECT_EQ(c.is_xbus_master(), expected["xbus_master"]);
  ASSERT_EQ(c.n_devices, expected["num_devices"]);
  for (std::size_t k = 0; k < c.n_devices; ++k) {
    const json& device = expected["devices"][k];
    EXPECT_EQ(c.devices[k].device_id, device["did"]);
    EXPECT_EQ(c.devices[k].data_length, device["data_length"]);
    EXPECT_EQ(c.devices[k].output_mode, device["output_mode"]);
    EXPECT_EQ(c.devices[k].output_settings, device["output_settings"]);
    EXPECT_EQ(c.devices[k].scenario, device["scenario"]);
    expect_values(c.devices[k].firmware, device["fw"]);
  }
}

TEST(MtDataVectors, EveryLegacyVectorDecodesToItsValues) {
  const auto vectors = test::load_vectors(test::source_path("tests/vectors/xsens_mtdata.hex"));
  const auto oracle = test::load_json(test::source_path("tests/vectors/xsens_mtdata.json"));
  ASSERT_EQ(oracle["vectors"].size(), 26U);
  int checked = 0;
  for (const json& v : oracle["vectors"]) {
    const auto name = v["name"].get<std::string>();
    SCOPED_TRACE(name);
    const auto data = data_of(test::vector_named(vectors, name));
    if (v.value("mid", 0) == mid::kConfiguration) {
      const auto configuration = read_configuration(data);
      ASSERT_TRUE(configuration);
      expect_configuration(*configuration, v["expected"]);
      ++checked;
    } else if (v.contains("devices")) {
      EXPECT_EQ(read_be<std::uint16_t>(data), v["xm_counter"]);
      std::size_t at = 2;
      for (std::size_t k = 0; k < v["devices"].size(); ++k) {
        const json& device = v["devices"][k];
        const std::size_t length = v["device_data_lengths"][k];
        MtData message;
        ASSERT_TRUE(read_mtdata(std::span(data).subspan(at, length),
                                {device["output_mode"], device["output_settings"]}, message));
        expect_mtdata(message, device["expected"]);
        at += length;
      }
      EXPECT_EQ(at, data.size());
      ++checked;
    } else if (!v["expected"].contains("counters")) {  // the stream is the decoder's, below
      MtData message;
      ASSERT_TRUE(read_mtdata(data, {v["output_mode"], v["output_settings"]}, message));
      expect_mtdata(message, v["expected"]);
      ++checked;
    }
  }
  EXPECT_EQ(checked, 25);
}

TEST(MtDataVectors, TheStreamUnwrapsItsCounterAndCountsTwoLost) {
  const auto vectors = test::load_vectors(test::source_path("tests/vectors/xsens_mtdata.hex"));
  const auto oracle = test::load_json(test::source_path("tests/vectors/xsens_mtdata.json"));
  for (const json& v : oracle["vectors"]) {
    if (v["name"] != "stream_wrap_and_gap") continue;
    MtDecoderConfig config;
    config.layout = {v["output_mode"], v["output_settings"]};
    config.clock = ClockMapConfig::fixed(HostTime{}, 1.0);
    MtDecoder decoder(config);
    test::CollectingSink sink;
    decoder.push(test::vector_named(vectors, "stream_wrap_and_gap"), HostTime{}, sink);
    std::vector<std::int64_t> unwrapped;
    for (const Sample& sample : sink.samples) unwrapped.push_back(sample.imu.counter);
    EXPECT_EQ(unwrapped, v["expected"]["unwrapped"].get<std::vector<std::int64_t>>());
    EXPECT_EQ(decoder.counters().samples_lost, v["expected"]["lost"]);
    return;
  }
  FAIL() << "the vector is not in the file";
}

TEST(MtDataLayout, RawTogetherWithCalibratedOrOrientationIsNoLayout) {
  EXPECT_FALSE(data_length({output_mode::kRaw | output_mode::kCalibrated, 1}));
  EXPECT_FALSE(data_length({output_mode::kRaw | output_mode::kOrientation, 1}));
  EXPECT_EQ(data_length({output_mode::kRaw | output_mode::kTemperature, 1}), 20U + 4U + 2U);
}

TEST(MtDataLayout, RefusesDataOfAnyOtherLength) {
  MtData message;
  const Bytes data(80);
  for (std::size_t n = 0; n <= data.size(); ++n) {
    EXPECT_EQ(read_mtdata(std::span(data).first(n), kDefaultLayout, message), n == 38) << n;
  }
}

TEST(MtConfiguration, RefusesATruncatedOneAndMoreDevicesThanABusHolds) {
  Bytes data(98 + 20);
  data[97] = 1;
  EXPECT_TRUE(read_configuration(data));
  for (std::size_t n = 0; n < data.size(); ++n)
    EXPECT_FALSE(read_configuration(std::span(data).first(n))) << n;
  Bytes full(98 + 20 * 11);
  full[97] = 11;
  EXPECT_FALSE(read_configuration(full));
}

void expect_item(const Item& item, const json& expected) {
  const ItemKind* kind = find_item_kind(item.id);
  EXPECT_EQ(item.data.size(), expected["size"]);
  if (expected.contains("raw")) {
    EXPECT_EQ(kind, nullptr);
    return;
  }
  ASSERT_NE(kind, nullptr);
  EXPECT_EQ(kind->name, expected["name"]);
  const json& value = expected["value"];
  switch (kind->content) {
    case ItemContent::kU8:
      EXPECT_EQ(item.data[0], value);
      break;
    case ItemContent::kU16:
      EXPECT_EQ(read_be<std::uint16_t>(item.data), value);
      break;
    case ItemContent::kU32:
      EXPECT_EQ(read_be<std::uint32_t>(item.data), value);
      break;
    case ItemContent::kUtc: {
      const UtcFields utc = read_utc(item.data);
      expect_values(std::vector<std::uint32_t>{utc.nanoseconds, utc.year, utc.month, utc.day, utc.hour,
                                               utc.minute, utc.second, utc.flags},
                    value);
      break;
    }
    case ItemContent::kNumbers: {
      EXPECT_EQ(static_cast<int>(item.format()), expected["format"]);
      EXPECT_EQ(item.data.size(), kind->count * size_of(item.format()));
      std::vector<double> numbers;
      for (std::size_t i = 0; i < kind->count; ++i) {
        numbers.push_back(read_number(item.data, i * size_of(item.format()), item.format()));
      }
      expect_values(numbers, value);
      break;
    }
    default:
      FAIL() << "not expected in the vectors";
  }
}

TEST(MtData2Vectors, EveryVectorDecodesToItsItems) {
  const auto vectors = test::load_vectors(test::source_path("tests/vectors/xsens_mtdata2.hex"));
  const auto oracle = test::load_json(test::source_path("tests/vectors/xsens_mtdata2.json"));
  ASSERT_EQ(oracle["vectors"].size(), 8U);
  for (const json& v : oracle["vectors"]) {
    SCOPED_TRACE(v["name"].get<std::string>());
    const auto data = data_of(test::vector_named(vectors, v["name"].get<std::string>()));
    ASSERT_EQ(items_are_whole(data), v.value("valid", true));
    if (!v.value("valid", true)) continue;
    ItemReader reader(data);
    Item item;
    for (const json& expected : v["expected"]) {
      ASSERT_TRUE(reader.next(item));
      char id[5];
      std::snprintf(id, sizeof id, "%04X", item.id);
      SCOPED_TRACE(id);
      EXPECT_EQ(id, expected["xdi"]);
      expect_item(item, expected);
    }
    EXPECT_FALSE(reader.next(item));
  }
}

}  // namespace
}  // namespace imuscope::xsens
