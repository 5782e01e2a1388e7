/// A run folder from somebody else may say anything: what is made of it stays inside, and starts nothing.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>

#include "results/report/gnuplot.h"
#include "results/report/paper_figures.h"
#include "results/report/report.h"
#include "results/tables/json_file.h"
#include "tests/results/report/synthetic_run.h"
#include "tests/support/file_content.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

using nlohmann::json;
using report::GnuplotText;
using testing::HasSubstr;

constexpr const char* kDrawingProgram = "/usr/bin/gnuplot";

class HostileRun : public testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::create_directories(run_);
    test::SyntheticRun options;
    options.names = {"mtx1"};
    test::write_synthetic_run(run_, options);
  }

  void forge(const char* file, const std::function<void(json&)>& change) const {
    json document = json::parse(test::content_of(run_ / file));
    change(document);
    std::ofstream(run_ / file) << document.dump();
  }

  /// Every fit gets this regime, this unit and these words.
  void forge_fits(const std::string& text) const {
    forge("models.json", [&](json& document) {
      for (json& fit : document.at("models")) {
        for (const char* key : {"regime", "unit", "model"}) fit[key] = text;
      }
    });
  }

  std::filesystem::path scratch_ = test::scratch_folder();
  std::filesystem::path run_ = scratch_ / "one" / "run";
};

TEST(GnuplotText, IsOneStringOfGnuplotWhateverIsInIt) {
  EXPECT_EQ(GnuplotText("calm").str(), "'calm'");
  EXPECT_EQ(GnuplotText("it's '' all").str(), "'it\u2019s \u2019\u2019 all'");
  EXPECT_EQ(GnuplotText("calm\n!command\r\v\f").str(), "'calm?!command??\?'");
  EXPECT_EQ(GnuplotText("\xff\u0085").str(), "'?\?'");
}

TEST_F(HostileRun, FiguresStartNoProgram) {
  if (!std::filesystem::exists(kDrawingProgram))
    GTEST_SKIP() << "needs " << kDrawingProgram << " (gnuplot-nox)";
  const std::string mark = (scratch_ / "started").string();
  const std::string touch = "touch " + mark;
  std::filesystem::create_directories(run_ / "figures");
  std::ofstream(run_ / "figures" / ".gnuplot") << "!" << touch << '\n';
  std::ofstream(run_ / "figures" / "gnuplotrc") << "!" << touch << '\n';
  for (const std::string& text :
       {"calm\n!" + touch + "\n", "calm\r!" + touch + "\r", "'\n!" + touch + "\n#", "`" + touch + "`",
        "'.system('" + touch + "').'", "\"`" + touch + "`\"", "\\'; !" + touch + " #",
        "@x ' ; system('" + touch, "EOD\n!" + touch, "${x} {/:Bold " + touch + "}"}) {
    forge_fits(text);
    const auto files = write_figures(run_);
    ASSERT_TRUE(files) << text << ": " << files.error().text();
    EXPECT_FALSE(std::filesystem::exists(mark)) << text;
  }
}

TEST_F(HostileRun, ANameOfAnImuLeadsNoFileOutOfTheFolder) {
  for (const char* name : {"../../away", "/tmp/away", "a/b", "..", "", "a\nb", "mtx1.csv", "\xff"}) {
    const auto calibration = test::content_of(run_ / "calibration.json");
    forge("calibration.json", [&](json& document) { document.at("imus").at(0)["name"] = "NAME"; });
    // Not by way of the JSON library, which refuses to write what is not UTF-8.
    std::string forged = test::content_of(run_ / "calibration.json");
    std::string escaped;
    for (const char c : std::string_view(name)) escaped += c == '\n' ? std::string("\\n") : std::string(1, c);
    forged.replace(forged.find("NAME"), 4, escaped);
    std::ofstream(run_ / "calibration.json") << forged;
    const auto page = write_report(run_);
    ASSERT_FALSE(page) << name;
    EXPECT_THAT(page.error().what, HasSubstr("calibration.json")) << name;
    EXPECT_FALSE(write_figures(run_)) << name;
    std::ofstream(run_ / "calibration.json") << calibration;
  }
  EXPECT_TRUE(write_report(run_)) << "the folder as it was";
  for (const auto& entry : std::filesystem::recursive_directory_iterator(scratch_))
    EXPECT_EQ(entry.path().filename().string().find("away"), std::string::npos) << entry.path();
}

TEST_F(HostileRun, TextsOfADocumentAreLinesWithoutWhatATerminalObeys) {
  forge("run.json", [](json& document) {
    document["problem\x1b[2J"] = "one\ntwo\x1b]0;title\a";
    document["configuration_text"] = "[run]\nname = \"\x1b[31m\"\n";
    document["long"] = std::string(100'000, 'x');
  });
  const json document = tables::read_json_file(run_ / "run.json");
  ASSERT_TRUE(document.is_object());
  EXPECT_EQ(document.at("problem?[2J"), "one?two?]0;title?");
  EXPECT_EQ(document.at("configuration_text"), "[run]\nname = \"?[31m\"\n");
  EXPECT_EQ(document.at("long").get<std::string>().size(), 4096U);
}

TEST_F(HostileRun, ADocumentNestedWithoutEndIsRefusedBeforeItTakesTheStack) {
  constexpr std::size_t kDeep = 2'000'000;
  std::ofstream(run_ / "models.json")
      << R"({"models":)" << std::string(kDeep, '[') << std::string(kDeep, ']') << "}";
  const auto page = write_report(run_);
  ASSERT_FALSE(page);
  EXPECT_THAT(page.error().what, HasSubstr("models.json"));
  std::ofstream(run_ / "models.json") << R"({"models":[],"words":")" << std::string(kDeep, '[') << "\"}";
  EXPECT_TRUE(write_report(run_)) << "brackets inside a text are none";
}

TEST_F(HostileRun, ALinkInTheFolderLeadsNoWriteOut) {
  if (!std::filesystem::exists(kDrawingProgram))
    GTEST_SKIP() << "needs " << kDrawingProgram << " (gnuplot-nox)";
  const auto victim = scratch_ / "victim";
  std::ofstream(victim) << "precious";
  std::filesystem::create_directories(run_ / "figures");
  for (const char* name : {"report.html", "report.html.unfinished", "figures/drive.gp", "figures/drive.svg",
                           "figures/drive.pdf", "figures/figure4_mtx1.svg"})
    std::filesystem::create_symlink(victim, run_ / name);
  ASSERT_TRUE(write_report(run_));
  ASSERT_TRUE(write_figures(run_));
  EXPECT_EQ(test::content_of(victim), "precious");
  EXPECT_FALSE(std::filesystem::is_symlink(run_ / "figures" / "drive.svg"));
  for (const auto& entry : std::filesystem::directory_iterator(run_ / "figures"))
    EXPECT_FALSE(entry.is_directory()) << "left behind: " << entry.path();

  std::filesystem::remove_all(run_ / "figures");
  std::filesystem::create_directories(scratch_ / "elsewhere");
  std::filesystem::create_symlink(scratch_ / "elsewhere", run_ / "figures");
  const auto files = write_figures(run_);
  ASSERT_FALSE(files);
  EXPECT_THAT(files.error().what, HasSubstr("is a link"));
  EXPECT_TRUE(std::filesystem::is_empty(scratch_ / "elsewhere"));
}

}  // namespace
}  // namespace imuscope
