#pragma once

/// Random effects on two levels: units of one kind differ about a common mean, and what is seen of a unit
/// differs from drive to drive, each time with a known error (G-70 to G-74 in EQUATIONS.md). random_effects.h
/// is the same with one level. Works on the scale that it is given: what can only be positive comes as a
/// logarithm.

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

namespace imuscope::noise {

/// What one drive tells of one unit.
struct DriveValue {
  std::size_t unit = 0;  ///< from 0, without gaps
  double value = 0.0;
  double variance = 0.0;  ///< of its error, > 0
  /// What the value may follow: the sensor's temperature, the time. All values have as many, none is NaN.
  std::vector<double> covariates{};
};

struct Spread95 {
  double value = 0.0;
  double low = 0.0;
  double high = 0.0;
};

/// How far something is from the others of its kind, judged by what they differ by without it.
struct Deviation {
  double deviation = 0.0;
  double t = 0.0;
  double dof = 0.0;
  double p_value = 1.0;  ///< two-sided
};

/// How a value follows a covariate within the units.
struct Slope {
  double value = 0.0;
  double sd = 0.0;
};

/// One unit, over its drives.
struct UnitEffect {
  std::size_t drives = 0;
  double mean = 0.0;
  double variance = 0.0;         ///< of the mean, what drives differ by included
  std::optional<Deviation> out;  ///< absent below three units
};

struct NestedEffects {
  std::size_t units = 0;
  std::size_t drives = 0;
  Spread95 mean;                     ///< of all units that there may be
  Spread95 unit_sd;                  ///< between units
  std::optional<Spread95> drive_sd;  ///< between drives of a unit; absent where no unit has two
  double tolerance_low = 0.0;        ///< holds the means of 95 % of all units, at a confidence of 95 %
  double tolerance_high = 0.0;
  std::vector<Slope> slopes;  ///< one a covariate; of none where the drives do not tell it
  std::vector<UnitEffect> of_units;
  /// One a value, in their order; absent where its unit has one drive, and where drives give too little to
  /// judge by.
  std::vector<std::optional<Deviation>> of_drives;
};

/// Absent below two units, and where a value or a variance is not finite or positive.
std::optional<NestedEffects> nested_effects(std::span<const DriveValue> values);

/// How every unit changes with `time`, judged by what drives differ by beside that: slope, its sd, test.
/// Absent for a unit of fewer than three drives, and where all of them are of one time.
/// @param values  their covariates are taken out before
/// @param time    one a value
std::vector<std::optional<Deviation>> unit_drifts(std::span<const DriveValue> values,
                                                  std::span<const double> time);

}  // namespace imuscope::noise
