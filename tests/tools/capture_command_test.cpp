/// `imuscope capture`: checks what a recording is worth and copies what is whole.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/support/file_content.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

struct Outcome {
  int exit_code;
  std::string out;
  std::string err;
};

Outcome imuscope_in(const fs::path& folder, const std::string& arguments) {
  const std::string line = "cd '" + folder.string() + "' && '" + program_path("imuscope").string() + "' " +
                           arguments + " >stdout.txt 2>stderr.txt </dev/null";
  const int status = std::system(line.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, content_of(folder / "stdout.txt"),
          content_of(folder / "stderr.txt")};
}

/// A folder with golden.lcm, which was recorded by a version without checksums.
fs::path with_golden_capture() {
  auto folder = scratch_folder();
  const std::string unpack = "gzip -dc '" + source_path("tests/golden/capture.lcm.gz").string() + "' > '" +
                             (folder / "golden.lcm").string() + "'";
  EXPECT_EQ(std::system(unpack.c_str()), 0);
  return folder;
}

void flip_byte(const fs::path& path, std::uintmax_t at) {
  std::fstream file(path, std::ios::binary | std::ios::in | std::ios::out);
  file.seekg(static_cast<std::streamoff>(at));
  const char byte = static_cast<char>(file.get() ^ 1);
  file.seekp(static_cast<std::streamoff>(at));
  file.put(byte);
}

TEST(CaptureCommand, ACaptureWithoutChecksumsIsReadAsBeforeAndItsCopyHasThem) {
  const auto folder = with_golden_capture();
  const auto old = imuscope_in(folder, "capture check golden.lcm");
  EXPECT_EQ(old.exit_code, 0) << old.out << old.err;
  EXPECT_THAT(old.out, HasSubstr("of a version without checksums"));
  const auto repaired = imuscope_in(folder, "capture repair golden.lcm --out new.lcm");
  ASSERT_EQ(repaired.exit_code, 0) << repaired.err;
  const auto whole = imuscope_in(folder, "capture check new.lcm");
  EXPECT_EQ(whole.exit_code, 0) << whole.out;
  EXPECT_THAT(whole.out, HasSubstr("as it was recorded"));
  ASSERT_EQ(imuscope_in(folder, "replay golden.lcm --out a").exit_code, 0);
  ASSERT_EQ(imuscope_in(folder, "replay new.lcm --out b").exit_code, 0);
  EXPECT_EQ(content_of(folder / "a" / "calibration.json"), content_of(folder / "b" / "calibration.json"));
}

TEST(CaptureCommand, DamageIsToldWithWhatItCostsByTheCheckTheReplayAndTheRunsRecord) {
  const auto folder = with_golden_capture();
  ASSERT_EQ(imuscope_in(folder, "capture repair golden.lcm --out new.lcm").exit_code, 0);
  const auto size = fs::file_size(folder / "new.lcm");
  flip_byte(folder / "new.lcm", size / 2);
  const auto check = imuscope_in(folder, "capture check new.lcm");
  EXPECT_EQ(check.exit_code, 1);
  EXPECT_THAT(check.out, HasSubstr("differs from what was recorded"));
  EXPECT_THAT(check.err, HasSubstr("is not whole"));
  ASSERT_EQ(imuscope_in(folder, "replay new.lcm --out a").exit_code, 0);
  const auto run = nlohmann::json::parse(content_of(folder / "a" / "run.json"));
  EXPECT_FALSE(run.at("warnings").empty()) << "nothing in run.json says that the capture is damaged";
  fs::resize_file(folder / "new.lcm", size / 3);
  const auto cut = imuscope_in(folder, "capture check new.lcm");
  EXPECT_EQ(cut.exit_code, 1);
  EXPECT_THAT(cut.out, HasSubstr("the recorder was cut off"));
  EXPECT_EQ(imuscope_in(folder, "capture repair new.lcm").exit_code, 0);
  EXPECT_EQ(imuscope_in(folder, "capture check new_repaired.lcm").exit_code, 0);
}

TEST(CaptureCommand, WhatWasRepairedIsNotSentToBeRepairedAgain) {
  const auto folder = with_golden_capture();
  flip_byte(folder / "golden.lcm", fs::file_size(folder / "golden.lcm") / 3);
  EXPECT_THAT(imuscope_in(folder, "capture check golden.lcm").err, HasSubstr("capture repair"));
  ASSERT_EQ(imuscope_in(folder, "capture repair golden.lcm --out new.lcm").exit_code, 0);
  const auto repaired = imuscope_in(folder, "capture check new.lcm");
  ASSERT_EQ(repaired.exit_code, 1) << repaired.out;
  EXPECT_THAT(repaired.err, HasSubstr("what it has is whole"));
  EXPECT_THAT(repaired.err, Not(HasSubstr("capture repair")));
}

TEST(CaptureCommand, AFileThatIsMissingIsNoReasonToRepair) {
  const auto folder = with_golden_capture();
  fs::copy_file(folder / "golden.lcm", folder / "golden_002.lcm");
  const auto checked = imuscope_in(folder, "capture check golden.lcm");
  ASSERT_EQ(checked.exit_code, 1) << checked.out;
  EXPECT_THAT(checked.out, HasSubstr("golden_001.lcm"));
  EXPECT_THAT(checked.err, HasSubstr("what it has is whole"));
  EXPECT_THAT(checked.err, Not(HasSubstr("capture repair")));
}

TEST(CaptureCommand, WhatIsNoCaptureIsNamed) {
  const auto folder = scratch_folder();
  std::ofstream(folder / "text.lcm") << "hello";
  const auto refused = imuscope_in(folder, "capture check text.lcm");
  EXPECT_NE(refused.exit_code, 0);
  EXPECT_THAT(refused.err, HasSubstr("text.lcm"));
  EXPECT_NE(imuscope_in(folder, "capture check absent.lcm").exit_code, 0);
  EXPECT_EQ(imuscope_in(folder, "capture").exit_code, 2);
}

}  // namespace
}  // namespace imuscope::test
