#pragma once

/// The page of a certificate: one HTML file that carries everything it shows, made from the certificate's
/// JSON alone, and its figures as SVG and PDF.

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "base/result.h"

namespace imuscope {

/// Writes `certificate.html` and `figures/` (SVG, PDF and gnuplot source of each figure) into `folder`.
/// @param certificate  as certificate::to_json() writes it, or with more: "comparison", "units", "virtual"
/// @return the files written. Errors (kWork): gnuplot is missing or refuses, a file that cannot be written, a
///         document that lacks a field.
Result<std::vector<std::filesystem::path>> write_certificate_page(const std::filesystem::path& folder,
                                                                  const nlohmann::json& certificate);

}  // namespace imuscope
