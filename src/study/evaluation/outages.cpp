#include "study/evaluation/outages.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "models/noise/chi_squared.h"

namespace imuscope {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// A longer hole in samples, fixes or reference is a gap.
constexpr double kGap_s = 0.5;
/// Without a fix for longer than this before it, an outage would begin earlier than it says.
constexpr double kFixGap_s = 2.0;
/// Slower than this counts as standing.
constexpr double kMoving_mps = 1.0;
/// sd of what the filter starts from: the reference's own solution, said to be this uncertain.
constexpr double kStartPositionSd_m = 0.5;
constexpr double kStartVelocitySd_mps = 0.2;
constexpr double kStartAttitudeSd_rad = 0.02;

bool moves(const DriveReference& at) { return at.state.v_n_mps.norm() > kMoving_mps; }

/// Plays the samples into a filter, to any instant: between samples rates are taken as linear.
class Player {
 public:
  Player(const Drive& drive, const CoastingModel& model, std::size_t first)
      : drive_(&drive),
        model_(&model),
        next_(first + 1),
        time_s_(drive.samples[first].time_s),
        measured_(drive.samples[first].measured) {
    for (std::size_t axis = 0; axis < kImuAxes; ++axis) density_[axis] = model.axes[axis].white_density;
  }

  [[nodiscard]] double time_s() const { return time_s_; }
  [[nodiscard]] const InertialRates& measured() const { return measured_; }
  [[nodiscard]] std::size_t next() const { return next_; }

  /// False at the end of the samples or at a gap in them; the filter is then where they end.
  bool advance(CoastingFilter& filter, double to_s) {
    while (time_s_ < to_s) {
      if (next_ >= drive_->samples.size()) return false;
      const DriveSample& sample = drive_->samples[next_];
      if (sample.time_s - time_s_ > kGap_s) return false;
      if (sample.time_s <= time_s_) {  // a second one of the same instant: nothing moved meanwhile
        measured_ = sample.measured;
        ++next_;
        continue;
      }
      const bool whole = sample.time_s <= to_s;
      const double end_s = whole ? sample.time_s : to_s;
      step(filter, end_s, sample);
      if (whole) ++next_;
    }
    return true;
  }

 private:
  /// To `end_s`, which lies behind the present and not behind the sample.
  void step(CoastingFilter& filter, double end_s, const DriveSample& towards) {
    const double share = (end_s - time_s_) / (towards.time_s - time_s_);
    const InertialRates end{
        measured_.omega_ib_b_radps + share * (towards.measured.omega_ib_b_radps - measured_.omega_ib_b_radps),
        measured_.f_b_mps2 + share * (towards.measured.f_b_mps2 - measured_.f_b_mps2)};
    const int parts = static_cast<int>(std::ceil((end_s - time_s_) / CoastingFilter::kStepMax_s));
    const double dt_s = (end_s - time_s_) / parts;
    set_density();
    for (int i = 0; i < parts; ++i) filter.propagate(measured_, end, dt_s, density_);
    measured_ = end;
    time_s_ = end_s;
  }

  void set_density() {
    const auto& changes = model_->changes;
    while (change_ < changes.size() && changes[change_].from_s <= time_s_)
      density_ = changes[change_++].white_density;
  }

  const Drive* drive_;
  const CoastingModel* model_;
  std::size_t next_;
  double time_s_;
  InertialRates measured_;
  std::size_t change_ = 0;
  std::array<double, kImuAxes> density_{};
};

/// The reference epoch nearest to `time_s`; nullptr where none is near.
const DriveReference* reference_near(const Drive& drive, double time_s) {
  const auto after = std::lower_bound(drive.reference.begin(), drive.reference.end(), time_s,
                                      [](const DriveReference& r, double t) { return r.time_s < t; });
  const DriveReference* best = nullptr;
  double distance_s = kGap_s;
  for (auto it = after == drive.reference.begin() ? after : after - 1;
       it != drive.reference.end() && it <= after; ++it) {
    if (std::abs(it->time_s - time_s) >= distance_s) continue;
    distance_s = std::abs(it->time_s - time_s);
    best = &*it;
  }
  return best;
}

CoastingFilter started(const CoastingModel& model, const DriveReference& at) {
  KinematicVector sd;
  sd << Vector3d::Constant(kStartPositionSd_m), Vector3d::Constant(kStartVelocitySd_mps),
      Vector3d::Constant(kStartAttitudeSd_rad);
  return {model, at.state, sd};
}

/// One run with GNSS from one start, or restart after a gap, to the next gap; outages on the way.
class Stretch {
 public:
  Stretch(const Drive& drive, const CoastingModel& model, const OutageOptions& options,
          std::vector<OutageResult>& results)
      : drive_(drive), model_(model), options_(options), results_(results) {}

  /// @return the first sample after the stretch
  std::size_t play(std::size_t first) {
    const double first_s = drive_.samples[first].time_s;
    auto start = std::lower_bound(drive_.reference.begin(), drive_.reference.end(), first_s,
                                  [](const DriveReference& r, double t) { return r.time_s < t; });
    // At rest a heading can only be lost, and with a model of large biases it is lost for good.
    start = std::find_if(start, drive_.reference.end(), moves);
    if (start == drive_.reference.end()) return drive_.samples.size();
    // Samples before that are passed over.
    while (first + 1 < drive_.samples.size() && drive_.samples[first + 1].time_s <= start->time_s) ++first;
    Player player(drive_, model_, first);
    CoastingFilter filter = started(model_, *start);
    double next_outage_s = -std::numeric_limits<double>::infinity();
    double driven_s = 0.0;
    auto fix = std::lower_bound(drive_.fixes.begin(), drive_.fixes.end(), player.time_s(),
                                [](const DriveFix& f, double t) { return f.time_s < t; });
    double last_fix_s = player.time_s();
    for (; fix != drive_.fixes.end(); ++fix) {
      if (!player.advance(filter, fix->time_s)) return std::max(player.next(), first + 1);
      take(filter, player, *fix);
      const double since_last_s = fix->time_s - last_fix_s;
      const bool continuous = since_last_s < kFixGap_s;
      last_fix_s = fix->time_s;
      const DriveReference* here = reference_near(drive_, fix->time_s);
      if (continuous && here != nullptr && moves(*here)) driven_s += since_last_s;
      // An outage begins right after a fix.
      if (driven_s < options_.settle_s || fix->time_s < next_outage_s || !continuous) continue;
      coast(filter, player);
      next_outage_s = fix->time_s + options_.spacing_s;
      if (options_.progress) options_.progress(player.time_s() / drive_.samples.back().time_s);
    }
    return drive_.samples.size();
  }

 private:
  void take(CoastingFilter& filter, const Player& player, const DriveFix& fix) const {
    const HostTime time = HostTime{from_seconds(fix.time_s)};
    filter.update_position(time, fix.antenna, fix.sd_position_m, drive_.r_sa_s_m);
    if (fix.has_velocity)
      filter.update_velocity(time, fix.v_n_mps, fix.sd_velocity_mps, player.measured(), drive_.r_sa_s_m);
  }

  void coast(CoastingFilter filter, Player player) {
    const double start_s = player.time_s();
    for (const double duration_s : options_.durations_s) {
      const DriveReference* reference = reference_near(drive_, start_s + duration_s);
      if (reference == nullptr || !player.advance(filter, reference->time_s)) return;
      OutageResult result;
      result.start_s = start_s;
      result.duration_s = duration_s;
      result.error = error_between(reference->state, filter.state()).head<kNavigationKinematicSize>();
      result.covariance = filter.covariance();
      result.reference_sd = reference->sd;
      results_.push_back(result);
    }
  }

  const Drive& drive_;
  const CoastingModel& model_;
  const OutageOptions& options_;
  std::vector<OutageResult>& results_;
};

/// e' P^-1 e, and log det P where asked for.
double normalised_squared(const Vector3d& e, const Matrix3d& P, double* log_det = nullptr) {
  const Eigen::LLT<Matrix3d> root(P);
  if (log_det != nullptr) *log_det = 2.0 * Matrix3d(root.matrixL()).diagonal().array().log().sum();
  return e.dot(root.solve(e));
}

Consistency summary(const std::vector<const OutageResult*>& outages) {
  constexpr double kFreedom = 3.0;
  constexpr double kTail = 0.025;
  Consistency out;
  out.duration_s = outages.front()->duration_s;
  out.n = outages.size();
  double free_from_s = -std::numeric_limits<double>::infinity();
  for (const OutageResult* outage : outages) {
    if (outage->start_s >= free_from_s) {
      ++out.n_independent;
      free_from_s = outage->start_s + outage->duration_s;
    }
    const KinematicVector& e = outage->error;
    KinematicCovariance P = outage->covariance;
    P.diagonal() += outage->reference_sd.cwiseAbs2();
    const KinematicVector variance = P.diagonal();
    out.horizontal_rms_m += e.head<2>().squaredNorm();
    out.horizontal_sd_m += variance.head<2>().sum();
    out.vertical_rms_m += e[2] * e[2];
    out.vertical_sd_m += variance[2];
    out.velocity_rms_mps += e.segment<3>(kVelocityError).squaredNorm();
    out.velocity_sd_mps += variance.segment<3>(kVelocityError).sum();
    out.attitude_rms_rad += e.segment<3>(kAttitudeError).squaredNorm();
    out.attitude_sd_rad += variance.segment<3>(kAttitudeError).sum();
    double log_det = 0.0;
    const double position = normalised_squared(e.head<3>(), P.topLeftCorner<3, 3>(), &log_det);
    // V-5, V-6
    out.nees_position += position / kFreedom;
    out.nees_velocity +=
        normalised_squared(e.segment<3>(kVelocityError), P.block<3, 3>(kVelocityError, kVelocityError)) /
        kFreedom;
    out.nees_attitude +=
        normalised_squared(e.segment<3>(kAttitudeError), P.block<3, 3>(kAttitudeError, kAttitudeError)) /
        kFreedom;
    out.surprise += 0.5 * (position + log_det + kFreedom * std::log(2.0 * std::numbers::pi));
  }
  const auto n = static_cast<double>(out.n);
  for (double* mean : {&out.nees_position, &out.nees_velocity, &out.nees_attitude, &out.surprise}) *mean /= n;
  for (double* root :
       {&out.horizontal_rms_m, &out.horizontal_sd_m, &out.vertical_rms_m, &out.vertical_sd_m,
        &out.velocity_rms_mps, &out.velocity_sd_mps, &out.attitude_rms_rad, &out.attitude_sd_rad}) {
    *root = std::sqrt(*root / n);
  }
  const double dof = kFreedom * static_cast<double>(out.n_independent);
  out.nees_low = noise::chi_squared_quantile(dof, kTail) / dof;
  out.nees_high = noise::chi_squared_quantile(dof, 1.0 - kTail) / dof;
  return out;
}

}  // namespace

std::vector<OutageResult> play_outages(const Drive& drive, const CoastingModel& model,
                                       const OutageOptions& options) {
  std::vector<OutageResult> results;
  Stretch stretch(drive, model, options, results);
  for (std::size_t next = 0; next + 1 < drive.samples.size() && !drive.reference.empty();)
    next = stretch.play(next);
  return results;
}

std::vector<Consistency> consistency_of(const std::vector<OutageResult>& results,
                                        const std::vector<double>& durations_s) {
  std::vector<Consistency> table;
  for (const double duration_s : durations_s) {
    std::vector<const OutageResult*> of_duration;
    for (const OutageResult& result : results) {
      if (result.duration_s == duration_s) of_duration.push_back(&result);
    }
    if (!of_duration.empty()) table.push_back(summary(of_duration));
  }
  return table;
}

}  // namespace imuscope
