#include "service/recording/decoded_lines.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <string>

#include "tests/support/two_devices.h"

namespace imuscope {
namespace {

/// A row of a text file with every read.
class Rows final : public ByteSource {
 public:
  /// @param arrivals_ms  of its rows; none: without stamps
  Rows(std::vector<int> arrivals_ms, std::size_t rows, std::size_t fails_after)
      : arrivals_ms_(std::move(arrivals_ms)), rows_(rows), fails_after_(fails_after) {}

  Result<std::optional<RecordedRead>> next() override {
    if (at_ == fails_after_) return work_error("the disk is gone");
    if (at_ == rows_) return std::optional<RecordedRead>{};
    text_ =
        at_ == 0 ? "t_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2\n" : "";
    text_ += fmt::format("{:.2f},0.1,0.2,0.3,0,0,-9.8\n", 0.01 * static_cast<double>(at_));
    RecordedRead read;
    read.bytes = {reinterpret_cast<const std::uint8_t*>(text_.data()), text_.size()};
    if (!arrivals_ms_.empty()) read.arrival = HostTime{std::chrono::milliseconds{arrivals_ms_[at_]}};
    ++at_;
    return std::optional<RecordedRead>{read};
  }
  [[nodiscard]] std::uint64_t bytes_read() const override { return 0; }
  [[nodiscard]] std::uint64_t bytes_total() const override { return 1; }

 private:
  std::vector<int> arrivals_ms_;
  std::size_t rows_;
  std::size_t fails_after_;
  std::size_t at_ = 0;
  std::string text_;
};

constexpr std::size_t kNever = 1'000'000;

struct MadeLine {
  std::vector<int> arrivals_ms;
  std::size_t rows = 0;
  std::size_t fails_after = kNever;
};

/// Each by whoever asks for it, and by a thread.
class DecodedLinesTest : public testing::TestWithParam<Reading> {
 protected:
  DecodedLines open(const MadeLine& reference, const MadeLine& study,
                    std::vector<bool> is_wanted = {true, true}) {
    recording_.present = {true, true};
    recording_.clocks.resize(2);
    for (auto& clock : recording_.clocks) clock.map = ClockMapConfig::fixed(HostTime{}, 1.0);
    recording_.has_lines_apart = true;
    recording_.open_side_by_side = [reference, study](Reading) {
      std::vector<std::unique_ptr<ByteSource>> sources;
      for (const MadeLine& line : {reference, study})
        sources.push_back(std::make_unique<Rows>(line.arrivals_ms, line.rows, line.fails_after));
      return Result<std::vector<std::unique_ptr<ByteSource>>>(std::move(sources));
    };
    return std::move(*DecodedLines::open(configuration_, recording_, is_wanted, GetParam()));
  }
  /// "0 1 0": whose samples came.
  static std::string order_of(DecodedLines& lines) {
    std::string order;
    for (auto read = lines.next(); !read || *read; read = lines.next()) {
      if (!read) {
        order += "!";
        continue;
      }
      for (const Sample& sample : (*read)->samples) {
        EXPECT_EQ(sample.device, (*read)->device);
        order += std::to_string(sample.device);
      }
    }
    return order;
  }

  Configuration configuration_ = *parse_configuration(test::kTwoDevices, "test.toml");
  Recording recording_;
};

TEST_P(DecodedLinesTest, ComeInTheOrderOfTheirArrival) {
  auto lines = open({{0, 10, 20, 30}, 4}, {{5, 6, 25, 26, 27}, 5});
  EXPECT_EQ(order_of(lines), "011001110");
  EXPECT_FALSE(*lines.next()) << "the end stays the end";
}

TEST_P(DecodedLinesTest, OfNoStampsComeOneAfterTheOther) {
  auto lines = open({{}, 3}, {{}, 2});
  EXPECT_EQ(order_of(lines), "00011");
}

TEST_P(DecodedLinesTest, OneMayBeAskedForAlone) {
  auto lines = open({{0, 10, 20}, 3}, {{5, 6}, 2});
  EXPECT_EQ((*lines.next_of(1))->device, 1U);
  EXPECT_EQ((*lines.next_of(1))->device, 1U);
  EXPECT_FALSE(*lines.next_of(1));
  EXPECT_EQ(order_of(lines), "000");
}

TEST_P(DecodedLinesTest, OneMayBeLeftOrNotBeWantedAtAll) {
  auto lines = open({{0, 10, 20}, 3}, {{5, 6, 7}, 3});
  EXPECT_EQ((*lines.next())->device, 0U);
  EXPECT_EQ((*lines.next())->device, 1U);
  lines.leave(1);
  EXPECT_EQ(order_of(lines), "00");
  auto one = open({{0, 10, 20}, 3}, {{5, 6, 7}, 3}, {false, true});
  EXPECT_EQ(order_of(one), "111");
}

TEST_P(DecodedLinesTest, OneThatFailsEndsAloneAndSaysSo) {
  auto lines = open({{0, 10, 20}, 3, 1}, {{5, 16, 17}, 3});
  EXPECT_EQ(order_of(lines), "0!111");
}

INSTANTIATE_TEST_SUITE_P(WhenAskedAndAhead, DecodedLinesTest,
                         testing::Values(Reading::kWhenAsked, Reading::kAhead));

}  // namespace
}  // namespace imuscope
