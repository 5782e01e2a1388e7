#include "firmware_sim/devices/can_encoder.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace imusim {
namespace {

constexpr std::uint16_t kWheelId = 0x0AA;
constexpr double kKmphPerMps = 3.6;
constexpr double kWheelUnit_kmph = 0.01;
constexpr double kWheelOffset_kmph = 67.67;

// MTi-600 CAN output: identifiers as delivered.
constexpr std::uint16_t kSampleTimeId = 0x005;
constexpr std::uint16_t kGroupCounterId = 0x006;
constexpr std::uint16_t kStatusWordId = 0x011;
constexpr std::uint16_t kDeltaVId = 0x031;
constexpr std::uint16_t kDeltaQId = 0x033;
/// raw = delta_v * 2^15: 16 bits hold +-1 m/s, 100 m/s^2 at 100 Hz.
constexpr std::uint8_t kDeltaVExponent = 15;
constexpr double kDeltaQUnits = 32767.0;

constexpr std::uint16_t kHighRateFirstId = 0x061;
constexpr std::uint16_t kHighRateSecondId = 0x062;
constexpr double kAccelerationUnits = 256.0;  // 2^-8 m/s^2
constexpr double kRateUnits = 512.0;          // 2^-9 rad/s

std::int16_t to_int16(double value) {
  constexpr double kMin = -32768.0;
  constexpr double kMax = 32767.0;
  return static_cast<std::int16_t>(std::lround(std::clamp(value, kMin, kMax)));
}

CanFrame triad_frame(std::uint16_t id, const Eigen::Vector3d& value, double units) {
  CanFrame frame{id, {}};
  for (int i = 0; i < 3; ++i) put_be(frame.data, to_int16(value[i] * units));
  return frame;
}

void add_high_rate(const MtiGroup& group, std::vector<CanFrame>& frames) {
  const bool swapped = group.output == MtiOutput::kHighRateSwapped;
  const CanFrame acceleration =
      triad_frame(swapped ? kHighRateSecondId : kHighRateFirstId, group.f_mps2, kAccelerationUnits);
  const CanFrame rate =
      triad_frame(swapped ? kHighRateFirstId : kHighRateSecondId, group.omega_radps, kRateUnits);
  frames.push_back(swapped ? rate : acceleration);
  frames.push_back(swapped ? acceleration : rate);
}

void add_increments(const MtiGroup& group, std::vector<CanFrame>& frames) {
  CanFrame delta_v = triad_frame(kDeltaVId, group.delta_v_mps, std::ldexp(1.0, kDeltaVExponent));
  delta_v.data.push_back(kDeltaVExponent);
  frames.push_back(std::move(delta_v));
  CanFrame delta_q{kDeltaQId, {}};
  const double angle = group.rotation_vector_rad.norm();
  const Eigen::Quaterniond q(angle > 0.0 ? Eigen::AngleAxisd(angle, group.rotation_vector_rad / angle)
                                         : Eigen::AngleAxisd::Identity());
  for (const double part : {q.w(), q.x(), q.y(), q.z()}) put_be(delta_q.data, to_int16(part * kDeltaQUnits));
  frames.push_back(std::move(delta_q));
}

}  // namespace

CanFrame wheel_frame(const std::array<double, 4>& speeds_mps) {
  CanFrame frame{kWheelId, {}};
  for (const double speed : speeds_mps) {
    constexpr double kMax = 65535.0;
    const double raw = std::round((speed * kKmphPerMps + kWheelOffset_kmph) / kWheelUnit_kmph);
    put_be(frame.data, static_cast<std::uint16_t>(std::clamp(raw, 0.0, kMax)));
  }
  return frame;
}

std::string_view wheel_dbc() {
  return R"(VERSION ""

NS_ :

BS_:

BU_: CAR

BO_ 170 WHEEL_SPEEDS: 8 CAR
 SG_ FR : 7|16@0+ (0.01,-67.67) [-67.67|587.68] "km/h" CAR
 SG_ FL : 23|16@0+ (0.01,-67.67) [-67.67|587.68] "km/h" CAR
 SG_ RR : 39|16@0+ (0.01,-67.67) [-67.67|587.68] "km/h" CAR
 SG_ RL : 55|16@0+ (0.01,-67.67) [-67.67|587.68] "km/h" CAR
)";
}

std::vector<CanFrame> mti_frames(const MtiGroup& group) {
  std::vector<CanFrame> frames(3);
  frames[0].id = kSampleTimeId;
  put_be(frames[0].data, group.sample_time_100us);
  frames[1].id = kGroupCounterId;
  put_be(frames[1].data, group.counter);
  frames[2].id = kStatusWordId;
  put_be(frames[2].data, group.status);
  (group.output == MtiOutput::kIncrements ? add_increments : add_high_rate)(group, frames);
  return frames;
}

}  // namespace imusim
