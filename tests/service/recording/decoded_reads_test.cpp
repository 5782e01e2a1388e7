#include "service/recording/decoded_reads.h"

#include <gtest/gtest.h>
#include <string>

namespace imuscope {
namespace {

constexpr int kReadsOfMany = 20000;  // several blocks

/// Reads of growing length, the bytes of which stand only until the next one.
class MadeSource final : public ByteSource {
 public:
  /// @param fails_after  so many reads; never where it is negative
  explicit MadeSource(int reads, int fails_after = -1) : reads_(reads), fails_after_(fails_after) {}

  Result<std::optional<RecordedRead>> next() override {
    if (at_ == fails_after_)
      return tl::unexpected<Error>(Error{ErrorKind::kWork, "the disk is gone", "look"});
    if (at_ == reads_) return std::optional<RecordedRead>{};
    bytes_.assign(static_cast<std::size_t>(1 + at_ % 70), static_cast<std::uint8_t>(at_));
    RecordedRead read{host_time_from_ns(1'000'000'000 + at_), bytes_};
    if (at_ % 13 == 4) read.arrival.reset();
    if (at_ % 3 == 0) read.per_byte = Duration{1 + at_};
    if (at_ % 5 == 0) read.received = host_time_from_ns(900'000'000 + at_);
    ++at_;
    return std::optional<RecordedRead>{read};
  }
  [[nodiscard]] std::uint64_t bytes_read() const override { return 0; }
  [[nodiscard]] std::uint64_t bytes_total() const override { return 77; }

 private:
  int reads_;
  int fails_after_;
  int at_ = 0;
  std::vector<std::uint8_t> bytes_;
};

/// A sample for every hundred bytes, which keeps all that it was told in what a sample has room for.
class MadeDecoder final : public DeviceDecoder {
 public:
  void push(std::span<const std::uint8_t> bytes, Arrival arrival, SampleSink& sink) noexcept override {
    counters_.bytes += bytes.size();
    for (waiting_ += bytes.size(); waiting_ >= 100; waiting_ -= 100) give(bytes.back(), arrival, sink);
  }
  void finish(HostTime arrival, SampleSink& sink) noexcept override { give(255, arrival, sink); }
  void set_per_byte(Duration per_byte) noexcept override { per_byte_ = per_byte; }
  [[nodiscard]] const DecoderCounters& counters() const noexcept override { return counters_; }

 private:
  void give(std::uint8_t byte, Arrival arrival, SampleSink& sink) noexcept {
    Sample sample{};
    sample.sequence = counters_.samples++ * 256 + byte;
    sample.arrival = arrival.read;
    sample.time = arrival.received + per_byte_;
    sink.on_sample(sample);
  }
  DecoderCounters counters_;
  std::size_t waiting_ = 0;
  Duration per_byte_{};
};

std::string text(const DecodedRead& read) {
  std::string out = read.arrival ? std::to_string(read.arrival->time_since_epoch().count()) : "-";
  out += " " + std::to_string(read.bytes_so_far) + ":";
  for (const Sample& sample : read.samples) {
    out += " " + std::to_string(sample.sequence) + "/" +
           std::to_string(sample.arrival.time_since_epoch().count()) + "/" +
           std::to_string(sample.time.time_since_epoch().count());
  }
  return out;
}

std::vector<std::string> all_of(DecodedReads& reads) {
  std::vector<std::string> all;
  for (auto read = reads.next(); read && *read; read = reads.next()) all.push_back(text(**read));
  return all;
}

/// What the decoder itself gives, read by read.
std::vector<std::string> expected_of(int n) {
  struct Kept final : SampleSink {
    void on_sample(const Sample& sample) noexcept override { all.push_back(sample); }
    std::vector<Sample> all;
  };
  MadeSource source(n);
  MadeDecoder decoder;
  std::vector<std::string> expected;
  std::uint64_t bytes = 0;
  for (int i = 0; i < n; ++i) {
    const auto read = *source.next();
    const HostTime stamp = read->arrival.value_or(HostTime{});
    if (read->per_byte) decoder.set_per_byte(*read->per_byte);
    Kept kept;
    decoder.push(read->bytes, {stamp, read->received.value_or(stamp)}, kept);
    bytes += read->bytes.size();
    if (i == n - 1) decoder.finish(stamp, kept);
    expected.push_back(text({read->arrival, bytes, kept.all}));
  }
  return expected;
}

class DecodedReadsTest : public testing::TestWithParam<bool> {
 protected:
  static std::unique_ptr<DecodedReads> reads_of(int n, int fails_after = -1) {
    return std::make_unique<DecodedReads>(std::make_unique<MadeSource>(n, fails_after),
                                          std::make_unique<MadeDecoder>(), GetParam());
  }
};

TEST_P(DecodedReadsTest, GivesWhatTheDecoderGivesReadByRead) {
  for (const int n : {0, 1, 2, 1023, 4095, 4096, 4097, kReadsOfMany}) {
    const auto reads = reads_of(n);
    EXPECT_EQ(all_of(*reads), expected_of(n)) << n;
    EXPECT_FALSE(*reads->next()) << "the end stays the end";
    EXPECT_EQ(reads->bytes_total(), 77U);
    MadeSource bytes(n);
    std::uint64_t total = 0;
    for (auto read = bytes.next(); *read; read = bytes.next()) total += (*read)->bytes.size();
    EXPECT_EQ(reads->decoder().counters().bytes, total);
  }
}

TEST_P(DecodedReadsTest, AnErrorComesAfterAllThatWasReadBeforeIt) {
  for (const int good : {0, 3, 4096, 6000}) {
    const auto reads = reads_of(kReadsOfMany, good);
    for (int i = 0; i < good; ++i) {
      const auto read = reads->next();
      ASSERT_TRUE(read && *read) << i;
    }
    const auto failed = reads->next();
    ASSERT_FALSE(failed) << good;
    EXPECT_EQ(failed.error().what, "the disk is gone");
    EXPECT_FALSE(reads->next()) << "it stays";
  }
}

TEST_P(DecodedReadsTest, EndsWhereverItIsLeft) {
  for (const int taken : {0, 1, 2000}) {
    const auto reads = reads_of(1'000'000);
    for (int i = 0; i < taken; ++i) ASSERT_TRUE(*reads->next());
  }
}

INSTANTIATE_TEST_SUITE_P(WhenAskedAndAhead, DecodedReadsTest, testing::Bool());

}  // namespace
}  // namespace imuscope
