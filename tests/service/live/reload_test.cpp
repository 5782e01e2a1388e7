#include "service/live/reload.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <fstream>

#include "tests/support/shared_data.h"
#include "tests/support/two_devices.h"

namespace imuscope {
namespace {

using test::kTwoDevices;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class ReloadTest : public testing::Test {
 protected:
  void write(const std::string& text) const { std::ofstream(file_) << text; }
  std::filesystem::path file_ = test::scratch_folder() / "car.toml";
};

TEST_F(ReloadTest, BusAndNoiseChangeAtOnceTheRestIsNamed) {
  write(std::string("[lcm]\nchannel_prefix = \"A\"\n") + kTwoDevices);
  const auto running = load_configuration(file_);
  ASSERT_TRUE(running);
  write(std::string("[lcm]\nchannel_prefix = \"B\"\n[noise]\nmodel = \"WN\"\nrefit_interval_s = 5.0\n"
                    "[estimator]\nstates = \"paper\"\n") +
        kTwoDevices + "rate_hz = 50.0\n");
  const auto reload = reload_configuration(*running);
  ASSERT_TRUE(reload) << reload.error().text();
  EXPECT_EQ(reload->tunables.lcm.channel_prefix, "B");
  EXPECT_EQ(reload->tunables.model.name(), "WN");
  EXPECT_DOUBLE_EQ(reload->tunables.noise.refit_interval_s, 5.0);
  EXPECT_THAT(reload->at_next_start, ElementsAre("device", "estimator"));
}

TEST_F(ReloadTest, CommentsAndOrderAreNoChange) {
  write(kTwoDevices);
  const auto running = load_configuration(file_);
  ASSERT_TRUE(running);
  write(std::string("# a comment\n") + kTwoDevices);
  const auto reload = reload_configuration(*running);
  ASSERT_TRUE(reload);
  EXPECT_THAT(reload->at_next_start, IsEmpty());
}

TEST_F(ReloadTest, AFileThatIsWrongNowIsAnErrorWithItsLine) {
  write(kTwoDevices);
  const auto running = load_configuration(file_);
  ASSERT_TRUE(running);
  write("[lcm]\nurll = 1\n" + std::string(kTwoDevices));
  const auto reload = reload_configuration(*running);
  ASSERT_FALSE(reload);
  EXPECT_THAT(reload.error().text(), HasSubstr("car.toml:2"));
  write("[noise]\nmodel = \"nonsense\"\n" + std::string(kTwoDevices));
  EXPECT_FALSE(reload_configuration(*running));
  std::filesystem::remove(file_);
  EXPECT_FALSE(reload_configuration(*running));
}

}  // namespace
}  // namespace imuscope
