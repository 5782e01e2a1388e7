#include "drivers/xsens_mt/inertial.h"

#include <cmath>

#include "drivers/xsens_mt/mtdata2.h"

namespace imuscope::xsens {
namespace {

constexpr Matrix3 kEnuToNed{0, 1, 0, 1, 0, 0, 0, 0, -1};
constexpr Matrix3 kNwuToNed{1, 0, 0, 0, -1, 0, 0, 0, -1};

Matrix3 rotation_of_euler_deg(const std::array<double, 3>& rpy_deg) noexcept {
  return rotation_of(
      RollPitchHeading{rpy_deg[0] * kRadPerDeg, rpy_deg[1] * kRadPerDeg, rpy_deg[2] * kRadPerDeg});
}

/// A matrix is sent column by column.
Matrix3 rotation_of_columns(const std::array<double, 9>& columns) noexcept { return transpose(columns); }

/// One item into the message.
class ItemTaker {
 public:
  explicit ItemTaker(InertialMessage& out) noexcept : out_(out) {}

  void take(const Item& item) noexcept {
    switch (item.kind()) {
      case xdi::kTemperature:
        mark(InertialMessage::kTemperature, read_numbers(item, out_.temperature_degC));
        break;
      case xdi::kAcceleration:
        mark(InertialMessage::kAcceleration, read_numbers(item, out_.acceleration_mps2));
        break;
      case xdi::kRateOfTurn:
        mark(InertialMessage::kRate, read_numbers(item, out_.rate_radps));
        break;
      case xdi::kAccelerationHr:
        if (!out_.has(InertialMessage::kAcceleration))
          mark(InertialMessage::kAcceleration, read_numbers(item, out_.acceleration_mps2));
        break;
      case xdi::kRateOfTurnHr:
        if (!out_.has(InertialMessage::kRate))
          mark(InertialMessage::kRate, read_numbers(item, out_.rate_radps));
        break;
      case xdi::kDeltaV:
        mark(InertialMessage::kDeltaV, read_numbers(item, out_.delta_v_mps));
        break;
      case xdi::kDeltaQ:
        mark(InertialMessage::kDeltaQ, read_numbers(item, out_.delta_q));
        break;
      case xdi::kPacketCounter:
        mark(InertialMessage::kPacketCounter, read_integer(item, out_.packet_counter));
        break;
      case xdi::kSampleTimeFine:
        mark(InertialMessage::kSampleTimeFine, read_integer(item, out_.sample_time_fine));
        break;
      case xdi::kStatusWord:
        mark(InertialMessage::kStatus, read_integer(item, out_.status_word));
        break;
      case xdi::kStatusByte:
        take_status_byte(item);
        break;
      case xdi::kUtcTime:
        if (item.data.size() != kUtcSize) break;
        out_.utc = read_utc(item.data);
        mark(InertialMessage::kUtc, true);
        break;
      case xdi::kGnssPvt:
        out_.gnss = item.data;
        mark(InertialMessage::kGnss, item.data.size() == kGnssPvtSize);
        break;
      default:
        take_orientation(item);
        break;
    }
  }

 private:
  void mark(InertialMessage::Item item, bool good) noexcept {
    if (good) out_.items |= item;
  }

  template <typename T>
  static bool read_integer(const Item& item, T& value) noexcept {
    if (item.data.size() != sizeof(T)) return false;
    value = read_be<T>(item.data);
    return true;
  }

  /// Its bits are the lowest ones of the status word, which is taken where both come.
  void take_status_byte(const Item& item) noexcept {
    if (item.data.size() != 1 || out_.has(InertialMessage::kStatus)) return;
    out_.status_word = item.data[0];
    mark(InertialMessage::kStatus, true);
  }

  void take_orientation(const Item& item) noexcept {
    switch (item.kind()) {
      case xdi::kQuaternion: {
        std::array<double, 4> q;
        if (!read_numbers(item, q)) return;
        out_.C_s_l = rotation_of(q);
        break;
      }
      case xdi::kRotationMatrix: {
        std::array<double, 9> columns;
        if (!read_numbers(item, columns)) return;
        out_.C_s_l = rotation_of_columns(columns);
        break;
      }
      case xdi::kEulerAngles: {
        std::array<double, 3> rpy_deg;
        if (!read_numbers(item, rpy_deg)) return;
        out_.C_s_l = rotation_of_euler_deg(rpy_deg);
        break;
      }
      default:
        return;
    }
    out_.frame = static_cast<LocalFrame>(item.id >> 2U & 0x3U);
    mark(InertialMessage::kOrientation, true);
  }

  InertialMessage& out_;
};

}  // namespace

bool read_inertial(std::span<const std::uint8_t> data, InertialMessage& out) noexcept {
  out.items = 0;
  out.status_word = 0;
  ItemTaker taker(out);
  ItemReader reader(data);
  Item item;
  while (reader.next(item)) taker.take(item);
  return reader.at_end();
}

std::optional<Matrix3> orientation_of(const MtData& data) noexcept {
  if (data.has(Field::kQuaternion)) return rotation_of(data.quaternion);
  if (data.has(Field::kEuler)) return rotation_of_euler_deg(data.euler_deg);
  if (data.has(Field::kMatrix)) return rotation_of_columns(data.matrix_as_sent);
  return std::nullopt;
}

LocalFrame local_frame_of(const DataLayout& layout) noexcept {
  return (layout.settings & output_settings::kNorthEastDown) != 0 ? LocalFrame::kNorthEastDown
                                                                  : LocalFrame::kNorthWestUp;
}

AttitudeData attitude_of(const Matrix3& C_s_l, LocalFrame frame, const Matrix3& axes) noexcept {
  AttitudeData attitude{};
  Matrix3 C_s_n = C_s_l;
  if (frame == LocalFrame::kEastNorthUp) C_s_n = multiply(kEnuToNed, C_s_l);
  if (frame == LocalFrame::kNorthWestUp) C_s_n = multiply(kNwuToNed, C_s_l);
  const RollPitchHeading rph = angles_of(multiply(C_s_n, transpose(axes)));
  if (!std::isfinite(rph.roll_rad) || !std::isfinite(rph.pitch_rad) || !std::isfinite(rph.heading_rad)) {
    return attitude;
  }
  attitude.roll_rad = rph.roll_rad;
  attitude.pitch_rad = rph.pitch_rad;
  attitude.heading_rad = to_positive_turn(rph.heading_rad);
  attitude.flags = kRollPitchValid;
  return attitude;
}

std::array<double, 3> rotation_vector(const std::array<double, 4>& q) noexcept {
  const double sign = q[0] < 0.0 ? -1.0 : 1.0;
  const double sine = std::sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  // angle / sine(angle/2), with its limit at zero
  const double scale = sign * (sine > 0.0 ? 2.0 * std::atan2(sine, sign * q[0]) / sine : 2.0);
  return {scale * q[1], scale * q[2], scale * q[3]};
}

}  // namespace imuscope::xsens
