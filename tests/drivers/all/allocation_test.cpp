// No decoder allocates once it is made, whatever comes.
#include <gtest/gtest.h>
#include <random>

#include "tests/drivers/all/protocol_streams.h"
#include "tests/support/allocation_counter.h"

namespace imuscope::test {
namespace {

struct CountingSink final : SampleSink {
  void on_sample(const Sample&) noexcept override { ++n; }
  std::size_t n = 0;
};

TEST(DecoderAllocation, DecodingAllocatesNothingFaultsIncluded) {
  std::mt19937 random(5);
  for (ProtocolStream& stream : protocol_streams(20)) {
    SCOPED_TRACE(stream.name);
    // One byte in 5000 is wrong.
    for (std::size_t i = 0; i < stream.bytes.size() / 5000; ++i) {
      stream.bytes[random() % stream.bytes.size()] ^= static_cast<std::uint8_t>(1 + random() % 255);
    }
    for (const std::size_t read_size : {std::size_t{1}, std::size_t{62}, std::size_t{4096}}) {
      const std::uint64_t unmade = allocation_count();
      const auto decoder = stream.make_decoder();
      CountingSink sink;
      const std::uint64_t before = allocation_count();
      EXPECT_GT(before, unmade) << "allocations are not counted";
      push_in_reads(stream, read_size, *decoder, sink);
      decoder->finish(host_time_from_ns(stream.lasts.count()), sink);
      EXPECT_EQ(allocation_count(), before);
      EXPECT_GT(sink.n, stream.samples * 9 / 10);
      EXPECT_EQ(decoder->counters().samples, sink.n);
      EXPECT_EQ(decoder->counters().bytes, stream.bytes.size());
    }
  }
}

TEST(DecoderStreams, EveryStreamGivesAllItsSamplesHoweverItIsSplit) {
  for (const ProtocolStream& stream : protocol_streams(5)) {
    SCOPED_TRACE(stream.name);
    for (const std::size_t read_size : {std::size_t{1}, std::size_t{7}, std::size_t{62}, std::size_t{4096}}) {
      const auto decoder = stream.make_decoder();
      CountingSink sink;
      push_in_reads(stream, read_size, *decoder, sink);
      decoder->finish(host_time_from_ns(stream.lasts.count()), sink);
      EXPECT_EQ(sink.n, stream.samples);
      EXPECT_EQ(decoder->counters().bytes_skipped, 0U);
      EXPECT_EQ(decoder->counters().samples_lost, 0U);
    }
  }
}

}  // namespace
}  // namespace imuscope::test
