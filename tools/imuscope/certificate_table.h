#pragma once

/// The numbers of a certificate for a paper or a page.

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace imuscope::cli {

enum class TableFormat { kLatex, kMarkdown, kCsv };

/// One row an axis and term: N, B, K, R, Q with their interval or bound and unit. LaTeX as a tabular that
/// needs no package.
std::string certificate_table(const nlohmann::json& certificate, TableFormat format);

/// The Allan deviation of every axis: axis, tau_s, deviation, ci_low, ci_high, model, unit.
std::string allan_csv(const nlohmann::json& certificate);

}  // namespace imuscope::cli
