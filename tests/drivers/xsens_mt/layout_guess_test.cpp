#include "drivers/xsens_mt/layout_guess.h"

#include <gtest/gtest.h>

#include "drivers/xsens_mt/scanner.h"
#include "tests/drivers/support/streams.h"
#include "tests/support/shared_data.h"

namespace imuscope::xsens {
namespace {

TEST(MtLayoutGuess, FindsTheLayoutOfEveryLegacyVectorWithSensibleNumbers) {
  const auto vectors = test::load_vectors(test::source_path("tests/vectors/xsens_mtdata.hex"));
  const auto oracle = test::load_json(test::source_path("tests/vectors/xsens_mtdata.json"));
  int guessed = 0;
  for (const auto& v : oracle["vectors"]) {
    const auto name = v["name"].get<std::string>();
    // Corner values are no measurement, and an Xbus Master's message is not one device's.
    if (!v.contains("output_mode") || name.rfind("corner_", 0) == 0) continue;
    SCOPED_TRACE(name);
    Scanner scanner;
    scanner.append(test::vector_named(vectors, name), HostTime{});
    Frame frame;
    ASSERT_TRUE(scanner.next(frame, true));
    const auto guess = guess_layout({frame.data});
    ASSERT_TRUE(guess);
    MtData expected;
    MtData read;
    ASSERT_TRUE(read_mtdata(frame.data, {v["output_mode"], v["output_settings"]}, expected));
    ASSERT_TRUE(read_mtdata(frame.data, *guess, read));
    EXPECT_EQ(read.fields, expected.fields);
    EXPECT_EQ(guess->format(), (DataLayout{v["output_mode"], v["output_settings"]}.format()));
    ++guessed;
  }
  EXPECT_EQ(guessed, 21);
}

TEST(MtLayoutGuess, GivesNothingWhereNoReadingMakesSense) {
  const std::vector<std::uint8_t> nonsense(37, 0xFF);
  EXPECT_FALSE(guess_layout({nonsense}));
  EXPECT_FALSE(guess_layout({}));
}

}  // namespace
}  // namespace imuscope::xsens
