// No decoder allocates once it is made, whatever comes.
#include <gtest/gtest.h>
#include <cstdlib>
#include <new>
#include <random>

#include "tests/drivers/all/protocol_streams.h"

namespace {
thread_local std::uint64_t g_allocations = 0;  // of this thread, in this program
}

// Every allocation of this test program is counted.
void* operator new(std::size_t size) {
  ++g_allocations;
  void* memory = std::malloc(size);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

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
      const auto decoder = stream.make_decoder();
      CountingSink sink;
      const std::uint64_t before = g_allocations;
      push_in_reads(stream, read_size, *decoder, sink);
      decoder->finish(host_time_from_ns(stream.lasts.count()), sink);
      EXPECT_EQ(g_allocations, before);
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
