#pragma once

/// The noise models of a run, in the units they are shown in: gyroscopes in deg/s as in the paper.

#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

namespace imuscope::report {

/// One level of the wavelet variance, shown unit squared; absent is what models.json does not hold.
struct FitLevel {
  double tau_s = 0.0;
  std::optional<double> value;
  std::optional<double> ci_low;
  std::optional<double> ci_high;
  std::optional<double> fitted;
};

/// One parameter as shown, unit included; absent is what models.json does not hold.
struct FitParameter {
  std::string process;
  std::string name;
  std::string unit;
  std::optional<double> value;
  std::optional<double> ci_low;
  std::optional<double> ci_high;
};

/// What one process contributes to the fitted wavelet variance, level by level.
struct FitComponent {
  std::string name;  ///< "WN", "GM1", ...
  std::vector<double> values;
};

/// One entry of models.json: the model of one axis in one regime.
struct Fit {
  std::string imu;
  std::string axis;    ///< "gyro_x"
  std::string regime;  ///< "static", "dynamic", or what the run calls it
  std::string unit;    ///< of the signal
  std::string model;
  std::optional<double> n;
  std::vector<FitLevel> levels;
  std::vector<FitComponent> components;  ///< empty where the entry is no whole fit
  std::vector<FitParameter> parameters;
  std::optional<double> j_p_value;
  bool identifiable = true;
  std::vector<std::string> warnings;
};

/// NaN where a number is not known.
inline double or_nan(std::optional<double> value) {
  return value.value_or(std::numeric_limits<double>::quiet_NaN());
}

/// The fits in `models` (the array of models.json); empty where it is null.
std::vector<Fit> read_fits(const nlohmann::json& models);

/// Regimes that occur, "static" and "dynamic" first, then the others as they come.
std::vector<std::string> regimes_of(const std::vector<Fit>& fits);

/// The regimes without that of everything together, where there are two others at least.
std::vector<std::string> particular_regimes(std::vector<std::string> regimes);

/// nullptr where there is none.
const Fit* find_fit(const std::vector<Fit>& fits, const std::string& imu, const std::string& axis,
                    const std::string& regime);

inline constexpr const char* kAxes[] = {"gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"};

/// Brings a unit to what people read, "rad/s" to "deg/s" and "^2" to "²"; returns the factor of its numbers.
double shown_unit(std::string& unit);

/// "gyroscope x" for "gyro_x"; any other axis as it is.
std::string axis_words(const std::string& axis);

}  // namespace imuscope::report
