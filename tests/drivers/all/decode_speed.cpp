/// Decode throughput: bytes to stamped SI samples through each protocol's decoder, on one core, beside the
/// floor: the protocol's own checksum, computed byte by byte over the same bytes in the same run.
///
/// The floor is one addition (exclusive or, rotation) that waits for the one before it, per byte: a byte a
/// clock cycle. A plain sum may be taken of many bytes at once, and the decoders do that; a floor of that
/// kind would be the memory's bandwidth and say nothing of the protocol, so the compiler is made to keep the
/// sum byte by byte at every level of optimisation.
///
/// What the floor leaves out is paid per sample and not per byte: unwrapping the device's count, the clock
/// map, the sample itself and handing it over. The last line gives the clock map's and the sink's share
/// alone. Where samples are short on the wire (43 bytes of MTData), that share is what keeps a decoder from
/// the floor; where they are text, it is the turning of digits into numbers.
///
///   decode_speed [repetitions = 15] [only protocols whose name holds this]

#include <fmt/format.h>
#include <ctime>

#include <algorithm>
#include <cstdlib>

#include "sample/clock_map.h"
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

/// What every decoder pays for a sample, whatever its bytes are.
void report_sample_alone(int repetitions) {
  constexpr int kSamples = 60'000;
  constexpr std::int64_t kPeriod_ns = 10'000'000;
  double alone_s = 1e9;
  KeepingSink sink;
  for (int i = 0; i < repetitions; ++i) {
    imuscope::ClockMap clock;
    alone_s = std::min(alone_s, timed([&] {
                         for (int k = 0; k < kSamples; ++k) {
                           const std::int64_t device_ns = k * kPeriod_ns;
                           const auto late = imuscope::Duration{k % 7 * 20'000};
                           Sample sample{};
                           sample.arrival = imuscope::host_time_from_ns(device_ns) + late;
                           sample.time = clock.observe(device_ns, sample.arrival);
                           sink.on_sample(sample);
                         }
                       }));
  }
  fmt::print("{:<20} {:>9} {:>9} {:>9.0f}\n", "clock map and sink", kSamples, "-", 1e9 * alone_s / kSamples);
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
  report_sample_alone(repetitions);
  if (!complete) fmt::print(stderr, "a decoder lost samples of its stream\n");
  return complete ? 0 : 1;
}
