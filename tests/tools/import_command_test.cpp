/// `imuscope import`: recordings of all kinds into one capture that replays to the same estimates.

#include <unistd.h>

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

TEST(ImportCommand, AnRtkSolutionFileReplaysToTheSameFilesAsItsCapture) {
  IMUSCOPE_NEEDS_SHARED("data/rtk_drive/gnss.pos");
  const auto folder = scratch_folder();
  const auto data = [](const char* name) {
    return shared_path(std::string("data/rtk_drive/") + name).string();
  };
  const std::string inputs =
      "reference=" + data("imu.csv") + " again=" + data("imu.csv") + " gnss=" + data("gnss.pos");
  const std::string config = " --config '" + source_path("config/rtklib_drive.toml").string() + "'";
  const auto imported = run_in(folder, "imuscope", "import --out drive.lcm " + inputs + config);
  ASSERT_EQ(imported.exit_code, 0) << imported.err;
  EXPECT_THAT(imported.out,
              HasSubstr("557772 bytes in 2197 reads"));  // wc -c, and its lines that are no comment
  const auto replayed = run_in(folder, "imuscope", "replay drive.lcm --out captured");
  ASSERT_EQ(replayed.exit_code, 0) << replayed.err;
  const auto direct = run_in(folder, "imuscope", "replay " + inputs + config + " --out direct");
  ASSERT_EQ(direct.exit_code, 0) << direct.err;
  for (const char* name : {"navigation.csv", "calibration_again.csv", "errors_again.csv"})
    expect_same_file(folder / "captured" / name, folder / "direct" / name);
}

// A receiver's log through Debian's rtklib, and its solution beside IMUs that were recorded at the same time.
TEST(ImportCommand, ASolutionOfRnx2rtkpIsFoundAndBroughtToTheReferenceByItsUtc) {
  IMUSCOPE_NEEDS_SHARED("data/streams/greis/javad.jps");
  if (!fs::exists("/usr/bin/rnx2rtkp") || !fs::exists("/usr/bin/convbin"))
    GTEST_SKIP() << "needs rnx2rtkp and convbin of the Debian package rtklib";
  const auto folder = scratch_folder();
  const auto log = shared_path("data/streams/greis/javad.jps").string();
  const std::string solve =
      "cd '" + folder.string() + "' && cp '" + log + "' rover.jps && " +
      "/usr/bin/convbin -r javad -v 3.03 -od -os -o rover.obs -n rover.nav rover.jps && " +
      "/usr/bin/rnx2rtkp -p 0 -t -o rover.pos rover.obs rover.nav";
  ASSERT_EQ(std::system(("(" + solve + ") > '" + (folder / "solve.log").string() + "' 2>&1").c_str()), 0)
      << content_of(folder / "solve.log");
  // The log is of 2011-01-15, 02:26:43 to 02:28:52 GPS time, which was 15 s ahead of UTC.
  std::string config = content_of(source_path("config/demo.toml"));
  const std::string key = "duration_s = 900.0";
  ASSERT_NE(config.find(key), std::string::npos);
  config.replace(config.find(key), key.size(), "duration_s = 150.0\nstart_utc = 2011-01-15T02:26:20Z");
  std::ofstream(folder / "vehicle.toml") << config;
  ASSERT_EQ(run_in(folder, "imusim", "record vehicle.toml --out recorded").exit_code, 0);
  for (const char* name : {"airins.bin", "mtx1.bin"}) fs::rename(folder / "recorded" / name, folder / name);

  const auto imported =
      run_in(folder, "imuscope", "import --out all.lcm airins=airins.bin mtx1=mtx1.bin gnss=rover.pos");
  ASSERT_EQ(imported.exit_code, 0) << imported.err;
  EXPECT_THAT(imported.out, testing::ContainsRegex("gnss .*in 130 reads; times: UTC tags"));
  ASSERT_EQ(run_in(folder, "imuscope", "replay all.lcm --out run").exit_code, 0);
  const auto run = nlohmann::json::parse(content_of(folder / "run" / "run.json"));
  const auto& gnss = run["devices"][2];
  EXPECT_EQ(gnss["name"], "gnss");
  EXPECT_EQ(gnss["protocol"], "rtklib_pos");
  EXPECT_EQ(gnss["samples"], 130);
  EXPECT_EQ(gnss["samples_lost"], 0) << "the draft has the file's own rate, one solution a second";
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
