#include "study/batch_study.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "base/calibration_levels.h"
#include "base/units.h"
#include "estimation/navigation/so3.h"
#include "service/pipeline/observability.h"
#include "service/recording/decoded_lines.h"

namespace imuscope {

namespace {

/// Beyond the filter's own coarse search, in case it ended at its border.
constexpr double kSearchMargin_s = 1.0;
/// The reference is kept so much longer than the S-IMU is used: the offsets that are searched, with room.
constexpr Duration kMargin = std::chrono::seconds{60};
/// Chi-square of six degrees of freedom that chance exceeds once in a million times.
constexpr double kContradictionChi2 = 38.3;
/// Where noise and motion have less than this share of the variance, no manoeuvre is worth its fuel.
constexpr double kMotionHelps = 0.5;
/// A lever arm counts as shown once its sd is below this share of what was assumed before the drive.
constexpr double kShownShare = 0.5;
/// Scatter over time this much above what the noise explains is worth a sentence.
constexpr double kInconsistencyTold = 2.0;
/// Axes that lean by so many sd of their class are worth a sentence.
constexpr double kBeyondClass = 5.0;
/// A mount that turns by this under hard braking is worth a sentence: half of what is still usable.
constexpr double kHardBraking_mps2 = 5.0;
constexpr double kTurnTold_rad = 0.05 * kRadPerDeg;
constexpr double kSureSds = 5.0;
/// A band that differs from a rigid body by this (half a degree) is worth a sentence.
constexpr double kDeviationTold = 0.01;

using Matrix3Row = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

Vector3 vector_of(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

Matrix3 matrix_of(const Eigen::Matrix3d& m) {
  Matrix3 out;
  Eigen::Map<Matrix3Row>(out.data()) = m;
  return out;
}

Vector3 sd_of(const batch::BatchMounting& mounting, batch::Parameter first) {
  return {mounting.sd(first, 0), mounting.sd(first, 1), mounting.sd(first, 2)};
}

/// What is known of the reference's gyros before the drive: what the configuration says, and what all
/// units have that speak its protocol.
std::optional<double> told_gyro_white_radps_per_sqrt_hz(const DeviceConfig& reference) {
  if (const auto sd_radps = reference.noise.gyro_white_sd_radps)
    return *sd_radps / std::sqrt(reference.rate_hz);
  if (traits_of(reference.protocol).has_optical_gyros) return ReferenceConfig{}.gyro_white_radps_per_sqrt_hz;
  return std::nullopt;
}

/// Whether two estimates cannot be of one mounting.
bool contradict(const batch::BatchMounting& a, const batch::BatchMounting& b) {
  Eigen::Matrix<double, 6, 1> difference;
  difference << -log_so3(a.sensor.C_b_s.transpose() * b.sensor.C_b_s),
      b.sensor.lever_arm_b_m() - a.sensor.lever_arm_b_m();
  const Eigen::Matrix<double, 6, 6> covariance =
      a.covariance.topLeftCorner<6, 6>() + b.covariance.topLeftCorner<6, 6>();
  return difference.dot(covariance.ldlt().solve(difference)) > kContradictionChi2;
}

/// Sets the direction of (psi, r) of which the drive shows least: nothing was assumed of the rotation, and of
/// the lever arm its prior.
void set_weakest(const batch::BatchMounting& mounting, SImuOutput& study) {
  Eigen::Matrix<double, 6, 1> assumed = Eigen::Matrix<double, 6, 1>::Ones();
  assumed.tail<3>().setConstant(batch::SensorClass{}.lever_arm_sd_m);
  const Eigen::Matrix<double, 6, 1> scale = assumed.cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> solver(
      scale.asDiagonal() * mounting.covariance.topLeftCorner<6, 6>() * scale.asDiagonal());
  const Eigen::Matrix<double, 6, 1> weakest = solver.eigenvectors().col(5);
  Eigen::Index largest = 0;
  weakest.cwiseAbs().maxCoeff(&largest);
  Eigen::Map<Eigen::Matrix<double, 6, 1>>(study.weakest_direction.data()) = weakest;
  study.weakest_component = static_cast<SImuDirection>(largest);
  study.weakest_relative_sd = std::sqrt(std::max(0.0, solver.eigenvalues()[5]));
}

/// "the boresight by the sensor's own axes, scales and delays (94 % of its variance)".
std::string limit_words(const char* what, double sensor, double reference, double drive) {
  const double largest = std::max({sensor, reference, drive});
  const char* by = largest == sensor      ? "the sensor's own axes, scales and delays"
                   : largest == reference ? "the reference's own axes and scales"
                                          : "noise, and motion that did not show more";
  return fmt::format("{} by {} ({:.0f} % of its variance)", what, by, 100.0 * largest);
}

nlohmann::json shares_json(const Eigen::Matrix<double, 6, 1>& shares) {
  return std::vector<double>(shares.data(), shares.data() + shares.size());
}

std::vector<double> degrees(const Eigen::Vector3d& v) {
  return {v.x() * kDegPerRad, v.y() * kDegPerRad, v.z() * kDegPerRad};
}

nlohmann::json band_json(const batch::BandReport& band) {
  return {{"from_hz", band.from_hz},
          {"to_hz", band.to_hz},
          {"gyro_density_radps_per_sqrt_hz", vector_of(band.gyro_density)},
          {"accel_density_mps2_per_sqrt_hz", vector_of(band.accel_density)},
          {"gyro_deviation_sd", band.gyro_deviation_sd},
          {"accel_deviation_sd", band.accel_deviation_sd}};
}

/// Whether the drive's parts agree (B-25).
nlohmann::json parts_json(const batch::BatchMounting& mounting) {
  const auto& change = mounting.change;
  const Eigen::Vector3d psi = change.difference.head<3>();
  const Eigen::Vector3d r = change.difference.segment<3>(batch::kLeverArm);
  return {{"agree", !change.is_told()},
          {"statistic", change.statistic},
          {"later_from_s", mounting.change_s},
          {"later_less_earlier_deg", degrees(psi)},
          {"later_less_earlier_m", vector_of(r)},
          {"later_less_earlier_t_d_s", change.difference[batch::kTimeOffset]}};
}

}  // namespace

BatchRecords::BatchRecords(const Configuration& configuration, double longest_s)
    : reference_(configuration.reference_index()),
      longest_(from_seconds(longest_s)),
      records_(configuration.devices.size()) {
  for (const auto& device : configuration.devices) half_period_.push_back(from_seconds(0.5 / device.rate_hz));
}

std::optional<HostTime> BatchRecords::taken_at(const Sample& sample, Stream& stream) const {
  constexpr std::uint32_t kBoth = kGyroValid | kAccelValid;
  if (sample.kind != SampleKind::kImu || (sample.imu.flags & kBoth) != kBoth) return std::nullopt;
  HostTime time = sample.time;
  if ((sample.imu.flags & kIsIncrement) != 0) time -= half_period_[sample.device];
  if (stream.first && time <= stream.last) return std::nullopt;
  const auto is_finite = [](double value) { return std::isfinite(static_cast<float>(value)); };
  if (!std::ranges::all_of(sample.imu.omega_radps, is_finite) ||
      !std::ranges::all_of(sample.imu.f_mps2, is_finite))
    return std::nullopt;
  if (!stream.first) stream.first = time;
  stream.last = time;
  return time;
}

void BatchRecords::Record::add(HostTime time_of_sample, const ImuData& data) {
  time.push_back(time_of_sample);
  omega_radps.push_back(Eigen::Map<const Eigen::Vector3d>(data.omega_radps.data()).cast<float>());
  f_mps2.push_back(Eigen::Map<const Eigen::Vector3d>(data.f_mps2.data()).cast<float>());
}

void BatchRecords::Record::forget_before(HostTime instant) {
  const auto kept = std::ranges::lower_bound(time, instant) - time.begin();
  time.erase(time.begin(), time.begin() + kept);
  omega_radps.erase(omega_radps.begin(), omega_radps.begin() + kept);
  f_mps2.erase(f_mps2.begin(), f_mps2.begin() + kept);
}

void BatchRecords::add_to_first(const Sample& sample) {
  Kept& kept = records_[sample.device];
  const auto time = taken_at(sample, kept.of_first);
  if (!time) return;
  kept.is_first_whole = *time > *kept.of_first.first + longest_ + kMargin;
  if (!kept.is_first_whole) kept.first.add(*time, sample.imu);
}

void BatchRecords::add_to_later(const Sample& sample) {
  Kept& kept = records_[sample.device];
  const auto time = taken_at(sample, kept.of_later);
  if (!time || *time <= *kept.of_later.first + longest_ + kMargin) return;
  kept.later.add(*time, sample.imu);
  // Seldom, as it moves an hour of samples.
  const Duration most = longest_ + 2 * kMargin;
  if (*time - kept.later.time.front() > 2 * most) kept.later.forget_before(*time - most);
}

void BatchRecords::add_part(const Record& all, double from_s, double to_s, batch::ImuRecord& part) const {
  const HostTime zero = origin();
  for (std::size_t i = 0; i < all.time.size(); ++i) {
    const double time_s = to_seconds(all.time[i] - zero);
    if (time_s < from_s) continue;
    if (time_s > to_s) break;
    part.add(time_s, all.omega_radps[i], all.f_mps2[i]);
  }
}

batch::ImuRecord BatchRecords::part(std::size_t device, double from_s, double to_s) const {
  batch::ImuRecord part = part_of_first(device, from_s, to_s);
  add_part(records_[device].later, from_s, to_s, part);
  return part;
}

batch::ImuRecord BatchRecords::part_of_first(std::size_t device, double from_s, double to_s) const {
  batch::ImuRecord part;
  add_part(records_[device].first, from_s, to_s, part);
  return part;
}

HostTime BatchRecords::origin() const { return records_[reference_].of_first.first.value_or(HostTime{}); }

double BatchRecords::first_s(std::size_t device) const {
  const auto& first = records_[device].of_first.first;
  return first ? to_seconds(*first - origin()) : 0.0;
}

double BatchRecords::kept_to_end_from_s(std::size_t device) const {
  const Kept& kept = records_[device];
  if (kept.later.time.empty() || kept.later.time.front() - kept.first.time.back() <= kMargin)
    return first_s(device);
  return to_seconds(kept.later.time.front() - origin());
}

/// The two IMUs of one estimate.
class BatchEstimates::Pair {
 public:
  Pair(const BatchRecords& records, const Configuration& configuration, std::size_t study, double longest_s)
      : records_(records), reference_(configuration.reference_index()), study_(study), longest_s_(longest_s) {
    options_.search_s = SImuConfig{}.coarse_search_s + kSearchMargin_s;
    options_.reference_gyro_white_radps_per_sqrt_hz =
        told_gyro_white_radps_per_sqrt_hz(configuration.devices[reference_]);
  }

  [[nodiscard]] double first_s() const { return records_.first_s(study_); }
  [[nodiscard]] double kept_to_end_from_s() const { return records_.kept_to_end_from_s(study_); }

  /// As estimate() of the same; the rest may still be gathered.
  [[nodiscard]] Result<batch::BatchMounting> estimate_first_hour() const {
    const double from_s = first_s();
    const double to_s = from_s + longest_s_;
    return batch::estimate_mounting(
        records_.part_of_first(reference_, from_s - options_.search_s, to_s + options_.search_s),
        records_.part_of_first(study_, from_s, to_s), options_);
  }
  [[nodiscard]] Result<batch::BatchMounting> estimate(double from_s, double to_s) const {
    return batch::estimate_mounting(
        records_.part(reference_, from_s - options_.search_s, to_s + options_.search_s),
        records_.part(study_, from_s, to_s), options_);
  }

 private:
  const BatchRecords& records_;
  std::size_t reference_;
  std::size_t study_;
  double longest_s_;
  batch::BatchOptions options_;
};

BatchEstimates::BatchEstimates(const Configuration& configuration, Read read, Foreseen foreseen,
                               double longest_s)
    : configuration_(configuration),
      foreseen_(std::move(foreseen)),
      longest_s_(longest_s),
      records_(configuration, longest_s),
      studies_(configuration.study_indices()),
      first_hours_(studies_.size()),
      n_ahead_(studies_.size()) {
  beside_.run([this, read = std::move(read)] { estimate_first_hours(read); });
}

BatchEstimates::~BatchEstimates() {
  // Not beside_.cancel(): it would stop the loops inside of an estimate that goes on to use what they made.
  is_given_up_ = true;
  beside_.wait();
}

BatchEstimates::Pair BatchEstimates::pair_of(std::size_t study) const {
  return {records_, configuration_, studies_[study], longest_s_};
}

void BatchEstimates::estimate_first_hours(const Read& read) {
  const auto done = read([this](const Sample& sample) {
    records_.add_to_first(sample);
    return !is_given_up_ && !records_.is_first_whole(sample.device);
  });
  for (std::size_t i = 0; i < studies_.size(); ++i) {
    if (!done) first_hours_[i] = tl::unexpected<Error>(done.error());
    if (done) beside_.run([this, i] { estimate_first_hour(i); });
  }
}

void BatchEstimates::estimate_first_hour(std::size_t study) {
  if (is_given_up_) return;
  first_hours_[study] = pair_of(study).estimate_first_hour();
  if (--n_ahead_ > 0 || !foreseen_ || is_given_up_) return;
  std::vector<BatchOutcome> outcomes(first_hours_.size());
  for (std::size_t i = 0; i < outcomes.size(); ++i) {
    const auto& found = *first_hours_[i];
    if (!found) return;
    outcomes[i].mounting = *found;
  }
  foreseen_(outcomes);
}

BatchOutcome BatchEstimates::outcome_of(std::size_t study, std::optional<double> moved_s) {
  const Pair pair = pair_of(study);
  const double first_s = pair.first_s();
  auto found = std::move(*first_hours_[study]);
  BatchOutcome outcome;
  if (moved_s) {
    const double after_s = std::max(*moved_s, pair.kept_to_end_from_s());
    const auto before = pair.estimate(first_s, std::min(*moved_s, first_s + longest_s_));
    auto after = pair.estimate(after_s, after_s + longest_s_);
    outcome.remounted = before && after && contradict(*before, *after);
    if (outcome.remounted) found = std::move(after);
  }
  if (found) {
    outcome.mounting = std::move(*found);
  } else {
    outcome.why_not = found.error();
  }
  return outcome;
}

std::vector<BatchOutcome> BatchEstimates::outcomes(const FormerMountings& former) {
  beside_.wait();
  std::vector<BatchOutcome> outcomes(studies_.size());
  tbb::parallel_for(std::size_t{0}, studies_.size(), [&](std::size_t i) {
    std::optional<double> moved_s;
    if (!former[i].empty()) moved_s = to_seconds(former[i].back().until - records_.origin());
    outcomes[i] = outcome_of(i, moved_s);
  });
  return outcomes;
}

BatchEstimates::Read reader_of(const Configuration& configuration, const Recording& recording) {
  return [&configuration, &recording](const BatchEstimates::Take& take) -> Result<void> {
    std::vector<bool> is_wanted(configuration.devices.size());
    is_wanted[configuration.reference_index()] = true;
    for (const std::size_t study : configuration.study_indices()) is_wanted[study] = true;
    auto lines = DecodedLines::open(configuration, recording, is_wanted, Reading::kWhenAsked);
    if (!lines) return tl::unexpected<Error>(lines.error());
    for (;;) {
      const auto read = lines->next();
      if (!read) return tl::unexpected<Error>(read.error());
      if (!*read) return {};
      const auto [device, samples] = **read;
      if (!std::ranges::all_of(samples, take)) lines->leave(device);
    }
  };
}

void take_over(const batch::BatchMounting& mounting, SImuOutput& study) {
  const auto& sensor = mounting.sensor;
  const Eigen::Matrix3d C_prior = Eigen::Map<const Matrix3Row>(study.C_prior.data());
  study.C_b_s = matrix_of(sensor.C_b_s);
  study.psi_rad = vector_of(-log_so3(C_prior.transpose() * sensor.C_b_s));
  study.sd_psi_rad = sd_of(mounting, batch::kPsi);
  study.r_bs_b_m = vector_of(sensor.lever_arm_b_m());
  study.sd_r_bs_b_m = sd_of(mounting, batch::kLeverArm);
  study.t_d_s = sensor.x[batch::kTimeOffset];
  study.sd_t_d_s = mounting.sd(batch::kTimeOffset);
  if (!has_estimate(study.status)) {
    study.gyro_bias_radps = vector_of(sensor.x.segment<3>(batch::kGyroBias));
    study.sd_gyro_bias_radps = sd_of(mounting, batch::kGyroBias);
    study.accel_bias_mps2 = vector_of(sensor.x.segment<3>(batch::kAccelBias));
    study.sd_accel_bias_mps2 = sd_of(mounting, batch::kAccelBias);
  }
  study.gyro_scale = vector_of(sensor.x.segment<3>(batch::kGyroShape));
  study.sd_gyro_scale = sd_of(mounting, batch::kGyroShape);
  study.accel_scale = vector_of(sensor.x.segment<3>(batch::kAccelShape));
  study.sd_accel_scale = sd_of(mounting, batch::kAccelShape);
  // In b, as the boresight.
  const Eigen::Matrix3d C_s_b = sensor.C_b_s.transpose();
  const Eigen::Matrix3d alpha =
      C_s_b * mounting.covariance.block<3, 3>(batch::kAlpha, batch::kAlpha) * C_s_b.transpose();
  study.accel_boresight_rad = vector_of(C_s_b * sensor.x.segment<3>(batch::kAlpha));
  study.sd_accel_boresight_rad = vector_of(alpha.diagonal().cwiseSqrt());
  study.accel_t_d_s = sensor.x[batch::kAccelDelay];
  study.sd_accel_t_d_s = mounting.sd(batch::kAccelDelay);
  Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(study.covariance_psi_r.data()) =
      mounting.covariance.topLeftCorner<6, 6>();
  // Rotation and offset have no prior to fall back to; a lever arm that the drive does not show stays at it.
  study.observable.fill(true);
  const double shown_m = kShownShare * batch::SensorClass{}.lever_arm_sd_m;
  for (std::size_t i = 0; i < 3; ++i) study.observable[3 + i] = study.sd_r_bs_b_m[i] < shown_m;
  study.t_d_observable = true;
  set_weakest(mounting, study);
  study.goal = kUsableGoal;  // of a drive that is over no more is to come
  const bool usable = is_usable(*std::ranges::max_element(study.sd_psi_rad),
                                *std::ranges::max_element(study.sd_r_bs_b_m), study.sd_t_d_s);
  study.status = usable ? CalibrationStatus::kCalibrated : CalibrationStatus::kConverging;
}

std::vector<SImuOutput> with_batch(std::vector<SImuOutput> studies,
                                   const std::vector<BatchOutcome>& outcomes) {
  for (std::size_t i = 0; i < studies.size(); ++i) {
    if (outcomes[i].mounting) {
      take_over(*outcomes[i].mounting, studies[i]);
    } else if (!outcomes[i].why_not.what.empty()) {
      // Where the whole drive did not tell, the filter, which takes a sensor to be perfect, cannot be sure.
      const auto most = outcomes[i].why_not.kind == ErrorKind::kUsage ? CalibrationStatus::kWaiting
                                                                      : CalibrationStatus::kConverging;
      studies[i].status = std::min(studies[i].status, most);
    }
  }
  return studies;
}

MountingEstimate estimate_of(const batch::BatchMounting& mounting) {
  MountingEstimate estimate{
      matrix_of(mounting.sensor.C_b_s), vector_of(mounting.sensor.lever_arm_b_m()), {}, {}};
  Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(estimate.covariance_psi_r.data()) =
      mounting.covariance.topLeftCorner<6, 6>();
  for (Eigen::Index i = 0; i < mounting.shared.rows(); ++i)
    for (Eigen::Index j = 0; j < mounting.shared.cols(); ++j)
      estimate.shared_psi_r.push_back(mounting.shared(i, j));
  return estimate;
}

nlohmann::json batch_observability_json(const SImuOutput& study, const batch::BatchMounting& mounting) {
  auto json = observability_json(observability_of(study));
  const auto& limits = mounting.limits;
  const Eigen::Matrix<double, 6, 1> drive = limits.drive();
  json["limited_by"] = fmt::format("{}; {}",
                                   limit_words("boresight", limits.sensor.head<3>().mean(),
                                               limits.reference.head<3>().mean(), drive.head<3>().mean()),
                                   limit_words("lever arm", limits.sensor.tail<3>().mean(),
                                               limits.reference.tail<3>().mean(), drive.tail<3>().mean()));
  Eigen::Index weakest = 0;
  (void)Eigen::Map<const Eigen::Matrix<double, 6, 1>>(study.weakest_direction.data())
      .cwiseAbs()
      .maxCoeff(&weakest);
  if (drive[weakest] < kMotionHelps) json["advice"] = nullptr;
  return json;
}

nlohmann::json batch_json(const batch::BatchMounting& mounting) {
  const auto& sensor = mounting.sensor;
  nlohmann::json json{
      {"seconds_used", mounting.used_s},
      {"windows", mounting.windows},
      {"iterations", mounting.iterations},
      {"settled", mounting.settled},
      {"rate_correlation", mounting.rate_correlation},
      {"degrees_of_freedom", mounting.degrees_of_freedom},
      {"inconsistency", mounting.inconsistency},
      {"parts", parts_json(mounting)},
      {"gyro_matrix", matrix_of(sensor.gyro_shape())},
      {"gyro_axes_sd_deg", degrees({mounting.sd(batch::kGyroShape, 3), mounting.sd(batch::kGyroShape, 4),
                                    mounting.sd(batch::kGyroShape, 5)})},
      {"accel_matrix", matrix_of(sensor.accel_shape())},
      {"accel_axes_sd_deg", degrees({mounting.sd(batch::kAccelShape, 3), mounting.sd(batch::kAccelShape, 4),
                                     mounting.sd(batch::kAccelShape, 5)})},
      {"C_gyro_accel", matrix_of(sensor.C_s_accel())},
      {"g_sensitivity_radps_per_mps2", matrix_of(sensor.g_sensitivity())},
      {"flexure_at_5_hz", matrix_of(sensor.flexure())},
      {"mount_turn_rad_per_mps2", matrix_of(sensor.compliance())},
      {"t_d_growth_at_5_hz_s", {sensor.x[batch::kDispersion], sensor.x[batch::kDispersion + 1]}},
      {"reference_accel_t_d_s", sensor.x[batch::kReferenceAccelDelay]},
      {"share_of_sensor_psi_r", shares_json(mounting.limits.sensor)},
      {"share_of_reference_psi_r", shares_json(mounting.limits.reference)},
      {"shared_psi_r", estimate_of(mounting).shared_psi_r},
      {"accelerometers_in_one_place", mounting.one_chip},
      {"clock_rate", sensor.x[batch::kClockRate]},
      {"clock_rate_sd", mounting.sd(batch::kClockRate)}};
  json["accel_places_s_m"] = nlohmann::json::array();
  for (Eigen::Index i = 0; i < 3; ++i) json["accel_places_s_m"].push_back(vector_of(sensor.place_s_m(i)));
  json["bands"] = nlohmann::json::array();
  for (const auto& band : mounting.bands) json["bands"].push_back(band_json(band));
  return json;
}

nlohmann::json filter_json(const SImuOutput& study, double clock_shift_s) {
  if (!has_estimate(study.status)) return nullptr;
  const auto deg = [](const Vector3& v) {
    return nlohmann::json{v[0] * kDegPerRad, v[1] * kDegPerRad, v[2] * kDegPerRad};
  };
  return {{"C_b_s", study.C_b_s},
          {"boresight_sd_deg", deg(study.sd_psi_rad)},
          {"r_bs_b_m", study.r_bs_b_m},
          {"r_bs_b_sd_m", study.sd_r_bs_b_m},
          {"t_d_s", study.t_d_s + clock_shift_s},
          {"t_d_sd_s", study.sd_t_d_s},
          {"covariance_psi_r", study.covariance_psi_r}};
}

std::string batch_remark(const std::string& name, const batch::BatchMounting& mounting) {
  if (mounting.change.is_told()) {
    return fmt::format(
        "{}: before and after {:.0f} s its mounting differs by {:.2g} deg and {:.0f} mm: it has moved, or "
        "the two IMUs do not sit on one rigid body; the sd reach to both, and each part by itself tells more",
        name, mounting.change_s, mounting.change.difference.head<3>().norm() * kDegPerRad,
        mounting.change.difference.segment<3>(batch::kLeverArm).norm() * kMmPerM);
  }
  if (mounting.inconsistency > kInconsistencyTold) {
    return fmt::format(
        "{}: parts of the drive disagree by {:.1f} times what the noise explains; the sd allows for it, but "
        "check that the sensor sits firmly",
        name, mounting.inconsistency);
  }
  const double leaning_rad = mounting.sensor.x.segment<3>(batch::kGyroShape + 3).cwiseAbs().maxCoeff();
  if (leaning_rad > kBeyondClass * batch::SensorClass{}.axis_sd_rad) {
    return fmt::format(
        "{}: its gyroscopes' axes and the reference's differ from right angles by {:.2g} deg, more than data "
        "sheets allow: which of the two are crooked no drive of theirs tells, and the boresight is about the "
        "axes that the reference's gyroscopes have",
        name, leaning_rad * kDegPerRad);
  }
  const double yields = mounting.sensor.compliance().rowwise().norm().maxCoeff();
  if (yields * kHardBraking_mps2 > kTurnTold_rad && yields > kSureSds * mounting.sd(batch::kCompliance)) {
    return fmt::format(
        "{}: its gyroscopes answer to forces as on a mount that turns by {:.2g} deg when the vehicle brakes "
        "hard; the mounting found is the mean one, but fasten it more stiffly",
        name, yields * kHardBraking_mps2 * kDegPerRad);
  }
  const auto loose =
      std::find_if(mounting.bands.begin(), mounting.bands.end(),
                   [](const batch::BandReport& band) { return band.gyro_deviation_sd > kDeviationTold; });
  if (loose == mounting.bands.end()) return {};
  return fmt::format(
      "{}: above {:.1f} Hz the two IMUs do not move as one rigid body (by {:.1f} % of the rates "
      "there); those frequencies count less",
      name, loose->from_hz, 100.0 * loose->gyro_deviation_sd);
}

}  // namespace imuscope
