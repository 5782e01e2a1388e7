#pragma once

/// What all units and drives of a fleet tell together: one random-effects model per quantity
/// (models/noise/nested_effects.h), units and drives that stand out, units that drift, units that do not hold what
/// their certificate or their data sheet says.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "models/noise/nested_effects.h"

namespace imuscope::fleet {

/// One quantity of one unit in one drive, on the quantity's scale.
struct Measured {
  std::uint32_t unit = 0;     ///< place in Fleet::units
  std::uint32_t capture = 0;  ///< place in Fleet::captures
  std::uint32_t device = 0;   ///< place in Fleet::devices
  double value = 0.0;
  double sd = 0.0;
};

/// A number that a unit should have, by whoever says so.
struct Stated {
  std::uint32_t unit = 0;
  std::string against;  ///< "certificate", "data sheet"
  double value = 0.0;   ///< on the quantity's scale
  double sd = 0.0;      ///< of that value; 0 of a data sheet
};

struct Quantity {
  std::string name;
  std::string regime;
  std::string axis;
  std::string unit_of_value;
  bool is_log = false;
  /// Counted from each unit's first drive, as mountings are: units have no mean of their own.
  bool from_first_drive = false;
  std::vector<Measured> values;  ///< by capture, then device
  std::vector<Stated> stated;
};

/// What the population is made of.
struct Fleet {
  std::vector<std::string> units;
  std::vector<std::string> captures;
  std::vector<std::string> devices;
  std::vector<double> days;  ///< of each capture since 1970; NaN where nobody tells
  std::vector<Quantity> quantities;
  std::vector<std::vector<double>> temperatures_degC;  ///< by capture and device; NaN where nobody tells
  double certificate_factor = 1.25;
};

/// A test with its p-value among all of its kind.
struct Tested {
  std::uint32_t unit = 0;
  std::optional<std::uint32_t> capture;  ///< of a drive
  std::optional<std::uint32_t> device;
  noise::Deviation test;
  double p_corrected = 1.0;
};

/// Whether a unit is as it should be.
struct Holding {
  std::uint32_t unit = 0;
  std::string against;
  double stated = 0.0;
  double ratio = 1.0;
  double ratio_low = 1.0;
  double ratio_high = 1.0;
  double p_value = 1.0;  ///< that it is above the factor by chance
  double p_corrected = 1.0;
};

/// "yes": the whole interval is below the factor; "no": it is above, tests of all units considered; "cannot
/// tell".
const char* words_of(const Holding& holding, double factor);

/// What is found of one quantity.
struct QuantityResult {
  std::optional<noise::NestedEffects> effects;
  std::optional<noise::Slope> per_degC;
  std::optional<noise::Slope> per_year;
  std::vector<Tested> outlying_units;  ///< all tests, those that found nothing included
  std::vector<Tested> outlying_drives;
  std::vector<Tested> drifts;
  std::vector<Holding> holdings;
};

/// One result per quantity. P-values are corrected over all quantities (Holm): of units, of drives, of drifts,
/// of what does not hold, each as a family. Parameters of the processes of a model ("GM1 beta") are
/// described, not tested: what two processes of one model are called is chance.
std::vector<QuantityResult> population_of(const Fleet& fleet);

}  // namespace imuscope::fleet
