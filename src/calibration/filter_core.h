#pragma once

/// The filter's state and covariance as one thing: every update corrects the navigation and every S-IMU.
/// Order of the error state: 15 of the navigation (navigation/error_model.h), then the S-IMUs in order of
/// configuration. Allocates: constructor only. Thread: one.

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "calibration/covariance_kernel.h"
#include "calibration/estimator_config.h"
#include "calibration/study_model.h"
#include "navigation/error_model.h"
#include "navigation/navigation_state.h"

namespace imuscope {

class FilterCore {
 public:
  explicit FilterCore(const EstimatorConfig& config);

  [[nodiscard]] CovarianceKernel& covariance() noexcept { return covariance_; }
  [[nodiscard]] const CovarianceKernel& covariance() const noexcept { return covariance_; }
  [[nodiscard]] double sd(std::size_t state) const noexcept;

  [[nodiscard]] NavigationState& navigation() noexcept { return navigation_; }
  [[nodiscard]] const NavigationState& navigation() const noexcept { return navigation_; }
  [[nodiscard]] StudyState& study(std::size_t i) noexcept { return studies_[i]; }
  [[nodiscard]] const StudyState& study(std::size_t i) const noexcept { return studies_[i]; }
  [[nodiscard]] const StudyLayout& layout(std::size_t i) const noexcept { return layouts_[i]; }
  [[nodiscard]] std::size_t study_count() const noexcept { return studies_.size(); }

  /// Second half of an update (CovarianceKernel::project() is the first): corrects everything.
  /// @return false where nothing was changed
  bool update(const Eigen::Vector3d& innovation, const std::array<bool, 3>& use) noexcept;

  /// Sum of the navigation corrections injected so far, carried to the present: e <- Phi e + d. E-4.
  [[nodiscard]] const NavigationErrorVector& injected() const noexcept { return injected_; }
  void carry_injected(const NavigationTransition& transition) noexcept;
  void clear_injected() noexcept { injected_.setZero(); }

  /// Makes every variance positive and finite again. @return states repaired; `first` is one of them.
  std::size_t repair(std::size_t& first) noexcept;

 private:
  CovarianceKernel covariance_;
  NavigationState navigation_;
  NavigationErrorVector injected_ = NavigationErrorVector::Zero();
  std::vector<StudyState> studies_;
  std::vector<StudyLayout> layouts_;
  std::vector<double> repair_variance_;  ///< prior variance of every state
};

/// Prior variances of one S-IMU's states, written to P with no correlation.
void reset_to_prior(FilterCore& core, std::size_t study, const StudyConfig& config) noexcept;

/// Eigen's and the samples' vectors.
inline Eigen::Vector3d to_eigen(const Vector3& v) noexcept { return {v[0], v[1], v[2]}; }
inline Vector3 to_array(const Eigen::Vector3d& v) noexcept { return {v.x(), v.y(), v.z()}; }
Eigen::Matrix3d to_eigen(const Matrix3& m) noexcept;
Matrix3 to_array(const Eigen::Matrix3d& m) noexcept;

}  // namespace imuscope
