#include "drivers/xsens_mt/mtdata.h"

#include <chrono>

#include "base/bytes.h"

namespace imuscope::xsens {
namespace {

constexpr std::size_t kRawSize = 20;
constexpr std::size_t kGpsPvtSize = 44;

constexpr std::size_t numbers_of_orientation(std::uint32_t settings) {
  switch (settings & output_settings::kOrientationMask) {
    case output_settings::kQuaternion:
      return 4;
    case output_settings::kEuler:
      return 3;
    case output_settings::kMatrix:
      return 9;
    default:
      return 0;
  }
}

/// Reads one field after the other.
class Cursor {
 public:
  Cursor(std::span<const std::uint8_t> data, NumberFormat format) noexcept : data_(data), format_(format) {}

  template <typename T>
  T integer() noexcept {
    const T value = read_be<T>(data_, at_);
    at_ += sizeof(T);
    return value;
  }
  double number() noexcept {
    const double value = read_number(data_, at_, format_);
    at_ += size_of(format_);
    return value;
  }
  template <std::size_t N>
  void numbers(std::array<double, N>& out) noexcept {
    if (format_ == NumberFormat::kFloat32) {  // the usual one, without a decision per number
      for (std::size_t i = 0; i < N; ++i) out[i] = read_be<float>(data_, at_ + i * sizeof(float));
      at_ += N * sizeof(float);
      return;
    }
    for (double& value : out) value = number();
  }
  template <typename T, std::size_t N>
  void integers(std::array<T, N>& out) noexcept {
    for (T& value : out) value = integer<T>();
  }
  std::span<const std::uint8_t> bytes(std::size_t n) noexcept {
    const auto part = data_.subspan(at_, n);
    at_ += n;
    return part;
  }

 private:
  std::span<const std::uint8_t> data_;
  NumberFormat format_;
  std::size_t at_ = 0;
};

void read_raw(Cursor& cursor, RawInertial& raw) noexcept {
  cursor.integers(raw.acceleration);
  cursor.integers(raw.rate);
  cursor.integers(raw.field);
  raw.temperature = cursor.integer<std::uint16_t>();
}

void read_gps(Cursor& cursor, GpsPvt& gps) noexcept {
  gps.pressure = cursor.integer<std::uint16_t>();
  gps.pressure_age = cursor.integer<std::uint8_t>();
  gps.time_of_week_ms = cursor.integer<std::uint32_t>();
  gps.latitude_1e7_deg = cursor.integer<std::int32_t>();
  gps.longitude_1e7_deg = cursor.integer<std::int32_t>();
  gps.altitude_mm = cursor.integer<std::int32_t>();
  cursor.integers(gps.velocity_ned_cmps);
  gps.horizontal_accuracy_mm = cursor.integer<std::uint32_t>();
  gps.vertical_accuracy_mm = cursor.integer<std::uint32_t>();
  gps.speed_accuracy_cmps = cursor.integer<std::uint32_t>();
  gps.gps_age = cursor.integer<std::uint8_t>();
}

void read_calibrated(Cursor& cursor, std::uint32_t settings, MtData& out) noexcept {
  const auto take = [&](std::uint32_t off_bit, Field field, std::array<double, 3>& values) {
    if ((settings & off_bit) != 0) return;
    cursor.numbers(values);
    out.fields |= static_cast<std::uint32_t>(field);
  };
  take(output_settings::kNoAcceleration, Field::kAcceleration, out.acceleration_mps2);
  take(output_settings::kNoRate, Field::kRate, out.rate_radps);
  take(output_settings::kNoField, Field::kMagneticField, out.field_au);
}

void read_orientation(Cursor& cursor, std::uint32_t settings, MtData& out) noexcept {
  switch (settings & output_settings::kOrientationMask) {
    case output_settings::kQuaternion:
      cursor.numbers(out.quaternion);
      out.fields |= static_cast<std::uint32_t>(Field::kQuaternion);
      break;
    case output_settings::kEuler:
      cursor.numbers(out.euler_deg);
      out.fields |= static_cast<std::uint32_t>(Field::kEuler);
      break;
    default:
      cursor.numbers(out.matrix_as_sent);
      out.fields |= static_cast<std::uint32_t>(Field::kMatrix);
      break;
  }
}

void read_analogue(Cursor& cursor, std::uint32_t settings, MtData& out) noexcept {
  if ((settings & output_settings::kNoAnalogue1) == 0) {
    out.analogue[0] = cursor.integer<std::uint16_t>();
    out.fields |= static_cast<std::uint32_t>(Field::kAnalogue1);
  }
  if ((settings & output_settings::kNoAnalogue2) == 0) {
    out.analogue[1] = cursor.integer<std::uint16_t>();
    out.fields |= static_cast<std::uint32_t>(Field::kAnalogue2);
  }
}

}  // namespace

std::optional<std::size_t> data_length(const DataLayout& layout) noexcept {
  using namespace output_settings;
  const std::uint16_t mode = layout.mode;
  const auto has = [mode](std::uint16_t bit) { return (mode & bit) != 0; };
  const auto off = [&layout](std::uint32_t bit) { return (layout.settings & bit) != 0; };
  if (has(output_mode::kRaw) && (has(output_mode::kCalibrated) || has(output_mode::kOrientation))) {
    return std::nullopt;
  }
  if (has(output_mode::kOrientation) && numbers_of_orientation(layout.settings) == 0) return std::nullopt;
  std::size_t numbers = 0;
  std::size_t bytes = 0;
  if (has(output_mode::kRaw)) bytes += kRawSize;
  if (has(output_mode::kGpsPvt)) bytes += kGpsPvtSize;
  if (has(output_mode::kTemperature)) numbers += 1;
  if (has(output_mode::kCalibrated)) {
    for (const std::uint32_t bit : {kNoAcceleration, kNoRate, kNoField}) numbers += off(bit) ? 0 : 3;
  }
  if (has(output_mode::kOrientation)) numbers += numbers_of_orientation(layout.settings);
  if (has(output_mode::kAuxiliary)) bytes += (off(kNoAnalogue1) ? 0U : 2U) + (off(kNoAnalogue2) ? 0U : 2U);
  if (has(output_mode::kPosition)) numbers += 3;
  if (has(output_mode::kVelocity)) numbers += 3;
  if (has(output_mode::kStatus)) bytes += 1;
  if (off(kSampleCounter)) bytes += 2;  // these two bits switch on
  if (off(kUtcTime)) bytes += kUtcSize;
  return bytes + numbers * size_of(layout.format());
}

UtcFields read_utc(std::span<const std::uint8_t> data) noexcept {
  return {read_be<std::uint32_t>(data, 0),
          read_be<std::uint16_t>(data, 4),
          data[6],
          data[7],
          data[8],
          data[9],
          data[10],
          data[11]};
}

std::optional<std::int64_t> utc_ns(const UtcFields& utc) noexcept {
  using namespace std::chrono;
  constexpr std::uint32_t kNsPerSecond = 1000000000;
  constexpr std::uint8_t kDateAndTime = 0x03;
  // Nanoseconds of 64 bits end in 2262.
  constexpr std::uint16_t kYearMin = 1970;
  constexpr std::uint16_t kYearMax = 2200;
  if ((utc.flags & kDateAndTime) != kDateAndTime) return std::nullopt;
  if (utc.year < kYearMin || utc.year > kYearMax) return std::nullopt;
  const year_month_day date{year{utc.year}, month{utc.month}, day{utc.day}};
  // Second 60 is a leap second: it counts as the first of the next minute.
  if (!date.ok() || utc.hour > 23 || utc.minute > 59 || utc.second > 60 || utc.nanoseconds >= kNsPerSecond) {
    return std::nullopt;
  }
  const auto since_epoch = sys_days{date}.time_since_epoch() + hours{utc.hour} + minutes{utc.minute} +
                           seconds{utc.second} + nanoseconds{utc.nanoseconds};
  return nanoseconds{since_epoch}.count();
}

bool read_mtdata(std::span<const std::uint8_t> data, const DataLayout& layout, MtData& out) noexcept {
  const auto length = data_length(layout);
  if (!length || *length != data.size()) return false;
  read_mtdata_of_known_length(data, layout, out);
  return true;
}

void read_mtdata_of_known_length(std::span<const std::uint8_t> data, const DataLayout& layout,
                                 MtData& out) noexcept {
  out.fields = 0;
  const auto has = [&layout](std::uint16_t bit) { return (layout.mode & bit) != 0; };
  const auto mark = [&out](Field field) { out.fields |= static_cast<std::uint32_t>(field); };
  Cursor cursor(data, layout.format());
  if (has(output_mode::kRaw)) {
    read_raw(cursor, out.raw);
    mark(Field::kRaw);
  }
  if (has(output_mode::kGpsPvt)) {
    read_gps(cursor, out.gps);
    mark(Field::kGpsPvt);
  }
  if (has(output_mode::kTemperature)) {
    out.temperature_degc = cursor.number();
    mark(Field::kTemperature);
  }
  if (has(output_mode::kCalibrated)) read_calibrated(cursor, layout.settings, out);
  if (has(output_mode::kOrientation)) read_orientation(cursor, layout.settings, out);
  if (has(output_mode::kAuxiliary)) read_analogue(cursor, layout.settings, out);
  if (has(output_mode::kPosition)) {
    cursor.numbers(out.position);
    mark(Field::kPosition);
  }
  if (has(output_mode::kVelocity)) {
    cursor.numbers(out.velocity_mps);
    mark(Field::kVelocity);
  }
  if (has(output_mode::kStatus)) {
    out.status = cursor.integer<std::uint8_t>();
    mark(Field::kStatus);
  }
  if ((layout.settings & output_settings::kSampleCounter) != 0) {
    out.counter = cursor.integer<std::uint16_t>();
    mark(Field::kCounter);
  }
  if ((layout.settings & output_settings::kUtcTime) != 0) {
    out.utc = read_utc(cursor.bytes(kUtcSize));
    mark(Field::kUtc);
  }
}

}  // namespace imuscope::xsens
