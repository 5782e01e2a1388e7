#include "estimation/calibration/smoother.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <Eigen/Dense>
#include <cmath>
#include <filesystem>
#include <random>
#include <string>

#include "tests/estimation/calibration/simulated_drive.h"
#include "tests/support/file_size_limit.h"
#include "tests/support/full_matrix.h"

namespace imuscope {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using test::SimulatedDrive;
using test::SimulatedStudy;

constexpr std::size_t kAmple_bytes = std::size_t{1} << 30U;

RecordStorage in_memory(std::size_t bytes = kAmple_bytes) { return {bytes, testing::TempDir()}; }

VectorXd normals(std::mt19937_64& random, Index n) {
  std::normal_distribution<double> normal;
  return VectorXd::NullaryExpr(n, [&] { return normal(random); });
}

/// A linear system in the filter's form (15 coupled states, a Gauss-Markov bias, a constant), run through the
/// filter, beside everything a batch solution needs.
class LinearSystem {
 public:
  static constexpr Index kStates = 15 + 3 + 1;
  static constexpr std::size_t kReset = 15;  ///< this state is set anew on the way
  static constexpr int kResetAt = 5;

  LinearSystem() : random_(7), core_(config()), truth_(kStates), mean_(VectorXd::Zero(kStates)) {
    core_.keep_history();
    for (Index i = 0; i < kStates; ++i) core_.reset_state(static_cast<std::size_t>(i), i < 15 ? 4.0 : 1.0);
    core_.restart_accumulation();
    state_covariance_ = MatrixXd::Zero(kStates, kStates);
    state_covariance_.diagonal().setConstant(1.0);
    state_covariance_.diagonal().head<15>().setConstant(4.0);
    truth_ = state_covariance_.cwiseSqrt() * normals(random_, kStates);
  }

  void run(int epochs, HistorySink& sink) {
    for (int k = 0; k < epochs; ++k) {
      if (k > 0) predict(k);
      measure();
      note();
      core_.study(0).gyro_bias_s_radps = mean_.segment<3>(15);
      core_.study(0).t_d_s = mean_(18);
      core_.navigation().v_n_mps = mean_.segment<3>(kVelocityError);
      core_.navigation().gyro_bias_b_radps = mean_.segment<3>(kGyroBiasError);
      core_.navigation().accel_bias_b_mps2 = mean_.segment<3>(kAccelBiasError);
      sink.on_history({host_time_from_ns(k), true, {true}, core_, core_.accumulated()});
      core_.restart_accumulation();
    }
  }

  /// Posterior of all states of all epochs given all measurements: conditioning of one joint normal
  /// distribution, with no recursion in it.
  void solve_batch(VectorXd& mean, MatrixXd& covariance) const {
    const MatrixXd C_zx = H_ * joint_;
    const MatrixXd C_zz = C_zx * H_.transpose() + MatrixXd(r_.asDiagonal());
    const MatrixXd gain = C_zz.ldlt().solve(C_zx).transpose();
    mean = gain * z_;
    covariance = joint_ - gain * C_zx;
  }

 private:
  static EstimatorConfig config() {
    EstimatorConfig config;
    config.studies.emplace_back();
    config.studies[0].blocks = kGyroBiasBlock | kTimeOffsetBlock;
    return config;
  }

  void predict(int k) {
    NavigationTransition step;
    step.kinematic_rows = NavigationDynamics::Identity();
    for (Index i = 0; i < 9; ++i) step.kinematic_rows.row(i) += 0.1 * normals(random_, 15).transpose();
    step.gyro_bias_decay = 0.9;
    step.accel_bias_decay = 0.95;
    const MatrixXd root = MatrixXd::NullaryExpr(15, 15, [this] { return 0.2 * normals(random_, 1)(0); });
    step.process_covariance = root * root.transpose();
    core_.predict_navigation(step);

    MatrixXd Phi = MatrixXd::Identity(kStates, kStates);
    Phi.topLeftCorner<15, 15>() = test::full_matrix(step);
    MatrixXd Q = MatrixXd::Zero(kStates, kStates);
    Q.topLeftCorner<15, 15>() = step.process_covariance;
    for (Index i = 15; i < 18; ++i) {
      core_.predict_state(static_cast<std::size_t>(i), 0.8, 0.3);
      Phi(i, i) = 0.8;
      Q(i, i) = 0.3;
    }
    if (k == kResetAt) {
      core_.reset_state(kReset, 2.0);
      Phi.row(kReset).setZero();
      Q.row(kReset).setZero();
      Q.col(kReset).setZero();
      Q(kReset, kReset) = 2.0;
    }
    truth_ = Phi * truth_ + MatrixXd(Q.llt().matrixL()) * normals(random_, kStates);
    Q_ = Q;
    mean_ = Phi * mean_;
    const Index n = joint_.rows();
    const MatrixXd last = joint_.bottomRows(kStates);
    joint_.conservativeResize(n + kStates, n + kStates);
    joint_.block(n, 0, kStates, n) = Phi * last;
    joint_.block(0, n, n, kStates) = (Phi * last).transpose();
    joint_.bottomRightCorner(kStates, kStates) = Phi * last.rightCols(kStates) * Phi.transpose() + Q;
  }

  void measure() {
    if (joint_.rows() == 0) joint_ = state_covariance_;
    SparseMeasurement H;
    MatrixXd row = MatrixXd::Zero(3, kStates);
    for (const std::size_t column : {3UL, 6UL, 9UL, 15UL, 18UL}) {
      MeasurementBlock& block = H.append(column, column == 18 ? 1 : 3);
      for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t j = 0; j < block.width; ++j) {
          block.h[i][j] = normals(random_, 1)(0);
          row(static_cast<Index>(i), static_cast<Index>(column + j)) = block.h[i][j];
        }
      }
    }
    const Vector3d r(0.5, 1.0, 2.0);
    std::array<double, 9> R{r(0), 0, 0, 0, r(1), 0, 0, 0, r(2)};
    const Vector3d z = row * truth_ + Vector3d(r.cwiseSqrt().cwiseProduct(normals(random_, 3)));
    core_.covariance().project(H, R);
    ASSERT_TRUE(core_.update(z - row * mean_, {true, true, true}));
    const std::span<const double> correction = core_.covariance().correction();
    mean_ += Eigen::Map<const VectorXd>(correction.data(), kStates);
    rows_.push_back(row);
    z_all_.push_back(z);
    r_all_.push_back(r);
  }

  void note() {
    H_ = MatrixXd::Zero(static_cast<Index>(3 * rows_.size()), joint_.rows());
    z_.resize(H_.rows());
    r_.resize(H_.rows());
    for (std::size_t k = 0; k < rows_.size(); ++k) {
      const auto i = static_cast<Index>(k);
      H_.block(3 * i, kStates * i, 3, kStates) = rows_[k];
      z_.segment<3>(3 * i) = z_all_[k];
      r_.segment<3>(3 * i) = r_all_[k];
    }
  }

  std::mt19937_64 random_;
  FilterCore core_;
  VectorXd truth_;
  VectorXd mean_;
  MatrixXd state_covariance_;
  MatrixXd Q_;
  MatrixXd joint_;  ///< covariance of the states of all epochs, before any measurement
  std::vector<MatrixXd> rows_;
  std::vector<Vector3d> z_all_;
  std::vector<Vector3d> r_all_;
  MatrixXd H_;
  VectorXd z_;
  VectorXd r_;
};

TEST(Smoother, EqualsABatchLeastSquaresSolutionOfALinearSystemWhereAStateIsSetAnew) {
  constexpr int kEpochs = 12;
  LinearSystem system;
  Smoother smoother(in_memory());
  system.run(kEpochs, smoother);
  const auto track = smoother.smooth();
  ASSERT_TRUE(track) << track.error().text();
  ASSERT_EQ(track->size(), static_cast<std::size_t>(kEpochs));
  VectorXd mean;
  MatrixXd covariance;
  system.solve_batch(mean, covariance);
  for (int k = 0; k < kEpochs; ++k) {
    const auto smoothed = track->at(static_cast<std::size_t>(k));
    ASSERT_TRUE(smoothed);
    const VectorXd batch = mean.segment<LinearSystem::kStates>(LinearSystem::kStates * k);
    const auto& nav = smoothed->navigation;
    const auto& study = smoothed->studies[0];
    EXPECT_LT((nav.v_n_mps - batch.segment<3>(kVelocityError)).norm(), 1e-9) << "epoch " << k;
    EXPECT_LT((nav.gyro_bias_b_radps - batch.segment<3>(kGyroBiasError)).norm(), 1e-9) << "epoch " << k;
    EXPECT_LT((nav.accel_bias_b_mps2 - batch.segment<3>(kAccelBiasError)).norm(), 1e-9) << "epoch " << k;
    EXPECT_LT((study.gyro_bias_s_radps - batch.segment<3>(15)).norm(), 1e-9) << "epoch " << k;
    EXPECT_NEAR(study.t_d_s, batch(18), 1e-9) << "epoch " << k;
    for (Index i = 0; i < LinearSystem::kStates; ++i) {
      const Index at = LinearSystem::kStates * k + i;
      EXPECT_NEAR(smoothed->sd(i), std::sqrt(covariance(at, at)), 1e-9) << "epoch " << k << ", state " << i;
    }
  }
}

/// Textbook smoothing of the whole error state at every R epoch, in long double, nothing spared.
class DenseSmoother final : public HistorySink {
 public:
  using Real = long double;
  using Matrix = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;
  using Vector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;
  struct Epoch {
    HostTime time;
    NavigationState navigation;
    SImuState study;
    Matrix P;
    Matrix Phi;
    Matrix Q;
    Vector injected;
    Vector d;
  };

  [[nodiscard]] Duration interval() const noexcept override { return Duration{0}; }
  void on_history(const HistoryEpoch& epoch) noexcept override {
    const auto n = static_cast<Index>(epoch.core.covariance().dimension());
    Epoch e{epoch.time,         epoch.core.navigation(), epoch.core.study(0), Matrix(n, n),
            Matrix::Zero(n, n), Matrix::Zero(n, n),      Vector(n),           Vector::Zero(n)};
    for (Index i = 0; i < n; ++i) {
      for (Index j = 0; j < n; ++j)
        e.P(i, j) = epoch.core.covariance()(static_cast<std::size_t>(i), static_cast<std::size_t>(j));
      e.injected(i) = epoch.since.injected[static_cast<std::size_t>(i)];
    }
    e.Phi.topLeftCorner(15, 15) = epoch.since.transition.cast<Real>();
    e.Q.topLeftCorner(15, 15) = epoch.since.noise.cast<Real>();
    for (Index i = 15; i < n; ++i) {
      e.Phi(i, i) = epoch.since.decay[static_cast<std::size_t>(i - 15)];
      e.Q(i, i) = epoch.since.decay_noise[static_cast<std::size_t>(i - 15)];
    }
    epochs.push_back(std::move(e));
  }
  void smooth() {
    for (std::size_t k = epochs.size() - 1; k-- > 0;) {
      Epoch& now = epochs[k];
      const Epoch& after = epochs[k + 1];
      const Matrix predicted = after.Phi * now.P * after.Phi.transpose() + after.Q;
      const Vector scale = predicted.diagonal().cwiseSqrt().cwiseInverse();
      const Matrix scaled = scale.asDiagonal() * predicted * scale.asDiagonal();
      const Matrix right = scale.asDiagonal() * (after.Phi * now.P);
      const Matrix A = (scale.asDiagonal() * scaled.ldlt().solve(right)).transpose();
      now.d = A * (after.d + after.injected);
      now.P += A * (after.P - predicted) * A.transpose();
    }
  }
  std::vector<Epoch> epochs;
};

/// A drive with a mounting, lever arm and time offset that the filter knows as well as its priors say.
EstimatorConfig known_roughly(const SimulatedDrive& drive, const SimulatedStudy& truth,
                              std::mt19937_64& random) {
  EstimatorConfig config = drive.config();
  auto& rpy = *config.navigation.initial_rpy_rad;
  const VectorXd attitude = normals(random, 3);
  for (std::size_t i = 0; i < 3; ++i)
    rpy[i] += config.navigation.initial_rpy_sd_rad[i] * attitude(static_cast<Index>(i));
  for (SImuConfig& study : config.studies) {
    study.prior_C_b_s = to_array(truth.C_b_s);
    study.prior_t_d_s = truth.t_d_s;
    study.prior_r_bs_b_m = to_array(truth.r_bs_b_m);
  }
  return config;
}

TEST(Smoother, FiveEpochsASecondEqualTextbookSmoothingOfTheWholeStateAtEveryEpoch) {
  const SimulatedStudy truth{Eigen::Matrix3d::Identity(), {0.35, -0.22, 0.12}, 0.004};
  DenseSmoother dense;
  Smoother sparse(in_memory());
  for (HistorySink* sink : {static_cast<HistorySink*>(&dense), static_cast<HistorySink*>(&sparse)}) {
    std::mt19937_64 random(3);
    SimulatedDrive drive(70.0, {truth}, 22);
    Estimator estimator(known_roughly(drive, truth, random), sink);
    test::run(drive, estimator);
  }
  const auto track = sparse.smooth();
  ASSERT_TRUE(track);
  ASSERT_GT(track->size(), 340U);
  // Both end at the same epoch: neither knows of measurements that the other has not seen.
  const HostTime end = track->at(track->size() - 1)->time;
  while (dense.epochs.back().time > end) dense.epochs.pop_back();
  dense.smooth();
  std::size_t at = 0;
  for (std::size_t k = 1; k < track->size(); ++k) {
    const auto smoothed = track->at(k);
    ASSERT_TRUE(smoothed);
    while (dense.epochs[at].time < smoothed->time) ++at;
    ASSERT_EQ(dense.epochs[at].time, smoothed->time);
    const DenseSmoother::Epoch& exact = dense.epochs[at];
    NavigationState navigation = exact.navigation;
    SImuState study = exact.study;
    const VectorXd d = exact.d.cast<double>();
    inject(navigation, NavigationErrorVector(d.head<15>()));
    inject(study, track->layout(0), {d.data(), static_cast<std::size_t>(d.size())});
    VectorXd difference(15 + 6);
    difference.head<15>() = error_between(navigation, smoothed->navigation);
    difference.segment<3>(15) = study.gyro_bias_s_radps - smoothed->studies[0].gyro_bias_s_radps;
    difference.segment<3>(18) = study.accel_bias_s_mps2 - smoothed->studies[0].accel_bias_s_mps2;
    const SImuLayout& layout = track->layout(0);
    for (Index i = 0; i < difference.size(); ++i) {
      const std::size_t state = i < 15   ? static_cast<std::size_t>(i)
                                : i < 18 ? layout.gyro_bias + static_cast<std::size_t>(i - 15)
                                         : layout.accel_bias + static_cast<std::size_t>(i - 18);
      const auto s = static_cast<Index>(state);
      const double sd = std::sqrt(static_cast<double>(exact.P(s, s)));
      // Measurements inside 0.2 s are taken to stand at its end: process noise of 0.2 s against the sd, at
      // most a seventh for the gyro bias, makes them move by less than a tenth of it.
      EXPECT_LT(std::abs(difference(i)), 0.1 * sd) << "state " << state << " at epoch " << k;
      EXPECT_NEAR(smoothed->sd(s) / sd, 1.0, 0.02) << "state " << state << " at epoch " << k;
    }
  }
}

/// What the filter itself said at the epochs of the history.
class Recorder final : public HistorySink {
 public:
  void on_history(const HistoryEpoch& epoch) noexcept override {
    smoother.on_history(epoch);
    velocity.push_back(epoch.core.navigation().v_n_mps);
    VectorXd sd(static_cast<Index>(epoch.core.covariance().dimension()));
    for (Index i = 0; i < sd.size(); ++i) sd(i) = epoch.core.sd(static_cast<std::size_t>(i));
    filtered_sd.push_back(sd);
  }
  Smoother smoother{in_memory()};
  std::vector<Vector3d> velocity;
  std::vector<VectorXd> filtered_sd;
};

NavigationState truth_at(const SimulatedDrive& drive, HostTime time) {
  const imusim::MotionState motion = drive.motion().state_at(static_cast<double>(to_ns(time)) * 1e-9 - 10.0);
  NavigationState state;
  state.position = {motion.position.latitude_rad, motion.position.longitude_rad, motion.position.height_m};
  state.v_n_mps = motion.v_n_mps;
  state.C_b_n = motion.C_b_n;
  return state;
}

TEST(Smoother, ImprovesOnTheFilterNeverClaimsLessAndItsSdIsHonest) {
  const SimulatedStudy truth{Eigen::Matrix3d::Identity(), {0.35, -0.22, 0.12}, 0.004};
  double filter_square = 0.0;
  double smoothed_square = 0.0;
  double normalised = 0.0;
  double n = 0.0;
  constexpr int kDrives = 6;
  for (int seed = 0; seed < kDrives; ++seed) {
    std::mt19937_64 random(static_cast<std::uint64_t>(seed));
    SimulatedDrive drive(100.0, {truth}, 40 + static_cast<std::uint64_t>(seed));
    Recorder recorder;
    Estimator estimator(known_roughly(drive, truth, random), &recorder);
    test::run(drive, estimator);
    const auto track = recorder.smoother.smooth();
    ASSERT_TRUE(track);
    ASSERT_EQ(track->size(), recorder.velocity.size());
    for (std::size_t k = 10; k + 10 < track->size(); ++k) {
      const auto smoothed = track->at(k);
      ASSERT_TRUE(smoothed);
      for (Index i = 0; i < smoothed->sd.size(); ++i)
        ASSERT_LE(smoothed->sd(i), recorder.filtered_sd[k](i) * (1.0 + 1e-6)) << "state " << i;
      const NavigationErrorVector error =
          error_between(truth_at(drive, smoothed->time), smoothed->navigation);
      filter_square += (recorder.velocity[k] - truth_at(drive, smoothed->time).v_n_mps).squaredNorm();
      smoothed_square += error.segment<3>(kVelocityError).squaredNorm();
      for (Index i = 0; i < 9; ++i) normalised += std::pow(error(i) / smoothed->sd(i), 2) / 9.0;
      n += 1.0;
    }
    // The end has no future to learn from.
    EXPECT_LT((track->at(track->size() - 1)->navigation.v_n_mps - recorder.velocity.back()).norm(), 1e-12);
  }
  EXPECT_LT(smoothed_square, 0.5 * filter_square);
  // Smoothed errors stay correlated over tens of seconds. Six drives, nine components: about fifty
  // independent squares, whose mean scatters by 0.2.
  EXPECT_NEAR(normalised / n, 1.0, 0.6);
}

TEST(Smoother, GivesTheSameWithAndWithoutAThreadAhead) {
  const SimulatedStudy truth{Eigen::Matrix3d::Identity(), {0.35, -0.22, 0.12}, 0.004};
  std::mt19937_64 random(1);
  SimulatedDrive drive(70.0, {truth}, 5);
  Smoother smoother(in_memory());
  Estimator estimator(known_roughly(drive, truth, random), &smoother);
  test::run(drive, estimator);
  const auto alone = smoother.smooth();
  const auto ahead = smoother.smooth(true);
  ASSERT_TRUE(alone && ahead);
  ASSERT_EQ(alone->size(), smoother.size());
  ASSERT_EQ(ahead->size(), alone->size());
  for (std::size_t k = 0; k < alone->size(); ++k) {
    ASSERT_EQ(ahead->at(k)->time, alone->at(k)->time);
    ASSERT_EQ(ahead->at(k)->sd, alone->at(k)->sd);
    ASSERT_EQ(ahead->at(k)->navigation.v_n_mps, alone->at(k)->navigation.v_n_mps);
  }
}

/// Cuts the files that this program has opened and that have no name any more.
void cut_nameless_files() {
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
    std::error_code gone;
    const auto target = std::filesystem::read_symlink(entry.path(), gone).string();
    if (!target.ends_with(" (deleted)")) continue;
    ASSERT_EQ(ftruncate(std::stoi(entry.path().filename()), 0), 0) << target;
  }
}

TEST(Smoother, TellsWhatTheDiskRefusesOnTheWayBackWithAndWithoutAThreadAhead) {
  const SimulatedStudy truth{Eigen::Matrix3d::Identity(), {0.35, -0.22, 0.12}, 0.004};
  std::mt19937_64 random(1);
  SimulatedDrive drive(70.0, {truth}, 5);
  Smoother smoother(in_memory(20'000));
  Estimator estimator(known_roughly(drive, truth, random), &smoother);
  test::run(drive, estimator);
  ASSERT_GT(smoother.file_bytes(), 0U);
  for (const bool ahead : {false, true}) {
    const test::FileSizeLimit limit(1000);
    const auto track = smoother.smooth(ahead);
    ASSERT_FALSE(track);
    EXPECT_THAT(track.error().text(), testing::HasSubstr("cannot be written"));
  }
  ASSERT_TRUE(smoother.smooth(true));
  cut_nameless_files();
  for (const bool ahead : {false, true}) {
    const auto track = smoother.smooth(ahead);
    ASSERT_FALSE(track);
    EXPECT_THAT(track.error().text(), testing::HasSubstr("cannot be read"));
  }
}

TEST(Smoother, GivesTheSameFromDiskAsFromMemoryAndKeepsToItsBound) {
  const SimulatedStudy truth{Eigen::Matrix3d::Identity(), {0.35, -0.22, 0.12}, 0.004};
  constexpr std::size_t kTight_bytes = 300'000;
  Smoother ample(in_memory());
  Smoother tight(in_memory(kTight_bytes));
  for (Smoother* smoother : {&ample, &tight}) {
    std::mt19937_64 random(1);
    SimulatedDrive drive(70.0, {truth}, 5);
    Estimator estimator(known_roughly(drive, truth, random), smoother);
    test::run(drive, estimator);
  }
  EXPECT_EQ(ample.file_bytes(), 0U);
  EXPECT_GT(tight.file_bytes(), tight.memory_bytes());
  const auto a = ample.smooth();
  const auto b = tight.smooth();
  ASSERT_TRUE(a);
  ASSERT_TRUE(b) << b.error().text();
  ASSERT_EQ(a->size(), b->size());
  EXPECT_LE(tight.memory_bytes() + b->memory_bytes(), kTight_bytes);
  for (std::size_t k = 0; k < a->size(); ++k) {
    const auto x = a->at(k);
    const auto y = b->at(k);
    ASSERT_TRUE(x && y);
    ASSERT_EQ(x->time, y->time);
    ASSERT_EQ(x->sd, y->sd);
    ASSERT_EQ(x->navigation.v_n_mps, y->navigation.v_n_mps);
    ASSERT_EQ(x->studies[0].accel_bias_s_mps2, y->studies[0].accel_bias_s_mps2);
  }
}

TEST(Smoother, FifteenMinutesOfThreeStudiesStayBelowSixtyFourMegabytes) {
  EstimatorConfig config;
  config.studies.resize(3);
  FilterCore core(config);
  core.keep_history();
  Smoother smoother({Smoother::kMemory_bytes, testing::TempDir()});
  for (int k = 0; k < 5 * 900; ++k) {
    for (std::size_t i = 0; i < core.covariance().dimension(); ++i) core.predict_state(i, 0.999, 1e-9);
    smoother.on_history({host_time_from_ns(k), false, {}, core, core.accumulated()});
    core.restart_accumulation();
  }
  EXPECT_EQ(smoother.size(), 4500U);
  EXPECT_GT(smoother.file_bytes(), 0U);
  EXPECT_LE(smoother.memory_bytes() + Smoother::kMemory_bytes / 8, std::size_t{64} * 1'000'000U);
}

TEST(Smoother, SaysWhichFolderCouldNotTakeItsHistory) {
  EstimatorConfig config;
  config.studies.resize(1);
  FilterCore core(config);
  core.keep_history();
  Smoother smoother({0, "/dev/null/folder"});
  smoother.on_history({host_time_from_ns(0), false, {}, core, core.accumulated()});
  const auto track = smoother.smooth();
  ASSERT_FALSE(track);
  EXPECT_NE(track.error().text().find("/dev/null/folder"), std::string::npos);
  EXPECT_FALSE(track.error().remedy.empty());
}

TEST(Smoother, WithoutAnyEpochGivesAnEmptyTrack) {
  const auto track = Smoother(in_memory()).smooth();
  ASSERT_TRUE(track);
  EXPECT_EQ(track->size(), 0U);
}

}  // namespace
}  // namespace imuscope
