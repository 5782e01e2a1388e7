#include "configuration/config.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <fstream>

#include "base/units.h"
#include "service/pipeline/estimator_setup.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

using testing::HasSubstr;

constexpr const char* kMinimal = R"(
[[device]]
name = "r"
role = "reference"
protocol = "ixblue_stdbin"
[[device]]
name = "s"
role = "study"
protocol = "xsens_mt"
)";

Configuration parsed(const std::string& text) {
  auto result = parse_configuration(text, "x.toml");
  EXPECT_TRUE(result) << (result ? "" : result.error().text());
  return result.value_or(Configuration{});
}

std::string refused(const std::string& text) {
  auto result = parse_configuration(text, "x.toml");
  EXPECT_FALSE(result) << "accepted:\n" << text;
  if (result) return {};
  EXPECT_EQ(result.error().kind, ErrorKind::kUsage);
  return result.error().text();
}

TEST(Configuration, EveryCommittedConfigurationIsAccepted) {
  int read = 0;
  for (const auto& entry : std::filesystem::directory_iterator(test::source_path("config"))) {
    if (entry.path().extension() != ".toml") continue;
    // A script of faults for the simulator, no configuration.
    if (entry.path().filename() == "faults.toml") continue;
    const auto result = load_configuration(entry.path());
    EXPECT_TRUE(result) << (result ? "" : result.error().text());
    ++read;
  }
  EXPECT_GE(read, 2);
}

TEST(Configuration, ADeviceWithoutAxesOfAStdbinUnitIsTurnedToForwardRightDown) {
  const auto configuration = parsed(kMinimal);
  EXPECT_EQ(configuration.devices[0].axes, (std::array<double, 9>{1, 0, 0, 0, -1, 0, 0, 0, -1}));
  EXPECT_EQ(configuration.devices[1].axes, (std::array<double, 9>{1, 0, 0, 0, 1, 0, 0, 0, 1}));
}

std::string with_virtual_imu(const std::string& keys) {
  return std::string(kMinimal) +
         "[[device]]\nname = \"s2\"\nrole = \"study\"\nprotocol = \"xsens_mt\"\n[virtual_imu]\n" + keys;
}

TEST(Configuration, AVirtualImuHasWeightsOfSumOneOrEqualOnes) {
  EXPECT_TRUE(parsed(kMinimal).virtual_imu.empty());
  const auto members =
      parsed(with_virtual_imu("imus = [\"s2\", \"s\"]\ngyro_y = [1.251, -0.25]\n")).virtual_imu;
  ASSERT_EQ(members.size(), 2U);
  EXPECT_EQ(members[0].device, 2U);
  EXPECT_EQ(members[1].device, 1U);
  EXPECT_EQ(members[0].gyro[0], 0.5);
  EXPECT_EQ(members[1].accel[2], 0.5);
  EXPECT_DOUBLE_EQ(members[0].gyro[1], 1.251 / 1.001);
  EXPECT_DOUBLE_EQ(members[0].gyro[1] + members[1].gyro[1], 1.0);
}

TEST(Configuration, AVirtualImuThatCannotBeIsRefusedWithWhatIsWrong) {
  EXPECT_THAT(refused(with_virtual_imu("gyro_x = [0.5, 0.5]")), HasSubstr("virtual_imu"));
  EXPECT_THAT(refused(with_virtual_imu("imus = [\"s\"]")), HasSubstr("a mean takes two or more"));
  EXPECT_THAT(refused(with_virtual_imu("imus = [\"s\", \"s\"]")), HasSubstr("names 's' twice"));
  EXPECT_THAT(refused(with_virtual_imu("imus = [\"s\", \"r\"]")),
              HasSubstr("names 'r', which is no device of role study"));
  EXPECT_THAT(refused(with_virtual_imu("imus = [\"s\", \"s2\"]\ngyro_x = [1.0]")),
              HasSubstr("has 1 weights for 2 IMUs"));
  EXPECT_THAT(refused(with_virtual_imu("imus = [\"s\", \"s2\"]\ngyro_x = [0.5, 0.4]")),
              HasSubstr("has weights whose sum is 0.9"));
  EXPECT_THAT(refused(with_virtual_imu("imus = [\"s\", \"s2\"]\ngyro_w = [0.5, 0.5]")), HasSubstr("gyro_w"));
}

TEST(Configuration, PulsesOfUtcAreADeviceOfTheirOwn) {
  const std::string pps = R"(
[[device]]
name = "pps"
role = "time"
protocol = "pps"
transport = { kind = "pps", port = "/dev/pps0", edge = "clear" }
)";
  const auto configuration = parsed(kMinimal + pps);
  ASSERT_EQ(configuration.devices.size(), 3U);
  const DeviceConfig& device = configuration.devices[2];
  EXPECT_EQ(device.role, DeviceRole::kTime);
  ASSERT_TRUE(device.pps);
  EXPECT_EQ(device.pps->port, "/dev/pps0");
  EXPECT_TRUE(device.pps->clear_edge);
  EXPECT_EQ(device.rate_hz, 1.0);
  EXPECT_THAT(refused(kMinimal + pps + pps), HasSubstr("pps"));
  auto other = pps;
  other.replace(other.find("\"pps\"\nrole"), 5, "\"two\"");
  EXPECT_THAT(refused(kMinimal + pps + other), HasSubstr("more than one time device"));
  EXPECT_THAT(
      refused(std::string(kMinimal) + "[[device]]\nname = \"p\"\nrole = \"time\"\nprotocol = \"pps\"\n"
                                      "transport = { kind = \"tcp\", host = \"h\", port = 1 }\n"),
      HasSubstr("does not carry pps"));
  EXPECT_THAT(refused(std::string(kMinimal) + "transport = { kind = \"pps\", port = \"/dev/pps0\" }\n"),
              HasSubstr("does not carry xsens_mt"));
  EXPECT_THAT(
      refused(std::string(kMinimal) + "[[device]]\nname = \"p\"\nrole = \"gnss\"\nprotocol = \"pps\"\n"),
      HasSubstr("does not fit role gnss"));
}

TEST(Configuration, UserUnitsBecomeSiOnLoading) {
  const auto configuration = parsed(std::string(kMinimal) + R"(
rate_hz = 50
[device.noise]
gyro_white_sd_degps = 0.5
accel_white_ug_per_sqrt_hz = 100.0
gyro_bias_sd_deg_per_h = 3600.0
[device.prior]
time_offset_ms = -4.0
)");
  const auto& study = configuration.devices[1];
  EXPECT_DOUBLE_EQ(*study.noise.gyro_white_sd_radps, 0.5 * kPi / 180.0);
  EXPECT_DOUBLE_EQ(*study.noise.accel_white_sd_mps2, 100e-6 * 9.80665 * std::sqrt(50.0));
  EXPECT_DOUBLE_EQ(*study.noise.gyro_bias_sd_radps, kPi / 180.0);
  EXPECT_DOUBLE_EQ(*study.prior.time_offset_s, -0.004);
  const auto estimator = estimator_config(configuration);
  EXPECT_DOUBLE_EQ(estimator.studies.at(0).noise.gyro[1].white_sd[2], 0.5 * kPi / 180.0);
  EXPECT_FALSE(estimator.navigation.enabled) << "there is no GNSS device";
}

TEST(Configuration, APriorRotationVectorBecomesTheRotationItNames) {
  const auto configuration = parsed(std::string(kMinimal) + R"(
[device.prior]
rotation_vector_b_s_deg = [0.0, 0.0, 90.0]
)");
  const auto C = *configuration.devices[1].prior.C_b_s;
  // A quarter turn about z takes x to y.
  EXPECT_NEAR(C[0], 0.0, 1e-15);
  EXPECT_NEAR(C[3], 1.0, 1e-15);
  EXPECT_NEAR(C[1], -1.0, 1e-15);
  EXPECT_NEAR(C[8], 1.0, 1e-15);
}

TEST(Configuration, AKeyThatWouldTakeTheStackIsRefused) {
  constexpr int kWords = 400'000;
  const auto repeated = [](const std::string& word) {
    std::string key;
    for (int i = 0; i < kWords; ++i) key += word;
    return key;
  };
  const std::vector<std::string> documents{repeated("a.") + "a = 1\n",
                                           "[" + repeated("a.") + "a]\n",
                                           "[[" + repeated("\"a\" . ") + "a]]\n",
                                           "x = {" + repeated("'a'.") + "a = 1}\n",
                                           "x = [{" + repeated("a.\t") + "a = 1}]\n",
                                           "x = \"\"\"\n\"\" # \"\"\"\n" + repeated("a.") + "a = 1\n",
                                           "x = '\\'\n" + repeated("a.") + "a = 1\n"};
  for (const std::string& document : documents)
    EXPECT_THAT(refused(document + std::string(kMinimal)), HasSubstr("a key has more than 64 words"));
  const std::string words = "x = \"" + repeated("a.") + "\" # " + repeated("a.") + "\n";
  EXPECT_THAT(refused(words + std::string(kMinimal)), testing::Not(HasSubstr("a key has"))) << "no key";
}

TEST(Configuration, ATextIsALineWithoutControlCharacters) {
  EXPECT_THAT(refused("[run]\nname = \"a\\u001b[2J\"\n" + std::string(kMinimal)),
              HasSubstr("run.name must be one line"));
  EXPECT_THAT(refused("[run]\nname = \"a\\nREADY=1\"\n" + std::string(kMinimal)),
              HasSubstr("run.name must be one line"));
  EXPECT_THAT(refused("[run]\nname = \"" + std::string(5'000, 'x') + "\"\n" + std::string(kMinimal)),
              HasSubstr("at most 4096 bytes"));
}

TEST(Configuration, AnUnknownKeyIsRefusedWithLineAndNearestKey) {
  const auto text = refused(std::string(kMinimal) + "rate_herz = 100\n");
  EXPECT_THAT(text, HasSubstr("x.toml:10"));
  EXPECT_THAT(text, HasSubstr("rate_herz"));
  EXPECT_THAT(text, HasSubstr("did you mean 'rate_hz'"));
}

TEST(Configuration, AnUnknownWordListsTheValidOnes) {
  const auto text = refused("[[device]]\nname = \"r\"\nrole = \"referense\"\nprotocol = \"greis\"\n");
  EXPECT_THAT(text, HasSubstr("x.toml:3"));
  EXPECT_THAT(text, HasSubstr("reference, study, gnss"));
}

TEST(Configuration, AnImpossibleValueNamesItsRange) {
  EXPECT_THAT(refused(std::string(kMinimal) + "rate_hz = -1\n"),
              HasSubstr("rate_hz must be a number from 0.1"));
}

TEST(Configuration, CoresOfTheThreadsAreAList) {
  const auto configuration =
      parsed(std::string("[threads]\nio_cores = [1]\nestimator_cores = [0, 1]\n") + kMinimal);
  EXPECT_EQ(configuration.threads.io_cores, std::vector<int>{1});
  EXPECT_EQ(configuration.threads.estimator_cores, (std::vector<int>{0, 1}));
  EXPECT_TRUE(parsed(kMinimal).threads.io_cores.empty()) << "any core unless some are named";
  EXPECT_THAT(refused(std::string("[threads]\nio_cores = [-1]\n") + kMinimal),
              HasSubstr("threads.io_cores names a core -1"));
  EXPECT_THAT(refused(std::string("[threads]\nio_cores = [0.5]\n") + kMinimal),
              HasSubstr("names a core 0.5"));
}

TEST(Configuration, NothingIsRemovedAndNothingListenedToUnlessItIsAskedFor) {
  const auto usual = parsed(kMinimal);
  EXPECT_FALSE(usual.record.remove_older_than_s || usual.record.remove_beyond_bytes ||
               usual.record.remove_below_free_bytes);
  EXPECT_EQ(usual.metrics.port, 0);
  EXPECT_EQ(usual.metrics.address, "127.0.0.1");
  const auto asked = parsed(std::string("[record]\nremove_older_than_days = 30\nremove_beyond_gb = 100\n"
                                        "remove_below_free_gb = 5\nfile_gb = 0.5\nfile_hours = 2\n"
                                        "[metrics]\nport = 9847\naddress = \"::1\"\n") +
                            kMinimal);
  EXPECT_DOUBLE_EQ(asked.record.remove_older_than_s.value_or(0.0), 30.0 * 86400.0);
  EXPECT_DOUBLE_EQ(asked.record.remove_beyond_bytes.value_or(0.0), 1e11);
  EXPECT_DOUBLE_EQ(asked.record.remove_below_free_bytes.value_or(0.0), 5e9);
  EXPECT_DOUBLE_EQ(asked.record.file_bytes, 5e8);
  EXPECT_DOUBLE_EQ(asked.record.file_s, 7200.0);
  EXPECT_EQ(asked.metrics.port, 9847);
  EXPECT_THAT(refused(std::string("[metrics]\nport = 9847\naddress = \"vehicle\"\n") + kMinimal),
              HasSubstr("'vehicle' is no address"));
  EXPECT_THAT(refused(std::string("[record]\nremove_older_than_days = 0\n") + kMinimal),
              HasSubstr("remove_older_than_days"));
}

TEST(Configuration, AxesThatAreNoRotationAreRefused) {
  EXPECT_THAT(refused(std::string(kMinimal) + "axes = \"+x +y -z\"\n"), HasSubstr("is not a rotation"));
  EXPECT_THAT(refused(std::string(kMinimal) + "axes = \"forward\"\n"), HasSubstr("signed axes"));
}

TEST(Configuration, TwoReferencesAreRefused) {
  const std::string twice =
      std::string(kMinimal) + "[[device]]\nname = \"r2\"\nrole = \"reference\"\nprotocol = \"csv_imu\"\n";
  EXPECT_THAT(refused(twice), HasSubstr("2 devices with role reference"));
}

TEST(Configuration, TheSameNameTwiceIsRefused) {
  const std::string twice =
      std::string(kMinimal) + "[[device]]\nname = \"s\"\nrole = \"study\"\nprotocol = \"csv_imu\"\n";
  EXPECT_THAT(refused(twice), HasSubstr("'s' is used twice"));
}

TEST(Configuration, ANameThatCouldLeaveTheOutputFolderIsRefused) {
  EXPECT_THAT(refused("[[device]]\nname = \"../s\"\nrole = \"study\"\nprotocol = \"csv_imu\"\n"),
              HasSubstr("letters, digits"));
}

TEST(Configuration, BrokenTomlNamesTheLine) {
  EXPECT_THAT(refused("[run]\nname = \n"), HasSubstr("x.toml:2"));
}

TEST(Configuration, AMissingOrEmptyFileAndAFolderAreToldApart) {
  const auto folder = test::scratch_folder();
  EXPECT_THAT(load_configuration(folder / "absent.toml").error().text(), HasSubstr("does not exist"));
  EXPECT_THAT(load_configuration(folder).error().text(), HasSubstr("is a folder"));
  std::ofstream(folder / "empty.toml").close();
  EXPECT_THAT(load_configuration(folder / "empty.toml").error().text(), HasSubstr("is empty"));
}

TEST(Configuration, TheHashIsThatOfTheText) {
  // Expected by coreutils: sha256sum of the text below.
  const std::string text =
      "[[device]]\nname = \"r\"\nrole = \"reference\"\nprotocol = \"csv_imu\"\n"
      "[[device]]\nname = \"s\"\nrole = \"study\"\nprotocol = \"csv_imu\"\n";
  EXPECT_EQ(parsed(text).sha256, "2bdf62cebb4b14b378b86ad7aeda9525d8823bb185756ec989c2bce285d0b960");
}

}  // namespace
}  // namespace imuscope
