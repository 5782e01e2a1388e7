#include "service/run/virtual_imu.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <random>

#include "publish/message_codec.h"
#include "sample/eigen_arrays.h"

namespace imuscope {
namespace {

using Eigen::Vector3d;

constexpr double kRate_hz = 100.0;
constexpr HostTime kFirstReference = host_time_from_ns(5'000'000'000);

/// Three S-IMUs with weights by axis; the third has none about x, and a negative one about z.
Configuration vehicle() {
  const auto made = parse_configuration(R"(
[[device]]
name = "reference"
role = "reference"
protocol = "csv_imu"
[[device]]
name = "mtx1"
role = "study"
protocol = "csv_imu"
[[device]]
name = "mtx2"
role = "study"
protocol = "csv_imu"
[[device]]
name = "mtx3"
role = "study"
protocol = "csv_imu"
[virtual_imu]
imus = ["mtx2", "mtx1", "mtx3"]
gyro_x = [0.75, 0.25, 0.0]
gyro_z = [0.8, 0.4, -0.2]
accel_y = [0.1, 0.2, 0.7]
)",
                                        "vehicle.toml");
  EXPECT_TRUE(made) << made.error().text();
  return made.value_or(Configuration{});
}

/// How an S-IMU sits, and when its samples are of: by its own clock `late_s` after the motion.
struct Sitting {
  Eigen::Matrix3d C_b_s;
  Vector3d r_b_m;
  double late_s;
  double phase_s;  ///< of its samples against the reference's epochs
};

const std::array<Sitting, 3>& sittings() {
  static const std::array<Sitting, 3> kSittings{{
      {Eigen::AngleAxisd(1.1, Vector3d(1, 2, 3).normalized()).toRotationMatrix(),
       {0.3, -0.1, 0.2},
       0.013,
       0.0021},
      {Eigen::AngleAxisd(-2.0, Vector3d(3, -1, 1).normalized()).toRotationMatrix(),
       {-0.2, 0.4, 0.0},
       0.004,
       0.0013},
      {Eigen::AngleAxisd(0.4, Vector3d(0, 1, -1).normalized()).toRotationMatrix(),
       {0.0, 0.1, -0.5},
       -0.002,
       0.0067},
  }};
  return kSittings;
}

/// Of the body, in b; slow against the samples.
Vector3d omega_b(double t) {
  return {0.3 * std::sin(0.9 * t), 0.2 * std::cos(0.5 * t), 0.4 * std::sin(0.7 * t + 1.0)};
}
Vector3d omega_dot_b(double t) {
  return {0.27 * std::cos(0.9 * t), -0.1 * std::sin(0.5 * t), 0.28 * std::cos(0.7 * t + 1.0)};
}
Vector3d f_at(const Vector3d& r_b_m, double t) {
  const Vector3d omega = omega_b(t);
  const Vector3d f(1.5 * std::sin(0.3 * t), 0.8 * std::cos(0.6 * t), -9.81);
  return f + omega_dot_b(t).cross(r_b_m) + omega.cross(omega.cross(r_b_m));
}

/// The k-th row of an S-IMU, whose error in b is `error_b` for rates and ten times that for forces.
ErrorRecord row_of(std::size_t study, int k, const Vector3d& error_b) {
  const Sitting& sitting = sittings()[study];
  const double motion_s = sitting.phase_s + static_cast<double>(k) / kRate_hz;
  ErrorRecord record{};
  record.study = study;
  record.first_reference_time = kFirstReference;
  record.mounting = {to_array(sitting.C_b_s), to_array(sitting.r_b_m)};
  record.t_d_s = -sitting.late_s;
  record.row.time = kFirstReference + from_seconds(motion_s + sitting.late_s);
  record.row.counter = k;
  record.row.gyro_valid = record.row.accel_valid = true;
  record.row.predicted_omega_s_radps = to_array(Vector3d(sitting.C_b_s * omega_b(motion_s)));
  record.row.predicted_f_s_mps2 = to_array(Vector3d(sitting.C_b_s * f_at(sitting.r_b_m, motion_s)));
  record.row.e_gyro_radps = to_array(Vector3d(sitting.C_b_s * error_b));
  record.row.e_accel_mps2 = to_array(Vector3d(sitting.C_b_s * (10.0 * error_b)));
  return record;
}

struct Rows {
  std::vector<virtual_imu_t> messages;
  std::vector<virtual_imu_row_t> rows;
  void take(std::vector<virtual_imu_t> more) {
    for (auto& message : more) {
      EXPECT_EQ(message.rows.size(), static_cast<std::size_t>(message.n_rows));
      rows.insert(rows.end(), message.rows.begin(), message.rows.end());
      messages.push_back(std::move(message));
    }
  }
  void end(VirtualImu& imu) {
    if (auto last = imu.take()) take({*last});
  }
};

/// The samples from one count to another of all three, in any order within a tick.
/// @param change  of a record: false leaves it out
template <typename Change>
void feed(VirtualImu& imu, int begin, int end, Rows& out, Change&& change) {
  for (int k = begin; k < end; ++k) {
    for (const std::size_t study : {2, 0, 1}) {
      auto record = row_of(study, k, Vector3d::Zero());
      if (change(study, k, record)) out.take(imu.add(record));
    }
  }
}

/// All that is said of this many samples.
template <typename Change>
Rows all_of(int samples, Change&& change) {
  const Configuration configuration = vehicle();
  VirtualImu imu(configuration);
  Rows out;
  feed(imu, 0, samples, out, change);
  out.end(imu);
  return out;
}

bool as_it_is(std::size_t, int, ErrorRecord&) { return true; }

constexpr double kThird = 1.0 / 3.0;

TEST(VirtualImu, IsTheWeightedMeanInTheReferencesAxesAtTheMotionsTime) {
  const std::array<Vector3d, 3> errors{Vector3d(1e-3, 2e-3, 3e-3), Vector3d(-4e-3, 5e-3, 6e-3),
                                       Vector3d(7e-3, 8e-3, -9e-3)};
  const Rows out = all_of(1000, [&](std::size_t study, int k, ErrorRecord& record) {
    record = row_of(study, k, errors[study]);
    return true;
  });
  ASSERT_GT(out.rows.size(), 990U);
  EXPECT_EQ(out.messages.front().imus, (std::vector<std::string>{"mtx2", "mtx1", "mtx3"}));
  EXPECT_LE(out.messages.back().missing, 2);  // the first and the last, of which one side is missing

  // By component: weights of mtx1, mtx2, mtx3.
  const Eigen::Matrix3d gyro{{0.25, 0.75, 0.0}, {kThird, kThird, kThird}, {0.4, 0.8, -0.2}};
  const Eigen::Matrix3d accel{{kThird, kThird, kThird}, {0.2, 0.1, 0.7}, {kThird, kThird, kThird}};
  for (const auto& row : out.rows) {
    const Vector3d omega = omega_b(row.time_s);
    Vector3d e_gyro = Vector3d::Zero();
    Vector3d e_accel = Vector3d::Zero();
    Vector3d f = Vector3d::Zero();
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      Vector3d place = Vector3d::Zero();
      for (Eigen::Index i = 0; i < 3; ++i) {
        const auto study = static_cast<std::size_t>(i);
        e_gyro[axis] += gyro(axis, i) * errors[study][axis];
        e_accel[axis] += accel(axis, i) * 10.0 * errors[study][axis];
        place += accel(axis, i) * sittings()[study].r_b_m;
      }
      f[axis] = f_at(place, row.time_s)[axis];
    }
    // Interpolation: an eighth of the second derivative times the interval's square.
    EXPECT_LT((Vector3d(row.omega_x_radps, row.omega_y_radps, row.omega_z_radps) - omega - e_gyro).norm(),
              1e-5);
    EXPECT_LT((Vector3d(row.f_x_mps2, row.f_y_mps2, row.f_z_mps2) - f - e_accel).norm(), 1e-4);
    EXPECT_LT((Vector3d(row.e_gyro_x_radps, row.e_gyro_y_radps, row.e_gyro_z_radps) - e_gyro).norm(), 1e-12);
    EXPECT_LT((Vector3d(row.e_accel_x_mps2, row.e_accel_y_mps2, row.e_accel_z_mps2) - e_accel).norm(), 1e-12);
  }
  Vector3d place_of_y = Vector3d::Zero();
  for (Eigen::Index i = 0; i < 3; ++i)
    place_of_y += accel(1, i) * sittings()[static_cast<std::size_t>(i)].r_b_m;
  for (Eigen::Index i = 0; i < 3; ++i)
    EXPECT_NEAR(out.messages.front().place_of_y_m[i], place_of_y[i], 1e-12);
}

TEST(VirtualImu, AMessageHoldsATenthOfASecondAndArrivesWhole) {
  const Rows out = all_of(300, as_it_is);
  for (const auto& message : out.messages) {
    EXPECT_LE(message.n_rows, 10);
    EXPECT_EQ(std::floor(10.0 * message.rows.front().time_s), std::floor(10.0 * message.rows.back().time_s));
    const auto received = decode_message<virtual_imu_t>(encode_message(message));
    ASSERT_TRUE(received);
    EXPECT_EQ(received->rows.size(), message.rows.size());
    EXPECT_EQ(received->rows.back().e_accel_z_mps2, message.rows.back().e_accel_z_mps2);
  }
}

TEST(VirtualImu, BridgesOneLostSampleButNoGap) {
  const Rows out = all_of(400, [](std::size_t study, int k, ErrorRecord&) {
    const bool lost = k == 100 || (k >= 200 && k < 205);
    return study != 0 || !lost;
  });
  // The gap of six intervals holds six instants of the first IMU.
  EXPECT_GE(out.messages.back().missing, 6);
  EXPECT_LE(out.messages.back().missing, 8);
  for (std::size_t i = 1; i < out.rows.size(); ++i) {
    const double interval_s = out.rows[i].time_s - out.rows[i - 1].time_s;
    if (std::abs(out.rows[i].time_s - 2.03) < 0.035) continue;
    EXPECT_NEAR(interval_s, 0.01, 1e-9) << out.rows[i].time_s;
  }
}

TEST(VirtualImu, IsSilentWhileAMemberIsAndGoesOnWithIt) {
  const Rows out =
      all_of(2000, [](std::size_t study, int k, ErrorRecord&) { return study != 2 || k < 500 || k >= 1500; });
  for (const auto& row : out.rows) EXPECT_FALSE(row.time_s > 5.01 && row.time_s < 14.99) << row.time_s;
  EXPECT_NEAR(static_cast<double>(out.rows.size()), 1000.0, 4.0);
  EXPECT_NEAR(out.rows.back().time_s, 19.98, 0.02);
}

TEST(VirtualImu, GoesOnAfterAClockThatBeginsAnew) {
  const Configuration configuration = vehicle();
  VirtualImu imu(configuration);
  Rows out;
  feed(imu, 1000, 1200, out, as_it_is);
  feed(imu, 0, 200, out, as_it_is);
  out.end(imu);
  EXPECT_NEAR(static_cast<double>(out.rows.size()), 400.0, 8.0);
}

TEST(VirtualImu, ATriadThatSaysNothingSpoilsOnlyWhereItHasWeight) {
  const Rows out = all_of(200, [](std::size_t study, int, ErrorRecord& record) {
    record.row.gyro_valid = study != 2;
    return true;
  });
  ASSERT_FALSE(out.rows.empty());
  for (const auto& row : out.rows) {
    EXPECT_TRUE(std::isfinite(row.omega_x_radps));
    EXPECT_TRUE(std::isnan(row.omega_y_radps));
    EXPECT_TRUE(std::isfinite(row.f_x_mps2));
  }
}

TEST(VirtualImu, IsAsUsableAsTheWorstOfItsMountings) {
  const Rows out = all_of(200, [](std::size_t study, int k, ErrorRecord& record) {
    if (study == 0 && k < 100) record.validity = Validity::kConverging;
    return true;
  });
  for (const auto& message : out.messages) {
    const bool early = message.rows.back().time_s < 0.99;
    if (early) {
      EXPECT_EQ(message.validity, virtual_imu_t::CONVERGING);
    }
    if (message.rows.front().time_s > 1.01) {
      EXPECT_EQ(message.validity, virtual_imu_t::USABLE);
    }
  }
}

TEST(VirtualImu, HasTheNoiseThatItsWeightsPromise) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  const Rows out = all_of(20000, [&](std::size_t study, int k, ErrorRecord& record) {
    Vector3d noise;
    for (double& value : noise) value = 1e-3 * normal(random);
    record = row_of(study, k, noise);
    return true;
  });
  // Means over a second hide what interpolation does to neighbours.
  constexpr std::size_t kMean = 100;
  double square = 0.0;
  std::size_t n = 0;
  for (std::size_t i = 0; i + kMean <= out.rows.size(); i += kMean, ++n) {
    double mean = 0.0;
    for (std::size_t j = 0; j < kMean; ++j) mean += out.rows[i + j].e_gyro_z_radps / kMean;
    square += mean * mean;
  }
  const double expected = 1e-6 / kMean * (0.4 * 0.4 + 0.8 * 0.8 + 0.2 * 0.2);
  const double of_mean = square / static_cast<double>(n) / expected;
  EXPECT_NEAR(of_mean, 1.0, 4.0 * std::sqrt(2.0 / static_cast<double>(n)));
}

}  // namespace
}  // namespace imuscope
