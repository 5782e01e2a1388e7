// A file's mistakes in words, before it is used.
#include "drivers/csv/validate.h"

#include <gtest/gtest.h>
#include <fstream>

#include "tests/support/shared_data.h"

namespace imuscope::csv {
namespace {

std::filesystem::path file_with(std::string_view text) {
  auto file = test::scratch_folder() / "imu.csv";
  std::ofstream(file, std::ios::binary) << text;
  return file;
}

std::string message(const Result<void>& result) { return result ? std::string() : result.error().text(); }

constexpr std::string_view kValidHeader =
    "t_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2\n";

TEST(CsvValidation, AGoodFilePasses) {
  EXPECT_EQ(message(validate_file(file_with(std::string(kValidHeader) + "0,1,2,3,4,5,6\n"), ImuConfig{})),
            "");
}

TEST(CsvValidation, AMissingColumnNamesTheNearestAndListsAll) {
  const auto result =
      validate_file(file_with("t_s,gyro_x_radps,gyro_y,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2\n"
                              "0,1,2,3,4,5,6\n"),
                    ImuConfig{});
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().kind, ErrorKind::kUsage);
  const std::string text = message(result);
  for (const char* part :
       {"imu.csv", "line 1", "'gyro_y_radps'", "did you mean", "t_s, gyro_x_radps, gyro_y,"}) {
    EXPECT_NE(text.find(part), std::string::npos) << part << " in: " << text;
  }
  const auto near = validate_file(file_with("time_s,gyro_x_radps,gyro_y_radps\n0,1,2\n"), ImuConfig{});
  EXPECT_NE(message(near).find("did you mean 'time_s'"), std::string::npos) << message(near);
}

TEST(CsvValidation, TextInANumberNamesLineColumnAndText) {
  const std::string text = message(validate_file(
      file_with(std::string(kValidHeader) + "0,1,2,3,4,5,6\n0.01,1,oops,3,4,5,6\n"), ImuConfig{}));
  for (const char* part : {"imu.csv", "line 3", "'oops'", "'gyro_y_radps'"}) {
    EXPECT_NE(text.find(part), std::string::npos) << part << " in: " << text;
  }
}

TEST(CsvValidation, AFileWithoutHeaderIsToldSo) {
  const std::string text =
      message(validate_file(file_with("0,1,2,3,4,5,6\n0.01,1,2,3,4,5,6\n"), ImuConfig{}));
  EXPECT_NE(text.find("names of the columns"), std::string::npos) << text;
}

TEST(CsvValidation, MissingEmptyAndRowlessFilesAndDirectoriesEachGetOneSentence) {
  const auto folder = test::scratch_folder();
  EXPECT_NE(message(validate_file(folder / "none.csv", GnssConfig{})).find("no such file"),
            std::string::npos);
  EXPECT_NE(message(validate_file(folder, GnssConfig{})).find("is a directory"), std::string::npos);
  EXPECT_NE(message(validate_file(file_with(""), GnssConfig{})).find("is empty"), std::string::npos);
  EXPECT_NE(message(validate_file(file_with(kValidHeader), ImuConfig{})).find("no row"), std::string::npos);
  EXPECT_NE(message(validate_file(file_with("# only a comment\n"), ImuConfig{})).find("is empty"),
            std::string::npos);
}

}  // namespace
}  // namespace imuscope::csv
