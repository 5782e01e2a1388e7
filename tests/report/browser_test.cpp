#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <fstream>

#include "report/report.h"
#include "tests/report/synthetic_run.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

constexpr const char* kBrowser = "/usr/bin/chromium";

/// What `command` writes to its standard output.
std::string output_of(const std::string& command) {
  std::string output;
  FILE* pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) return output;
  std::array<char, 65536> block{};
  for (std::size_t n = 0; (n = fread(block.data(), 1, block.size(), pipe)) > 0;)
    output.append(block.data(), n);
  pclose(pipe);
  return output;
}

std::string browser_command(const std::filesystem::path& profile, const std::string& options,
                            const std::filesystem::path& page) {
  return std::string(kBrowser) +
         " --headless --no-sandbox --disable-gpu --no-first-run --disable-background-networking "
         "--user-data-dir='" +
         profile.string() + "' " + options + " 'file://" + page.string() + "' 2>/dev/null";
}

class Browser : public testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(kBrowser)) {
      GTEST_SKIP() << "needs " << kBrowser << " (Debian package chromium), which is absent here";
    }
    folder_ = test::scratch_folder();
    test::write_synthetic_run(folder_, {});
    const auto written = write_report(folder_);
    ASSERT_TRUE(written) << written.error().text();
  }
  std::filesystem::path folder_;
};

TEST_F(Browser, DrawsEveryFigureWithoutAnErrorInTheScript) {
  const std::string page = output_of(browser_command(
      folder_ / "profile", "--virtual-time-budget=20000 --dump-dom", folder_ / "report.html"));
  // Speed, height and two sensors of 33 panels are graphs; the map is a drawing of its own.
  EXPECT_NE(page.find("data-figures-drawn=\"68\""), std::string::npos);
  EXPECT_NE(page.find("<svg viewBox="), std::string::npos);
}

TEST_F(Browser, TakesPicturesAtDesktopAndPhoneWidth) {
  for (const char* size : {"1280,4000", "500,4000"}) {
    const auto picture = folder_ / (std::string("page_") + size + ".png");
    output_of(browser_command(
        folder_ / "profile",
        "--virtual-time-budget=20000 --screenshot='" + picture.string() + "' --window-size=" + size,
        folder_ / "report.html"));
    ASSERT_TRUE(std::filesystem::exists(picture));
    EXPECT_GT(std::filesystem::file_size(picture), 50'000U) << "an empty page compresses to less";
  }
}

}  // namespace
}  // namespace imuscope
