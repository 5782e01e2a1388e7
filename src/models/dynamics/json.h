#pragma once

/// Regressions as JSON: the entries of regression.json.

#include <array>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "models/dynamics/study.h"

namespace imuscope {

/// Appends to `regressions`, for every axis and regression that there is:
/// {"name", "axis", "n", "r2", "f", "f_dof": [2], "p_value", "method": "ols"|"gls", "projected",
///  "coefficients": [{"covariate", "unit", "value", "sd", "ci_low", "ci_high", "p_value", "means"}],
///  "left_out": [{"covariate", "why"}]}.
/// "means" says what fault of mounting or sensor the coefficient would stand for.
void append_regressions(const std::string& name, const std::array<AxisDynamics, kErrorAxes>& axes,
                        nlohmann::json& regressions);

/// Gives every coefficient and every regression "p_holm": p corrected for how many coefficients (regressions)
/// of the same method there are over all axes and S-IMUs (G-22). Null where there is no p.
void correct_for_number(nlohmann::json& regressions);

}  // namespace imuscope
