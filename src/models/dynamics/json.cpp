#include "models/dynamics/json.h"

#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "models/dynamics/covariates.h"
#include "models/dynamics/physical_meaning.h"
#include "models/noise/holm.h"

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

/// Sets p_holm of what shares one question.
void correct_family(const std::vector<nlohmann::json*>& family) {
  std::vector<std::optional<double>> p;
  for (const nlohmann::json* entry : family) {
    const auto& value = entry->at("p_value");
    p.push_back(value.is_number() ? std::optional(value.get<double>()) : std::nullopt);
  }
  const auto adjusted = noise::holm_adjusted(p);  // G-22
  for (std::size_t i = 0; i < family.size(); ++i)
    (*family[i])["p_holm"] = adjusted[i] ? nlohmann::json(*adjusted[i]) : nlohmann::json(nullptr);
}

}  // namespace

void correct_for_number(nlohmann::json& regressions) {
  struct Family {
    std::vector<nlohmann::json*> regressions;
    std::vector<nlohmann::json*> coefficients;
  };
  std::map<std::pair<std::string, bool>, Family> families;
  for (nlohmann::json& regression : regressions) {
    auto& family =
        families[{regression.at("method").get<std::string>(), regression.at("projected").get<bool>()}];
    family.regressions.push_back(&regression);
    for (nlohmann::json& c : regression.at("coefficients")) family.coefficients.push_back(&c);
  }
  for (const auto& [method, family] : families) {
    correct_family(family.regressions);
    correct_family(family.coefficients);
  }
}

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
