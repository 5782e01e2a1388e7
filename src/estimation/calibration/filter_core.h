#pragma once

/// The filter's state and covariance as one thing: every update corrects the navigation and every S-IMU.
/// Order of the error state: 15 of the navigation (estimation/navigation/error_model.h), then the S-IMUs in order of
/// configuration, then the odometry's 6 where there is one (estimation/navigation/odometry_measurement.h), then the
/// antenna's 4 where there is GNSS (estimation/navigation/antenna.h). Allocates: constructor only. Thread: one.

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/contracts.h"
#include "estimation/calibration/covariance_kernel.h"
#include "estimation/calibration/estimator_config.h"
#include "estimation/calibration/measurement_columns.h"
#include "estimation/calibration/s_imu_model.h"
#include "estimation/navigation/antenna.h"
#include "estimation/navigation/error_model.h"
#include "estimation/navigation/navigation_state.h"
#include "estimation/navigation/odometry_measurement.h"
#include "sample/eigen_arrays.h"

namespace imuscope {

class FilterCore {
 public:
  explicit FilterCore(const EstimatorConfig& config);

  /// For project() and for setting correlations; changes over time go through the functions below.
  [[nodiscard]] CovarianceKernel& covariance() noexcept { return covariance_; }
  [[nodiscard]] const CovarianceKernel& covariance() const noexcept { return covariance_; }
  [[nodiscard]] double sd(std::size_t state) const noexcept;

  /// An update of one S-IMU moves every state by a little, and most are not looked at before the next update:
  /// their corrections wait. Whoever may change the core gets a state with its corrections in it; for those
  /// who only look, settle() must have been called since the last update().
  [[nodiscard]] NavigationState& navigation() noexcept {
    settle_navigation();
    return navigation_;
  }
  [[nodiscard]] const NavigationState& navigation() const noexcept {
    IMUSCOPE_EXPECTS(!navigation_waits_);
    return navigation_;
  }
  [[nodiscard]] SImuState& study(std::size_t i) noexcept {
    settle_study(i);
    return studies_[i];
  }
  [[nodiscard]] const SImuState& study(std::size_t i) const noexcept {
    IMUSCOPE_EXPECTS(study_waits_[i] == 0);
    return studies_[i];
  }
  void settle() noexcept;
  /// Of the R-IMU; never waiting.
  [[nodiscard]] const Eigen::Vector3d& reference_gyro_bias_radps() const noexcept {
    return navigation_.gyro_bias_b_radps;
  }
  [[nodiscard]] const Eigen::Vector3d& reference_accel_bias_mps2() const noexcept {
    return navigation_.accel_bias_b_mps2;
  }
  [[nodiscard]] const SImuLayout& layout(std::size_t i) const noexcept { return layouts_[i]; }
  [[nodiscard]] std::size_t study_count() const noexcept { return studies_.size(); }
  [[nodiscard]] const OdometryState& odometry() const noexcept { return odometry_; }
  /// First index of the odometry's states; SImuLayout::kAbsent where there are none.
  [[nodiscard]] std::size_t odometry_states() const noexcept { return odometry_states_; }
  [[nodiscard]] const AntennaState& antenna() const noexcept { return antenna_; }
  /// First index of the antenna's states; SImuLayout::kAbsent where there are none.
  [[nodiscard]] std::size_t antenna_states() const noexcept { return antenna_states_; }
  /// A receiver's latency of which nothing else is known yet.
  void reset_latency(double latency_s, double sd_s) noexcept;

  /// Second half of an update (CovarianceKernel::project() is the first): corrects everything.
  /// @return false where nothing was changed
  bool update(const Eigen::Vector3d& innovation, const std::array<bool, 3>& use,
              CovarianceKernel::Considered considered = {}) noexcept;

  /// How often an update or a reset has changed states and covariance; the passing of time does not count.
  [[nodiscard]] std::uint64_t changes() const noexcept { return changes_; }

  /// Carries the covariance of the navigation over one interval (not its state).
  void predict_navigation(const NavigationTransition& step) noexcept;
  /// Covariance of one state: decay, then white noise of the given variance.
  void predict_state(std::size_t i, double decay, double variance) noexcept;
  /// The same of several neighbours at once.
  void predict_states(std::size_t first, std::span<const double> decay,
                      std::span<const double> variance) noexcept;
  /// Makes a state uncorrelated, of the given variance; to the history that is a new state.
  void reset_state(std::size_t i, double variance) noexcept;

  /// Sum of the navigation corrections since the last take. E-4.
  [[nodiscard]] const NavigationErrorVector& injected() const noexcept { return injected_; }
  NavigationErrorVector take_injected() noexcept;

  /// What the smoother needs to know of the time since the last take: kept only where asked for.
  struct Accumulated {
    NavigationErrorCovariance transition = NavigationErrorCovariance::Identity();
    NavigationErrorCovariance noise = NavigationErrorCovariance::Zero();
    std::vector<double> decay;  ///< of the states from 15 on
    std::vector<double> decay_noise;
    std::vector<double> injected;  ///< of every state, carried to the present
  };
  void keep_history() noexcept { keeps_history_ = true; }
  [[nodiscard]] const Accumulated& accumulated() const noexcept { return accumulated_; }
  void restart_accumulation() noexcept;

  /// Makes every variance positive and finite again. @return states repaired; `first` is one of them.
  std::size_t repair(std::size_t& first) noexcept;
  /// Makes one state as uncertain as it was at the start, and uncorrelated.
  void repair_state(std::size_t i) noexcept { reset_state(i, repair_variance_[i]); }

 private:
  void accumulate(std::size_t i, double decay, double variance) noexcept;
  void settle_navigation() noexcept;
  void settle_study(std::size_t i) noexcept;

  CovarianceKernel covariance_;
  NavigationState navigation_;
  NavigationErrorVector injected_ = NavigationErrorVector::Zero();
  std::vector<SImuState> studies_;
  std::vector<double> waiting_;  ///< corrections of every state that are not yet in it
  bool navigation_waits_ = false;
  std::vector<unsigned char> study_waits_;
  std::vector<SImuLayout> layouts_;
  OdometryState odometry_;
  std::size_t odometry_states_ = SImuLayout::kAbsent;
  AntennaState antenna_;
  std::size_t antenna_states_ = SImuLayout::kAbsent;
  std::vector<double> repair_variance_;  ///< prior variance of every state
  std::uint64_t changes_ = 0;
  bool keeps_history_ = false;
  Accumulated accumulated_;
};

/// Prior variances of one S-IMU's states, written to P with no correlation.
void reset_to_prior(FilterCore& core, std::size_t study, const SImuConfig& config) noexcept;

}  // namespace imuscope
