#include "dynamics/json.h"

#include <nlohmann/json.hpp>

#include "dynamics/covariates.h"
#include "dynamics/physical_meaning.h"

namespace imuscope {
namespace {

constexpr std::array<const char*, kErrorAxes> kAxisNames{"gyro_x",  "gyro_y",  "gyro_z",
                                                         "accel_x", "accel_y", "accel_z"};

nlohmann::json coefficient_json(std::size_t axis, const RegressionCoefficient& c) {
  return {{"covariate", covariate_name(c.covariate)},
          {"unit",
           std::string(axis < 3 ? "rad/s" : "m/s^2") + " per " + std::string(covariate_unit(c.covariate))},
          {"value", c.value},
          {"sd", c.sd},
          {"ci_low", c.ci_low},
          {"ci_high", c.ci_high},
          {"p_value", c.p_value},
          {"means", describe_coefficient(axis, c.covariate, c.value)}};
}

nlohmann::json left_out_json(std::size_t axis, bool projected, std::size_t covariate, LeftOut why) {
  const char* text = why == LeftOut::kConstant ? "does not vary in this drive"
                     : projected && is_calibration_column(axis, covariate)
                         ? "cannot be told from an error of the calibration"
                         : "a combination of other covariates in this drive";
  return {{"covariate", covariate_name(covariate)}, {"why", text}};
}

nlohmann::json regression_json(const std::string& name, std::size_t axis, const Regression& regression,
                               const char* method, bool projected) {
  nlohmann::json json{{"name", name},
                      {"axis", kAxisNames[axis]},
                      {"n", regression.n},
                      {"r2", regression.r2},
                      {"f", regression.f},
                      {"f_dof", {regression.dof_model, regression.dof_rest}},
                      {"p_value", regression.p_value},
                      {"method", method},
                      {"projected", projected},
                      {"coefficients", nlohmann::json::array()},
                      {"left_out", nlohmann::json::array()}};
  for (const auto& c : regression.coefficients) json["coefficients"].push_back(coefficient_json(axis, c));
  for (const auto& [covariate, why] : regression.left_out) {
    json["left_out"].push_back(left_out_json(axis, projected, covariate, why));
  }
  return json;
}

}  // namespace

void append_regressions(const std::string& name, const std::array<AxisDynamics, kErrorAxes>& axes,
                        nlohmann::json& regressions) {
  for (std::size_t axis = 0; axis < kErrorAxes; ++axis) {
    const auto& a = axes[axis];
    const auto append = [&](const std::optional<Regression>& r, const char* method, bool projected) {
      if (r) regressions.push_back(regression_json(name, axis, *r, method, projected));
    };
    append(a.ols, "ols", false);
    append(a.ols_projected, "ols", true);
    append(a.gls, "gls", false);
    append(a.gls_projected, "gls", true);
  }
}

}  // namespace imuscope
