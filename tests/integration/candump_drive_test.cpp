/// A drive of a car with a CAN bus: what candump logged, beside dumps of serial devices, through every
/// command that takes recordings. The truth is the simulator's.

#include <gtest/gtest.h>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iomanip>
#include <sstream>

#include "demo_vehicle.h"
#include "mounting_compare.h"
#include "programs.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

constexpr double kDeg = 180.0 / 3.14159265358979323846;
/// Published sd that a found value may be off.
constexpr double kSigmas = 4.0;

void write_text(const fs::path& file, const std::string& text) { std::ofstream(file) << text; }

/// Runs a program in `folder`, so that its files can be named as a user does.
int run_there(const fs::path& folder, const std::string& program, const std::string& arguments) {
  const std::string command = "cd '" + folder.string() + "' && '" + program_path(program).string() + "' " +
                              arguments + " >log.txt 2>&1 </dev/null";
  const int status = std::system(command.c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

std::string log_of(const fs::path& folder) { return read_text(folder / "log.txt"); }

constexpr const char* kFiles = "airins=airins.bin mtx1=mtx1.bin mti=mti.log gnss=gnss.bin wheels=wheels.log";

fs::path recorded(const std::string& configuration = read_text(source_path("config/can_vehicle.toml"))) {
  const auto folder = scratch_folder();
  fs::create_directories(folder);
  write_text(folder / "vehicle.toml", configuration);
  EXPECT_EQ(run_there(folder, "imusim", "record vehicle.toml --minutes 5 --seed 1 --out ."), 0)
      << log_of(folder);
  return folder;
}

nlohmann::json imu_of(const fs::path& file, const std::string& name) {
  const auto json = read_json(file);
  for (const auto& imu : json.at("imus")) {
    if (imu.at("name") == name) return imu;
  }
  ADD_FAILURE() << file << " holds nothing of " << name;
  return {};
}

nlohmann::json device_of(const fs::path& file, const std::string& name) {
  const auto json = read_json(file);
  for (const auto& device : json.at("devices")) {
    if (device.at("name") == name) return device;
  }
  ADD_FAILURE() << file << " holds nothing of " << name;
  return {};
}

void expect_mounting_found(const fs::path& drive, const fs::path& run, const std::string& name) {
  const auto found = imu_of(run / "calibration.json", name);
  const auto truth = imu_of(drive / "truth.json", name);
  const Vector3d psi_deg =
      kDeg * rotation_between_b(matrix_of(truth.at("C_b_s")), matrix_of(found.at("C_b_s")));
  const Vector3d r_m = vector_of(found.at("r_bs_b_m")) - vector_of(truth.at("r_bs_b_m"));
  for (int i = 0; i < 3; ++i) {
    EXPECT_LT(std::abs(psi_deg[i]), kSigmas * vector_of(found.at("boresight_sd_deg"))[i]) << name << " " << i;
    EXPECT_LT(std::abs(r_m[i]), kSigmas * vector_of(found.at("r_bs_b_sd_m"))[i]) << name << " " << i;
  }
}

/// The reference's samples come this late. A log is stamped with UTC, as the reference's tags are, so that
/// the time offset of a device in a log is its own latency, and that of a device with arrival stamps lacks
/// the reference's.
constexpr double kReferenceLatency_s = 0.001;

/// @param beyond_s  to be added to the offset between arrivals
void expect_time_offset_found(const fs::path& drive, const fs::path& run, const std::string& name,
                              double beyond_s) {
  const auto found = imu_of(run / "calibration.json", name);
  const auto truth = imu_of(drive / "truth.json", name);
  // UTC tags of 0.1 ms, and stamps of the kernel that come 30 us late on average.
  constexpr double kStamps_s = 0.1e-3;
  EXPECT_NEAR(found.at("t_d_s").get<double>(), truth.at("t_d_s").get<double>() + beyond_s,
              kSigmas * found.at("t_d_sd_s").get<double>() + kStamps_s)
      << name;
}

void expect_same_file(const fs::path& a, const fs::path& b) {
  const std::string text = read_text(a);
  EXPECT_GT(text.size(), 1000U) << a;
  EXPECT_TRUE(text == read_text(b)) << a << " and " << b << " differ";
}

std::size_t lines_in(const fs::path& file) {
  const std::string text = read_text(file);
  return static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
}

TEST(CandumpDrive, LogsBesideDumpsGiveTheMountingTheWheelsScaleAndTheRests) {
  const auto drive = recorded();
  ASSERT_EQ(
      run_there(drive, "imuscope", std::string("process ") + kFiles + " --config config.toml --out run"), 0)
      << log_of(drive);
  EXPECT_NE(log_of(drive).find("mti: times from the log's stamps, taken as UTC"), std::string::npos);
  const auto run = drive / "run";
  for (const char* name : {"mtx1", "mti"}) expect_mounting_found(drive, run, name);
  expect_time_offset_found(drive, run, "mti", -kReferenceLatency_s);
  expect_time_offset_found(drive, run, "mtx1", 0.0);

  const auto mti = device_of(run / "run.json", "mti");
  EXPECT_EQ(mti.at("frames").get<std::size_t>(), lines_in(drive / "mti.log"));
  EXPECT_EQ(mti.at("samples_lost"), 0);
  EXPECT_EQ(device_of(run / "run.json", "wheels").at("frames").get<std::size_t>(),
            lines_in(drive / "wheels.log"));

  const auto odometry = read_json(run / "run.json").at("odometry");
  EXPECT_NEAR(odometry.at("scale").get<double>(), 0.012, kSigmas * odometry.at("scale_sd").get<double>());
  EXPECT_LT(odometry.at("scale_sd").get<double>(), 0.002);
  EXPECT_GT(odometry.at("speed_used"), 10'000);
  EXPECT_GT(odometry.at("zero_velocity_used"), 1'000);
  EXPECT_NE(read_text(run / "report.html").find("Error of the wheel scale"), std::string::npos);
}

TEST(CandumpDrive, TheLogsGiveWhatTheCaptureOfTheSameDriveGives) {
  const auto drive = recorded();
  ASSERT_EQ(run_there(drive, "imuscope", "replay capture.lcm --out captured"), 0) << log_of(drive);
  ASSERT_EQ(
      run_there(drive, "imuscope", std::string("replay ") + kFiles + " --config config.toml --out logged"), 0)
      << log_of(drive);
  for (const char* name : {"airins", "mtx1", "mti", "gnss", "wheels"}) {
    EXPECT_EQ(device_of(drive / "captured" / "run.json", name).at("samples"),
              device_of(drive / "logged" / "run.json", name).at("samples"))
        << name;
  }
  const auto captured = imu_of(drive / "captured" / "calibration.json", "mti");
  const auto logged = imu_of(drive / "logged" / "calibration.json", "mti");
  // Stamps of a log are whole microseconds, and its time scale comes from tags of 0.1 ms: t_d takes that up.
  constexpr double kShare = 0.2;
  const Vector3d psi_deg =
      kDeg * rotation_between_b(matrix_of(captured.at("C_b_s")), matrix_of(logged.at("C_b_s")));
  for (int i = 0; i < 3; ++i) {
    EXPECT_LT(std::abs(psi_deg[i]), kShare * vector_of(captured.at("boresight_sd_deg"))[i]);
    EXPECT_LT(std::abs(vector_of(captured.at("r_bs_b_m"))[i] - vector_of(logged.at("r_bs_b_m"))[i]),
              kShare * vector_of(captured.at("r_bs_b_sd_m"))[i]);
  }
  EXPECT_NEAR(captured.at("t_d_s").get<double>() - logged.at("t_d_s").get<double>(), kReferenceLatency_s,
              0.1e-3);
}

TEST(CandumpDrive, ImportedLogsReplayToTheSameFilesAsTheLogs) {
  const auto drive = recorded();
  ASSERT_EQ(run_there(drive, "imuscope",
                      std::string("import --out imported.lcm ") + kFiles + " --config config.toml"),
            0)
      << log_of(drive);
  ASSERT_EQ(run_there(drive, "imuscope", "replay imported.lcm --out imported"), 0) << log_of(drive);
  ASSERT_EQ(
      run_there(drive, "imuscope", std::string("replay ") + kFiles + " --config config.toml --out logged"), 0)
      << log_of(drive);
  for (const char* file : {"navigation.csv", "odometry.csv", "errors_mti.csv", "calibration_mti.csv"})
    expect_same_file(drive / "imported" / file, drive / "logged" / file);
}

TEST(CandumpDrive, FdRemoteAndErrorFramesAndOtherInterfacesInTheLogChangeNothing) {
  const auto drive = recorded();
  // Every hundredth line has strangers before it, as on a bus with more on it.
  std::istringstream lines(read_text(drive / "mti.log"));
  std::ofstream mixed(drive / "mixed.log");
  std::size_t n = 0;
  for (std::string line; std::getline(lines, line); ++n) {
    const std::string stamp = line.substr(0, line.find(' '));
    if (n % 100 == 0) {
      mixed << stamp << " can0 123##1" << std::string(128, 'A') << '\n'
            << stamp << " can0 031#R7\n"
            << stamp << " can0 20000204#0008000000006014\n"
            << stamp << " can1 031#0102030405060F\n"
            << stamp << " can0 18FF0031#00000000000000\n";
    }
    mixed << line << '\n';
  }
  mixed.close();
  const std::string rest =
      " airins=airins.bin gnss=gnss.bin wheels=wheels.log mtx1=mtx1.bin --config config.toml";
  ASSERT_EQ(run_there(drive, "imuscope", "replay mti=mixed.log" + rest + " --out mixed"), 0) << log_of(drive);
  ASSERT_EQ(run_there(drive, "imuscope", "replay mti=mti.log" + rest + " --out plain"), 0) << log_of(drive);
  expect_same_file(drive / "mixed" / "errors_mti.csv", drive / "plain" / "errors_mti.csv");
  ASSERT_EQ(run_there(drive, "imuscope", "decode --json mixed.log"), 0);
  const std::string last = log_of(drive).substr(log_of(drive).rfind("{\"bytes_skipped") == std::string::npos
                                                    ? log_of(drive).rfind("{\"messages")
                                                    : log_of(drive).rfind("{\"bytes_skipped"));
  EXPECT_EQ(nlohmann::json::parse(last).at("messages").get<std::size_t>(), lines_in(drive / "mixed.log"));
}

TEST(CandumpDrive, AWallClockWithoutUtcIsBroughtToTheReferenceByTheMotionAndWheelsAreRefused) {
  const auto drive = recorded();
  // As `candump -tz` would have it: seconds since the beginning.
  for (const char* name : {"mti", "wheels"}) {
    std::istringstream lines(read_text(drive / (std::string(name) + ".log")));
    std::ofstream shifted(drive / (std::string(name) + "_zero.log"));
    for (std::string line; std::getline(lines, line);)
      shifted << "(" << std::fixed << std::stod(line.substr(1)) - 1773480600.0 + 100.0
              << line.substr(line.find(')')) << '\n';
  }
  ASSERT_EQ(
      run_there(drive, "imuscope",
                "replay airins=airins.bin gnss=gnss.bin mti=mti_zero.log --config config.toml --out run"),
      0)
      << log_of(drive);
  EXPECT_NE(log_of(drive).find("angular rate against the reference's"), std::string::npos) << log_of(drive);
  expect_mounting_found(drive, drive / "run", "mti");
  EXPECT_NE(
      run_there(drive, "imuscope",
                "replay airins=airins.bin mti=mti.log wheels=wheels_zero.log --config config.toml --out no"),
      0);
  EXPECT_NE(log_of(drive).find("wheels: the stamps of the log are no UTC"), std::string::npos)
      << log_of(drive);
  EXPECT_NE(log_of(drive).find("log_clock"), std::string::npos) << log_of(drive);
}

/// NTP or a person sets the PC's clock while candump runs.
TEST(CandumpDrive, AWallClockThatIsPutBackIsToldAndCostsNoMounting) {
  const auto drive = recorded();
  std::istringstream lines(read_text(drive / "mti.log"));
  std::ofstream stepped(drive / "mti_set.log");
  const std::size_t half = lines_in(drive / "mti.log") / 2;
  std::size_t n = 0;
  for (std::string line; std::getline(lines, line); ++n) {
    stepped << "(" << std::fixed << std::setprecision(6)
            << std::stod(line.substr(1)) - (n >= half ? 1.5 : 0.0) << line.substr(line.find(')')) << '\n';
  }
  stepped.close();
  ASSERT_EQ(
      run_there(drive, "imuscope",
                "replay airins=airins.bin mtx1=mtx1.bin mti=mti_set.log gnss=gnss.bin wheels=wheels.log "
                "--config config.toml --out run"),
      0)
      << log_of(drive);
  // By the 1.5 s less the pause between two frames, some ms.
  EXPECT_NE(log_of(drive).find("the stamps go back 1 times, by 1.49"), std::string::npos) << log_of(drive);
  const auto mti = device_of(drive / "run" / "run.json", "mti");
  EXPECT_EQ(mti.at("samples_lost"), 0);
  EXPECT_EQ(mti.at("clock_resets"), 0);
  expect_mounting_found(drive, drive / "run", "mti");
}

/// The MTi on CAN as the reference: its log is the run's time, or is brought to the dumps by the receiver's
/// UTC.
TEST(CandumpDrive, AReferenceInALogGoesWithOtherLogsAndWithDumpsThatTellUtc) {
  const auto drive = recorded();
  const std::string config = R"([run]
name = "reference_on_can"
[[device]]
name = "mti"
role = "reference"
protocol = "xsens_can"
transport = { kind = "can", interface = "can0" }
[[device]]
name = "mtx1"
role = "study"
protocol = "xsens_mt"
transport = { kind = "serial", port = "/dev/mtx1", baud = 115200 }
[[device]]
name = "twin"
role = "study"
protocol = "xsens_can"
transport = { kind = "can", interface = "can0" }
[[device]]
name = "gnss"
role = "gnss"
protocol = "greis"
transport = { kind = "serial", port = "/dev/gnss", baud = 115200 }
)";
  write_text(drive / "on_can.toml", config);
  // Two devices in one log, here the same one twice: it sits where it sits.
  ASSERT_EQ(run_there(drive, "imuscope", "replay mti=mti.log twin=mti.log --config on_can.toml --out twins"),
            0)
      << log_of(drive);
  EXPECT_NE(log_of(drive).find("the log's stamps, which are the run's"), std::string::npos) << log_of(drive);
  const auto twin = imu_of(drive / "twins" / "calibration.json", "twin");
  EXPECT_NEAR(twin.at("t_d_s").get<double>(), 0.0, 1e-4);
  EXPECT_LT((kDeg * rotation_between_b(Eigen::Matrix3d::Identity(), matrix_of(twin.at("C_b_s")))).norm(),
            0.05);

  ASSERT_EQ(run_there(drive, "imuscope",
                      "replay mti=mti.log mtx1=mtx1.bin gnss=gnss.bin --config on_can.toml --out dumps"),
            0)
      << log_of(drive);
  EXPECT_NE(log_of(drive).find("mti: times from the log's stamps, taken as UTC"), std::string::npos);
  const auto mtx1 = imu_of(drive / "dumps" / "calibration.json", "mtx1");
  const double truth_s = imu_of(drive / "truth.json", "mtx1").at("t_d_s").get<double>() -
                         imu_of(drive / "truth.json", "mti").at("t_d_s").get<double>();
  // A receiver tells UTC some 50 ms late: that is what the log's time scale is known to.
  constexpr double kReceiverLatency_s = 0.1;
  EXPECT_NEAR(mtx1.at("t_d_s").get<double>(), truth_s, kReceiverLatency_s);
  EXPECT_NE(run_there(drive, "imuscope", "replay mti=mti.log mtx1=mtx1.bin --config on_can.toml --out no"), 0)
      << "nothing ties the dump's stamps to the log's";
}

class HighRate : public testing::TestWithParam<const char*> {};

/// Which of 061 and 062 is the acceleration shows in the rest before the drive.
TEST_P(HighRate, WhichMessageIsTheAccelerationIsFoundAtRestAndTheMountingWithIt) {
  DemoVehicle vehicle(source_path("config/can_vehicle.toml"));
  const auto drive = recorded(vehicle.set_truth("mti", "can_output", GetParam()).text());
  ASSERT_EQ(run_there(drive, "imuscope", std::string("replay ") + kFiles + " --config config.toml --out run"),
            0)
      << log_of(drive);
  const auto samples = device_of(drive / "run" / "run.json", "mti").at("samples").get<int>();
  // All but the 50 groups in which it is being found.
  EXPECT_GT(samples, 29'900);
  EXPECT_LT(samples, 29'960);
  expect_mounting_found(drive, drive / "run", "mti");
}

INSTANTIATE_TEST_SUITE_P(Orders, HighRate, testing::Values("high_rate", "high_rate_swapped"));

}  // namespace
}  // namespace imuscope::test
