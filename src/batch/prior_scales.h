#pragma once

/// How large each kind of imperfection is taken to be: as the sensor's class has it, and more where the drive
/// shows more (B-16). Three accelerometers on one chip or on three is decided by which of the two the drive
/// makes likelier (B-17).

#include <Eigen/Core>

#include "batch/sensor_model.h"

namespace imuscope::batch {

class PriorScales {
 public:
  explicit PriorScales(const SensorClass& sensor);

  /// Inverse variances in force; 0 for psi and t_d.
  [[nodiscard]] ParameterVector precision() const;

  /// @param x           the estimate
  /// @param covariance  of it, with precision() in it
  void learn(const ParameterVector& x, const Eigen::Matrix<double, kParameters, kParameters>& covariance);

  [[nodiscard]] bool one_chip() const { return one_chip_; }

 private:
  void choose_places(const ParameterVector& x,
                     const Eigen::Matrix<double, kParameters, kParameters>& covariance);

  SensorClass sensor_;
  ParameterVector class_sd_;
  ParameterVector sd_;
  bool one_chip_ = false;
};

}  // namespace imuscope::batch
