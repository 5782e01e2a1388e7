#include "service/run/modeller.h"

#include <gtest/gtest.h>

#include <fstream>
#include <random>

#include "service/run/models_file.h"
#include "tests/support/error_rows.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

using test::fed;
using test::row_of;
using test::two_devices;

TEST(NewestModels, AreThoseOfTheLastRefitOfEverySensorInTheFile) {
  ModelBook book(two_devices(), *noise::parse_model("WN"));
  std::mt19937 random(29);
  std::int64_t counter = 0;
  NewestModels newest;
  newest.take(fed(book, counter, 10, 1.0, random));
  const auto last = fed(book, counter, 10, 1.0, random);
  newest.take(last);
  const auto folder = test::scratch_folder();
  ASSERT_TRUE(newest.write(*OutputFolder::open(folder)));
  std::ifstream file(folder / "models.json");
  const auto models = nlohmann::json::parse(file).at("models");
  ASSERT_EQ(models.size(), kAxisCount);
  const auto read = read_model(models, "s", 5, "static");
  ASSERT_TRUE(read) << read.error().text();
  EXPECT_EQ(read->n, 2000U);
  EXPECT_EQ(read->parameters.at(0).value, last.axes[5].fit->parameters.at(0).value);
  EXPECT_EQ(models[5].at("unit"), "m/s^2");
  EXPECT_FALSE(read_model(models, "s", 5, "dynamic"));
}

TEST(Modeller, LosesNoRowWhileItsThreadDoesNotGetToRun) {
  Modeller modeller(two_devices(), *noise::parse_model("WN"));
  std::mt19937 random(4);
  constexpr int kRows = 60'030;  // ten minutes at 100 Hz, and a block that is not full
  for (int i = 0; i < kRows; ++i) modeller.add({0, HostTime{}, row_of(i, Regime::kDynamic, random)});
  EXPECT_EQ(modeller.rows().refused, 0U);
  EXPECT_GE(modeller.rows().level, 60'000U - 64U);
  modeller.start({"modeller", Scheduling::kIdle, 0, {}});
  modeller.stop();
  const auto refits = modeller.take();
  ASSERT_EQ(refits.size(), 60U) << "one for every 10 s of samples";
  EXPECT_EQ(refits.back().samples, 60'000);
}

TEST(Modeller, CountsEachRowThatFoundNoRoom) {
  Modeller modeller(two_devices(), *noise::parse_model("WN"));
  const ErrorRecord record{0, HostTime{}, ErrorRow{}};
  constexpr std::size_t kTooMany = 100;  // one block, and one that is not full
  for (std::size_t i = 0; i < Modeller::row_capacity() + kTooMany; ++i) modeller.add(record);
  EXPECT_EQ(modeller.rows().refused, 64U);
  modeller.stop();
  EXPECT_EQ(modeller.rows().refused, kTooMany);
  EXPECT_EQ(modeller.rows().pushed, Modeller::row_capacity());
  EXPECT_EQ(modeller.rows().level, Modeller::row_capacity());
}

}  // namespace
}  // namespace imuscope
