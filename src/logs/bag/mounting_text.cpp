#include "logs/bag/mounting_text.h"

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
      "sd: boresight about forward, right, down {:.3g} {:.3g} {:.3g} deg; lever arm {:.3g} {:.3g} "
      "{:.3g} m; time offset {:.3g} ms; {}",
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
      "{:.12g} --qy {:.12g} --qz {:.12g} --qw {:.12g} --frame-id {} --child-frame-id {}\n",
      knowledge(m), place[0], place[1], place[2], q[0], q[1], q[2], q[3], kBaseLink, m.name);
}

Rotation product(const Rotation& a, const Rotation& b) {
  Rotation out{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      out[3 * i + j] = 0.0;
      for (std::size_t k = 0; k < 3; ++k) out[3 * i + j] += a[3 * i + k] * b[3 * k + j];
    }
  }
  return out;
}

Rotation transposed(const Rotation& m) { return {m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8]}; }

/// Rows of the transform that takes coordinates in b to those in i: s, or the accelerometer triad's frame.
std::string rows_of_T_i_b(const Mounting& m, const std::optional<Triads>& triads) {
  const Rotation C_b_i = triads ? product(triads->C_s_accel, m.C_b_s) : m.C_b_s;
  std::string rows;
  for (std::size_t i = 0; i < 3; ++i) {
    const double* C = &C_b_i[3 * i];
    const double t = -(C[0] * m.r_bs_b_m[0] + C[1] * m.r_bs_b_m[1] + C[2] * m.r_bs_b_m[2]);
    rows += fmt::format("    - [{:.12g}, {:.12g}, {:.12g}, {:.9g}]\n", C[0], C[1], C[2], t);
  }
  return rows + "    - [0.0, 0.0, 0.0, 1.0]\n";
}

std::string chain(const Mounting& m, const std::optional<Triads>& triads, const std::string& reference) {
  return fmt::format(
      "# imuscope: {}\n# body: {}, forward-right-down\n{}:\n  T_i_b:\n{}  time_offset: {:.9g}\n",
      knowledge(m), reference, m.name, rows_of_T_i_b(m, triads), m.t_d_s);
}

/// A matrix as three lists, `indent` deep.
std::string matrix(const char* key, const std::array<double, 9>& m, int indent) {
  const std::string space(static_cast<std::size_t>(indent), ' ');
  std::string rows = fmt::format("{}{}:\n", space, key);
  for (std::size_t i = 0; i < 3; ++i)
    rows += fmt::format("{}  - [{:.12g}, {:.12g}, {:.12g}]\n", space, m[3 * i], m[3 * i + 1], m[3 * i + 2]);
  return rows;
}

Rotation diagonal(const Vector3& v) { return {1.0 + v[0], 0, 0, 0, 1.0 + v[1], 0, 0, 0, 1.0 + v[2]}; }

std::string kalibr(const Mounting& m, const std::optional<Triads>& triads, const std::string& reference) {
  if (!triads) return chain(m, triads, reference);
  return chain(m, triads, reference) + "  model: scale-misalignment\n  accelerometers:\n" +
         matrix("M", triads->accel_matrix, 4) + "  gyroscopes:\n" + matrix("M", triads->gyro_matrix, 4) +
         matrix("A", triads->g_sensitivity, 4) + matrix("C_gyro_i", transposed(triads->C_s_accel), 4);
}

std::string openvins(const Mounting& m, const Correction& scale, const std::optional<Triads>& known,
                     const std::string& reference) {
  const Triads triads = known.value_or(
      Triads{diagonal(scale.gyro_scale), diagonal(scale.accel_scale), {1, 0, 0, 0, 1, 0, 0, 0, 1}, {}});
  const Rotation C_gyro_i = transposed(triads.C_s_accel);
  return "%YAML:1.0\n" + chain(m, known, reference) + "  model: \"kalibr\"\n" +
         matrix("Tw", triads.gyro_matrix, 2) + matrix("R_IMUtoGYRO", C_gyro_i, 2) +
         matrix("Ta", triads.accel_matrix, 2) + matrix("R_IMUtoACC", diagonal({}), 2) +
         matrix("Tg", product(triads.g_sensitivity, C_gyro_i), 2);
}

std::string all_of_it(const Mounting& m, const Correction& scale, const std::optional<Triads>& triads,
                      const std::string& reference) {
  const auto q = sensor_in_base_link(m.C_b_s);
  nlohmann::json document{
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
  if (triads) {
    document["gyro_matrix"] = triads->gyro_matrix;
    document["accel_matrix"] = triads->accel_matrix;
    document["C_s_accel"] = triads->C_s_accel;
    document["g_sensitivity_radps_per_mps2"] = triads->g_sensitivity;
  }
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

std::string mounting_text(const Mounting& mounting, const Correction& scale,
                          const std::optional<Triads>& triads, const std::string& reference,
                          MountingFormat format) {
  switch (format) {
    case MountingFormat::kUrdf:
      return urdf(mounting);
    case MountingFormat::kTf:
      return tf(mounting);
    case MountingFormat::kKalibr:
      return kalibr(mounting, triads, reference);
    case MountingFormat::kOpenVins:
      return openvins(mounting, scale, triads, reference);
    case MountingFormat::kJson:
      return all_of_it(mounting, scale, triads, reference);
  }
  return {};
}

}  // namespace imuscope::bag
