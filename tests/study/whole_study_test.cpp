/// A whole study of a simulated drive, from files to documents: two S-IMUs, of which one is turned on its mount half way,
/// and GNSS. What is right about it, the tests of the parts and tests/integration prove.

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <unistd.h>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <numbers>
#include <string>
#include <vector>

#include "configuration/config.h"
#include "estimation/navigation/so3.h"
#include "firmware_sim/imu/imu_model.h"
#include "firmware_sim/imu/sensor_classes.h"
#include "firmware_sim/motion/motion.h"
#include "logs/mcap/reader.h"
#include "service/pipeline/estimator_setup.h"
#include "service/recording/recording.h"
#include "study/evaluate.h"
#include "study/mounted_passes.h"
#include "study/run_bag.h"
#include "study/study.h"
#include "tests/support/answer.h"
#include "tests/support/recorded_answer.h"

namespace imuscope {
namespace {

using Eigen::Vector3d;
using nlohmann::json;
using test::Answer;

constexpr double kDrive_s = 130.0;
constexpr double kTurned_s = 65.0;
constexpr double kImuRate_hz = 100.0;
constexpr double kDegPerRadian = 180.0 / std::numbers::pi;
/// Iterations of the batch estimate and of the noise fits end where a step no longer matters.
constexpr double kShare = 1e-3;
constexpr double kNothing = 1e-8;

constexpr const char* kConfiguration = R"(
[run]
name = "whole"

[noise]
model = "WN"

[[device]]
name = "reference"
role = "reference"
protocol = "csv_imu"
rate_hz = 100.0
[device.noise]
gyro_white_sd_degps = 0.02
accel_white_sd_mps2 = 0.004

[[device]]
name = "mtx1"
role = "study"
protocol = "csv_imu"
rate_hz = 100.0
[device.csv]
counter_column = "n"
[device.data_sheet]
gyro_density_degps_per_sqrt_hz = 0.05
gyro_bias_stability_deg_per_h = 20.0
accel_density_ug_per_sqrt_hz = 250.0
accel_bias_stability_ug = 30.0

[[device]]
name = "mtx2"
role = "study"
protocol = "csv_imu"
rate_hz = 100.0
[device.csv]
clock = "own"

[[device]]
name = "gnss"
role = "gnss"
protocol = "csv_gnss"
rate_hz = 5.0
position_sd_m = [0.02, 0.02, 0.04]
[device.csv]
velocity_columns = ["vn", "ve", "vd"]
)";

/// A folder that is gone at the end.
struct ScratchFolder {
  std::filesystem::path path =
      std::filesystem::temp_directory_path() / ("whole_study_" + std::to_string(::getpid()));
  ScratchFolder() { std::filesystem::create_directories(path); }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  ~ScratchFolder() { std::filesystem::remove_all(path); }
};

void write_row(std::ofstream& out, double t_s, const imusim::ImuReading& r) {
  char row[256];
  std::snprintf(row, sizeof row, "%.4f,%.9f,%.9f,%.9f,%.8f,%.8f,%.8f", t_s, r.omega_radps.x(),
                r.omega_radps.y(), r.omega_radps.z(), r.f_mps2.x(), r.f_mps2.y(), r.f_mps2.z());
  out << row;
}

/// reference.csv, mtx1.csv, mtx2.csv and gnss.csv.
void write_drive(const std::filesystem::path& folder) {
  imusim::Scenario scenario;
  scenario.duration_s = kDrive_s + 2.0;
  const imusim::Motion motion(scenario);
  imusim::Random random(31, "whole study");
  imusim::ReferenceClass fog;
  fog.gyro_white_radps_per_sqrt_hz = 3e-5;
  imusim::ImuModel reference(motion, {}, imusim::draw_reference(fog, kImuRate_hz, random), 31, "reference");
  imusim::MtxClass mtx;
  mtx.gyro_noise = imusim::GyroNoiseChoice::kAllDynamic;
  const Eigen::Matrix3d C1 = exp_so3({0.02, -0.03, 1.6});
  const Eigen::Matrix3d C2 = exp_so3({-0.01, 0.02, -0.7});
  imusim::ImuModel mtx1(motion, {C1, {0.35, -0.22, 0.12}}, imusim::draw_mtx(mtx, random), 31, "mtx1");
  const imusim::ImuErrors errors = imusim::draw_mtx(mtx, random);
  imusim::ImuModel before(motion, {C2, {-0.4, 0.3, 0.2}}, errors, 31, "mtx2");
  imusim::ImuModel after(motion, {exp_so3({0.0, 0.35, 0.0}) * C2, {-0.4, 0.3, 0.2}}, errors, 31, "turned");
  const std::string columns =
      "gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2\n";
  std::ofstream of_reference(folder / "reference.csv");
  std::ofstream of_mtx1(folder / "mtx1.csv");
  std::ofstream of_mtx2(folder / "mtx2.csv");
  std::ofstream of_gnss(folder / "gnss.csv");
  of_reference << "t_s," << columns;
  of_mtx1 << "n,t_s," << columns;
  of_mtx2 << "t_s," << columns;
  of_gnss << "t_s,lat_deg,lon_deg,height_m,vn,ve,vd\n";
  for (int i = 0; i < static_cast<int>(kDrive_s * kImuRate_hz); ++i) {
    const double t_s = i / kImuRate_hz;
    write_row(of_reference, t_s, reference.sample_at(t_s));
    of_reference << '\n';
    const bool lost = i == 4000 || (i >= 9000 && i < 9030);
    const imusim::ImuReading first = mtx1.sample_at(t_s + 0.003);
    if (!lost) {
      of_mtx1 << i << ',';
      write_row(of_mtx1, t_s, first);
      of_mtx1 << '\n';
    }
    write_row(of_mtx2, t_s + 10.0, (t_s < kTurned_s ? before : after).sample_at(t_s + 0.25));
    of_mtx2 << '\n';
    if (i % 20 != 0) continue;
    const imusim::MotionState state = motion.state_at(t_s);
    const double north = random.normal();
    const double east = random.normal();
    const imusim::GeodeticPosition p =
        imusim::displaced(state.position, Vector3d(0.02 * north, 0.02 * east, 0.0));
    char row[256];
    std::snprintf(row, sizeof row, "%.3f,%.11f,%.11f,%.4f,%.4f,%.4f,%.4f\n", t_s,
                  p.latitude_rad * kDegPerRadian, p.longitude_rad * kDegPerRadian, p.height_m,
                  state.v_n_mps.x(), state.v_n_mps.y(), state.v_n_mps.z());
    of_gnss << row;
  }
}

/// A leaf of a document, or an array of numbers, a line.
void add_json(Answer& lines, const std::string& path, const json& value) {
  const auto is_leaf = [](const json& one) { return !one.is_structured(); };
  if (value.is_object()) {
    for (const auto& [key, inner] : value.items()) add_json(lines, path + "/" + key, inner);
  } else if (value.is_array() && std::all_of(value.begin(), value.end(), is_leaf)) {
    std::string row;
    for (const json& one : value) row += " " + one.dump();
    lines.line(path, row);
  } else if (value.is_array()) {
    for (std::size_t i = 0; i < value.size(); ++i) add_json(lines, path + "/" + std::to_string(i), value[i]);
  } else {
    lines.line(path, value.dump());
  }
}

json read_document(const std::filesystem::path& file) {
  std::ifstream in(file);
  return json::parse(in);
}

/// The header and every `every`-th row of a table.
void add_table(Answer& lines, const std::filesystem::path& file, std::size_t every) {
  std::ifstream in(file);
  std::string line;
  std::size_t n = 0;
  for (; std::getline(in, line); ++n)
    if (n == 0 || n % every == 1) lines.line(line);
  lines.line(file.filename().string(), n);
}

/// Without what depends on the machine: the folder's name.
std::string without(std::string text, const std::string& folder) {
  for (auto at = text.find(folder); at != std::string::npos; at = text.find(folder))
    text.erase(at, folder.size());
  return text;
}

/// The study, made once for all tests.
class WholeStudy : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    scratch_ = new ScratchFolder;
    write_drive(scratch_->path);
    StudyRunOptions options;
    options.out = run();
    options.version = "0";
    options.progress = [](const std::string& step, double share) { progress_[step] = share; };
    const auto done = study(kConfiguration, {"reference", "mtx1", "mtx2", "gnss"}, options);
    ASSERT_TRUE(done) << done.error().text();
  }
  static Result<void> study(const std::string& text, const std::vector<std::string>& devices,
                            const StudyRunOptions& options) {
    std::vector<std::string> inputs;
    for (const std::string& name : devices)
      inputs.push_back(name + "=" + (scratch_->path / (name + ".csv")).string());
    auto configuration = parse_configuration(text, "whole.toml");
    if (!configuration) return tl::unexpected<Error>(configuration.error());
    const auto opened = open_dumps(inputs, std::move(*configuration));
    if (!opened) return tl::unexpected<Error>(opened.error());
    return run_study(opened->configuration, opened->recording, options);
  }
  static void TearDownTestSuite() {
    delete scratch_;
    scratch_ = nullptr;
  }
  static std::filesystem::path run() { return scratch_->path / "run"; }
  static std::string folder() { return scratch_->path.string(); }

  static inline ScratchFolder* scratch_ = nullptr;
  static inline std::map<std::string, double> progress_;
};

/// All files of a run, by name.
std::map<std::string, std::string> files_of(const std::filesystem::path& run) {
  std::map<std::string, std::string> files;
  for (const auto& file : std::filesystem::directory_iterator(run)) {
    std::ifstream in(file.path(), std::ios::binary);
    files[file.path().filename().string()] =
        without({std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()}, run.string());
  }
  return files;
}

/// The configuration without the S-IMU that is turned.
std::string without_turned() {
  std::string text = kConfiguration;
  const auto name = text.find("name = \"mtx2\"");
  const auto begin = text.rfind("[[device]]", name);
  return text.erase(begin, text.find("[[device]]", name) - begin);
}

/// The passes that need the mountings begin ahead where more than one thread may be used: what they were told ahead is
/// what comes out, or is not used, as of an S-IMU that is turned later.
TEST_F(WholeStudy, WhatBeginsBesideTheCalibrationMakesNoDifference) {
  StudyRunOptions options;
  options.version = "0";
  options.batch_longest_s = 60.0;
  const std::vector<std::pair<std::string, std::vector<std::string>>> drives{
      {without_turned(), {"reference", "mtx1", "gnss"}},
      {kConfiguration, {"reference", "mtx1", "mtx2", "gnss"}}};
  for (const auto& [configuration, devices] : drives) {
    SCOPED_TRACE(devices.size());
    options.out = scratch_->path / "ahead";
    const auto ahead = study(configuration, devices, options);
    ASSERT_TRUE(ahead) << ahead.error().text();
    const auto files = files_of(options.out);
    options.out = scratch_->path / "by one thread";
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    const auto in_order = study(configuration, devices, options);
    ASSERT_TRUE(in_order) << in_order.error().text();
    const auto same = files_of(options.out);
    ASSERT_EQ(files.size(), same.size());
    for (const auto& [name, text] : files) EXPECT_TRUE(same.at(name) == text) << name;
    for (const char* folder : {"ahead", "by one thread"})
      std::filesystem::remove_all(scratch_->path / folder);
  }
}

/// Estimates in which both S-IMUs are as configured.
StudyMountings some_mountings() {
  std::vector<SImuOutput> both(2);
  for (SImuOutput& one : both) one.status = CalibrationStatus::kCalibrated;
  return {both, both, FormerMountings(2)};
}

TEST_F(WholeStudy, PassesAreOfTheMountingsThatTheyBeganWith) {
  auto configuration = parse_configuration(kConfiguration, "whole.toml");
  ASSERT_TRUE(configuration);
  std::vector<std::string> inputs;
  for (const char* name : {"reference", "mtx1", "mtx2", "gnss"})
    inputs.push_back(std::string(name) + "=" + (scratch_->path / (std::string(name) + ".csv")).string());
  const auto opened = open_dumps(inputs, std::move(*configuration));
  ASSERT_TRUE(opened);
  const EstimatorConfig estimator = estimator_config(opened->configuration);
  const auto path = scratch_->path / "given up";
  std::filesystem::create_directories(path);
  const auto folder = OutputFolder::open(path);
  ASSERT_TRUE(folder);
  // Given up at once: this ends long before the passes would.
  const auto passes = MountedPasses::begin(
      {opened->configuration, estimator, opened->recording, *folder, path}, some_mountings(), true);
  ASSERT_TRUE(passes);
  EXPECT_TRUE((*passes)->are_of(some_mountings()));
  StudyMountings others = some_mountings();
  others.of_drive[1].sd_psi_rad[0] = 1.0;  // no matter
  EXPECT_TRUE((*passes)->are_of(others));
  others.of_drive[1].t_d_s += 1e-6;
  EXPECT_FALSE((*passes)->are_of(others));
  others = some_mountings();
  others.settled[0].gyro_scale[2] += 1e-9;
  EXPECT_FALSE((*passes)->are_of(others));
  others = some_mountings();
  others.settled[0].status = CalibrationStatus::kWaiting;
  EXPECT_FALSE((*passes)->are_of(others));
  others = some_mountings();
  others.former[1].push_back({});
  EXPECT_FALSE((*passes)->are_of(others));
}

TEST_F(WholeStudy, AReplayThatIsGivenUpEndsWithAnError) {
  auto configuration = parse_configuration(kConfiguration, "whole.toml");
  ASSERT_TRUE(configuration);
  const auto opened = open_dumps({"reference=" + (scratch_->path / "reference.csv").string(),
                                  "mtx1=" + (scratch_->path / "mtx1.csv").string()},
                                 std::move(*configuration));
  ASSERT_TRUE(opened);
  struct : CoreSink {
    void on_error(const ErrorRecord&) noexcept override {}
    void on_event(const EstimatorEvent&) noexcept override {}
    void on_snapshot(const Snapshot&) noexcept override { is_given_up = true; }
    void on_late_sample(const LateSample&) noexcept override {}
    std::atomic<bool> is_given_up{false};
  } sink;
  ReplayOptions options;
  options.is_given_up = &sink.is_given_up;
  const auto result = replay(opened->configuration, estimator_config(opened->configuration),
                             opened->recording, sink, options);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().what, "the replay was given up");
}

TEST_F(WholeStudy, Calibration) {
  Answer lines;
  json calibration = read_document(run() / "calibration.json");
  // Once is enough of the longest list.
  calibration.at("imus").at(1).at("batch").erase("shared_psi_r");
  add_json(lines, "", calibration);
  const json record = read_document(run() / "run.json");
  for (const char* key :
       {"warnings", "notes", "static_s", "dynamic_s", "error_process_mounting", "schema", "name"})
    if (record.contains(key)) add_json(lines, key, record.at(key));
  for (const auto& [step, share] : progress_) lines.line(step, share);
  test::expect_recorded("study/calibration.txt", without(lines.text(), folder()), kShare, kNothing);
}

TEST_F(WholeStudy, Tables) {
  Answer lines;
  for (const char* name : {"mtx1", "mtx2"}) {
    add_table(lines, run() / (std::string("errors_") + name + ".csv"), 1500);
    add_table(lines, run() / (std::string("smoothed_") + name + ".csv"), 90);
    add_table(lines, run() / (std::string("scatter_") + name + ".csv"), 500);
  }
  add_table(lines, run() / "smoothed_navigation.csv", 90);
  test::expect_recorded("study/tables.txt", lines.text(), kShare, 1e-6);
}

TEST_F(WholeStudy, NoiseAndRegimes) {
  Answer lines;
  for (const char* name : {"regimes.json", "comparison.json", "vibration.json"})
    add_json(lines, name, read_document(run() / name));
  for (const json& model : read_document(run() / "models.json").at("models")) {
    if (model.at("name") == "mtx1" && model.at("axis") == "gyro_x")
      add_json(lines, "model", model);
    else
      lines.line("model", model.at("name").dump(), model.at("axis").dump(), model.at("regime").dump(),
                 model.at("parameters").dump());
  }
  test::expect_recorded("study/noise.txt", lines.text(), kShare, kNothing);
}

TEST_F(WholeStudy, DynamicsAndDependence) {
  Answer lines;
  const json regression = read_document(run() / "regression.json");
  lines.line("regressions", regression.at("regressions").size(), regression.at("remarks").dump());
  for (const json& r : regression.at("regressions"))
    lines.line("regression", r.at("name").dump(), r.at("axis").dump(), r.at("method").dump(),
               r.at("projected").dump(), r.at("n").dump(), r.at("r2").get<double>(), r.at("f").get<double>());
  const json dependence = read_document(run() / "dependence.json");
  for (const auto& [key, value] : dependence.items())
    if (key != "points") add_json(lines, key, value);
  lines.line("points", dependence.at("points").size());
  for (std::size_t i = 0; i < dependence.at("points").size(); i += 7)
    add_json(lines, "point", dependence.at("points")[i]);
  test::expect_recorded("study/dynamics.txt", lines.text(), kShare, kNothing);
}

TEST_F(WholeStudy, Evaluation) {
  EvaluationRunOptions options;
  options.run_dir = run();
  options.outages = {{4.0, 10.0}, 8.0, 20.0, {}};
  const auto evaluation = evaluate_run(options);
  ASSERT_TRUE(evaluation) << evaluation.error().text();
  EXPECT_EQ(*evaluation, read_document(run() / "evaluation.json"));
  Answer lines;
  add_json(lines, "", *evaluation);
  options.outages.settle_s = 1e4;
  lines.line("too long", without(evaluate_run(options).error().text(), folder()));
  options.run_dir = scratch_->path / "none";
  lines.line("no run", without(evaluate_run(options).error().text(), folder()));
  test::expect_recorded("study/evaluation.txt", lines.text(), kShare, kNothing);
}

/// Of a CDR message, what stands where doubles may stand.
void add_doubles(Answer& lines, std::string_view data) {
  constexpr std::size_t kHeader = 4;
  std::vector<double> values;
  for (std::size_t at = kHeader; at + sizeof(double) <= data.size() && values.size() < 60;
       at += sizeof(double)) {
    double value = 0.0;
    std::memcpy(&value, data.data() + at, sizeof value);
    values.push_back(std::isfinite(value) && std::abs(value) < 1e12 && std::abs(value) > 1e-12 ? value : 0.0);
  }
  lines.line(" holds", values);
}

/// The first values of a message, counted by their commas: a number's digits differ from processor to processor.
std::string_view first_values(std::string_view text) {
  constexpr int kValues = 60;
  std::size_t end = 0;
  for (int i = 0; i < kValues; ++i) {
    end = text.find(',', end + 1);
    if (end == std::string_view::npos) return text;
  }
  return text.substr(0, end);
}

TEST_F(WholeStudy, Bag) {
  RunBagOptions options;
  options.source.run_dir = run();
  options.out = scratch_->path / "run.mcap";
  options.version = "0";
  options.compression = mcap::Compression::kNone;
  options.with_errors = true;
  double last_share = 0.0;
  options.progress = [&](double share) { last_share = share; };
  const auto bag = write_run_bag(options);
  ASSERT_TRUE(bag) << bag.error().text();
  Answer lines;
  lines.line("bag", bag->messages, bag->times_are_utc, last_share > 0.5, bag->remarks);
  EXPECT_EQ(bag->bytes, std::filesystem::file_size(options.out));
  auto reader = mcap::Reader::open(options.out);
  ASSERT_TRUE(reader);
  std::map<std::string, std::size_t> seen;
  while (const auto message = reader->next()) {
    const std::size_t n = seen[message->topic->name]++;
    if (n != 0 && n != 3 && n % 5000 != 77) continue;
    lines.line(message->topic->name, n, message->topic->schema, message->topic->encoding,
               1e-9 * static_cast<double>(message->log_time),
               1e-9 * static_cast<double>(message->publish_time));
    const std::string_view data = mcap::text_of(message->data);
    if (message->topic->encoding == "json") {
      lines.line(first_values(data));
    } else {
      add_doubles(lines, data);
    }
  }
  for (const auto& [topic, n] : seen) lines.line(topic, n);
  test::expect_recorded("study/bag.txt", without(lines.text(), folder()), kShare, 1e-6);
}

/// The times of all messages of a bag of the run in this folder, ns, by topic.
std::map<std::string, std::vector<std::int64_t>> times_of_bag(const std::filesystem::path& run,
                                                              bool are_utc) {
  RunBagOptions options;
  options.source.run_dir = run;
  options.out = run.string() + ".mcap";
  options.version = "0";
  options.compression = mcap::Compression::kNone;
  const auto bag = write_run_bag(options);
  EXPECT_TRUE(bag) << bag.error().text();
  EXPECT_EQ(bag->times_are_utc, are_utc);
  std::map<std::string, std::vector<std::int64_t>> times;
  auto reader = mcap::Reader::open(options.out);
  if (!reader) return times;
  while (const auto message = reader->next())
    times[message->topic->name].push_back(static_cast<std::int64_t>(message->log_time));
  return times;
}

/// navigation.csv of the run with another `utc_s`: a clock that is 50 ppm slow up to the bend, and as much fast after it.
constexpr std::int64_t kBegin_ns = 1'773'480'672'250'000'000;  // 2026-03-14T09:31:12.25Z
constexpr double kBend_s = 60.0;
constexpr double kRate = 50e-6;
double ahead_ns(double time_s) { return 1e9 * kRate * (kBend_s - std::abs(time_s - kBend_s)); }

void write_utc(const std::filesystem::path& from, const std::filesystem::path& to) {
  std::ifstream in(from);
  std::ofstream out(to);
  std::string line;
  std::getline(in, line);
  out << line << '\n';
  const auto comma = line.find(",utc_s,");
  const auto column = std::count(line.begin(), line.begin() + static_cast<std::ptrdiff_t>(comma) + 1, ',');
  ASSERT_TRUE(line.starts_with("time_s,") && comma != std::string::npos) << line;
  while (std::getline(in, line)) {
    std::size_t begin = 0;
    for (std::ptrdiff_t i = 0; i < column; ++i) begin = line.find(',', begin) + 1;
    const double time_s = std::stod(line);
    const double utc_s = 1e-9 * static_cast<double>(kBegin_ns) + time_s + 1e-9 * ahead_ns(time_s);
    out << line.substr(0, begin) << fmt::format("{:.6f}", utc_s) << line.substr(line.find(',', begin))
        << '\n';
  }
}

TEST_F(WholeStudy, ABagsTimesAreUtcByTheNavigationsRowsOrFromTheBeginningByTheClocksRate) {
  const auto of_run = times_of_bag(run(), false);
  const auto copy = scratch_->path / "utc";
  std::filesystem::copy(run(), copy, std::filesystem::copy_options::recursive);
  json record = read_document(copy / "run.json");
  record["t0_utc"] = "2026-03-14T09:31:12.25Z";
  record["time_scale"]["host_clock_ppm"] = 40.0;
  std::ofstream(copy / "run.json") << record.dump();
  const auto by_beginning = times_of_bag(copy, true);
  write_utc(run() / "navigation.csv", copy / "navigation.csv");
  const auto by_rows = times_of_bag(copy, true);

  for (const char* topic : {"/imu/reference/raw", "/imu/mtx1/corrected"}) {
    const auto& times = of_run.at(topic);
    ASSERT_EQ(by_beginning.at(topic).size(), times.size()) << topic;
    ASSERT_EQ(by_rows.at(topic).size(), times.size()) << topic;
    for (std::size_t i = 0; i < times.size(); i += 50) {
      const double time_s = 1e-9 * static_cast<double>(times[i]);
      // A PC's clock that gains 40 ppm shows more seconds than have passed.
      ASSERT_NEAR(static_cast<double>(by_beginning.at(topic)[i] - kBegin_ns - times[i]), -40e3 * time_s, 1e3)
          << topic << " at " << time_s;
      // Rows ten seconds apart cut the bend's corner; a double of seconds since 1970 is good to 0.24 us.
      if (std::abs(time_s - kBend_s) < 10.0) continue;
      ASSERT_NEAR(static_cast<double>(by_rows.at(topic)[i] - kBegin_ns - times[i]), ahead_ns(time_s), 5e3)
          << topic << " at " << time_s;
    }
  }
}

}  // namespace
}  // namespace imuscope
