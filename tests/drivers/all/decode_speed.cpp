/// Decode throughput: bytes to samples through each protocol's decoder, on one core, beside the floor that
/// nobody gets below who looks at every byte: the protocol's own checksum, computed byte by byte over the
/// same bytes in the same run.
///
///   decode_speed [repetitions = 15] [only protocols whose name holds this]

#include <fmt/format.h>
#include <ctime>

#include <algorithm>
#include <cstdlib>

#include "tests/drivers/all/protocol_streams.h"

namespace {

using imuscope::Sample;
using imuscope::test::ProtocolStream;

constexpr int kSeconds = 600;            // of data a stream
constexpr std::size_t kReadSize = 4096;  // what the service reads at once at most
constexpr double kGoal = 3.0;

struct KeepingSink final : imuscope::SampleSink {
  void on_sample(const Sample& sample) noexcept override {
    last = sample;
    ++n;
  }
  Sample last{};
  std::size_t n = 0;
};

double processor_s() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

template <typename Job>
double timed(Job&& job) {
  const double start = processor_s();
  job();
  return processor_s() - start;
}

bool report(const ProtocolStream& stream, int repetitions) {
  double decode_s = 1e9;
  double floor_s = 1e9;
  volatile std::uint32_t checksum = 0;
  KeepingSink sink;
  for (int i = 0; i < repetitions; ++i) {
    const auto decoder = stream.make_decoder();
    sink.n = 0;
    decode_s = std::min(decode_s, timed([&] { push_in_reads(stream, kReadSize, *decoder, sink); }));
    if (!stream.checksum) continue;
    floor_s = std::min(floor_s, timed([&] { checksum = stream.checksum(stream.bytes); }));
  }
  const double megabytes = static_cast<double>(stream.bytes.size()) * 1e-6;
  fmt::print("{:<20} {:>9} {:>9.0f} {:>9.0f}", stream.name, sink.n, megabytes / decode_s,
             1e9 * decode_s / static_cast<double>(sink.n));
  if (stream.checksum) {
    const double ratio = decode_s / floor_s;
    fmt::print(" {:>9.0f} {:>7.2f}{}\n", megabytes / floor_s, ratio, ratio <= kGoal ? "" : "  above 3");
  } else {
    fmt::print(" {:>9} {:>7}\n", "no sum", "-");
  }
  return sink.n + 1 >= stream.samples;  // the last epoch of some protocols ends with the next
}

}  // namespace

int main(int argc, char** argv) {
  const int repetitions = argc > 1 ? std::max(std::atoi(argv[1]), 1) : 15;
  const std::string only = argc > 2 ? argv[2] : "";
  fmt::print("{:<20} {:>9} {:>9} {:>9} {:>9} {:>7}\n", "protocol", "samples", "MB/s", "ns/sample",
             "floor MB/s", "ratio");
  bool complete = true;
  for (const ProtocolStream& stream : imuscope::test::protocol_streams(kSeconds)) {
    if (stream.name.find(only) != std::string::npos) complete = report(stream, repetitions) && complete;
  }
  if (!complete) fmt::print(stderr, "a decoder lost samples of its stream\n");
  return complete ? 0 : 1;
}
