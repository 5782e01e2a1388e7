#pragma once

/// A drive without any file: a vehicle that stands, drives and turns both ways, as a reference, an S-IMU at its
/// side and a receiver see it. Everything follows from closed forms and seeded noise.

#include <string>
#include <vector>

#include "check/finding.h"
#include "planted_mistakes.h"

namespace imuscope::check {

/// How the made drive goes.
struct MadeDrive {
  double length_s = 70.0;
  double reference_hz = 100.0;
  double study_hz = 120.0;
  double gnss_hz = 5.0;
  /// Turns of the course and tilts of the body, as a share of the usual ones.
  double turns = 1.0;
  double tilts = 1.0;
  double rest_s = 12.0;    ///< standing, before it begins to move
  bool straights = false;  ///< turns and tilts in the last quarter of each minute alone
};

/// Its devices are "reference", "study" and "gnss", CSV files all of them; the S-IMU has a clock of its own.
[[nodiscard]] test::DriveInMemory made_drive(const MadeDrive& how = {});

/// Every field of the findings, a line each.
[[nodiscard]] std::string findings_text(const std::vector<Finding>& findings);

}  // namespace imuscope::check
