// docs/pitfalls.md promises a test for each trouble: the tests must be there.
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <regex>
#include <set>
#include <string>

#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

/// "Suite.Name" of every test in the tree.
std::set<std::string> tests_in_the_tree() {
  const std::regex test("TEST(?:_F|_P)?\\(\\s*(\\w+),\\s*(\\w+)\\)");
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(source_path("tests"))) {
    if (entry.path().extension() != ".cpp") continue;
    std::ifstream in(entry.path());
    const std::string text(std::istreambuf_iterator<char>(in), {});
    for (std::sregex_iterator found(text.begin(), text.end(), test), end; found != end; ++found) {
      names.insert((*found)[1].str() + "." + (*found)[2].str());
    }
  }
  return names;
}

TEST(DecoderPitfalls, EveryNamedTestExists) {
  std::ifstream in(source_path("docs/pitfalls.md"));
  ASSERT_TRUE(in);
  const std::string text(std::istreambuf_iterator<char>(in), {});
  const auto tests = tests_in_the_tree();
  const std::regex name("`(\\w+\\.\\w+)`");
  int named = 0;
  for (std::sregex_iterator found(text.begin(), text.end(), name), end; found != end; ++found) {
    ++named;
    EXPECT_TRUE(tests.contains((*found)[1].str())) << (*found)[1].str() << " is named and not there";
  }
  EXPECT_GT(named, 60);
}

}  // namespace
}  // namespace imuscope::test
