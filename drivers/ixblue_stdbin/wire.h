#pragma once

/// iXblue / Exail StdBin (binary output protocol V2 to V5) as it stands on the wire. All numbers most
/// significant byte first. Layout and bits after the public decoder of the maker and captured telegrams.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace imuscope::ixblue_stdbin {

inline constexpr std::uint8_t kTelegramSync[] = {'I', 'X'};
inline constexpr std::uint8_t kAnswerSync[] = {'A', 'N'};
inline constexpr std::size_t kVersionOffset = 2;
inline constexpr std::uint8_t kVersionMin = 2;
inline constexpr std::uint8_t kVersionMax = 5;
inline constexpr std::uint8_t kAnswerVersionMin = 3;
inline constexpr std::size_t kChecksumSize = 4;  ///< u32: sum of every byte before it, modulo 2^32
inline constexpr std::size_t kAnswerHeaderSize = 5;
inline constexpr std::size_t kAnswerSizeOffset = 3;
inline constexpr std::size_t kAnswerMax = 1024;

/// Where the header of one protocol version has its numbers. Absent ones are 0.
struct HeaderLayout {
  std::size_t nav_mask;       // u32
  std::size_t extended_mask;  // u32
  std::size_t external_mask;  // u32
  std::size_t nav_size;       // u16: bytes of nav and extended blocks
  std::size_t total_size;     // u16: whole telegram with header and checksum
  std::size_t validity;       // u32, unit 100 us, time of day
  std::size_t counter;        // u32, +1 per telegram
  std::size_t size;           // of the header
};
inline constexpr HeaderLayout kHeaderV2{3, 0, 7, 0, 11, 13, 17, 21};
inline constexpr HeaderLayout kHeaderV3{3, 7, 11, 0, 15, 17, 21, 25};
inline constexpr HeaderLayout kHeaderV4{3, 7, 11, 15, 17, 19, 23, 27};
constexpr const HeaderLayout& header_layout(std::uint8_t version) noexcept {
  return version == 2 ? kHeaderV2 : version == 3 ? kHeaderV3 : kHeaderV4;
}

/// After the last size in the longest header; in shorter ones what follows is the validity.
inline constexpr std::size_t kSizesEnd = 19;

/// The unit of validity and of every block's own time.
inline constexpr std::int64_t kTickNs = 100'000;
inline constexpr std::int64_t kTicksPerSecond = 10'000;
inline constexpr std::int64_t kTicksPerDay = 86'400 * kTicksPerSecond;

enum class FieldType : std::uint8_t { kU8, kU16, kU32, kI32, kF32, kF64, kText8, kText32 };

constexpr std::size_t size_of(FieldType type) noexcept {
  switch (type) {
    case FieldType::kU8:
      return 1;
    case FieldType::kU16:
      return 2;
    case FieldType::kU32:
    case FieldType::kI32:
    case FieldType::kF32:
      return 4;
    case FieldType::kF64:
    case FieldType::kText8:
      return 8;
    case FieldType::kText32:
      return 32;
  }
  return 0;
}

/// One number or text of a block. The suffix of the name is its unit on the wire: deg, dps (deg/s), m, ms
/// (m/s), 100us; accelerations have no suffix and are m/s^2 (rotation accelerations deg/s^2).
struct FieldLayout {
  std::string_view name;
  FieldType type;
};

/// One data block. A block without fields is one whose length is not known.
struct BlockLayout {
  std::string_view name;
  std::span<const FieldLayout> fields;
  std::size_t size;
};

inline constexpr FieldLayout kHeadingRollPitchFields[] = {
    {"heading_deg", FieldType::kF32}, {"roll_deg", FieldType::kF32}, {"pitch_deg", FieldType::kF32}};
inline constexpr FieldLayout kRtHeaveSurgeSwayFields[] = {{"heave_no_lever_m", FieldType::kF32},
                                                          {"heave_m", FieldType::kF32},
                                                          {"surge_m", FieldType::kF32},
                                                          {"sway_m", FieldType::kF32}};
inline constexpr FieldLayout kSmartHeaveFields[] = {{"validity_100us", FieldType::kU32},
                                                    {"heave_m", FieldType::kF32}};
inline constexpr FieldLayout kHrpRateFields[] = {
    {"heading_dps", FieldType::kF32}, {"roll_dps", FieldType::kF32}, {"pitch_dps", FieldType::kF32}};
inline constexpr FieldLayout kAxesDpsFields[] = {
    {"x1_dps", FieldType::kF32}, {"x2_dps", FieldType::kF32}, {"x3_dps", FieldType::kF32}};
inline constexpr FieldLayout kAxesFields[] = {
    {"x1", FieldType::kF32}, {"x2", FieldType::kF32}, {"x3", FieldType::kF32}};
inline constexpr FieldLayout kPositionFields[] = {{"lat_deg", FieldType::kF64},
                                                  {"lon_deg", FieldType::kF64},
                                                  {"alt_ref", FieldType::kU8},
                                                  {"alt_m", FieldType::kF32}};
inline constexpr FieldLayout kPositionStdFields[] = {{"north_m", FieldType::kF32},
                                                     {"east_m", FieldType::kF32},
                                                     {"ne_corr", FieldType::kF32},
                                                     {"alt_m", FieldType::kF32}};
inline constexpr FieldLayout kNorthEastUpFields[] = {
    {"north", FieldType::kF32}, {"east", FieldType::kF32}, {"up", FieldType::kF32}};
inline constexpr FieldLayout kNorthEastFields[] = {{"north", FieldType::kF32}, {"east", FieldType::kF32}};
inline constexpr FieldLayout kSystemDateFields[] = {
    {"day", FieldType::kU8}, {"month", FieldType::kU8}, {"year", FieldType::kU16}};
inline constexpr FieldLayout kTwoWordsFields[] = {{"s1", FieldType::kU32}, {"s2", FieldType::kU32}};
inline constexpr FieldLayout kFourWordsFields[] = {
    {"s1", FieldType::kU32}, {"s2", FieldType::kU32}, {"s3", FieldType::kU32}, {"s4", FieldType::kU32}};
inline constexpr FieldLayout kThreeWordsFields[] = {
    {"s1", FieldType::kU32}, {"s2", FieldType::kU32}, {"s3", FieldType::kU32}};
inline constexpr FieldLayout kOneWordFields[] = {{"s", FieldType::kU32}};
inline constexpr FieldLayout kHeaveSurgeSwaySpeedFields[] = {
    {"heave", FieldType::kF32}, {"surge", FieldType::kF32}, {"sway", FieldType::kF32}};
inline constexpr FieldLayout kCogSogFields[] = {{"cog_deg", FieldType::kF32}, {"sog_ms", FieldType::kF32}};
inline constexpr FieldLayout kTemperaturesFields[] = {
    {"fog", FieldType::kF32}, {"acc", FieldType::kF32}, {"board", FieldType::kF32}};
inline constexpr FieldLayout kQuaternionFields[] = {
    {"q0", FieldType::kF32}, {"q1", FieldType::kF32}, {"q2", FieldType::kF32}, {"q3", FieldType::kF32}};
inline constexpr FieldLayout kQuaternionStdFields[] = {
    {"xi1", FieldType::kF32}, {"xi2", FieldType::kF32}, {"xi3", FieldType::kF32}};
inline constexpr FieldLayout kUtcFields[] = {{"t_100us", FieldType::kU32}, {"source", FieldType::kU8}};
inline constexpr FieldLayout kGnssFields[] = {
    {"t_100us", FieldType::kU32},       {"id", FieldType::kU8},          {"quality", FieldType::kU8},
    {"lat_deg", FieldType::kF64},       {"lon_deg", FieldType::kF64},    {"alt_m", FieldType::kF32},
    {"lat_std_m", FieldType::kF32},     {"lon_std_m", FieldType::kF32},  {"alt_std_m", FieldType::kF32},
    {"latlon_cov_m2", FieldType::kF32}, {"geoid_sep_m", FieldType::kF32}};
inline constexpr FieldLayout kEmLogFields[] = {{"t_100us", FieldType::kU32},
                                               {"id", FieldType::kU8},
                                               {"x1", FieldType::kF32},
                                               {"x1_std", FieldType::kF32}};
inline constexpr FieldLayout kUsblFields[] = {
    {"t_100us", FieldType::kU32},     {"id", FieldType::kU8},          {"beacon", FieldType::kText8},
    {"lat_deg", FieldType::kF64},     {"lon_deg", FieldType::kF64},    {"alt_m", FieldType::kF32},
    {"north_std_m", FieldType::kF32}, {"east_std_m", FieldType::kF32}, {"latlon_cov_m2", FieldType::kF32},
    {"alt_std_m", FieldType::kF32}};
inline constexpr FieldLayout kDepthFields[] = {
    {"t_100us", FieldType::kU32}, {"depth_m", FieldType::kF32}, {"std_m", FieldType::kF32}};
inline constexpr FieldLayout kDvlGroundFields[] = {{"t_100us", FieldType::kU32}, {"id", FieldType::kU8},
                                                   {"x1", FieldType::kF32},      {"x2", FieldType::kF32},
                                                   {"x3", FieldType::kF32},      {"sos", FieldType::kF32},
                                                   {"alt_m", FieldType::kF32},   {"x1_std", FieldType::kF32},
                                                   {"x2_std", FieldType::kF32},  {"x3_std", FieldType::kF32}};
inline constexpr FieldLayout kDvlWaterFields[] = {
    {"t_100us", FieldType::kU32}, {"id", FieldType::kU8},      {"x1", FieldType::kF32},
    {"x2", FieldType::kF32},      {"x3", FieldType::kF32},     {"sos", FieldType::kF32},
    {"x1_std", FieldType::kF32},  {"x2_std", FieldType::kF32}, {"x3_std", FieldType::kF32}};
inline constexpr FieldLayout kSoundVelocityFields[] = {{"t_100us", FieldType::kU32},
                                                       {"sos", FieldType::kF32}};
inline constexpr FieldLayout kDmiFields[] = {{"t_100us", FieldType::kU32}, {"pulses", FieldType::kI32}};
inline constexpr FieldLayout kLblFields[] = {{"t_100us", FieldType::kU32},  {"rfu", FieldType::kU8},
                                             {"beacon", FieldType::kText8}, {"lat_deg", FieldType::kF64},
                                             {"lon_deg", FieldType::kF64},  {"alt_m", FieldType::kF32},
                                             {"range_m", FieldType::kF32},  {"range_std_m", FieldType::kF32}};
inline constexpr FieldLayout kEventFields[] = {
    {"t_100us", FieldType::kU32}, {"id", FieldType::kU8}, {"count", FieldType::kU32}};
inline constexpr FieldLayout kTurretFields[] = {{"t_100us", FieldType::kU32},
                                                {"heading_deg", FieldType::kF32},
                                                {"roll_deg", FieldType::kF32},
                                                {"elevation_deg", FieldType::kF32}};
inline constexpr FieldLayout kVtgFields[] = {{"t_100us", FieldType::kU32},
                                             {"id", FieldType::kU8},
                                             {"true_course_deg", FieldType::kF32},
                                             {"mag_course_deg", FieldType::kF32},
                                             {"sog_ms", FieldType::kF32}};
inline constexpr FieldLayout kLogbookFields[] = {
    {"t_100us", FieldType::kU32}, {"log_id", FieldType::kU32}, {"text", FieldType::kText32}};

/// Blocks in stream order: mask bits of the nav mask (section 3.2).
inline constexpr BlockLayout kNavBlocks[] = {
    {"attitude_heading", kHeadingRollPitchFields, 12},
    {"attitude_heading_std", kHeadingRollPitchFields, 12},
    {"rt_heave_surge_sway", kRtHeaveSurgeSwayFields, 16},
    {"smart_heave", kSmartHeaveFields, 8},
    {"hrp_rate", kHrpRateFields, 12},
    {"rotation_rate_vessel", kAxesDpsFields, 12},
    {"accel_vessel", kAxesFields, 12},
    {"position", kPositionFields, 21},
    {"position_std", kPositionStdFields, 16},
    {"speed_geo", kNorthEastUpFields, 12},
    {"speed_geo_std", kNorthEastUpFields, 12},
    {"current_geo", kNorthEastFields, 8},
    {"current_geo_std", kNorthEastFields, 8},
    {"system_date", kSystemDateFields, 4},
    {"sensor_status", kTwoWordsFields, 8},
    {"ins_algo_status", kFourWordsFields, 16},
    {"ins_system_status", kThreeWordsFields, 12},
    {"ins_user_status", kOneWordFields, 4},
    {"ahrs_algo_status", kOneWordFields, 4},
    {"ahrs_system_status", kThreeWordsFields, 12},
    {"ahrs_user_status", kOneWordFields, 4},
    {"heave_surge_sway_speed", kHeaveSurgeSwaySpeedFields, 12},
    {"speed_vessel", kAxesFields, 12},
    {"accel_geo", kNorthEastUpFields, 12},
    {"cog_sog", kCogSogFields, 8},
    {"temperatures", kTemperaturesFields, 12},
    {"quaternion", kQuaternionFields, 16},
    {"quaternion_std", kQuaternionStdFields, 12},
    {"raw_accel_vessel", kAxesFields, 12},
    {"accel_vessel_std", kAxesFields, 12},
    {"rotation_rate_vessel_std", kAxesDpsFields, 12},
};

/// Blocks in stream order: mask bits of the extended nav mask.
inline constexpr BlockLayout kExtendedBlocks[] = {
    {"rotation_accel_vessel", kAxesFields, 12},
    {"rotation_accel_vessel_std", kAxesFields, 12},
    {"raw_rotation_rate_vessel", kAxesDpsFields, 12},
    {"vehicle_attitude_heading", kHeadingRollPitchFields, 12},
    {"vehicle_attitude_heading_std", kHeadingRollPitchFields, 12},
    {"vehicle_position", kPositionFields, 21},
    {"vehicle_position_std", kPositionStdFields, 16},
};

/// Blocks in stream order: mask bits of the external mask; bit 23 is not known.
inline constexpr BlockLayout kExternalBlocks[] = {
    {"utc", kUtcFields, 5},
    {"gnss1", kGnssFields, 46},
    {"gnss2", kGnssFields, 46},
    {"gnss_manual", kGnssFields, 46},
    {"emlog1", kEmLogFields, 13},
    {"emlog2", kEmLogFields, 13},
    {"usbl1", kUsblFields, 49},
    {"usbl2", kUsblFields, 49},
    {"usbl3", kUsblFields, 49},
    {"depth", kDepthFields, 12},
    {"dvl_ground1", kDvlGroundFields, 37},
    {"dvl_water1", kDvlWaterFields, 33},
    {"sound_velocity", kSoundVelocityFields, 8},
    {"dmi", kDmiFields, 8},
    {"lbl1", kLblFields, 41},
    {"lbl2", kLblFields, 41},
    {"lbl3", kLblFields, 41},
    {"lbl4", kLblFields, 41},
    {"event_a", kEventFields, 9},
    {"event_b", kEventFields, 9},
    {"event_c", kEventFields, 9},
    {"dvl_ground2", kDvlGroundFields, 37},
    {"dvl_water2", kDvlWaterFields, 33},
    {"", {}, 0},
    {"turret", kTurretFields, 16},
    {"vtg1", kVtgFields, 17},
    {"vtg2", kVtgFields, 17},
    {"logbook", kLogbookFields, 40},
};

namespace detail {
constexpr bool sizes_agree(std::span<const BlockLayout> blocks) {
  for (const BlockLayout& block : blocks) {
    std::size_t sum = 0;
    for (const FieldLayout& field : block.fields) sum += size_of(field.type);
    if (sum != block.size) return false;
  }
  return true;
}
}  // namespace detail
static_assert(detail::sizes_agree(kNavBlocks));
static_assert(detail::sizes_agree(kExtendedBlocks));
static_assert(detail::sizes_agree(kExternalBlocks));

/// Names of the mask bits that the decoder needs.
enum class Nav : std::size_t {
  kAttitude = 0,
  kAttitudeStd = 1,
  kSystemDate = 13,
  kAlgorithmStatus = 15,
  kSystemStatus = 16,
  kUserStatus = 17,
  kRawAcceleration = 28,
};
enum class Extended : std::size_t { kRotationAcceleration = 0, kRawRotationRate = 2 };

// INS user status (section 3.4).
inline constexpr std::uint32_t kUserTimeReceived = 1U << 8U;
inline constexpr std::uint32_t kUserHrpInvalid = 1U << 26U;
inline constexpr std::uint32_t kUserAlignment = 1U << 27U;
inline constexpr std::uint32_t kUserFailure = 1U << 31U;

/// Longest telegram of known blocks (all of them, V4 and V5) is below 1300 bytes; more is a false start.
inline constexpr std::size_t kTelegramMax = 2048;

}  // namespace imuscope::ixblue_stdbin
