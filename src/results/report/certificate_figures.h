#pragma once

/// The figures of a certificate, drawn by gnuplot.

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <utility>
#include <vector>

#include "base/output_folder.h"
#include "base/result.h"

namespace imuscope::report {

/// SVG files; the PDF and the gnuplot source of each lie beside it.
struct CertificateFigures {
  std::vector<std::pair<std::filesystem::path, std::string>> overview;  ///< with the caption
  std::vector<std::filesystem::path> of_axes;                           ///< in the order of "axes"
};

/// Whether an axis of a certificate is a gyroscope's, by its unit.
bool is_gyro_axis(const nlohmann::json& axis);

/// Draws into `folder`/figures. Errors (kWork): those of draw_into().
Result<CertificateFigures> draw_certificate(const OutputFolder& folder, const nlohmann::json& certificate);

}  // namespace imuscope::report
