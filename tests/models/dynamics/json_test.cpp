#include "models/dynamics/json.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace imuscope {
namespace {

nlohmann::json regression(const char* method, bool projected, double p, std::vector<double> coefficients) {
  nlohmann::json out{{"method", method}, {"projected", projected}, {"p_value", p}};
  for (const double c : coefficients) out["coefficients"].push_back({{"p_value", c}});
  return out;
}

TEST(DynamicsJson, EveryPIsCorrectedForHowManyOfItsMethodThereAre) {
  nlohmann::json all = nlohmann::json::array();
  all.push_back(regression("gls", true, 0.01, {0.001, 0.2}));
  all.push_back(regression("gls", true, 0.04, {0.02, 0.9}));
  all.push_back(regression("gls", false, 0.03, {0.03, 0.04}));
  all[2]["coefficients"][1]["p_value"] = nullptr;
  correct_for_number(all);
  // Holm of 0.001, 0.02, 0.2, 0.9: by 4, 3, 2, 1, none smaller than the one before.
  EXPECT_DOUBLE_EQ(all[0]["coefficients"][0]["p_holm"].get<double>(), 0.004);
  EXPECT_DOUBLE_EQ(all[1]["coefficients"][0]["p_holm"].get<double>(), 0.06);
  EXPECT_DOUBLE_EQ(all[0]["coefficients"][1]["p_holm"].get<double>(), 0.4);
  EXPECT_DOUBLE_EQ(all[1]["coefficients"][1]["p_holm"].get<double>(), 0.9);
  EXPECT_DOUBLE_EQ(all[0]["p_holm"].get<double>(), 0.02);
  EXPECT_DOUBLE_EQ(all[1]["p_holm"].get<double>(), 0.04);
  // Another method is another question, and what has no p does not count.
  EXPECT_DOUBLE_EQ(all[2]["coefficients"][0]["p_holm"].get<double>(), 0.03);
  EXPECT_TRUE(all[2]["coefficients"][1]["p_holm"].is_null());
}

}  // namespace
}  // namespace imuscope
