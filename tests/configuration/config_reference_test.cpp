#include "configuration/config_reference.h"

#include <gmock/gmock.h>
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <regex>
#include <set>
#include <sstream>
#include <string>

#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

std::string text_of(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

TEST(ConfigReference, EveryKeyHasItsSentence) {
  const auto keys = configuration_reference();
  ASSERT_FALSE(keys.empty());
  for (const auto& key : keys) EXPECT_FALSE(key.about.empty()) << key.name;
}

TEST(ConfigReference, EverySentenceHasItsKey) { EXPECT_THAT(sentences_without_key(), testing::IsEmpty()); }

TEST(ConfigReference, PresetsAreThoseThatHold) {
  const auto keys = configuration_reference();
  const auto find = [&](const std::string& name) {
    return *std::find_if(keys.begin(), keys.end(), [&](const auto& key) { return key.name == name; });
  };
  EXPECT_THAT(find("device.rate_hz").presets, testing::UnorderedElementsAre("100", "10", "50", "1"));
  EXPECT_THAT(find("device.axes").presets, testing::UnorderedElementsAre("\"+x -y -z\"", "\"+x +y +z\""));
  EXPECT_THAT(find("noise.model").presets, testing::ElementsAre("\"WN+2*GM\""));
  EXPECT_TRUE(find("device.role").required);
  EXPECT_FALSE(find("device.rate_hz").required);
  EXPECT_EQ(find("device.transport.kind").values, "\"serial\", \"tcp\", \"udp\", \"can\", \"pps\"");
}

// A branch of a reader that no configuration of the reference leads into would leave its keys out.
TEST(ConfigReference, NoReaderIsPassedBy) {
  std::set<std::string> known;
  for (const auto& key : configuration_reference()) known.insert(key.name.substr(key.name.rfind('.') + 1));
  const std::regex asks(
      R"re(\.(?:text|texts|boolean|number|numbers|integer|vector|choice|node)\(\s*"(\w+)")re");
  std::size_t count = 0;
  for (const auto* name : {"config.cpp", "config_devices.cpp", "config_vehicle.cpp"}) {
    const auto source = text_of(test::source_path("src/configuration") / name);
    for (std::sregex_iterator found(source.begin(), source.end(), asks), end; found != end; ++found, ++count)
      EXPECT_TRUE(known.count((*found)[1])) << (*found)[1] << " of " << name;
  }
  EXPECT_GT(count, 80U);
}

}  // namespace
}  // namespace imuscope
