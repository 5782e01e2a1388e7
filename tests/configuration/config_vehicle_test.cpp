// The configuration of what hangs on a vehicle's CAN.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <fstream>

#include "base/units.h"
#include "configuration/config.h"
#include "service/pipeline/device_factory.h"
#include "service/pipeline/estimator_setup.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

using testing::HasSubstr;

constexpr std::string_view kDbc =
    "BO_ 170 REAR: 8 ECU\n"
    " SG_ RL : 7|16@0- (0.01,0) [0|0] \"km/h\" X\n"
    " SG_ RR : 23|16@0- (0.01,0) [0|0] \"\xB0\\\"km/h\" X\n"
    "BO_ 2147483650 GEAR: 1 ECU\n"
    " SG_ LEVER : 0|8@1+ (1,0) [0|0] \"\" X\n"
    "VAL_ 2147483650 LEVER 0 \"park\" 1 \"reverse\" ;\n";

constexpr std::string_view kImus = R"([[device]]
name = "r"
role = "reference"
protocol = "ixblue_stdbin"
[[device]]
name = "s"
role = "study"
protocol = "xsens_can"
[device.xsens_can]
ids = { delta_v = "131", delta_q = "18FF0133" }
)";

constexpr std::string_view kWheels = R"([[device]]
name = "wheels"
role = "odometry"
protocol = "can_odometry"
rate_hz = 80
[device.odometry]
dbc = "car.dbc"
speed_signals = ["REAR.RL", "REAR.RR"]
speed_unit = "km/h"
direction_signal = "GEAR.LEVER"
backward_values = ["reverse"]
latency_ms = 20
axle_lever_arm_b_m = [-1.2, 0.0, 0.5]
axle_lever_arm_sd_m = 0.05
scale_sd_percent = 2.0
mounting_sd_deg = 1.0
non_holonomic = false
)";

class VehicleConfiguration : public testing::Test {
 protected:
  VehicleConfiguration() { write("car.dbc", kDbc); }
  void write(const std::string& name, std::string_view text) const {
    std::ofstream(folder_ / name, std::ios::binary) << text;
  }
  [[nodiscard]] Result<Configuration> load(std::string_view text) const {
    write("car.toml", text);
    return load_configuration(folder_ / "car.toml");
  }
  [[nodiscard]] std::string refused(std::string text, std::string_view from, std::string_view to) const {
    text.replace(text.find(from), from.size(), to);
    const auto result = load(text);
    EXPECT_FALSE(result) << "accepted:\n" << text;
    if (result) return {};
    EXPECT_EQ(result.error().kind, ErrorKind::kUsage);
    return result.error().text();
  }
  std::filesystem::path folder_ = test::scratch_folder();
  std::string whole_ = std::string(kImus) + std::string(kWheels);
};

TEST_F(VehicleConfiguration, ChoosesSignalsAndTellsTheFilter) {
  const auto configuration = load(whole_);
  ASSERT_TRUE(configuration) << configuration.error().text();
  ASSERT_EQ(configuration->odometry_index(), 2U);
  const EstimatorConfig estimator = estimator_config(*configuration);
  EXPECT_TRUE(estimator.odometry.enabled);
  EXPECT_EQ(estimator.odometry.device, 2);
  EXPECT_EQ(estimator.odometry.rate_hz, 80.0);
  EXPECT_TRUE(estimator.odometry.use_speed);
  EXPECT_FALSE(estimator.odometry.use_non_holonomic);
  EXPECT_EQ(estimator.odometry.prior_r_bv_b_m, (Vector3{-1.2, 0.0, 0.5}));
  EXPECT_EQ(estimator.odometry.prior_r_bv_b_sd_m[1], 0.05);
  EXPECT_NEAR(estimator.odometry.prior_scale_sd, 0.02, 1e-15);
  EXPECT_NEAR(estimator.odometry.prior_mount_sd_rad, kRadPerDeg, 1e-15);
  EXPECT_EQ(configuration->devices[2].odometry.latency_s, 0.02);
  EXPECT_NE(make_decoder(configuration->devices[2], 2, {}), nullptr);
  EXPECT_NE(make_decoder(configuration->devices[1], 1, {}), nullptr);
}

TEST_F(VehicleConfiguration, KeepsTheDbcFileSoThatACaptureIsWhole) {
  const auto configuration = load(whole_);
  ASSERT_TRUE(configuration);
  EXPECT_THAT(configuration->text, HasSubstr("[attached]"));
  // As a capture's reader has it: no file beside it.
  const auto again = parse_configuration(configuration->text, "car (kept in the capture)");
  ASSERT_TRUE(again) << again.error().text();
  EXPECT_EQ(again->sha256, configuration->sha256);
  EXPECT_EQ(again->text, configuration->text);
  ASSERT_NE(again->devices[2].odometry.database, nullptr);
  EXPECT_EQ(again->devices[2].odometry.database->messages.size(), 2U);
  EXPECT_EQ(again->devices[2].odometry.database->messages[0].signals[1].unit, "\xC2\xB0\\\"km/h");
  // Another DBC file is another configuration.
  write("car.dbc", std::string(kDbc) + "\n");
  EXPECT_NE(load(whole_)->sha256, configuration->sha256);
}

TEST_F(VehicleConfiguration, ThatOfACaptureReadsNoFileOfThisPc) {
  ASSERT_TRUE(load(whole_));
  std::string text = whole_;
  const std::string dbc = (folder_ / "car.dbc").string();
  ASSERT_TRUE(std::filesystem::exists(dbc));
  text.replace(text.find("car.dbc"), std::string("car.dbc").size(), dbc);
  const auto of_capture = parse_configuration(text, "car (kept in the capture)");
  ASSERT_FALSE(of_capture) << "the file's text would stand in run.json and in the report";
  EXPECT_THAT(of_capture.error().text(), HasSubstr("is not attached to this configuration"));
  EXPECT_TRUE(load(text)) << "a person's own configuration may name any file";
}

TEST_F(VehicleConfiguration, MistakesAreToldWithFileLineAndRemedy) {
  EXPECT_THAT(refused(whole_, "\"REAR.RL\"", "\"REAR.RX\""),
              HasSubstr("car.dbc: no signal 'REAR.RX'; did you mean 'REAR.RL'?"));
  EXPECT_THAT(refused(whole_, "\"REAR.RL\"", "\"REAR.RX\""),
              HasSubstr("car.toml:18: device.odometry.speed_signals"));
  EXPECT_THAT(refused(whole_, "car.dbc", "cat.dbc"), HasSubstr("cat.dbc does not exist"));
  EXPECT_THAT(refused(whole_, "speed_signals", "speed_signal"),
              HasSubstr("device.odometry.speed_signals is missing"));
  EXPECT_THAT(refused(whole_, "scale_sd_percent", "scale_sd_percents"),
              HasSubstr("did you mean 'scale_sd_percent'?"));
  EXPECT_THAT(refused(whole_, "protocol = \"can_odometry\"", "protocol = \"xsens_can\""),
              HasSubstr("xsens_can does not fit role odometry"));
  EXPECT_THAT(refused(whole_, "\"131\"", "\"1310\""), HasSubstr("'1310' is no identifier"));
  EXPECT_THAT(refused(whole_, "delta_v", "delta_w"), HasSubstr("did you mean 'delta_v'?"));
  EXPECT_THAT(refused(whole_, "[device.odometry]", "[device.odometri]"), HasSubstr("device.odometry"));
  write("car.dbc", "BO_ 170 REAR: 8 ECU\n SG_ RL : 7|16@0- 0.01,0) [0|0] \"km/h\" X\n");
  EXPECT_THAT(refused(whole_, "latency_ms = 20", "latency_ms = 21"),
              HasSubstr("car.dbc:2: SG_ RL: expected '(', found '0.01'"));
}

TEST_F(VehicleConfiguration, IdentifiersHaveThreeOrEightDigits) {
  const auto configuration = load(whole_);
  ASSERT_TRUE(configuration);
  const auto& ids = configuration->devices[1].xsens_can_ids;
  EXPECT_EQ(ids[static_cast<std::size_t>(xsens_can::Item::kDeltaV)], (CanId{0x131, false}));
  EXPECT_EQ(ids[static_cast<std::size_t>(xsens_can::Item::kDeltaQ)], (CanId{0x18FF0133, true}));
  EXPECT_EQ(ids[static_cast<std::size_t>(xsens_can::Item::kSampleTime)], (CanId{0x005, false}));
}

}  // namespace
}  // namespace imuscope
