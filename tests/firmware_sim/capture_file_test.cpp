/// The capture that the simulator writes, read back by the reader of live captures. Both know the format from
/// its description alone.

#include "firmware_sim/imusim/capture_file.h"

#include <gtest/gtest.h>
#include <fstream>
#include <sstream>

#include "capture/capture_reader.h"
#include "capture/raw_dump.h"
#include "tests/support/shared_data.h"

namespace imusim {
namespace {

using imuscope::test::scratch_folder;

class CaptureFileTest : public testing::Test {
 protected:
  void device(const std::string& name, const std::string& bytes, const std::string& arrivals) {
    std::ofstream(folder_ / (name + ".bin"), std::ios::binary) << bytes;
    std::ofstream(folder_ / (name + ".arrivals.csv")) << "byte_offset,n_bytes,arrival_ns\n" << arrivals;
    header_.devices.push_back(name);
  }
  void write() {
    header_.run_name = "test";
    header_.version = "7";
    header_.host_begin_ns = 1'000'000'000;
    header_.utc_begin = Utc{std::chrono::nanoseconds{1'700'000'000'000'000'000}};
    header_.configuration = "abc";
    const auto written = write_capture(header_, folder_);
    ASSERT_TRUE(written) << written.error().text;
  }
  /// "device@arrival:bytes" of each read, in the reader's order.
  [[nodiscard]] std::string reads() const {
    auto reader = imuscope::CaptureReader::open(folder_ / "capture.lcm");
    EXPECT_TRUE(reader) << reader.error().text();
    std::string all;
    while (const auto read = reader->next()) {
      EXPECT_EQ(read->direction, imuscope::Direction::kRead);
      all += read->device + "@" + std::to_string(imuscope::to_ns(read->arrival)) + ":" +
             std::string(read->bytes.begin(), read->bytes.end()) + " ";
    }
    EXPECT_EQ(reader->disordered(), 0U);
    return all;
  }

  std::filesystem::path folder_ = scratch_folder();
  CaptureHeader header_;
};

TEST_F(CaptureFileTest, ReadsOfAllDevicesComeBackInTheOrderOfArrival) {
  device("mtx-1", "abcdef", "0,2,1005000000\n2,1,1030000000\n3,3,1040000000\n");
  device("ref", "xyz", "0,1,1005000000\n1,2,1006000000\n");
  write();
  EXPECT_EQ(reads(),
            "mtx-1@1005000000:ab ref@1005000000:x ref@1006000000:yz mtx-1@1030000000:c "
            "mtx-1@1040000000:def ");
}

TEST_F(CaptureFileTest, TheHeaderSaysWhatWasRunAndWhen) {
  device("a", "x", "0,1,1234567890\n");
  write();
  const auto summary = imuscope::summarise_capture(folder_ / "capture.lcm");
  ASSERT_TRUE(summary) << summary.error().text();
  const imuscope::RunHeader& run = summary->run;
  EXPECT_EQ(run.name, "test");
  EXPECT_EQ(run.version, "7");
  EXPECT_EQ(imuscope::to_ns(run.t0), 1'230'000'000);  // the tick before the first read
  EXPECT_EQ(run.period, std::chrono::milliseconds(10));
  EXPECT_EQ(run.t0_wall.time_since_epoch().count(), 1'700'000'000'230'000'000);
  EXPECT_EQ(run.configuration, "abc");
  // FIPS 180-2, appendix B.1.
  EXPECT_EQ(run.configuration_hash, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(run.devices, std::vector<std::string>{"a"});
  const imuscope::LogHealth health = imuscope::health_of(summary->files);
  EXPECT_EQ(health.bytes_skipped + health.bytes_cut_off + summary->other_messages, 0U);
}

TEST_F(CaptureFileTest, ALongReadIsCutAndJoinedAgain) {
  const std::string bytes(5000, 'q');
  device("a", bytes, "0,5000,1000000000\n");
  write();
  EXPECT_EQ(reads(), "a@1000000000:" + bytes + " ");
}

TEST_F(CaptureFileTest, ADeviceThatNeverSpokeIsStillNamed) {
  device("a", "x", "0,1,1000000000\n");
  device("silent", "", "");
  write();
  const auto summary = imuscope::summarise_capture(folder_ / "capture.lcm");
  ASSERT_TRUE(summary);
  EXPECT_EQ(summary->run.devices.size(), 2U);
  EXPECT_FALSE(summary->devices.contains("silent"));
}

}  // namespace
}  // namespace imusim
