/// Files of every kind opened as one recording, as they once were: what is there, what is told, and every device's bytes.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "service/recording/recording.h"
#include "tests/support/answer.h"
#include "tests/support/recorded_answer.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

namespace fs = std::filesystem;
using test::Answer;

void put(const fs::path& file, const std::string& text) { std::ofstream(file, std::ios::binary) << text; }

/// Half a minute of an IMU that turns, at 100 Hz.
std::string imu_rows(double off_s, double size) {
  constexpr int kRows = 3000;
  std::string text = "t_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2\n";
  for (int i = 0; i < kRows; ++i) {
    const double t = 0.01 * i;
    const double at = t + off_s;
    const double w = size * (0.3 * std::sin(1.7 * at) + 0.2 * std::sin(0.31 * at * at));
    text += fmt::format("{:.4f},{:.6f},{:.6f},{:.6f},{:.5f},{:.5f},{:.5f}\n", t, 0.1 * w, -0.2 * w, w,
                        0.5 * w, 0.1, -9.8);
  }
  return text;
}

std::string imu(const std::string& name, const std::string& role, const std::string& clock) {
  return fmt::format(
      "[[device]]\nname = \"{}\"\nrole = \"{}\"\nprotocol = \"csv_imu\"\nrate_hz = 100\n"
      "[device.csv]\nclock = \"{}\"\n",
      name, role, clock);
}

std::string without(std::string text, const std::string& folder) {
  for (auto at = text.find(folder); at != std::string::npos; at = text.find(folder))
    text.erase(at, folder.size());
  return text;
}

class OpenedRecordings : public testing::Test {
 protected:
  void open(const std::string& title, const std::vector<std::string>& inputs,
            const std::string& configuration) {
    answer_.line("==", title);
    put(folder_ / "vehicle.toml", configuration);
    std::vector<check::Finding> findings;
    const auto opened = open_recording(inputs, folder_ / "vehicle.toml", {}, &findings);
    const auto tell = [&](const std::string& text) {
      answer_.line(without(without(text, folder_.string() + "/"), test::source_path("").string()));
    };
    for (const auto& finding : findings) tell("finding: " + finding.what);
    if (!opened) return tell(opened.error().text());
    const Recording& recording = opened->recording;
    for (const auto& remark : opened->remarks) tell("remark: " + remark);
    for (const auto& damage : recording.damage) tell("damage: " + damage);
    for (std::size_t i = 0; i < recording.present.size(); ++i) {
      answer_.line("device", opened->configuration.devices[i].name, recording.present[i],
                   recording.clocks[i].how, recording.clocks[i].shift_s, recording.clocks[i].shift_sd_s);
      if (!recording.present[i]) continue;
      auto source = recording.open(static_cast<DeviceIndex>(i));
      if (!source) {
        tell(source.error().text());
        continue;
      }
      std::size_t reads = 0;
      std::size_t bytes = 0;
      std::uint32_t sum = 0;
      for (auto next = (*source)->next(); next && *next; next = (*source)->next()) {
        ++reads;
        bytes += (*next)->bytes.size();
        for (const std::uint8_t byte : (*next)->bytes) sum = sum * 31U + byte;
      }
      answer_.line("reads", reads > 0, "bytes", bytes, "sum", sum, (*source)->bytes_total(),
                   (*source)->bytes_read());
    }
  }
  [[nodiscard]] std::string input(const std::string& name, const std::string& file) const {
    return name + "=" + (folder_ / file).string();
  }

  fs::path folder_ = test::scratch_folder();
  Answer answer_;
};

TEST_F(OpenedRecordings, OfEveryKindOfFile) {
  put(folder_ / "ref.csv", imu_rows(0.0, 1.0));
  put(folder_ / "study.csv", imu_rows(0.37, -1.0));
  const std::string both = imu("ref", "reference", "common") + imu("imu", "study", "own");
  open("two files", {input("ref", "ref.csv"), input("imu", "study.csv")}, both);
  open("no reference", {input("imu", "study.csv")}, both);
  open("no study", {input("ref", "ref.csv")}, both);
  open("no file", {input("ref", "ref.csv"), input("imu", "none.csv")}, both);
  put(folder_ / "empty.csv", "");
  open("an empty one", {input("ref", "ref.csv"), input("imu", "empty.csv")}, both);

  const std::string bag = test::source_path("tests/vectors/bag_none.bag");
  const std::string of_bag = R"(
[[device]]
name = "bag"
role = "study"
protocol = "rosbag"
rate_hz = 100
[device.messages]
topic = "/imu/data"
)";
  open("messages", {input("ref", "ref.csv"), "bag=" + bag}, imu("ref", "reference", "common") + of_bag);
  std::ifstream in(bag, std::ios::binary);
  const std::string whole{std::istreambuf_iterator<char>(in), {}};
  put(folder_ / "cut.bag", whole.substr(0, whole.size() / 2));
  open("messages that are cut off", {input("ref", "ref.csv"), input("bag", "cut.bag")},
       imu("ref", "reference", "common") + of_bag);
  test::expect_recorded("service/recording/opened.txt", answer_.text(), 1e-4, 1e-7);
}

/// Wheels that candump logged, beside a reference in a file: by what the log's stamps are brought to the run's.
TEST_F(OpenedRecordings, ALogOfCandumpBesideOtherFiles) {
  put(folder_ / "ref.csv", imu_rows(0.0, 1.0));
  put(folder_ / "study.csv", imu_rows(0.37, -1.0));
  std::string frames;
  for (int i = 0; i < 200; ++i)
    frames += fmt::format("({:.6f}) can0 0AA#1A6F1A6F1A6F1A6F\n", 946684800.0 + 0.02 * i);
  put(folder_ / "wheels.log", frames);
  const auto wheels = [](const std::string& clock) {
    return fmt::format(R"(
[[device]]
name = "wheels"
role = "odometry"
protocol = "can_odometry"
rate_hz = 50
transport = {{ kind = "can", interface = "can0"{} }}
[device.odometry]
dbc = "{}"
speed_signals = ["WHEEL_SPEEDS.RL", "WHEEL_SPEEDS.RR"]
)",
                       clock, test::source_path("config/toyota_rav4.dbc").string());
  };
  const std::vector<std::string> files{input("ref", "ref.csv"), input("imu", "study.csv"),
                                       input("wheels", "wheels.log")};
  const std::string others = imu("ref", "reference", "common") + imu("imu", "study", "common");
  open("UTC that nobody else tells", files, others + wheels(""));
  open("the reference's clock", files, others + wheels(", log_clock = \"common\""));
  test::expect_recorded("service/recording/opened_candump.txt", answer_.text(), 1e-4, 1e-7);
}

}  // namespace
}  // namespace imuscope
