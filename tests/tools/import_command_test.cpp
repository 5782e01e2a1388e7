/// `imuscope import`: recordings of all kinds into one capture that replays to the same estimates.

#include <unistd.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

std::string content_of(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

struct Outcome {
  int exit_code;
  std::string out;
  std::string err;
};

Outcome run_in(const fs::path& folder, const std::string& program, const std::string& arguments) {
  const std::string line = "cd '" + folder.string() + "' && '" + program_path(program).string() + "' " +
                           arguments + " >stdout.txt 2>stderr.txt </dev/null";
  const int status = std::system(line.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, content_of(folder / "stdout.txt"),
          content_of(folder / "stderr.txt")};
}

/// One recorded drive for all tests of this process: 3 minutes, the first of them at rest. CTest runs each
/// test in a process of its own, side by side.
const fs::path& drive() {
  static const fs::path folder = [] {
    fs::path made = fs::path(program_path("imusim")).parent_path().parent_path() / "scratch" /
                    ("import_drive_" + std::to_string(getpid()));
    fs::remove_all(made);
    fs::create_directories(made);
    const auto recorded = run_in(
        made, "imusim", "record '" + source_path("config/demo.toml").string() + "' --minutes 3 --out .");
    EXPECT_EQ(recorded.exit_code, 0) << recorded.err;
    return made;
  }();
  return folder;
}

constexpr const char* kAll = "airins=airins.bin mtx1=mtx1.bin mtx2=mtx2.bin mtx3=mtx3.bin gnss=gnss.bin";

/// A folder that holds the drive's dumps without their arrivals.
fs::path without_arrivals(const fs::path& folder) {
  for (const char* name : {"airins", "mtx1", "mtx2", "mtx3", "gnss"})
    fs::copy_file(drive() / (std::string(name) + ".bin"), folder / (std::string(name) + ".bin"));
  return folder;
}

void expect_same_file(const fs::path& a, const fs::path& b) {
  const std::string text = content_of(a);
  EXPECT_GT(text.size(), 1000U) << a;
  EXPECT_TRUE(text == content_of(b)) << a << " and " << b << " differ";
}

TEST(ImportCommand, ACaptureOfDumpsReplaysToTheSameFilesAsTheDumpsAndTheSimulatorsCapture) {
  const auto folder = scratch_folder();
  const std::string files = std::string(kAll);
  const auto imported =
      run_in(drive(), "imuscope",
             "import " + files + " --config config.toml --out '" + (folder / "imported.lcm").string() + "'");
  ASSERT_EQ(imported.exit_code, 0) << imported.err;
  const auto replay = [&](const std::string& inputs, const std::string& out) {
    const auto done =
        run_in(drive(), "imuscope", "replay " + inputs + " --out '" + (folder / out).string() + "'");
    EXPECT_EQ(done.exit_code, 0) << done.err;
  };
  replay("'" + (folder / "imported.lcm").string() + "'", "imported");
  replay("capture.lcm", "captured");
  replay(files + " --config config.toml", "dumps");
  for (const char* name : {"navigation.csv", "calibration_mtx1.csv", "errors_mtx3.csv"}) {
    expect_same_file(folder / "imported" / name, folder / "dumps" / name);
    expect_same_file(folder / "captured" / name, folder / "dumps" / name);
  }
}

TEST(ImportCommand, DumpsWithoutArrivalsAndWithoutConfigurationBecomeACaptureThatReplays) {
  const auto folder = without_arrivals(scratch_folder());
  const auto imported = run_in(folder, "imuscope", std::string("import --out all.lcm ") + kAll);
  ASSERT_EQ(imported.exit_code, 0) << imported.err;
  EXPECT_THAT(imported.err, HasSubstr("drafted"));
  EXPECT_THAT(imported.out, HasSubstr("angular rate against the reference's"));
  EXPECT_THAT(imported.out, HasSubstr("UTC tags"));
  const auto replayed = run_in(folder, "imuscope", "replay all.lcm --out run");
  ASSERT_EQ(replayed.exit_code, 0) << replayed.err;
  // Mountings are found as they are: within four of their own standard deviations.
  const auto truth = nlohmann::json::parse(content_of(drive() / "truth.json"));
  const auto found = nlohmann::json::parse(content_of(folder / "run" / "calibration.json"));
  for (std::size_t i = 0; i < 3; ++i) {
    const auto& imu = found["imus"][i];
    ASSERT_EQ(imu["name"], truth["imus"][i]["name"]);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double error_m =
          imu["r_bs_b_m"][axis].get<double>() - truth["imus"][i]["r_bs_b_m"][axis].get<double>();
      EXPECT_LT(std::abs(error_m), 4.0 * imu["r_bs_b_sd_m"][axis].get<double>())
          << imu["name"] << " " << axis;
    }
  }
}

TEST(ImportCommand, TheHeaderOfAnMtbIsPassedOver) {
  const auto folder = without_arrivals(scratch_folder());
  // A header of text and of bytes that look like the beginning of messages, one of them with a right
  // checksum.
  std::string header = "XSensBinaryLog v1\r\n";
  header += std::string("\xFA\xFF\x32\x80", 4) + std::string(40, '\x55');
  header += std::string("\xFA\xFF\x10\x00\xF1", 5) + "end of header";
  const std::string bytes = content_of(folder / "mtx1.bin");
  std::ofstream(folder / "mtx1.MTB", std::ios::binary) << header << bytes;
  for (const char* file : {"mtx1.bin", "mtx1.MTB"}) {
    const auto imported = run_in(folder, "imuscope",
                                 std::string("import --out ") + file + ".lcm airins=airins.bin mtx1=" + file);
    ASSERT_EQ(imported.exit_code, 0) << imported.err;
    EXPECT_THAT(imported.out, HasSubstr(std::to_string(bytes.size()) + " bytes"));
  }
  std::ofstream(folder / "empty.mtb", std::ios::binary) << header;
  const auto refused = run_in(folder, "imuscope", "import --out x.lcm airins=airins.bin mtx1=empty.mtb");
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.err, HasSubstr("empty.mtb: no XSens message follows its header"));
}

TEST(ImportCommand, SaysWhatCannotBeImportedAndWhy) {
  const auto folder = without_arrivals(scratch_folder());
  const auto says = [&](const std::string& arguments, int code, const std::string& words) {
    const auto outcome = run_in(folder, "imuscope", "import " + arguments);
    EXPECT_EQ(outcome.exit_code, code) << arguments;
    EXPECT_THAT(outcome.err, HasSubstr(words));
  };
  std::ofstream(folder / "text.bin") << std::string(5000, 'x');
  says("--out x.lcm airins.bin", 2, "write NAME=FILE");
  says("--out x.lcm airins=airins.bin mtx1=none.bin", 2, "none.bin does not exist");
  says("--out x.lcm airins=airins.bin mtx1=text.bin", 1, "no message of a known protocol in text.bin");
  says("--out x.lcm airins=airins.bin", 1, "a run needs two IMUs");
  says("--out airins.bin airins=airins.bin mtx1=mtx1.bin", 1, "a capture is never overwritten");
  EXPECT_EQ(content_of(folder / "airins.bin"), content_of(drive() / "airins.bin"));
}

}  // namespace
}  // namespace imuscope::test
