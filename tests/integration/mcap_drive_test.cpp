/// A drive out as an MCAP file and in again, as a user does it.

#include <fmt/os.h>
#include <gtest/gtest.h>
#include <cmath>
#include <cstring>
#include <fstream>

#include "demo_vehicle.h"
#include "logs/mcap/reader.h"
#include "logs/mcap/ros_messages.h"
#include "mounting_compare.h"
#include "programs.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

using nlohmann::json;

constexpr const char* kConfiguration = R"(
[[device]]
name = "airins"
role = "reference"
protocol = "mcap"
[device.messages]
topic = "/imu/airins/raw"
times_are_utc = true
[device.noise]
gyro_white_deg_per_sqrt_h = 0.0015
accel_white_ug_per_sqrt_hz = 10.0
gyro_bias_sd_deg_per_h = 0.005
accel_bias_sd_mps2 = 5e-4
[[device]]
name = "mtx1"
role = "study"
protocol = "mcap"
[device.messages]
topic = "/imu/mtx1/raw"
times_are_utc = true
[[device]]
name = "gnss"
role = "gnss"
protocol = "mcap"
antenna_lever_arm_b_m = [-0.50, 0.20, -1.30]
[device.messages]
topic = "/gnss/gnss/fix"
velocity_topic = "/gnss/gnss/velocity"
times_are_utc = true
)";

struct Answer {
  int code = -1;
  std::string text;
};

class McapDrive : public testing::Test {
 protected:
  /// A drive of four minutes, its study and its bag: made once for all tests.
  void SetUp() override {
    if (!folder_.empty()) return;
    folder_ = scratch_folder();
    const auto at = [](const char* name) { return (folder_ / name).string(); };
    // One S-IMU of the three: it is quicker.
    DemoVehicle().without("mtx2").without("mtx3").write(at("demo.toml"));
    std::ofstream(at("bag.toml")) << kConfiguration;
    ASSERT_EQ(run_program("imusim",
                          {"record", at("demo.toml"), "--minutes", "4", "--seed", "9", "--out", at("drive")},
                          at("imusim.log")),
              0)
        << read_text(at("imusim.log"));
    ASSERT_EQ(run_program("imuscope", {"process", at("drive") + "/capture.lcm", "--out", at("run")},
                          at("process.log")),
              0)
        << read_text(at("process.log"));
    ASSERT_EQ(run_program("imuscope", {"export", at("run"), "--to", "mcap", "--out", at("run.mcap")},
                          at("export.log")),
              0)
        << read_text(at("export.log"));
  }
  static std::filesystem::path file(const std::string& name) { return folder_ / name; }
  static Answer run(std::vector<std::string> arguments) {
    const auto log = file("log");
    Answer answer;
    answer.code = run_program("imuscope", arguments, log);
    answer.text = read_text(log);
    return answer;
  }
  static Answer study(const std::string& bag, const std::string& out,
                      const std::string& config = "bag.toml") {
    const std::string path = file(bag).string();
    return run({"process", "airins=" + path, "mtx1=" + path, "gnss=" + path, "--config",
                file(config).string(), "--out", file(out).string()});
  }

 private:
  static inline std::filesystem::path folder_;
};

/// Largest difference of two mountings in sd of the first.
double worst_share(const json& a, const json& b) {
  double worst =
      std::abs(a.at("t_d_s").get<double>() - b.at("t_d_s").get<double>()) / a.at("t_d_sd_s").get<double>();
  const auto A = a.at("C_b_s").get<std::array<double, 9>>();
  const auto B = b.at("C_b_s").get<std::array<double, 9>>();
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> Ca(A.data());
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> Cb(B.data());
  const Eigen::Matrix3d R = Ca.transpose() * Cb;
  const Eigen::Vector3d turn_deg =
      Eigen::Vector3d(R(2, 1) - R(1, 2), R(0, 2) - R(2, 0), R(1, 0) - R(0, 1)) * 90.0 / M_PI;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto axis = static_cast<Eigen::Index>(i);
    worst = std::max(worst, std::abs(turn_deg[axis]) / a.at("boresight_sd_deg")[i].get<double>());
    worst = std::max(worst, std::abs(a.at("r_bs_b_m")[i].get<double>() - b.at("r_bs_b_m")[i].get<double>()) /
                                a.at("r_bs_b_sd_m")[i].get<double>());
  }
  return worst;
}

TEST_F(McapDrive, ItsStudyIsThatOfTheCapture) {
  const auto answer = study("run.mcap", "again");
  ASSERT_EQ(answer.code, 0) << answer.text;
  const auto first = read_json(file("run/calibration.json")).at("imus").at(0);
  const auto second = read_json(file("again/calibration.json")).at("imus").at(0);
  EXPECT_LT(worst_share(first, second), 0.1);
  EXPECT_EQ(first.at("status"), second.at("status"));
  EXPECT_EQ(read_json(file("again/run.json")).at("time_scale").at("utc_from"), "reference");
  EXPECT_FALSE(read_json(file("again/run.json")).at("gnss").at("contradicts_motion").get<bool>());
}

/// Corrected samples show the motion of the truth: the reference's, whose noise is small, turned
/// forward-left-up.
TEST_F(McapDrive, CorrectedSamplesAreTheReferencesAndTheirCovarianceIsTheirNoises) {
  auto reader = mcap::Reader::open(file("run.mcap"));
  ASSERT_TRUE(reader);
  std::map<std::int64_t, Eigen::Vector3d> reference;
  std::vector<mcap::Imu> corrected;
  while (const auto message = reader->next()) {
    mcap::Imu imu;
    if (message->topic->name == "/imu/airins/raw" && mcap::read(message->data, imu))
      reference[imu.header.stamp_ns] = {imu.angular_velocity[0], -imu.angular_velocity[1],
                                        -imu.angular_velocity[2]};
    if (message->topic->name == "/imu/mtx1/corrected" && mcap::read(message->data, imu))
      corrected.push_back(imu);
  }
  ASSERT_GT(corrected.size(), 20000U);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero(), square = Eigen::Vector3d::Zero(),
                  told = Eigen::Vector3d::Zero();
  int n = 0;
  for (const auto& imu : corrected) {
    const auto after = reference.lower_bound(imu.header.stamp_ns);
    if (after == reference.end() || after == reference.begin()) continue;
    const auto before = std::prev(after);
    const double share = static_cast<double>(imu.header.stamp_ns - before->first) /
                         static_cast<double>(after->first - before->first);
    const Eigen::Vector3d at = before->second + share * (after->second - before->second);
    const Eigen::Vector3d e = Eigen::Map<const Eigen::Vector3d>(imu.angular_velocity.data()) - at;
    mean += e;
    square += e.cwiseAbs2();
    told += Eigen::Vector3d(imu.angular_velocity_covariance[0], imu.angular_velocity_covariance[4],
                            imu.angular_velocity_covariance[8]);
    ++n;
  }
  for (int axis = 0; axis < 3; ++axis) {
    const double sd = std::sqrt(square[axis] / n);
    EXPECT_LT(std::abs(mean[axis] / n), 5.0 * sd / std::sqrt(n)) << axis;
    EXPECT_NEAR(sd / std::sqrt(told[axis] / n), 1.0, 0.1) << axis;
  }
}

TEST_F(McapDrive, OfADamagedFileWhatIsReadableIsUsedAndTheLossIsSaid) {
  const std::string whole = read_text(file("run.mcap"));
  std::ofstream(file("cut.mcap"), std::ios::binary) << whole.substr(0, whole.size() * 3 / 5);
  const auto cut = study("cut.mcap", "of_cut");
  ASSERT_EQ(cut.code, 0) << cut.text;
  const auto said = [](const json& run, const char* words) {
    for (const auto& warning : run.at("warnings")) {
      if (warning.get<std::string>().find(words) != std::string::npos) return true;
    }
    return false;
  };
  const auto run_of_cut = read_json(file("of_cut/run.json"));
  EXPECT_TRUE(said(run_of_cut, "is cut off")) << run_of_cut.at("warnings");
  EXPECT_LT(run_of_cut.at("duration_s").get<double>(),
            0.95 * read_json(file("run/run.json")).at("duration_s").get<double>());
  EXPECT_NE(read_text(file("of_cut/report.html")).find("is cut off"), std::string::npos);

  std::string damaged = whole;
  // A chunk of the samples, and not the one whose turns the mounting of so short a drive hangs on.
  std::memset(damaged.data() + damaged.size() / 4, 0x55, 1000);
  std::ofstream(file("damaged.mcap"), std::ios::binary) << damaged;
  const auto answer = study("damaged.mcap", "of_damaged");
  ASSERT_EQ(answer.code, 0) << answer.text;
  EXPECT_TRUE(said(read_json(file("of_damaged/run.json")), "cannot be read"));
}

TEST_F(McapDrive, SignalCommandsReadTheAxesOfATopic) {
  // The same samples as a table.
  auto reader = mcap::Reader::open(file("run.mcap"));
  ASSERT_TRUE(reader);
  {
    auto table = fmt::output_file(file("mtx1.csv").string());
    table.print("time_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2\n");
    std::int64_t first = 0;
    while (const auto message = reader->next()) {
      mcap::Imu imu;
      if (message->topic->name != "/imu/mtx1/raw" || !mcap::read(message->data, imu)) continue;
      if (first == 0) first = imu.header.stamp_ns;
      const auto& w = imu.angular_velocity;
      const auto& f = imu.linear_acceleration;
      table.print("{:.9f},{},{},{},{},{},{}\n", static_cast<double>(imu.header.stamp_ns - first) * 1e-9, w[0],
                  w[1], w[2], f[0], f[1], f[2]);
    }
  }
  for (const std::string command : {"wv", "fit"}) {
    std::vector<std::string> of_bag{
        command, file("run.mcap").string(), "--topic", "/imu/mtx1/raw", "--column", "accel_y", "--json"};
    std::vector<std::string> of_table{command, file("mtx1.csv").string(), "--column", "accel_y_mps2",
                                      "--json"};
    if (command == "fit") {
      for (auto* line : {&of_bag, &of_table}) line->insert(line->end(), {"--model", "WN+GM"});
    }
    const auto bag = run(of_bag);
    const auto table = run(of_table);
    ASSERT_EQ(bag.code, 0) << bag.text;
    ASSERT_EQ(table.code, 0) << table.text;
    EXPECT_EQ(bag.text, table.text) << command;
  }
  const auto bag =
      run({"characterize", file("run.mcap").string(), "--topic", "/imu/mtx1/raw", "--no-page", "--json"});
  const auto table = run({"characterize", file("mtx1.csv").string(), "--no-page", "--json"});
  ASSERT_EQ(bag.code, 0) << bag.text;
  const auto terms = [](const std::string& text) {
    return json::parse(text.substr(text.find('{'))).at("axes");
  };
  EXPECT_EQ(terms(bag.text), terms(table.text));
}

TEST_F(McapDrive, WhatIsWrongIsSaidWithItsRemedy) {
  const auto says = [](const Answer& answer, int code, const std::vector<std::string>& words) {
    EXPECT_EQ(answer.code, code) << answer.text;
    for (const auto& word : words)
      EXPECT_NE(answer.text.find(word), std::string::npos) << word << " is not in: " << answer.text;
  };
  const auto with = [](std::string from, const std::string& to) {
    std::string text = kConfiguration;
    text.replace(text.find(from), from.size(), to);
    std::ofstream(file("wrong.toml")) << text;
  };
  with("\"/imu/mtx1/raw\"", "\"/imu/mtx1/rw\"");
  says(study("run.mcap", "none", "wrong.toml"), 2,
       {"has no topic /imu/mtx1/rw", "did you mean /imu/mtx1/raw?"});
  with("topic = \"/imu/mtx1/raw\"", "");
  says(study("run.mcap", "none", "wrong.toml"), 2,
       {"topics of sensor_msgs/Imu", "/imu/mtx1/corrected (sensor_msgs/Imu)"});
  with("topic = \"/imu/mtx1/raw\"", "topic = \"/imu/mtx1/raw\"\nframe_id = \"mtx9\"");
  says(study("run.mcap", "none", "wrong.toml"), 2, {"frame_id 'mtx9'", "there is mtx1"});
  with("\"/imu/mtx1/raw\"", "\"/gnss/gnss/fix\"");
  says(study("run.mcap", "none", "wrong.toml"), 1, {"/gnss/gnss/fix", "sensor_msgs/Imu"});
  std::ofstream(file("text.mcap")) << "time_s,gyro_x\n";
  says(study("text.mcap", "none"), 1, {"is no MCAP file"});
  says(study("absent.mcap", "none"), 1, {"no such file"});
  says(run({"wv", file("run.mcap").string(), "--column", "gyro_x"}), 2,
       {"give --topic; its topics are /imu/"});
  says(run({"wv", file("run.mcap").string(), "--topic", "/imu/mtx1/raw"}), 2, {"give --column", "accel_z"});
  says(run({"export", file("drive").string(), "--to", "mcap"}), 2, {"run.json", "give the folder of a run"});
  says(run({"export", file("run").string(), "--to", "sdf"}), 2, {"urdf"});
  says(run({"export", file("run").string(), "--to", "urdf", "--name", "mtx9"}), 2, {"there is mtx1"});
}

TEST_F(McapDrive, ALinkInTheRunIsNotAttached) {
  std::filesystem::copy(file("run"), file("linked"));
  std::ofstream(file("private.txt")) << "nobody else's business";
  std::filesystem::remove(file("linked/report.html"));
  std::filesystem::create_symlink(file("private.txt"), file("linked/report.html"));
  const auto answer = run({"export", file("linked").string(), "--to", "mcap", "--out",
                           file("linked.mcap").string(), "--compression", "none"});
  ASSERT_EQ(answer.code, 0) << answer.text;
  const std::string bag = read_text(file("linked.mcap"));
  EXPECT_EQ(bag.find("nobody else's business"), std::string::npos);
  EXPECT_NE(bag.find("calibration.json"), std::string::npos);
}

TEST_F(McapDrive, AMountingIsPrintedForOthers) {
  const auto calibration = read_json(file("run/calibration.json")).at("imus").at(0);
  const auto of_folder = run({"export", file("run").string(), "--name", "mtx1", "--to", "json"});
  ASSERT_EQ(of_folder.code, 0) << of_folder.text;
  EXPECT_EQ(json::parse(of_folder.text).at("C_b_s"), calibration.at("C_b_s"));
  EXPECT_EQ(json::parse(of_folder.text).at("reference"), "airins");
  const auto of_file = run({"export", file("run/calibration.json").string(), "--to", "json"});
  EXPECT_EQ(of_file.text, of_folder.text);
  // A noise model is still what models.json is for.
  const auto noise = run({"export", file("run/models.json").string(), "--name", "mtx1", "--regime", "dynamic",
                          "--to", "ros", "--force"});
  EXPECT_NE(noise.text.find("gyroscope_noise_density"), std::string::npos) << noise.text;
}

}  // namespace
}  // namespace imuscope::test
