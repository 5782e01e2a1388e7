#pragma once

/// The catalogue of a campaign: one SQLite file (schema.sql), written by one reducer from the results of the
/// tasks. Nobody writes to it at the same time, and it is made anew from the results whenever it is asked
/// for.

#include <filesystem>

#include "base/result.h"
#include "fleet/fleet_file.h"
#include "fleet/plan.h"

namespace imuscope::fleet {

inline constexpr const char* kCatalogue = "catalogue.db";

/// Writes OUT/catalogue.db, which has its name when it is whole. The same results give the same tables, row
/// by row, but for attempts and other_results. Errors: kWork, a result that is not understood, or a file that
/// cannot be written.
Result<void> write_catalogue(const FleetFile& fleet, const Plan& plan);

/// Writes every table as OUT_FOLDER/TABLE.csv, its rows in the order of the primary key.
Result<void> export_csv(const std::filesystem::path& catalogue, const std::filesystem::path& folder);

}  // namespace imuscope::fleet
