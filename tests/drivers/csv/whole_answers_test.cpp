// Everything that comes out of rich files, held as it once was.
#include <gtest/gtest.h>
#include <fstream>

#include "drivers/csv/decoder.h"
#include "drivers/csv/validate.h"
#include "tests/drivers/support/sample_text.h"
#include "tests/support/recorded_answer.h"
#include "tests/support/shared_data.h"

namespace imuscope::csv {
namespace {

using test::bytes_of;
using test::expect_recorded;
using namespace std::chrono_literals;

constexpr HostTime kWholeBegin = host_time_from_ns(5'000'000'000'000);
const std::string kImuHeader =
    "t_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2,n\n";

std::string whole_text(RowDecoder& decoder, const std::string& file, std::size_t read_size = 200) {
  const std::string decoded = test::decoded_text(decoder, bytes_of(file), read_size, kWholeBegin, 20ms);
  return decoded + describe(decoder.error()) + '\n';
}

std::string imu_row(double time_s, const std::string& rest = "0.1,-0.2,0.3,1.5,-2.5,9.75",
                    const std::string& counter = "0") {
  return test::real_text(time_s) + ',' + rest + ',' + counter + '\n';
}

TEST(CsvWhole, RowsOfAnImuWithGaps) {
  std::string text;
  std::vector<double> times;
  for (int i = 0; i < 20; ++i) times.push_back(0.01 * i + (i == 5 ? 0.004 : 0.0));
  for (const double more : {0.2, 0.214, 0.2305, 0.27, 0.27, 0.28}) times.push_back(more);
  std::string file = kImuHeader;
  for (const double time : times) file += imu_row(time);
  for (const Duration period : {Duration{}, Duration{10ms}, Duration{20ms}}) {
    ImuConfig config;
    config.device = 3;
    config.period = period;
    if (period == 20ms) {
      config.gyro_unit = AngularRateUnit::kDegps;
      config.accel_unit = AccelerationUnit::kG;
      config.axes = {0, 1, 0, 0, 0, -1, -1, 0, 0};
      config.gyro_columns = {"gyro_y_radps", "-gyro_x_radps", "gyro_z_radps"};
      config.accel_columns = {"-accel_x_mps2", "accel_z_mps2", "-accel_y_mps2"};
      config.time_unit_s = 2.0;
      config.time_offset_s = -0.5;
      config.clock = {};
    }
    ImuDecoder decoder(config);
    text += whole_text(decoder, file);
  }
  expect_recorded("drivers/csv/imu.txt", text, test::kSampleShare);
}

TEST(CsvWhole, CountersThatWrapSkipAndRestart) {
  std::string text;
  for (const auto& counters : std::vector<std::vector<std::string>>{
           {"10", "11", "13", "13", "14", "12", "13"},
           {"65534", "65535", "0", "1", "30", "29"},
           {"65000", "29464", "29465"},
           {"65000", "29465"},
           {"65000", "29463", "64000", "10"},
           {"4294967294", "4294967295", "0", "1"},
           {"4294967294", "29998", "5"},
           {"1.5", "2", "nan", "9007199254740991", "9007199254740992", "-5", "-4"},
           {"70000", "5", "6", "131077"}}) {
    ImuConfig config;
    config.counter_column = "n";
    config.period = 10ms;
    ImuDecoder decoder(config);
    std::string file = kImuHeader;
    int i = 0;
    for (const std::string& counter : counters)
      file += imu_row(0.01 * i++, "0.1,-0.2,0.3,1.5,-2.5,9.75", counter);
    const std::string all = whole_text(decoder, file);
    for (std::size_t at = all.find(" n "); at != std::string::npos; at = all.find(" n ", at + 1))
      text += all.substr(at, all.find(" T", at) - at) + '\n';
    text += all.substr(all.find("counts"));
  }
  expect_recorded("drivers/csv/counters.txt", text);
}

TEST(CsvWhole, RowsThatAreNone) {
  std::string text;
  for (const char* row : {"0.5,1,2,3,4,5,6,7",
                          "0.5,1,2,3,4,5,6",
                          "0.5,1,2,3,4,5",
                          "0.5,,2,3,4,5,6",
                          "0.5,x,2,3,4,5,6",
                          "0.5,+1,\"2\", 3 ,4,5,6",
                          "0.5,++1,2,3,4,5,6",
                          "0.5,1e999,2,3,4,5,6",
                          "0.5,inf,2,3,4,5,6",
                          "0.5,nan,2,3,4,5,6",
                          "0.5,1,2,3,4,5,6x",
                          "4e9,1,2,3,4,5,6",
                          "3.9e9,1,2,3,4,5,6",
                          "-4e9,1,2,3,4,5,6",
                          "nan,1,2,3,4,5,6",
                          "-0.5,1,2,3,4,5,6",
                          "0.4,1,2,3,4,5,6",
                          "0.39,1,2,3,4,5,6",
                          "# 0.5,1,2,3,4,5,6",
                          " \t",
                          "",
                          "0.5;1;2;3;4;5;6",
                          "0.5,1,2,3,4,5,6\r"}) {
    ImuDecoder decoder({});
    text += std::string(row) + " -> " +
            whole_text(decoder, kImuHeader + imu_row(0.4) + row + "\n" + imu_row(0.6));
  }
  for (const std::size_t size :
       {kLineMax - 1, kLineMax, kLineMax + 1, 2 * kLineMax - 1, 2 * kLineMax, 2 * kLineMax + 5}) {
    for (const char* end : {"\n", ""}) {
      ImuDecoder decoder({});
      text +=
          std::to_string(size) + ' ' +
          whole_text(decoder,
                     kImuHeader + imu_row(0.4) + '#' + std::string(size - 1, 'x') + end + imu_row(0.6), 1000);
    }
  }
  expect_recorded("drivers/csv/bad_rows.txt", text, test::kSampleShare);
}

TEST(CsvWhole, HeadersOfEveryKind) {
  std::string text;
  const std::string rows = "0.5,1,2,3,4,5,6,7\n";
  std::string many = "t_s";
  for (int i = 0; i < 600; ++i) many += ",x" + std::to_string(i);
  for (const std::string& header :
       {std::string(
            "\xEF\xBB\xBFt_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2"),
        std::string("t_s;gyro_x_radps"), std::string("t_s\tgyro_x_radps"), std::string("t_s"),
        std::string(
            "t_s,gyro_x_radps,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2"),
        std::string("gyro_z_radps,t_s,gyro_x_radps,gyro_y_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2,n"),
        many + ",gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2"}) {
    ImuDecoder decoder({});
    std::string file = header;
    file.append("\n").append(rows);
    text += whole_text(decoder, file, 100'000);
    for (std::size_t column = 0; column < 9; ++column) text += decoder.reader().is_wanted(column) ? "w" : ".";
    text += '\n' + std::to_string(decoder.reader().line()) + '\n';
  }
  text += separator_of("a,b;c\td"), text += separator_of("a;b\tc"), text += separator_of("a\tb"),
      text += separator_of("ab");
  expect_recorded("drivers/csv/headers.txt", text, test::kSampleShare);
}

GnssConfig gnss_config(bool sd, bool velocity, bool velocity_sd, bool code) {
  GnssConfig config;
  config.device = 5;
  config.period = 1s;
  if (velocity) config.velocity_columns = {"vn", "ve", "vd"};
  if (sd) config.position_sd_columns = {"sn", "se", "sd"};
  if (velocity_sd) config.velocity_sd_columns = {"svn", "sve", "svd"};
  if (code) config.solution_column = "q";
  return config;
}

TEST(CsvWhole, RowsOfAReceiver) {
  const std::string file =
      "t_s,lat_deg,lon_deg,height_m,vn,ve,vd,sn,se,sd,svn,sve,svd,q\n"
      "1,48.5,2.25,81.5,1.5,-2.5,0.5,0.01,0.02,0.03,0.1,0.2,0.3,1\n"
      "2,-48.5,270,81.5,1.5,-2.5,0.5,0.01,0.02,0,0.1,0.2,0.3,2\n"
      "3,90,360,81.5,1.5,,0.5,0.01,0.02,0.03,0.1,0.2,0.3,3\n"
      "4,90.5,2,81.5,1.5,1,0.5,0.01,0.02,0.03,0.1,0.2,0.3,4\n"
      "4.5,-90,-360,81.5,1.5,1,0.5,,0.02,0.03,0.1,,0.3,4\n"
      "5,48,360.5,81.5,1.5,1,0.5,0.01,0.02,0.03,0.1,0.2,0.3,4\n"
      "8,48,2,81.5,1.5,1,0.5,0.01,0.02,0.03,-0.1,0.2,0.3,5\n"
      "9,48,2,81.5,1.5,1,0.5,0.01,0.02,0.03,0.1,0.2,0.3,6\n"
      "10,48,2,81.5,1.5,1,0.5,0.01,0.02,0.03,0.1,0.2,0.3,7\n"
      "11,48,2,81.5,1.5,1,0.5,0.01,0.02,0.03,0.1,0.2,0.3,0\n"
      "12,48,2,81.5,1.5,1,0.5,0.01,0.02,0.03,0.1,0.2,0.3,-1\n"
      "13,48,2,81.5,1.5,1,0.5,0.01,0.02,0.03,0.1,0.2,nan,1.9\n";
  std::string text;
  for (unsigned which = 0; which < 16; ++which) {
    GnssConfig config =
        gnss_config((which & 1U) != 0, (which & 2U) != 0, (which & 4U) != 0, (which & 8U) != 0);
    if (which == 14) config.solution_code = SolutionCode::kNmea;
    if (which == 3) config.solution_without_column = GnssSolution::kDifferential;
    if (which == 4) config.solution_without_column = GnssSolution::kNone;
    GnssDecoder decoder(config);
    text += whole_text(decoder, file);
  }
  expect_recorded("drivers/csv/gnss.txt", text, test::kSampleShare);
}

TEST(CsvWhole, SentencesAboutFiles) {
  std::string text;
  const auto file = test::scratch_folder() / "some.csv";
  const auto add = [&](const Result<void>& result) {
    if (result) {
      text += "good\n";
      return;
    }
    std::string sentence =
        std::to_string(static_cast<int>(result.error().kind)) + ' ' + result.error().text();
    for (std::size_t at = sentence.find(file.parent_path().string()); at != std::string::npos;
         at = sentence.find(file.parent_path().string())) {
      sentence.erase(at, file.parent_path().string().size() + 1);
    }
    text += sentence + '\n';
  };
  for (const std::string& content :
       {std::string(""), kImuHeader, kImuHeader + imu_row(0.5),
        kImuHeader + imu_row(0.5) + "0.6,1,x,3,4,5,6\n", kImuHeader + "0.5,1,2,3\n",
        kImuHeader + "0.5,,2,3,4,5,6\n", kImuHeader + "0.5,inf,2,3,4,5,6\n",
        kImuHeader + imu_row(0.5) + imu_row(0.4), std::string("0.1,0.2,0.3\n0.2,0.3,0.4\n"),
        std::string("time,gyro_x,gyro_y,gyro_z,a,b,c\n1,2,3,4,5,6,7\n"),
        std::string("t_s,gyro_x_rad,gyro_y_radps\n1,2,3\n"), std::string("1,2,x\n"),
        kImuHeader + std::string(5000, 'x'), std::string("# only\n\n")}) {
    std::ofstream(file, std::ios::binary) << content;
    add(validate_file(file, ImuConfig{}));
    add(validate_file(file, GnssConfig{}));
  }
  std::ofstream(file, std::ios::binary) << "t_s,lat_deg,lon_deg,height_m\n1,2,3,4\n";
  add(validate_file(file, GnssConfig{}));
  std::string long_file = kImuHeader;
  for (int i = 0; i < 3000; ++i) long_file += imu_row(i);
  std::ofstream(file, std::ios::binary) << long_file + "x,1\n";
  add(validate_file(file, ImuConfig{}));
  add(validate_file(file.parent_path(), ImuConfig{}));
  add(validate_file(file.parent_path() / "none.csv", GnssConfig{}));
  expect_recorded("drivers/csv/sentences.txt", text);
}

}  // namespace
}  // namespace imuscope::csv
