#include "estimation/batch/batch_mounting.h"

#include <fmt/format.h>
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "estimation/batch/checks.h"
#include "estimation/batch/grid.h"
#include "estimation/batch/normal_equations.h"
#include "estimation/batch/prior_scales.h"
#include "estimation/batch/quietest_rates.h"
#include "estimation/navigation/so3.h"

namespace imuscope::batch {

namespace {

using Covariance = Eigen::Matrix<double, kParameters, kParameters>;

/// A band's first sd of deviation, before it is learned.
constexpr double kFirstDeviation = 0.01;
constexpr double kLeastDeviation = 1e-5;
/// Of a band that deviates by as much the S-IMU tells nothing; more would be the reference's noise.
constexpr double kMostDeviation = 0.3;
/// Rounds of learning the deviations' sizes in each step.
constexpr int kLearningRounds = 10;
/// Deviations that a drive must tell at least, for their size to be learned from it.
constexpr double kLeastTold = 1e-3;
/// Bands to either side that a band's sd of deviation is learned with: nine elements alone tell it too badly,
/// and a band that came out quiet by chance would rule all others.
constexpr Eigen::Index kNeighbours = 2;
/// A delay does not change by this, half a sample of 100 Hz; a clock that jumps does.
constexpr double kJumpMin_s = 0.005;
/// Two quartzes differ by less than so many sd.
constexpr double kQuartzSds = 5.0;
constexpr int kMostIterations = 25;
/// Rounds before noise and scales have come near enough for the finer corrections.
constexpr int kRoughIterations = 2;
/// A step of less than this share of the sd changes nothing that is published.
constexpr double kSettledShare = 0.1;
/// Steps that are so alike (cosine) and as large as this share of the one before creep.
constexpr double kAlike = 0.8;
constexpr double kCreeping = 0.7;
/// B-14a: bounds of what a step is multiplied by.
constexpr double kFastestPace = 4.0;
constexpr double kSlowestPace = 0.25;
/// After the last step one of more than this is no approach to anything.
constexpr double kLostShare = 1.0;
/// Data sheets have a per cent, cheap parts three; known to so many sd.
constexpr double kNoSensorsScale = 0.2;
constexpr double kSureSds = 5.0;
/// Share of the information that the noise in the derivatives may be.
constexpr double kMostNoise = 0.9;
/// Windows overlap by half, so that neighbours share information: so many of them are one that stands alone.
constexpr double kWindowsPerIndependent = 1.5;
/// Weight, in windows, of the covariance that the noise gives against that of the scatter over time.
constexpr double kNoiseWeight = 20.0;

/// Mean over the instants that count.
Eigen::RowVectorXd mean_of(const Eigen::Ref<const Eigen::MatrixXd>& series, const std::vector<char>& valid) {
  Eigen::RowVectorXd sum = Eigen::RowVectorXd::Zero(series.cols());
  double n = 0.0;
  for (Eigen::Index i = 0; i < series.rows(); ++i) {
    if (valid[static_cast<std::size_t>(i)] == 0) continue;
    sum += series.row(i);
    n += 1.0;
  }
  return n > 0.0 ? Eigen::RowVectorXd(sum / n) : sum;
}

Eigen::MatrixXd reference_series(const Grid& grid, const Eigen::RowVectorXd& mean) {
  Eigen::MatrixXd series(grid.motion.rows(), kReferenceColumns);
  series.leftCols<6>() = grid.motion.rowwise() - mean;
  series.middleCols<3>(kOmegaDot) = grid.omega_dot;
  for (Eigen::Index i = 0; i < series.rows(); ++i)
    series.row(i).segment<6>(kProducts) = products_of(grid.motion.row(i).head<3>());
  series.middleCols<6>(kShakes) = grid.products - series.middleCols<6>(kProducts);
  for (Eigen::Index i = 0; i < 9; ++i) {
    auto column = series.col(kForceProducts + i);
    column = grid.motion.col(3 + i / 3).cwiseProduct(series.col(kForce + i % 3));
    column.array() -= mean_of(column, grid.valid)[0];
  }
  return series;
}

/// What the reference's gyros show in the mean, by band.
void set_gyro_moment(Problem& problem) {
  const auto n_windows = static_cast<Eigen::Index>(problem.plan.starts.size());
  problem.gyro_moment.assign(static_cast<std::size_t>(problem.bands.size()), Eigen::Matrix3d::Zero());
  for (Eigen::Index band = 0; band < problem.bands.size(); ++band) {
    const double values = static_cast<double>(problem.bands.width(band) * n_windows) / kWindowsPerInstant;
    for (Eigen::Index w = 0; w < n_windows; ++w)
      for (Eigen::Index k = problem.bands.first(band); k < problem.bands.end(band); ++k) {
        const Vector3c omega = problem.reference.row(w, k).segment<3>(kOmega).transpose();
        problem.gyro_moment[static_cast<std::size_t>(band)] += (omega * omega.adjoint()).real() / values;
      }
  }
}

/// The estimate of one pair of records.
class Batch {
 public:
  Batch(const ImuRecord& reference, const ImuRecord& study, const BatchOptions& options)
      : reference_(reference),
        study_(study),
        class_(options.sensor),
        reference_gyro_white_radps_per_sqrt_hz_(options.reference_gyro_white_radps_per_sqrt_hz),
        scales_(options.sensor) {}

  Result<BatchMounting> run(const Start& start) {
    if (auto set = set_up(start); !set) return tl::unexpected<Error>(set.error());
    BatchMounting result;
    result.rate_correlation = start.rate_correlation;
    for (int i = 0; i < kMostIterations && !result.settled; ++i) {
      result.iterations = i + 1;
      result.settled = step(i);
    }
    finish(result);
    // A clock that jumps makes an estimate run away, too, and is the better thing to be told.
    if (auto ok = one_clock(result); !ok) return tl::unexpected(ok.error());
    if (auto ok = one_mounting(result); !ok) return tl::unexpected(ok.error());
    if (auto ok = same_sizes(result); !ok) return tl::unexpected(ok.error());
    return result;
  }

 private:
  Result<void> set_up(const Start& start) {
    instants_ = common_instants(reference_, study_, start.time_offset_s, kGridRate_hz);
    middle_s_ = 0.5 * (instants_.front() + instants_.back());
    const Grid grid = make_grid(reference_, instants_, true);
    estimate_.sensor.C_b_s = start.C_b_s;
    estimate_.sensor.x[kTimeOffset] = start.time_offset_s;
    Grid study = study_grid();
    std::vector<char> valid = grid.valid;
    for (std::size_t i = 0; i < valid.size(); ++i)
      valid[i] = static_cast<char>(valid[i] != 0 && study.valid[i] != 0);
    problem_.plan = plan_windows(valid, kGridRate_hz, kTop_hz);
    if (problem_.plan.starts.empty())
      return work_error("no stretch of it is free of gaps for five seconds",
                        "look at its counter and its line");
    problem_.bands = Bands(problem_.plan.n_frequencies);
    problem_.constant = window_spectrum(problem_.plan);
    reference_mean_ = mean_of(grid.motion, grid.valid);
    study_mean_ = mean_of(study.motion, study.valid);
    problem_.reference = Spectra(problem_.plan, reference_series(grid, reference_mean_));
    set_gyro_moment(problem_);
    class_.reference = reference_grade(reference_gyro_white_radps_per_sqrt_hz_.value_or(
        quietest_gyro_white_radps_per_sqrt_hz(grid.motion.leftCols<3>(), grid.valid)));
    const auto n = static_cast<Eigen::Index>(problem_.plan.starts.size());
    problem_.from_middle_s.resize(n);
    for (Eigen::Index w = 0; w < n; ++w) {
      const Eigen::Index middle =
          problem_.plan.starts[static_cast<std::size_t>(w)] + problem_.plan.length / 2;
      problem_.from_middle_s[w] = instants_[static_cast<std::size_t>(middle)] - middle_s_;
    }
    estimate_.deviation.assign(static_cast<std::size_t>(problem_.bands.size()), DeviationVector::Zero());
    estimate_.deviation_sd.setConstant(problem_.bands.size(), 2, kFirstDeviation);
    taken_.setZero(problem_.bands.size(), 2);
    return {};
  }

  /// The S-IMU at the instants of the grid, by the clock as it is known now.
  [[nodiscard]] Grid study_grid() const {
    std::vector<double> own(instants_.size());
    for (std::size_t i = 0; i < own.size(); ++i)
      own[i] = instants_[i] - estimate_.sensor.time_offset_s(instants_[i] - middle_s_);
    return make_grid(study_, own, false);
  }

  [[nodiscard]] Spectra study_spectra() const {
    const Grid grid = study_grid();
    return {problem_.plan, Eigen::MatrixXd(grid.motion.rowwise() - study_mean_)};
  }

  /// One Gauss-Newton step and one round of learning. True where nothing moves any more.
  bool step(int round) {
    const bool rough = round < kRoughIterations;
    const Spectra study = study_spectra();
    const Residuals residual = residuals(problem_, study, estimate_);
    noise_ = NoiseBands(problem_.bands, static_cast<Eigen::Index>(problem_.plan.starts.size()),
                        problem_.plan.n_frequencies, residual, taken_);
    const ReferenceNoise reference =
        rough ? ReferenceNoise::even(problem_.bands, 0.0) : reference_noise(study);
    sums_ = band_sums(problem_, study, residual, estimate_, noise_, reference, !rough);
    ParameterVector correction;
    std::vector<DeviationVector> deviation;
    for (int inner = 0; inner < (rough ? 1 : kLearningRounds); ++inner) {
      correction = solve(sums_, deviation);
      if (!rough) learn(deviation);
    }
    const ParameterVector sds = covariance_.diagonal().cwiseSqrt();
    if (!rough) set_pace(correction.cwiseQuotient(sds));
    // Where the step leads, whatever the pace: what is learned of sizes and places is true there.
    SensorState led_to = estimate_.sensor;
    led_to.add(correction);
    estimate_.sensor.add(pace_ * correction);
    for (std::size_t band = 0; band < deviation.size(); ++band)
      estimate_.deviation[band] += std::min(1.0, pace_) * (deviation[band] - estimate_.deviation[band]);
    for (std::size_t band = 0; band < sums_.size(); ++band)
      taken_.row(static_cast<Eigen::Index>(band)) =
          numbers_taken(sums_[band], equations_.bands[band], covariance_).transpose();
    if (!rough) {
      scales_.learn_sizes(led_to.x, covariance_);
      scales_.choose_places(led_to.x, honest_covariance().per_slope);
    }
    last_share_ = correction.cwiseAbs().cwiseQuotient(sds).head<kGyroBias>().maxCoeff();
    return !rough && last_share_ < kSettledShare;
  }

  /// B-14a: weights that are learned let steps creep, one as large as the other, or go to and fro.
  /// @param step  in sd
  void set_pace(const ParameterVector& step) {
    const auto now = step.head<kGyroBias>();
    const auto before = last_step_.head<kGyroBias>();
    const double along = now.dot(before);
    const double size = now.norm() * before.norm();
    if (along < 0.0) {
      pace_ = std::max(0.5 * pace_, kSlowestPace);
    } else if (along > kAlike * size && now.norm() > kCreeping * before.norm()) {
      pace_ = std::min(2.0 * pace_, kFastestPace);
    }
    last_step_ = step;
  }

  [[nodiscard]] ReferenceNoise reference_noise(const Spectra& study) const {
    Estimate rigid = estimate_;
    std::ranges::fill(rigid.deviation, DeviationVector::Zero());
    return {problem_.plan, problem_.bands, problem_.reference, residuals(problem_, study, rigid),
            rigid.sensor,  noise_};
  }

  /// A clock that jumps makes a lever arm of its own: no sd is wide enough for that. Much of a jump is taken
  /// for a clock rate.
  [[nodiscard]] Result<void> one_clock(const BatchMounting& result) const {
    constexpr const char* kRemedy = "cut the recording there, or look at its line and its time column";
    // t_d falls where the clock jumps forward.
    const double jump_s = -result.change.difference[kTimeOffset];
    const double rate = -result.sensor.x[kClockRate];
    if (result.change.is_told() && std::abs(jump_s) > kJumpMin_s) {
      return usage_error(fmt::format("its clock jumps by {:.3f} s or more after {:.0f} s of the recording",
                                     jump_s, result.change_s - instants_.front()),
                         kRemedy);
    }
    if (std::abs(rate) < kQuartzSds * class_.clock_rate_sd) return {};
    return usage_error(
        fmt::format("against the reference's its clock gains {:.0f} millionths, which no quartz "
                    "does: it jumps, about {:.0f} s into the recording",
                    1e6 * rate, result.change_s - instants_.front()),
        kRemedy);
  }

  /// Nothing that settles fits two mountings that differ by much.
  [[nodiscard]] Result<void> one_mounting(const BatchMounting& result) const {
    if (last_share_ <= kLostShare) return {};
    if (!result.change.is_told()) {
      return work_error(
          "its estimate runs away",
          "the drive tells too little: more turns, braking and accelerating, and a minute of rest; or its mounting "
          "changes: study each half of the recording by itself");
    }
    // By how much, an estimate that fits neither part does not tell well.
    return work_error(
        fmt::format("about {:.0f} s into the recording its mounting changes, and no estimate fits both parts",
                    result.change_s - instants_.front()),
        "cut the recording there and study each part, and check that it sits firmly");
  }

  /// One axis of one triad that is in another unit than the others, or cut off, or no axis of that sensor.
  [[nodiscard]] static Result<void> same_sizes(const BatchMounting& result) {
    constexpr std::array kTriads{std::pair{kGyroShape, "gyroscope"}, std::pair{kAccelShape, "accelerometer"}};
    for (const auto& [first, what] : kTriads) {
      Eigen::Index axis = 0;
      const double scale = result.sensor.x.segment<3>(first).cwiseAbs().maxCoeff(&axis);
      if (scale < kNoSensorsScale || scale < kSureSds * result.sd(first, axis)) continue;
      return usage_error(
          fmt::format("its {} {} shows {:.2f} times what the reference shows along it, as no sensor does",
                      what, "xyz"[axis], 1.0 + result.sensor.x[first + axis]),
          "look at that column, its unit and its range, and at the reference's");
    }
    return {};
  }

  /// The correction of the parameters and the deviations that go with it, with the sizes as they are known.
  ParameterVector solve(const std::vector<BandSums>& sums, std::vector<DeviationVector>& deviation) {
    equations_ = normal_equations(sums, estimate_);
    const ParameterVector precision = scales_.precision();
    Covariance information = equations_.information;
    information.diagonal() += precision;
    const ParameterVector gradient = equations_.gradient - precision.cwiseProduct(estimate_.sensor.x);
    const Eigen::LLT<Covariance> factor(information);
    covariance_ = factor.solve(Covariance::Identity());
    ParameterVector correction = factor.solve(gradient);
    deviation = estimate_.deviation;
    for (std::size_t band = 1; band < deviation.size(); ++band) {
      const auto& own = equations_.bands[band];
      deviation[band] += own.own - own.coupling.transpose() * correction;
    }
    return correction;
  }

  /// B-15: what a band's deviations add up to, over how many of them the drive tells.
  void learn(const std::vector<DeviationVector>& deviation) {
    const Eigen::Index n = problem_.bands.size();
    Eigen::MatrixX2d square = Eigen::MatrixX2d::Zero(n, 2);
    Eigen::MatrixX2d told = Eigen::MatrixX2d::Zero(n, 2);
    for (Eigen::Index band = 1; band < n; ++band) {
      const auto& own = equations_.bands[static_cast<std::size_t>(band)];
      const DeviationVector variance =
          own.covariance.diagonal() + (own.coupling.transpose() * covariance_ * own.coupling).diagonal();
      const DeviationVector& d = deviation[static_cast<std::size_t>(band)];
      for (Eigen::Index triad = 0; triad < 2; ++triad) {
        const double prior = std::pow(estimate_.deviation_sd(band, triad), 2);
        square(band, triad) = d.segment<9>(9 * triad).squaredNorm();
        told(band, triad) = (1.0 - variance.segment<9>(9 * triad).array() / prior).max(0.0).sum();
      }
    }
    for (Eigen::Index band = 1; band < n; ++band) {
      const Eigen::Index first = std::max<Eigen::Index>(1, band - kNeighbours);
      const Eigen::Index count = std::min(n - 1, band + kNeighbours) - first + 1;
      for (Eigen::Index triad = 0; triad < 2; ++triad) {
        const double of_all = told.col(triad).segment(first, count).sum();
        const double sum = square.col(triad).segment(first, count).sum();
        estimate_.deviation_sd(band, triad) =
            std::clamp(std::sqrt(sum / std::max(of_all, kLeastTold)), kLeastDeviation, kMostDeviation);
      }
    }
  }

  /// B-13: what the noise makes of the estimate.
  struct OfNoise {
    Covariance per_slope;  ///< inverse of the information: what a score moves
    Covariance covariance;
  };
  /// Information without what the reference's noise only seems to add. Where that is nearly all of it, the
  /// difference of the two is no number to rely on: at most kMostNoise of it goes.
  [[nodiscard]] OfNoise honest_covariance() const {
    Covariance information = equations_.information;
    information.diagonal() += scales_.precision();
    const Eigen::GeneralizedSelfAdjointEigenSolver<Covariance> shares(equations_.of_noise, information);
    // With V' information V = I: information - noise = V^-T (I - shares) V^-1.
    // What shows of the noise scatters about nothing where there is none.
    const ParameterVector left = (ParameterVector::Ones() - shares.eigenvalues().cwiseMax(0.0))
                                     .cwiseMax(1.0 - kMostNoise)
                                     .cwiseInverse();
    const Covariance& V = shares.eigenvectors();
    // The noise in the derivatives is no information, yet the score has its variance.
    return {V * left.asDiagonal() * V.transpose(), V * left.cwiseAbs2().asDiagonal() * V.transpose()};
  }

  /// B-19: covariance by the scatter of the windows' scores over time.
  [[nodiscard]] Covariance scatter_covariance(const Covariance& covariance) const {
    Covariance sum = variance_of_sum(equations_.window_scores, kLags);
    sum.diagonal() += scales_.precision();
    return covariance * sum * covariance;
  }

  /// B-23: what the priors of all that lasts from drive to drive leave in (psi, r). Biases and clocks are
  /// another drive's no more.
  [[nodiscard]] Eigen::Matrix<double, 6, kParameters> of_lasting_priors(const Covariance& covariance) const {
    ParameterVector root = scales_.precision().cwiseSqrt();
    root.segment<kGyroShape - kClockRate>(kClockRate).setZero();
    root.segment<3>(kShaking).setZero();
    return covariance.topRows<6>() * root.asDiagonal();
  }

  /// B-22: what would go if the sensor's imperfections were known is theirs.
  [[nodiscard]] static LimitShares limit_shares(const Covariance& own, const Covariance& of_reference) {
    // Without the shaking, which is the drive's.
    constexpr Eigen::Index kImperfections = kShaking - kGyroShape;
    const Eigen::Matrix<double, 6, kImperfections> cross = own.block<6, kImperfections>(0, kGyroShape);
    const Eigen::Matrix<double, 6, 6> of_sensor =
        cross *
        own.block<kImperfections, kImperfections>(kGyroShape, kGyroShape).ldlt().solve(cross.transpose());
    const Eigen::Array<double, 6, 1> all =
        own.diagonal().head<6>().array() + of_reference.diagonal().head<6>().array();
    LimitShares shares;
    shares.sensor = of_sensor.diagonal().array() / all;
    shares.reference = of_reference.diagonal().head<6>().array() / all;
    return shares;
  }

  /// B-13a: the normal equations with the noise in the derivatives as it shows, not as the shares have it.
  void show_noise_in_equations(const Spectra& study, const Residuals& residual,
                               const ReferenceNoise& reference) {
    show_noise(problem_, study, residual, estimate_, noise_, reference, sums_);
    equations_ = normal_equations(sums_, estimate_);
  }

  void finish(BatchMounting& result) {
    const Spectra study = study_spectra();
    const Residuals residual = residuals(problem_, study, estimate_);
    const ReferenceNoise reference = reference_noise(study);
    show_noise_in_equations(study, residual, reference);
    const OfNoise of_noise = honest_covariance();
    const Covariance& by_noise = of_noise.covariance;
    const Covariance by_scatter = scatter_covariance(of_noise.per_slope);
    const auto windows = static_cast<double>(problem_.plan.starts.size());
    const double independent = windows / kWindowsPerIndependent;
    // B-20: correlations as the noise gives them, sd between both.
    ParameterVector growth;
    for (Eigen::Index i = 0; i < kParameters; ++i) {
      // Below one is what the fit itself takes from the windows that tell most: no reason to claim more.
      const double ratio = std::max(1.0, by_scatter(i, i) / by_noise(i, i));
      growth[i] = std::sqrt((kNoiseWeight + independent * ratio) / (kNoiseWeight + independent));
      if (i < kTimeOffset) result.inconsistency = std::max(result.inconsistency, std::sqrt(ratio));
    }
    const AxesFrame published = in_axes_frame(estimate_.sensor);
    const Covariance grown = published.derivative * growth.asDiagonal();
    const Covariance of_estimate = growth.asDiagonal() * by_noise * growth.asDiagonal() +
                                   scales_.doubt(estimate_.sensor.x, of_noise.per_slope);
    result.covariance = published.derivative * of_estimate * published.derivative.transpose();
    result.degrees_of_freedom = kNoiseWeight + independent;
    result.sensor = published.sensor;
    add_change(of_noise, result);
    add_unknown_shares(of_noise, published.derivative, study, residual, reference, result);
    add_mean_motion(result);
    // B-21
    const Eigen::Matrix<double, kParameters, kReferenceErrors> of_reference_errors =
        published.derivative *
        (of_noise.per_slope * reference_slopes(problem_, study, residual, estimate_, noise_, reference,
                                               class_.reference, equations_));
    const Covariance of_reference = of_reference_errors * of_reference_errors.transpose();
    result.limits = limit_shares(result.covariance, of_reference);
    // B-23: F
    result.shared << of_lasting_priors(grown * of_noise.per_slope), of_reference_errors.topRows<6>();
    result.covariance += of_reference;  // B-21
    result.middle_s = middle_s_;
    result.windows = problem_.plan.starts.size();
    const double half_s = 0.5 * static_cast<double>(problem_.plan.length) / kGridRate_hz;
    result.used_s = half_s * (windows + 1.0);
    result.one_chip = scales_.one_chip();
    for (Eigen::Index band = 0; band < problem_.bands.size(); ++band) result.bands.push_back(report(band));
  }

  /// B-10b: what the estimate would be with more of the noise taken for the reference's, by one sd.
  void add_unknown_shares(const OfNoise& of_noise, const Covariance& to_published, const Spectra& study,
                          const Residuals& residual, const ReferenceNoise& reference,
                          BatchMounting& result) const {
    const auto gradient = [&](const ReferenceNoise& assumed) -> ParameterVector {
      return normal_equations(band_sums(problem_, study, residual, estimate_, noise_, assumed, true),
                              estimate_)
          .gradient;
    };
    const ParameterVector as_estimated = gradient(reference);
    for (Eigen::Index triad = 0; triad < 2; ++triad) {
      const ParameterVector moved =
          to_published * (of_noise.per_slope * (gradient(reference.shifted(triad)) - as_estimated));
      result.covariance += moved * moved.transpose();
    }
  }

  /// B-25: where parts of the drive disagree, the sd reach to both.
  void add_change(const OfNoise& of_noise, BatchMounting& result) const {
    const WindowInfluences influences = equations_.window_scores * of_noise.per_slope.leftCols<kWatched>();
    result.change = largest_change(influences, of_noise.covariance.diagonal().head<kWatched>());
    result.change_s = middle_s_ + problem_.from_middle_s[result.change.window];
    if (!result.change.is_told()) return;
    const WatchedVector& reach = result.change.reach;
    result.covariance.topLeftCorner<kWatched, kWatched>() += reach * reach.transpose();
  }

  /// B-26. Biases were those of records without their means. That of the gyros stays what they show at the drive's
  /// mean force; in that of the accelerometers the uncertain axes are multiplied by gravity.
  void add_mean_motion(BatchMounting& result) const {
    SensorState& sensor = result.sensor;
    const Eigen::Vector3d omega = reference_mean_.head<3>().transpose();
    const Eigen::Vector3d f = reference_mean_.tail<3>().transpose();
    sensor.x.segment<3>(kGyroBias) += study_mean_.head<3>().transpose() - sensor.C_b_gyro() * omega;
    sensor.x.segment<3>(kAccelBias) += study_mean_.tail<3>().transpose() - sensor.C_b_accel() * f;
    Covariance to_bias = Covariance::Identity();
    const Eigen::Vector3d f_a = sensor.C_s_accel() * sensor.C_b_s * f;
    to_bias.block<3, 3>(kAccelBias, kPsi) = -sensor.C_b_accel() * skew(f);
    to_bias.block<3, 3>(kAccelBias, kAlpha) = -sensor.accel_shape() * skew(f_a);
    for (Eigen::Index j = 0; j < 6; ++j)
      to_bias.block<3, 1>(kAccelBias, kAccelShape + j) = -shape_derivative(j, sensor.above) * f_a;
    result.covariance = to_bias * result.covariance * to_bias.transpose();
  }

  [[nodiscard]] BandReport report(Eigen::Index band) const {
    BandReport out;
    out.from_hz = problem_.plan.frequency_hz(problem_.bands.first(band));
    out.to_hz = problem_.plan.frequency_hz(problem_.bands.end(band));
    // Power a frequency of a record scaled to keep sums of squares: density = 2 P / rate.
    for (Eigen::Index i = 0; i < 3; ++i) {
      out.gyro_density[i] = std::sqrt(2.0 * noise_.power(band, i) / kGridRate_hz);
      out.accel_density[i] = std::sqrt(2.0 * noise_.power(band, 3 + i) / kGridRate_hz);
    }
    if (band > 0) {
      out.gyro_deviation_sd = estimate_.deviation_sd(band, 0);
      out.accel_deviation_sd = estimate_.deviation_sd(band, 1);
    }
    return out;
  }

  const ImuRecord& reference_;
  const ImuRecord& study_;
  SensorClass class_;
  std::optional<double> reference_gyro_white_radps_per_sqrt_hz_;
  PriorScales scales_;
  std::vector<double> instants_;
  double middle_s_ = 0.0;
  Problem problem_;
  Eigen::RowVectorXd reference_mean_;
  Eigen::RowVectorXd study_mean_;
  Estimate estimate_;
  Eigen::MatrixX2d taken_;  ///< B-11b, of the step before
  NoiseBands noise_;
  std::vector<BandSums> sums_;  ///< of the last step
  NormalEquations equations_;
  Covariance covariance_;
  double last_share_ = 0.0;                              ///< the newest step's largest, of its sd
  ParameterVector last_step_ = ParameterVector::Zero();  ///< in sd
  double pace_ = 1.0;                                    ///< what a step is multiplied by
};

}  // namespace

double BatchMounting::sd(Parameter first, Eigen::Index component) const {
  return std::sqrt(covariance(first + component, first + component));
}

Result<BatchMounting> estimate_mounting(const ImuRecord& reference, const ImuRecord& study,
                                        const BatchOptions& options) {
  const auto start = find_start(reference, study, options.search_s);
  if (!start) return tl::unexpected<Error>(start.error());
  return Batch(reference, study, options).run(*start);
}

}  // namespace imuscope::batch
