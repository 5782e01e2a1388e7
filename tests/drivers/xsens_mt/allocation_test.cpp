#include <gtest/gtest.h>

#include "drivers/xsens_mt/decoder.h"
#include "drivers/xsens_mt/session.h"
#include "tests/drivers/xsens_mt/mt_frames.h"
#include "tests/support/allocation_counter.h"

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
  const std::uint64_t before = test::allocation_count();
  HostTime now{};
  for (std::size_t at = 0; at < stream.size(); at += 62) {
    now += std::chrono::milliseconds{14};  // 62 bytes of 43 a message at 100 Hz
    const auto read = std::span(stream).subspan(at, std::min<std::size_t>(62, stream.size() - at));
    decoder.push(read, now, sink);
    session.on_bytes(read, now);
    (void)session.poll(now);
  }
  EXPECT_EQ(test::allocation_count(), before);
  EXPECT_EQ(sink.n, 20000 - 400);
  EXPECT_EQ(decoder.counters().samples_lost, 400U);
}

}  // namespace
}  // namespace imuscope::xsens
