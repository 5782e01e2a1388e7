#include "results/tables/columns.h"

#include <gtest/gtest.h>

#include <set>

#include "models/dynamics/covariates.h"

namespace imuscope::tables {
namespace {

TEST(RunTables, EveryColumnHasANameOfItsOwnAUnitAndAMeaning) {
  for (const TableKind& table : run_tables()) {
    std::set<std::string> names;
    EXPECT_FALSE(table.description.empty());
    for (const Column& column : table.columns) {
      EXPECT_TRUE(names.insert(column.name).second) << table.stem << " " << column.name;
      EXPECT_FALSE(column.description.empty()) << column.name;
      EXPECT_EQ(column.unit.empty(), column.kind == CellKind::kText) << column.name;
    }
    EXPECT_EQ(table.columns[0].name, "time_s");
    EXPECT_EQ(table.columns[1].name, "utc_s");
  }
}

TEST(RunTables, AUnitInANameIsTheUnit) {
  for (const TableKind& table : run_tables()) {
    for (const Column& column : table.columns) {
      const auto in_name = unit_in_name(column.name);
      EXPECT_TRUE(in_name.empty() || in_name == column.unit) << column.name;
    }
  }
}

TEST(RunTables, TheMotionInAScatterIsTheCovariates) {
  const TableKind& scatter = run_table("scatter");
  for (std::size_t i = 0; i < kCovariates; ++i) {
    EXPECT_EQ(scatter.columns[2 + i].name, covariate_name(i));
    EXPECT_EQ(scatter.columns[2 + i].unit, covariate_unit(i));
  }
}

TEST(RunTables, AHeaderIsItsNames) {
  EXPECT_EQ(csv_header(run_table("errors")),
            "time_s,utc_s,counter,e_gyro_x_radps,e_gyro_y_radps,e_gyro_z_radps,e_accel_x_mps2,e_accel_y_mps2,"
            "e_accel_z_mps2,regime\n");
}

TEST(TableFile, KnowsATableByItsName) {
  EXPECT_EQ(table_file("navigation.csv")->kind->stem, "navigation");
  EXPECT_EQ(table_file("smoothed_navigation.csv")->kind->stem, "smoothed_navigation");
  EXPECT_EQ(table_file("smoothed_mtx1.csv")->device, "mtx1");
  EXPECT_EQ(table_file("errors_a_b-1.csv")->device, "a_b-1");
  for (const char* other : {"errors_.csv", "errors.csv", "errors_a b.csv", "errors_../x.csv",
                            "navigation.csv.gz", "truth.csv", ".csv", "", "navigation_mtx1.csv"}) {
    EXPECT_FALSE(table_file(other)) << other;
  }
}

TEST(UnitInName, IsNotTheFrameInAName) {
  EXPECT_EQ(unit_in_name("r_bs_b_sd_m"), "m");
  EXPECT_EQ(unit_in_name("t_d_s"), "s");
  EXPECT_EQ(unit_in_name("gyro_bias_radps"), "rad/s");
  EXPECT_EQ(unit_in_name("boresight_sd_deg"), "deg");
  for (const char* without : {"C_b_s", "q_b_s", "name", "", "s", "m", "samples"})
    EXPECT_EQ(unit_in_name(without), "") << without;
}

}  // namespace
}  // namespace imuscope::tables
