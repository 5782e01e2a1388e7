#include "bag/mounting_text.h"

#include <fmt/format.h>
#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/json_text.h"
#include "base/units.h"

namespace imuscope::bag {
namespace {

constexpr std::array<std::pair<std::string_view, MountingFormat>, 5> kFormats{
    {{"urdf", MountingFormat::kUrdf},
     {"tf", MountingFormat::kTf},
     {"kalibr", MountingFormat::kKalibr},
     {"openvins", MountingFormat::kOpenVins},
     {"json", MountingFormat::kJson}}};

/// What is known of the numbers, as a comment. XML forbids two hyphens in one, which "e-05" has not.
std::string knowledge(const Mounting& m) {
  return fmt::format(
      "sd: boresight about forward, right, down {:.3g} {:.3g} {:.3g} deg; lever arm {:.3g} {:.3g} {:.3g} m; "
      "time offset "
      "{:.3g} ms; {}",
      m.sd_boresight_rad[0] * kDegPerRad, m.sd_boresight_rad[1] * kDegPerRad,
      m.sd_boresight_rad[2] * kDegPerRad, m.sd_r_bs_b_m[0], m.sd_r_bs_b_m[1], m.sd_r_bs_b_m[2],
      m.sd_t_d_s * kMsPerS, m.status);
}

/// Roll, pitch, yaw about fixed axes: R = Rz(yaw) Ry(pitch) Rx(roll).
Vector3 fixed_rpy(const mcap::Quaternion& q) {
  const double x = q[0], y = q[1], z = q[2], w = q[3];
  const double sine = std::clamp(2.0 * (w * y - z * x), -1.0, 1.0);
  // Near the pole roll and yaw turn about one axis: all of it is yaw's.
  constexpr double kPole = 1.0 - 1e-12;
  if (std::abs(sine) > kPole)
    return {0.0, std::copysign(kPi / 2.0, sine), -std::copysign(2.0, sine) * std::atan2(x, w)};
  return {std::atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)), std::asin(sine),
          std::atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))};
}

std::string urdf(const Mounting& m) {
  const Vector3 place = flu(m.r_bs_b_m);
  const Vector3 rpy = fixed_rpy(sensor_in_base_link(m.C_b_s));
  return fmt::format(
      "<!-- imuscope: {0}\n     base_link is forward-left-up, its origin that of the reference IMU. "
      "-->\n<link name=\"{1}\"/>\n"
      "<joint name=\"{2}_to_{1}\" type=\"fixed\">\n  <parent link=\"{2}\"/>\n  <child link=\"{1}\"/>\n"
      "  <origin xyz=\"{3:.9g} {4:.9g} {5:.9g}\" rpy=\"{6:.12g} {7:.12g} {8:.12g}\"/>\n</joint>\n",
      knowledge(m), m.name, kBaseLink, place[0], place[1], place[2], rpy[0], rpy[1], rpy[2]);
}

std::string tf(const Mounting& m) {
  const Vector3 place = flu(m.r_bs_b_m);
  const auto q = sensor_in_base_link(m.C_b_s);
  return fmt::format(
      "# imuscope: {}\nros2 run tf2_ros static_transform_publisher --x {:.9g} --y {:.9g} --z {:.9g} --qx "
      "{:.12g} --qy "
      "{:.12g} --qz {:.12g} --qw {:.12g} --frame-id {} --child-frame-id {}\n",
      knowledge(m), place[0], place[1], place[2], q[0], q[1], q[2], q[3], kBaseLink, m.name);
}

/// Rows of the transform that takes coordinates in b to those in s.
std::string rows_of_T_s_b(const Mounting& m) {
  std::string rows;
  for (std::size_t i = 0; i < 3; ++i) {
    const double* C = &m.C_b_s[3 * i];
    const double t = -(C[0] * m.r_bs_b_m[0] + C[1] * m.r_bs_b_m[1] + C[2] * m.r_bs_b_m[2]);
    rows += fmt::format("    - [{:.12g}, {:.12g}, {:.12g}, {:.9g}]\n", C[0], C[1], C[2], t);
  }
  return rows + "    - [0.0, 0.0, 0.0, 1.0]\n";
}

std::string chain(const Mounting& m, const std::string& reference) {
  return fmt::format(
      "# imuscope: {}\n# body: {}, forward-right-down\n{}:\n  T_i_b:\n{}  time_offset: {:.9g}\n",
      knowledge(m), reference, m.name, rows_of_T_s_b(m), m.t_d_s);
}

std::string diagonal(const char* key, const Vector3& v) {
  return fmt::format("  {}:\n    - [{:.9g}, 0.0, 0.0]\n    - [0.0, {:.9g}, 0.0]\n    - [0.0, 0.0, {:.9g}]\n",
                     key, 1.0 + v[0], 1.0 + v[1], 1.0 + v[2]);
}

std::string openvins(const Mounting& m, const Correction& scale, const std::string& reference) {
  constexpr Vector3 kNone{};
  constexpr const char* kZeros = "    - [0.0, 0.0, 0.0]\n    - [0.0, 0.0, 0.0]\n    - [0.0, 0.0, 0.0]\n";
  return "%YAML:1.0\n" + chain(m, reference) + "  model: \"kalibr\"\n" + diagonal("Tw", scale.gyro_scale) +
         diagonal("R_IMUtoGYRO", kNone) + diagonal("Ta", scale.accel_scale) + diagonal("R_IMUtoACC", kNone) +
         "  Tg:\n" + kZeros;
}

std::string all_of_it(const Mounting& m, const Correction& scale, const std::string& reference) {
  const auto q = sensor_in_base_link(m.C_b_s);
  const nlohmann::json document{
      {"schema", "imuscope.mounting/1"},
      {"name", m.name},
      {"reference", reference},
      {"status", m.status},
      {"C_b_s", m.C_b_s},
      {"r_bs_b_m", m.r_bs_b_m},
      {"t_d_s", m.t_d_s},
      {"boresight_sd_deg",
       {m.sd_boresight_rad[0] * kDegPerRad, m.sd_boresight_rad[1] * kDegPerRad,
        m.sd_boresight_rad[2] * kDegPerRad}},
      {"r_bs_b_sd_m", m.sd_r_bs_b_m},
      {"t_d_sd_s", std::isfinite(m.sd_t_d_s) ? nlohmann::json(m.sd_t_d_s) : nlohmann::json(nullptr)},
      {"gyro_scale", scale.gyro_scale},
      {"accel_scale", scale.accel_scale},
      {"in_base_link", {{"xyz_m", flu(m.r_bs_b_m)}, {"quaternion_xyzw", q}, {"rpy_rad", fixed_rpy(q)}}}};
  return json_text(document) + "\n";
}

}  // namespace

Result<MountingFormat> parse_mounting_format(std::string_view text) {
  for (const auto& [name, format] : kFormats) {
    if (name == text) return format;
  }
  return usage_error(fmt::format("a mounting is not written as '{}'", text),
                     "give urdf, tf, kalibr, openvins or json; noise models are in the run's models.json");
}

std::string mounting_text(const Mounting& mounting, const Correction& scale, const std::string& reference,
                          MountingFormat format) {
  switch (format) {
    case MountingFormat::kUrdf:
      return urdf(mounting);
    case MountingFormat::kTf:
      return tf(mounting);
    case MountingFormat::kKalibr:
      return chain(mounting, reference);
    case MountingFormat::kOpenVins:
      return openvins(mounting, scale, reference);
    case MountingFormat::kJson:
      return all_of_it(mounting, scale, reference);
  }
  return {};
}

}  // namespace imuscope::bag
