// Legacy data in every output mode, setting and number format, against an encoder written from the protocol's
// field table and not from the decoder.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>

#include "drivers/xsens_mt/mtdata.h"
#include "tests/drivers/support/streams.h"

namespace imuscope::xsens {
namespace {

using test::Bytes;

void put(Bytes& bytes, std::uint64_t value, int size) {
  for (int i = size - 1; i >= 0; --i) bytes.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

/// `value` is a multiple of 2^-20 below 2048, so that every format holds it exactly.
void put_number(Bytes& bytes, double value, unsigned format) {
  switch (format) {
    case 0:
      put(bytes, std::bit_cast<std::uint32_t>(static_cast<float>(value)), 4);
      break;
    case 1:
      put(bytes, static_cast<std::uint64_t>(static_cast<std::int64_t>(value * 1048576.0)), 4);
      break;
    case 2: {
      const auto fixed = static_cast<std::uint64_t>(static_cast<std::int64_t>(value * 4294967296.0));
      put(bytes, fixed & 0xFFFFFFFFU, 4);  // the fraction comes first
      put(bytes, fixed >> 32U & 0xFFFFU, 2);
      break;
    }
    default:
      put(bytes, std::bit_cast<std::uint64_t>(value), 8);
      break;
  }
}

/// The k-th number of a message; of both signs, and never the same.
double number(int k) { return (k % 2 == 0 ? 1.0 : -1.0) * (k + 1) / 64.0; }

struct Encoded {
  Bytes bytes;
  MtData expected;
};

class Encoder {
 public:
  Encoder(std::uint16_t mode, std::uint32_t settings)
      : mode_(mode), settings_(settings), format_(settings >> 8U & 3U) {}

  Encoded encode() {
    if (mode(0x4000)) raw();
    if (mode(0x1000)) gps();
    if (mode(0x0001)) numbers(Field::kTemperature, &out_.expected.temperature_degc, 1);
    if (mode(0x0002)) {
      if ((settings_ & 0x10) == 0) numbers(Field::kAcceleration, out_.expected.acceleration_mps2.data(), 3);
      if ((settings_ & 0x20) == 0) numbers(Field::kRate, out_.expected.rate_radps.data(), 3);
      if ((settings_ & 0x40) == 0) numbers(Field::kMagneticField, out_.expected.field_au.data(), 3);
    }
    if (mode(0x0004)) orientation();
    if (mode(0x0008)) {
      if ((settings_ & 0x400) == 0) integer(Field::kAnalogue1, out_.expected.analogue[0], 2);
      if ((settings_ & 0x800) == 0) integer(Field::kAnalogue2, out_.expected.analogue[1], 2);
    }
    if (mode(0x0010)) numbers(Field::kPosition, out_.expected.position.data(), 3);
    if (mode(0x0020)) numbers(Field::kVelocity, out_.expected.velocity_mps.data(), 3);
    if (mode(0x0800)) integer(Field::kStatus, out_.expected.status, 1);
    if ((settings_ & 1U) != 0) integer(Field::kCounter, out_.expected.counter, 2);
    if ((settings_ & 2U) != 0) utc();
    return out_;
  }

 private:
  [[nodiscard]] bool mode(unsigned bit) const { return (mode_ & bit) != 0; }
  void mark(Field field) { out_.expected.fields |= static_cast<std::uint32_t>(field); }

  void numbers(Field field, double* values, int n) {
    mark(field);
    for (int i = 0; i < n; ++i) {
      values[i] = number(k_++);
      put_number(out_.bytes, values[i], format_);
    }
  }
  template <typename T>
  void integer(Field field, T& value, int size) {
    mark(field);
    value = static_cast<T>(0xA1B2 + k_++);
    put(out_.bytes, value, size);
  }
  void raw() {
    mark(Field::kRaw);
    RawInertial& raw = out_.expected.raw;
    for (auto* group : {&raw.acceleration, &raw.rate, &raw.field}) {
      for (auto& value : *group) integer(Field::kRaw, value, 2);
    }
    integer(Field::kRaw, raw.temperature, 2);
  }
  void gps() {
    GpsPvt& gps = out_.expected.gps;
    integer(Field::kGpsPvt, gps.pressure, 2);
    integer(Field::kGpsPvt, gps.pressure_age, 1);
    integer(Field::kGpsPvt, gps.time_of_week_ms, 4);
    for (std::int32_t* value : {&gps.latitude_1e7_deg, &gps.longitude_1e7_deg, &gps.altitude_mm}) {
      integer(Field::kGpsPvt, *value, 4);
    }
    for (auto& value : gps.velocity_ned_cmps) {
      value = -12345 - k_++;
      put(out_.bytes, static_cast<std::uint32_t>(value), 4);
    }
    integer(Field::kGpsPvt, gps.horizontal_accuracy_mm, 4);
    integer(Field::kGpsPvt, gps.vertical_accuracy_mm, 4);
    integer(Field::kGpsPvt, gps.speed_accuracy_cmps, 4);
    integer(Field::kGpsPvt, gps.gps_age, 1);
  }
  void orientation() {
    switch (settings_ >> 2U & 3U) {
      case 0:
        numbers(Field::kQuaternion, out_.expected.quaternion.data(), 4);
        break;
      case 1:
        numbers(Field::kEuler, out_.expected.euler_deg.data(), 3);
        break;
      default:
        numbers(Field::kMatrix, out_.expected.matrix_as_sent.data(), 9);
        break;
    }
  }
  void utc() {
    UtcFields& utc = out_.expected.utc;
    utc = {123456789, 2026, 3, 14, 12, 34, 56, 7};
    mark(Field::kUtc);
    put(out_.bytes, utc.nanoseconds, 4);
    put(out_.bytes, utc.year, 2);
    for (const unsigned value : {3U, 14U, 12U, 34U, 56U, 7U}) put(out_.bytes, value, 1);
  }

  std::uint16_t mode_;
  std::uint32_t settings_;
  unsigned format_;
  int k_ = 0;
  Encoded out_;
};

void expect_equal(const MtData& found, const MtData& expected) {
  ASSERT_EQ(found.fields, expected.fields);
  const auto check = [&](Field field, const auto& a, const auto& b) {
    if (expected.has(field)) {
      ASSERT_EQ(a, b) << static_cast<std::uint32_t>(field);
    }
  };
  check(Field::kRaw, found.raw.acceleration, expected.raw.acceleration);
  check(Field::kRaw, found.raw.rate, expected.raw.rate);
  check(Field::kRaw, found.raw.field, expected.raw.field);
  check(Field::kRaw, found.raw.temperature, expected.raw.temperature);
  check(Field::kGpsPvt, found.gps.pressure, expected.gps.pressure);
  check(Field::kGpsPvt, found.gps.pressure_age, expected.gps.pressure_age);
  check(Field::kGpsPvt, found.gps.time_of_week_ms, expected.gps.time_of_week_ms);
  check(Field::kGpsPvt, found.gps.latitude_1e7_deg, expected.gps.latitude_1e7_deg);
  check(Field::kGpsPvt, found.gps.longitude_1e7_deg, expected.gps.longitude_1e7_deg);
  check(Field::kGpsPvt, found.gps.altitude_mm, expected.gps.altitude_mm);
  check(Field::kGpsPvt, found.gps.velocity_ned_cmps, expected.gps.velocity_ned_cmps);
  check(Field::kGpsPvt, found.gps.horizontal_accuracy_mm, expected.gps.horizontal_accuracy_mm);
  check(Field::kGpsPvt, found.gps.vertical_accuracy_mm, expected.gps.vertical_accuracy_mm);
  check(Field::kGpsPvt, found.gps.speed_accuracy_cmps, expected.gps.speed_accuracy_cmps);
  check(Field::kGpsPvt, found.gps.gps_age, expected.gps.gps_age);
  check(Field::kTemperature, found.temperature_degc, expected.temperature_degc);
  check(Field::kAcceleration, found.acceleration_mps2, expected.acceleration_mps2);
  check(Field::kRate, found.rate_radps, expected.rate_radps);
  check(Field::kMagneticField, found.field_au, expected.field_au);
  check(Field::kQuaternion, found.quaternion, expected.quaternion);
  check(Field::kEuler, found.euler_deg, expected.euler_deg);
  check(Field::kMatrix, found.matrix_as_sent, expected.matrix_as_sent);
  check(Field::kAnalogue1, found.analogue[0], expected.analogue[0]);
  check(Field::kAnalogue2, found.analogue[1], expected.analogue[1]);
  check(Field::kPosition, found.position, expected.position);
  check(Field::kVelocity, found.velocity_mps, expected.velocity_mps);
  check(Field::kStatus, found.status, expected.status);
  check(Field::kCounter, found.counter, expected.counter);
  check(Field::kUtc, utc_ns(found.utc), utc_ns(expected.utc));
}

void expect_decodes(std::uint16_t mode, std::uint32_t settings) {
  const Encoded encoded = Encoder(mode, settings).encode();
  MtData found;
  ASSERT_EQ(data_length({mode, settings}), encoded.bytes.size());
  ASSERT_TRUE(read_mtdata(encoded.bytes, {mode, settings}, found));
  ASSERT_NO_FATAL_FAILURE(expect_equal(found, encoded.expected));
}

TEST(MtDataLayouts, EveryOutputModeSettingAndNumberFormatIsRead) {
  constexpr std::uint16_t kFreeModes[] = {0x0001, 0x0002, 0x0004, 0x0008, 0x0010,
                                          0x0020, 0x0800, 0x1000, 0x4000};
  int layouts = 0;
  for (unsigned choice = 0; choice < 512; ++choice) {
    unsigned mode = 0;
    for (unsigned i = 0; i < 9; ++i) mode |= (choice >> i & 1U) != 0 ? kFreeModes[i] : 0U;
    if ((mode & 0x4000) != 0 && (mode & 0x0006) != 0) {
      EXPECT_FALSE(
          data_length({static_cast<std::uint16_t>(mode), 0}));  // raw excludes calibrated, orientation
      continue;
    }
    const unsigned n_orientations = (mode & 0x0004) != 0 ? 3 : 1;
    const unsigned n_calibrated = (mode & 0x0002) != 0 ? 8 : 1;
    const unsigned n_analogue = (mode & 0x0008) != 0 ? 4 : 1;
    for (unsigned format = 0; format < 4; ++format) {
      for (unsigned stamp = 0; stamp < 4; ++stamp) {
        for (unsigned orientation = 0; orientation < n_orientations; ++orientation) {
          for (unsigned off = 0; off < n_calibrated; ++off) {
            for (unsigned analogue = 0; analogue < n_analogue; ++analogue) {
              const std::uint32_t settings =
                  stamp | orientation << 2U | off << 4U | format << 8U | analogue << 10U;
              ASSERT_NO_FATAL_FAILURE(expect_decodes(static_cast<std::uint16_t>(mode), settings))
                  << std::hex << mode << " " << settings;
              ++layouts;
            }
          }
        }
      }
    }
  }
  EXPECT_EQ(layouts, 94'720);
}

}  // namespace
}  // namespace imuscope::xsens
