#include <gtest/gtest.h>

#include <cstdlib>
#include <new>

#include "drivers/xsens_mt/decoder.h"
#include "drivers/xsens_mt/session.h"
#include "tests/drivers/xsens_mt/mt_frames.h"

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

namespace imuscope::xsens {
namespace {

using namespace test_frames;

struct CountingSink final : SampleSink {
  void on_sample(const Sample&) noexcept override { ++n; }
  int n = 0;
};

TEST(MtAllocation, TwentyThousandMessagesFaultsIncludedAllocateNothing) {
  Bytes stream = configuration(1152, 0, 1, 38, kDefaultLayout.mode, kDefaultLayout.settings);
  for (int i = 0; i < 20000; ++i) {
    const Bytes message = mtdata(static_cast<std::uint16_t>(i));
    stream.insert(stream.end(), message.begin(), message.end());
    if (i % 100 == 7) stream.back() ^= 0x40;  // a bad checksum
    if (i % 100 == 31) stream.resize(stream.size() - 5);
  }
  MtDecoder decoder{MtDecoderConfig{}};
  MtSession session{MtSessionConfig{}};
  CountingSink sink;
  const std::uint64_t before = g_allocations;
  HostTime now{};
  for (std::size_t at = 0; at < stream.size(); at += 62) {
    now += std::chrono::milliseconds{14};  // 62 bytes of 43 a message at 100 Hz
    const auto read = std::span(stream).subspan(at, std::min<std::size_t>(62, stream.size() - at));
    decoder.push(read, now, sink);
    session.on_bytes(read, now);
    (void)session.poll(now);
  }
  EXPECT_EQ(g_allocations, before);
  EXPECT_EQ(sink.n, 20000 - 400);
  EXPECT_EQ(decoder.counters().samples_lost, 400U);
}

}  // namespace
}  // namespace imuscope::xsens
