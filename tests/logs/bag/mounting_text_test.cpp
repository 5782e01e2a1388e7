/// Mountings as others write them, read back and put through the equations of those who read them.

#include "logs/bag/mounting_text.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>
#include <regex>

#include "tests/support/recorded_answer.h"

namespace imuscope::bag {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Numbers of a text after `key`.
std::vector<double> numbers_behind(const std::string& text, const std::string& key, std::size_t n) {
  const auto at = text.find(key);
  EXPECT_NE(at, std::string::npos) << key << " is not in\n" << text;
  static const std::regex kNumber("[-+]?[0-9]*\\.?[0-9]+(e[-+]?[0-9]+)?");
  std::vector<double> numbers;
  const std::string rest = text.substr(at + key.size());
  for (auto found = std::sregex_iterator(rest.begin(), rest.end(), kNumber);
       found != std::sregex_iterator() && numbers.size() < n; ++found)
    numbers.push_back(std::stod(found->str()));
  EXPECT_EQ(numbers.size(), n);
  return numbers;
}

struct Case {
  Matrix3d C_b_s;
  Vector3d r_bs_b_m;
  Mounting mounting;
};

std::vector<Case> cases() {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  std::vector<Case> all;
  for (int i = 0; i < 40; ++i) {
    Eigen::Quaterniond q{normal(random), normal(random), normal(random), normal(random)};
    q.normalize();
    // The poles of roll, pitch and yaw, too: s points up or down.
    if (i == 0) q = Eigen::Quaterniond(Eigen::AngleAxisd(M_PI / 2.0, Vector3d::UnitY()));
    if (i == 1)
      q = Eigen::Quaterniond(Eigen::AngleAxisd(-M_PI / 2.0, Vector3d::UnitY()) *
                             Eigen::AngleAxisd(0.7, Vector3d::UnitX()));
    if (i == 2) q = Eigen::Quaterniond::Identity();
    Case one{q.toRotationMatrix(), {normal(random), normal(random), normal(random)}, {}};
    one.mounting.name = "mtx1";
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(one.mounting.C_b_s.data()) = one.C_b_s;
    one.mounting.r_bs_b_m = {one.r_bs_b_m.x(), one.r_bs_b_m.y(), one.r_bs_b_m.z()};
    one.mounting.t_d_s = -0.0123;
    one.mounting.status = "calibrated";
    all.push_back(one);
  }
  return all;
}

/// A point that the sensor sees, in its own axes, and where it is in base_link: forward-left-up, by our
/// definition.
Vector3d in_base_link(const Case& one, const Vector3d& p_s) {
  const Vector3d p_b = one.C_b_s.transpose() * p_s + one.r_bs_b_m;
  return {p_b.x(), -p_b.y(), -p_b.z()};
}

const Vector3d kPoint(0.3, -1.1, 2.2);

TEST(MountingText, UrdfTurnsAboutFixedAxesRollFirst) {
  for (const Case& one : cases()) {
    const auto text = mounting_text(one.mounting, {}, std::nullopt, "airins", MountingFormat::kUrdf);
    const auto xyz = numbers_behind(text, "xyz=\"", 3);
    const auto rpy = numbers_behind(text, "rpy=\"", 3);
    const Matrix3d R =
        (Eigen::AngleAxisd(rpy[2], Vector3d::UnitZ()) * Eigen::AngleAxisd(rpy[1], Vector3d::UnitY()) *
         Eigen::AngleAxisd(rpy[0], Vector3d::UnitX()))
            .toRotationMatrix();
    EXPECT_LT((R * kPoint + Vector3d(xyz[0], xyz[1], xyz[2]) - in_base_link(one, kPoint)).norm(), 1e-6)
        << text;
    EXPECT_NE(text.find("<parent link=\"base_link\"/>"), std::string::npos);
    // A comment of XML ends at its first two hyphens.
    const auto end = text.find("-->");
    EXPECT_EQ(text.substr(4, end - 4).find("--"), std::string::npos) << text;
  }
}

TEST(MountingText, TfTakesTheChildsCoordinatesToTheParents) {
  for (const Case& one : cases()) {
    const auto text = mounting_text(one.mounting, {}, std::nullopt, "airins", MountingFormat::kTf);
    const Vector3d at(numbers_behind(text, "--x ", 1)[0], numbers_behind(text, "--y ", 1)[0],
                      numbers_behind(text, "--z ", 1)[0]);
    const Eigen::Quaterniond q(numbers_behind(text, "--qw ", 1)[0], numbers_behind(text, "--qx ", 1)[0],
                               numbers_behind(text, "--qy ", 1)[0], numbers_behind(text, "--qz ", 1)[0]);
    EXPECT_LT((q * kPoint + at - in_base_link(one, kPoint)).norm(), 1e-6) << text;
  }
}

/// kalibr: p_i = T_i_b p_b, and t = stamp + time_offset. OpenVINS reads the same T_i_b.
TEST(MountingText, ImuChainsTakeTheBodysCoordinatesToTheSensors) {
  for (const auto format : {MountingFormat::kKalibr, MountingFormat::kOpenVins}) {
    for (const Case& one : cases()) {
      const auto text = mounting_text(one.mounting, {}, std::nullopt, "airins", format);
      const auto T = numbers_behind(text, "T_i_b:", 16);
      const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> T_i_b(T.data());
      const Vector3d p_b = one.C_b_s.transpose() * kPoint + one.r_bs_b_m;
      const Eigen::Vector4d p_i = T_i_b * p_b.homogeneous();
      EXPECT_LT((p_i.head<3>() - kPoint).norm(), 1e-6) << text;
      EXPECT_NEAR(p_i[3], 1.0, 0.0);
      EXPECT_NEAR(numbers_behind(text, "time_offset:", 1)[0], -0.0123, 1e-9);
    }
  }
}

/// OpenVINS (VioManagerOptions.h, Propagator.cpp) reads Tw and Ta, inverts them, and takes D (reading - bias)
/// for the truth, turned by the transposes of R_IMUtoGYRO and R_IMUtoACC; Tg is what forces do to the gyros.
TEST(MountingText, OpenVinsFindsTheTruthBehindAReading) {
  using Matrix = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  Correction scale;
  scale.gyro_scale = {0.01, -0.02, 0.03};
  scale.accel_scale = {0.001, 0.002, -0.003};
  const auto text =
      mounting_text(cases()[5].mounting, scale, std::nullopt, "airins", MountingFormat::kOpenVins);
  const auto matrix = [&](const char* key) { return Matrix(numbers_behind(text, key, 9).data()); };
  const Vector3d rate(0.3, -0.7, 1.1), force(0.5, -9.7, 2.0), gyro_bias(0.01, 0.02, -0.03),
      accel_bias(0.1, -0.2, 0.3);
  Vector3d gyro_reading = gyro_bias, accel_reading = accel_bias;
  for (Eigen::Index i = 0; i < 3; ++i) {
    gyro_reading[i] += (1.0 + scale.gyro_scale[static_cast<std::size_t>(i)]) * rate[i];
    accel_reading[i] += (1.0 + scale.accel_scale[static_cast<std::size_t>(i)]) * force[i];
  }
  const Vector3d found_force =
      matrix("R_IMUtoACC:").transpose() * (matrix("Ta:").inverse() * (accel_reading - accel_bias));
  const Vector3d found_rate =
      matrix("R_IMUtoGYRO:").transpose() *
      (matrix("Tw:").inverse() * (gyro_reading - gyro_bias - matrix("Tg:") * found_force));
  EXPECT_LT((found_force - force).norm(), 1e-7);
  EXPECT_LT((found_rate - rate).norm(), 1e-8);
}

using Matrix3Row = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

Matrix3d matrix_behind(const std::string& text, const std::string& key) {
  const auto m = numbers_behind(text, key, 9);
  return Eigen::Map<const Matrix3Row>(m.data());
}

/// What a sensor with crooked triads reads, by our definition and by the equations of kalibr
/// (scale-misalignment) and OpenVINS, which undoes Tw, Ta, Tg and the rotations.
TEST(MountingText, TriadsMakeTheSameReadingsByEveryonesEquations) {
  std::mt19937 random(8);
  std::normal_distribution<double> normal;
  for (const Case& one : cases()) {
    const auto small = [&] { return 0.02 * normal(random); };
    Matrix3d gyro = Matrix3d::Identity();
    Matrix3d accel = Matrix3d::Identity();
    Matrix3d K;
    for (Eigen::Index i = 0; i < 3; ++i) {
      for (Eigen::Index j = 0; j < 3; ++j) {
        if (j <= i) gyro(i, j) += small(), accel(i, j) += small();
        K(i, j) = 0.01 * small();
      }
    }
    const Matrix3d C_s_accel =
        Eigen::AngleAxisd(0.05, Vector3d{normal(random), normal(random), normal(random)}.normalized())
            .toRotationMatrix();
    Triads triads;
    Eigen::Map<Matrix3Row>(triads.gyro_matrix.data()) = gyro;
    Eigen::Map<Matrix3Row>(triads.accel_matrix.data()) = accel;
    Eigen::Map<Matrix3Row>(triads.C_s_accel.data()) = C_s_accel;
    Eigen::Map<Matrix3Row>(triads.g_sensitivity.data()) = K;
    const Vector3d w_b(0.3, -0.2, 0.9);
    const Vector3d f_b(1.0, 2.0, -9.8);
    const Vector3d w_read = gyro * one.C_b_s * w_b + K * one.C_b_s * f_b;
    const Vector3d f_read = accel * C_s_accel * one.C_b_s * f_b;

    const auto kalibr = mounting_text(one.mounting, {}, triads, "airins", MountingFormat::kKalibr);
    const auto T = numbers_behind(kalibr, "T_i_b:", 16);
    const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> T_i_b(T.data());
    const Matrix3d C_b_i = T_i_b.topLeftCorner<3, 3>();
    EXPECT_LT((C_b_i * one.r_bs_b_m + T_i_b.topRightCorner<3, 1>()).norm(), 1e-6) << "r is i's origin";
    const auto of_gyros = kalibr.find("gyroscopes:");
    ASSERT_NE(of_gyros, std::string::npos);
    const Matrix3d M_accel = matrix_behind(kalibr.substr(0, of_gyros), "    M:");
    const std::string gyroscopes = kalibr.substr(of_gyros);
    const Matrix3d C_gyro_i = matrix_behind(gyroscopes, "C_gyro_i:");
    const Vector3d w_kalibr = matrix_behind(gyroscopes, "    M:") * C_gyro_i * C_b_i * w_b +
                              matrix_behind(gyroscopes, "    A:") * C_gyro_i * C_b_i * f_b;
    EXPECT_LT((w_kalibr - w_read).norm(), 1e-9) << kalibr;
    EXPECT_LT((M_accel * C_b_i * f_b - f_read).norm(), 1e-8) << kalibr;

    const auto vins = mounting_text(one.mounting, {}, triads, "airins", MountingFormat::kOpenVins);
    const Vector3d f_i =
        matrix_behind(vins, "R_IMUtoACC:").transpose() * matrix_behind(vins, "Ta:").inverse() * f_read;
    const Vector3d w_i = matrix_behind(vins, "R_IMUtoGYRO:").transpose() *
                         (matrix_behind(vins, "Tw:").inverse() * (w_read - matrix_behind(vins, "Tg:") * f_i));
    EXPECT_LT((f_i - C_b_i * f_b).norm(), 1e-8) << vins;
    EXPECT_LT((w_i - C_b_i * w_b).norm(), 1e-8) << vins;
  }
}

TEST(MountingText, JsonHoldsTheSameThreeTimes) {
  for (const Case& one : cases()) {
    const auto document =
        nlohmann::json::parse(mounting_text(one.mounting, {}, std::nullopt, "airins", MountingFormat::kJson));
    const auto q = document.at("in_base_link").at("quaternion_xyzw").get<std::array<double, 4>>();
    const auto at = document.at("in_base_link").at("xyz_m").get<std::array<double, 3>>();
    const Vector3d there =
        Eigen::Quaterniond(q[3], q[0], q[1], q[2]) * kPoint + Vector3d(at[0], at[1], at[2]);
    EXPECT_LT((there - in_base_link(one, kPoint)).norm(), 1e-9);
    EXPECT_EQ((document.at("C_b_s").get<std::array<double, 9>>()), one.mounting.C_b_s);
  }
}

TEST(MountingText, AnUnknownFormatNamesThoseThatExist) {
  const auto format = parse_mounting_format("sdf");
  ASSERT_FALSE(format);
  EXPECT_NE(format.error().text().find("urdf"), std::string::npos);
}

TEST(MountingTextWhole, EveryFormat) {
  std::string text;
  Triads triads;
  triads.gyro_matrix = {1.01, 0, 0, 0.002, 0.99, 0, 0.003, -0.004, 1.02};
  triads.accel_matrix = {0.98, 0, 0, -0.005, 1.03, 0, 0.006, 0.007, 0.97};
  triads.C_s_accel = {0.36, 0.48, -0.8, -0.8, 0.6, 0.0, 0.48, 0.64, 0.6};
  triads.g_sensitivity = {1e-4, 2e-4, 3e-4, 4e-4, 5e-4, 6e-4, 7e-4, 8e-4, 9e-4};
  Correction scale;
  scale.gyro_scale = {0.01, 0.02, -0.03};
  scale.accel_scale = {-0.01, 0.005, 0.002};
  const auto all = cases();
  for (const std::size_t i : {0U, 1U, 2U, 3U}) {
    Mounting mounting = all[i].mounting;
    mounting.sd_boresight_rad = {0.01, 0.02, 0.03};
    mounting.sd_r_bs_b_m = {0.001, 0.002, 0.003};
    mounting.sd_t_d_s = i == 2 ? std::nan("") : 0.0005;
    if (i == 2) mounting.r_bs_b_m = {1.5, -2.5, 0.25};
    if (i == 3)
      mounting.C_b_s = {0.36, 0.48, -0.8, -0.8, 0.6, 0.0, 0.48, 0.64, 0.6},
      mounting.r_bs_b_m = {1.5, -2.5, 0.25};
    if (i < 2) mounting.r_bs_b_m = {0.5, 0.25, -0.125};
    for (const char* name : {"urdf", "tf", "kalibr", "openvins", "json"}) {
      const auto format = parse_mounting_format(name);
      ASSERT_TRUE(format);
      text += mounting_text(mounting, scale, std::nullopt, "airins", *format) +
              mounting_text(mounting, scale, triads, "airins", *format);
    }
  }
  text += parse_mounting_format("xml").error().text() + '\n';
  test::expect_recorded("logs/mountings.txt", text, 1e-8, 1e-9);
}

}  // namespace
}  // namespace imuscope::bag
