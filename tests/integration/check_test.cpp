/// The look at the data before anything is estimated: planted mistakes are named with their remedy, healthy
/// drives have nothing that harms.

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <map>
#include <random>
#include <set>

#include "check/check.h"
#include "check/config_lines.h"
#include "demo_vehicle.h"
#include "planted_mistakes.h"
#include "programs.h"
#include "service/pipeline/device_factory.h"
#include "service/recording/recording.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

class Collector final : public SampleSink {
 public:
  explicit Collector(std::vector<Sample>& samples) : samples_(samples) {}
  void on_sample(const Sample& sample) noexcept override {
    if (sample.kind == SampleKind::kImu || sample.kind == SampleKind::kGnss) samples_.push_back(sample);
  }

 private:
  std::vector<Sample>& samples_;
};

std::vector<Sample> decode(const OpenedRecording& opened, const std::string& name) {
  const auto& devices = opened.configuration.devices;
  const auto device = static_cast<std::size_t>(opened.configuration.find(name) - devices.data());
  const auto index = static_cast<DeviceIndex>(device);
  std::vector<Sample> samples;
  Collector collector(samples);
  auto source = opened.recording.open(index);
  const auto decoder = make_decoder(devices[device], index, opened.recording.clocks[device].map);
  while (source) {
    const auto read = (*source)->next();
    if (!read || !*read) break;
    decoder->push((*read)->bytes, (*read)->arrival.value_or(HostTime{}), collector);
  }
  decoder->finish(HostTime{}, collector);
  return samples;
}

/// The devices of a recording as a drive of a reference, one S-IMU and a receiver.
DriveInMemory drive_of(const OpenedRecording& opened, const std::array<std::string, 3>& names,
                       const std::string& toml) {
  DriveInMemory drive;
  drive.toml = toml;
  auto configuration = parse_configuration(toml, "drive.toml");
  EXPECT_TRUE(configuration.has_value()) << configuration.error().text();
  drive.configuration = *configuration;
  for (std::size_t device = 0; device < names.size(); ++device) {
    drive.samples.push_back(decode(opened, names[device]));
    for (Sample& sample : drive.samples.back()) sample.device = static_cast<DeviceIndex>(device);
  }
  drive.has_own_clock = {false, true, false};
  return drive;
}

constexpr const char* kSimulated = R"([[device]]
name = "reference"
role = "reference"
protocol = "csv_imu"
rate_hz = 100.0

[[device]]
name = "study"
role = "study"
protocol = "csv_imu"
rate_hz = 100.0
[device.csv]
clock = "own"

[[device]]
name = "gnss"
role = "gnss"
protocol = "csv_gnss"
rate_hz = 10.0
)";

OpenedRecording simulate(int seed, const std::vector<std::string>& more = {}) {
  const auto out = scratch_folder() / ("seed" + std::to_string(seed));
  std::vector<std::string> arguments{"record",    source_path("config/demo.toml").string(),
                                     "--minutes", "4",
                                     "--seed",    std::to_string(seed),
                                     "--out",     out.string()};
  arguments.insert(arguments.end(), more.begin(), more.end());
  EXPECT_EQ(run_program("imusim", arguments, out.string() + ".log"), 0) << read_text(out.string() + ".log");
  auto opened = open_recording({(out / "capture.lcm").string()}, {});
  EXPECT_TRUE(opened.has_value());
  return *opened;
}

OpenedRecording recorded(const std::string& name) {
  const auto folder = shared_path("data/car_drive") / name;
  auto opened =
      open_recording({"reference=" + (folder / "reference_imu.csv").string(),
                      "gnss=" + (folder / "gnss.csv").string(), "dot=" + (folder / "study_imu.csv").string()},
                     source_path("config/csv_drive.toml"));
  EXPECT_TRUE(opened.has_value());
  return *opened;
}

/// The reference as b has it, whatever its file's axes are, so that planted axes are those of the test.
std::string recorded_toml() {
  std::string toml = kSimulated;
  toml.replace(toml.find("rate_hz = 100.0", toml.find("study")), 15, "rate_hz = 120.0");
  toml.replace(toml.find("rate_hz = 10.0"), 14, "rate_hz = 5.0\nposition_sd_m = [0.1, 0.1, 0.2]");
  return toml;
}

/// Of each kind of mistake, how many were planted and how many were named.
struct Score {
  struct Count {
    std::size_t planted = 0;
    std::size_t named = 0;
    std::size_t with_line = 0;  ///< whose remedy is a line of the configuration
  };
  std::map<std::string, Count> of_check;
  std::set<std::string> kinds;

  [[nodiscard]] Count all() const {
    Count sum;
    for (const auto& [check, count] : of_check) {
      sum.planted += count.planted;
      sum.named += count.named;
      sum.with_line += count.with_line;
    }
    return sum;
  }
};

void plant_all(const DriveInMemory& healthy, const std::string& where, Score& score) {
  for (const Mistake& mistake : planted_mistakes()) {
    DriveInMemory drive = healthy;
    mistake.plant(drive);
    const auto findings = look_at(drive);
    Score::Count& count = score.of_check[mistake.check];
    score.kinds.insert(mistake.name);
    ++count.planted;
    if (!mistake.key.empty()) ++count.with_line;
    if (is_named(mistake, drive, findings)) {
      ++count.named;
      continue;
    }
    std::cout << where << ", " << mistake.name << ": not named; the first lines are\n";
    for (std::size_t i = 0; i < std::min<std::size_t>(findings.size(), 3); ++i)
      std::cout << "    " << findings[i].check << ": " << check::sentence(findings[i]) << '\n';
  }
}

void expect_named(const Score& score) {
  const auto row = [](const std::string& check, const Score::Count& count) {
    std::cout << std::left << std::setw(20) << check << std::right << std::setw(9) << count.planted
              << std::setw(9) << count.named << std::setw(16) << count.with_line << '\n';
  };
  std::cout << "finding               planted    named  with its line\n";
  for (const auto& [check, count] : score.of_check) {
    row(check, count);
    EXPECT_GE(count.planted, 2U) << check;
  }
  const Score::Count all = score.all();
  row("all", all);
  std::cout << all.named << " of " << all.planted << " planted mistakes of " << score.kinds.size()
            << " kinds are named with their remedy\n";
  EXPECT_GE(score.kinds.size(), 50U);
  EXPECT_GE(20 * all.named, 19 * all.planted) << "at least 95 %";
}

void expect_no_harm(const DriveInMemory& drive, const std::string& where) {
  for (const check::Finding& finding : look_at(drive))
    EXPECT_EQ(finding.harm, check::Harm::kNote) << where << ": " << check::sentence(finding);
}

TEST(PlantedMistakes, OnSimulatedDrivesAreNamedInTheFirstThreeLines) {
  const auto opened = simulate(21);
  Score score;
  for (const char* imu : {"mtx1", "mtx2", "mtx3"})
    plant_all(drive_of(opened, {"airins", imu, "gnss"}, kSimulated), imu, score);
  expect_named(score);
}

TEST(PlantedMistakes, OnRecordedDrivesAreNamedInTheFirstThreeLines) {
  IMUSCOPE_NEEDS_SHARED("data/car_drive");
  Score score;
  for (const char* name : {"02", "08"})
    plant_all(drive_of(recorded(name), {"reference", "dot", "gnss"}, recorded_toml()),
              std::string("drive ") + name, score);
  expect_named(score);
}

TEST(HealthyDrives, OfManySeedsAndMountingsHaveNothingThatHarms) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  for (int seed = 1; seed <= 10; ++seed) {
    // Every other one with sensors that have all that data sheets allow.
    const auto opened =
        seed % 2 == 0 ? simulate(seed, {"--world", "harsh", "--reference-class", "4"}) : simulate(seed);
    for (const char* imu : {"mtx1", "mtx2", "mtx3"}) {
      DriveInMemory drive = drive_of(opened, {"airins", imu, "gnss"}, kSimulated);
      const Eigen::Quaterniond any{normal(random), normal(random), normal(random), normal(random)};
      const Eigen::Matrix3d C = any.normalized().toRotationMatrix();
      for (Sample& sample : drive.samples[kStudy]) {
        for (Vector3* v : {&sample.imu.omega_radps, &sample.imu.f_mps2}) {
          const Eigen::Vector3d turned = C * Eigen::Vector3d((*v)[0], (*v)[1], (*v)[2]);
          *v = {turned.x(), turned.y(), turned.z()};
        }
      }
      expect_no_harm(drive, imu + std::string(" of seed ") + std::to_string(seed));
    }
  }
}

TEST(HealthyDrives, RecordedOnTheRoadHaveNothingThatHarms) {
  IMUSCOPE_NEEDS_SHARED("data/car_drive");
  // Positions of 06 and 07 jump by metres, which is to be told.
  for (const char* name : {"02", "04", "08"})
    expect_no_harm(drive_of(recorded(name), {"reference", "dot", "gnss"}, recorded_toml()), name);
}

TEST(HealthyDrives, OfARadioControlledCarHaveNothingThatHarms) {
  IMUSCOPE_NEEDS_SHARED("data/rc_car");
  std::string toml = recorded_toml();
  toml.replace(toml.find("rate_hz = 100.0"), 15, "rate_hz = 120.0");
  toml.replace(toml.find("rate_hz = 5.0"), 13, "rate_hz = 10.0");
  const auto file = scratch_folder() / "rc_car.toml";
  std::ofstream(file) << toml;
  for (const char* name : {"h", "k", "l"}) {
    for (const char* imu : {"2", "3", "4"}) {
      const auto folder = shared_path("data/rc_car") / name;
      const auto opened = open_recording(
          {"reference=" + (folder / "reference_imu.csv").string(), "gnss=" + (folder / "gnss.csv").string(),
           "study=" + (folder / (std::string("study_imu_") + imu + ".csv")).string()},
          file);
      ASSERT_TRUE(opened.has_value()) << opened.error().text();
      expect_no_harm(drive_of(*opened, {"reference", "study", "gnss"}, toml), std::string(name) + imu);
    }
  }
}

TEST(TheProgram, SaysTheMistakeFirstAndWritesAConfigurationThatMendsIt) {
  IMUSCOPE_NEEDS_SHARED("data/car_drive");
  const auto folder = scratch_folder();
  const auto drive = shared_path("data/car_drive/08");
  std::string toml = read_text(source_path("config/csv_drive.toml"));
  const auto put = [&](const std::string& from, const std::string& to) {
    ASSERT_NE(toml.find(from), std::string::npos);
    toml.replace(toml.find(from), from.size(), to);
  };
  // The reference's axes not turned, the S-IMU's accelerometers taken for g, its gyro x and y swapped, and
  // half its rate.
  put("axes = \"+x -y -z\"", "axes = \"+x +y +z\"");
  put("rate_hz = 120.0", "rate_hz = 60.0 # of the sensor");
  const auto study = toml.find("name = \"dot\"");
  toml.replace(toml.find("accel_unit = \"m/s2\"", study), 19, "accel_unit = \"g\"");
  toml.replace(toml.find("\"gyro_x_radps\", \"gyro_y_radps\"", study), 30,
               "\"gyro_y_radps\", \"gyro_x_radps\"");
  const auto wrong = folder / "wrong.toml";
  std::ofstream(wrong) << toml;
  const std::vector<std::string> inputs{"reference=" + (drive / "reference_imu.csv").string(),
                                        "gnss=" + (drive / "gnss.csv").string(),
                                        "dot=" + (drive / "study_imu.csv").string()};
  const auto fixed = folder / "fixed.toml";
  std::vector<std::string> arguments{"config", wrong.string(), "--data"};
  arguments.insert(arguments.end(), inputs.begin(), inputs.end());
  auto with_fix = arguments;
  with_fix.insert(with_fix.end(), {"--fix", fixed.string()});
  EXPECT_EQ(run_program("imuscope", with_fix, folder / "config.log"), 1);
  const std::string log = read_text(folder / "config.log");
  EXPECT_NE(log.find("WRONG  dot: "), std::string::npos) << log;
  const auto configuration = load_configuration(fixed);
  ASSERT_TRUE(configuration.has_value()) << log;
  const auto as_committed = load_configuration(source_path("config/csv_drive.toml"));
  for (std::size_t i = 0; i < configuration->devices.size(); ++i) {
    const DeviceConfig& mended = configuration->devices[i];
    const DeviceConfig& committed = as_committed->devices[i];
    EXPECT_EQ(mended.axes, committed.axes);
    EXPECT_EQ(mended.rate_hz, committed.rate_hz);
    EXPECT_EQ(mended.csv.accel_in_g, committed.csv.accel_in_g);
    EXPECT_EQ(mended.csv.gyro_columns, committed.csv.gyro_columns);
  }
  arguments[1] = fixed.string();
  EXPECT_EQ(run_program("imuscope", arguments, folder / "again.log"), 0) << read_text(folder / "again.log");
  // A file that is there stays as it is.
  EXPECT_EQ(run_program("imuscope", with_fix, folder / "twice.log"), 2);
}

TEST(TheProgram, StudiesAndSaysFirstAndLastWhatIsWrong) {
  IMUSCOPE_NEEDS_SHARED("data/car_drive");
  const auto folder = scratch_folder();
  const auto drive = shared_path("data/car_drive/08");
  std::string toml = read_text(source_path("config/csv_drive.toml"));
  toml.replace(toml.find("rate_hz = 120.0"), 15, "rate_hz = 60.0");
  const auto wrong = folder / "wrong.toml";
  std::ofstream(wrong) << toml;
  const auto out = folder / "run";
  ASSERT_EQ(run_program("imuscope",
                        {"process", "reference=" + (drive / "reference_imu.csv").string(),
                         "gnss=" + (drive / "gnss.csv").string(), "dot=" + (drive / "study_imu.csv").string(),
                         "--config", wrong.string(), "--out", out.string()},
                        folder / "process.log"),
            0)
      << read_text(folder / "process.log");
  const std::string log = read_text(folder / "process.log");
  EXPECT_NE(
      log.find("WRONG  dot: its samples do not come at the rate that is configured (120 Hz, expected 60)"),
      std::string::npos)
      << log;
  EXPECT_GT(log.rfind("Do not use these results"), log.rfind("Report:"));
  const auto findings = read_json(out / "run.json").at("findings");
  ASSERT_GE(findings.size(), 1U);
  EXPECT_EQ(findings[0].at("check"), "rate");
  EXPECT_EQ(findings[0].at("mends").at(0).at("key"), "rate_hz");
  EXPECT_LT(read_text(out / "report.html").find("its samples do not come at the rate"),
            read_text(out / "report.html").find("Is the calibration usable?"));
}

TEST(TheProgram, LooksAtWhatItImports) {
  IMUSCOPE_NEEDS_SHARED("data/car_drive");
  const auto folder = scratch_folder();
  const auto drive = shared_path("data/car_drive/08");
  std::string toml = read_text(source_path("config/csv_drive.toml"));
  toml.replace(toml.find("rate_hz = 120.0"), 15, "rate_hz = 60.0");
  const auto wrong = folder / "wrong.toml";
  std::ofstream(wrong) << toml;
  ASSERT_EQ(run_program("imuscope",
                        {"import", "reference=" + (drive / "reference_imu.csv").string(),
                         "gnss=" + (drive / "gnss.csv").string(), "dot=" + (drive / "study_imu.csv").string(),
                         "--config", wrong.string(), "--out", (folder / "drive.lcm").string()},
                        folder / "import.log"),
            0)
      << read_text(folder / "import.log");
  EXPECT_NE(read_text(folder / "import.log").find("WRONG  dot: its samples do not come at the rate"),
            std::string::npos)
      << read_text(folder / "import.log");
}

TEST(TheProgram, LooksOnceAtWhatALiveRunRecorded) {
  const auto folder = scratch_folder();
  const auto recorded_to = folder / "recorded";
  ASSERT_EQ(run_program("imusim",
                        {"record", source_path("config/demo.toml").string(), "--minutes", "3", "--out",
                         recorded_to.string()},
                        folder / "record.log"),
            0);
  const auto wrong = DemoVehicle().set_device("airins", "axes", "+x +y +z").write(folder / "wrong.toml");
  // What a live run with this configuration would have left.
  const auto run = folder / "run";
  std::vector<std::string> import{"import"};
  for (const char* device : {"airins", "mtx1", "mtx2", "mtx3", "gnss"})
    import.push_back(device + ("=" + (recorded_to / device).string() + ".bin"));
  std::filesystem::create_directory(run);
  import.insert(import.end(), {"--config", wrong.string(), "--out", (run / "capture.lcm").string()});
  ASSERT_EQ(run_program("imuscope", import, folder / "import.log"), 0) << read_text(folder / "import.log");
  ASSERT_EQ(run_program("imuscope", {"replay", (run / "capture.lcm").string(), "--out", run.string()},
                        folder / "replay.log"),
            0)
      << read_text(folder / "replay.log");
  nlohmann::json record = read_json(run / "run.json");
  EXPECT_TRUE(record.at("findings").is_null()) << "nobody has looked yet";
  record["inputs"] = {"live"};
  std::ofstream(run / "run.json") << record;
  const auto report = [&](const char* log) {
    EXPECT_EQ(run_program("imuscope", {"report", run.string()}, folder / log), 0) << read_text(folder / log);
    return read_text(folder / log);
  };
  EXPECT_NE(report("report.log").find("WRONG  airins: its z axis does not point down"), std::string::npos);
  EXPECT_EQ(read_json(run / "run.json").at("findings").at(0).at("check"), "reference axes");
  EXPECT_NE(read_text(run / "report.html").find("its z axis does not point down"), std::string::npos);
  EXPECT_EQ(report("again.log").find("WRONG"), std::string::npos) << "what was found is known";
}

}  // namespace
}  // namespace imuscope::test
