/// Decode throughput: bytes to stamped SI samples through each protocol's decoder, on one core, beside the
/// floor: the protocol's own checksum, computed byte by byte over the same bytes in the same run.
///
/// The floor is one addition (exclusive or, rotation) that waits for the one before it, per byte: a byte a
/// clock cycle. A plain sum may be taken of many bytes at once, and the decoders do that; a floor of that
/// kind would be the memory's bandwidth and say nothing of the protocol, so the compiler is made to keep the
/// sum byte by byte at every level of optimisation.
///
/// What the floor leaves out is paid per sample and not per byte: unwrapping the device's count, the clock
/// map, the sample itself and handing it over. The rows of a sample give that beside the clock map's and the
/// sink's share alone. Where samples are short on the wire (43 bytes of MTData), that share is what keeps a
/// decoder from the floor; where they are text, it is the turning of digits into numbers.

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>

#include "sample/clock_map.h"
#include "tests/drivers/all/protocol_streams.h"
#include "tools/benchmarks/bench_report.h"

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

template <typename Job>
double timed(Job&& job) {
  const double start = bench::processor_time_s();
  job();
  return bench::processor_time_s() - start;
}

/// Fastest of interleaved repetitions. `complete` turns false where samples were lost.
std::vector<bench::Row> measure(const ProtocolStream& stream, int repetitions, bool& complete) {
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
  complete = complete && sink.n + 1 >= stream.samples;  // the last epoch of some protocols ends with the next
  const double megabytes = static_cast<double>(stream.bytes.size()) * 1e-6;
  bench::Row row;
  row.group = "decoding";
  row.what = stream.name;
  row.ratio = std::nan("");
  row.against = "no checksum to compare with";
  row.value = megabytes / decode_s;
  row.unit = "MB/s";
  row.memory_mb = bench::peak_memory_mb([&] {
    const auto decoder = stream.make_decoder();
    KeepingSink other;
    push_in_reads(stream, kReadSize, *decoder, other);
  });
  if (stream.checksum) {
    row.ratio = decode_s / floor_s;
    row.against = "x its checksum alone, byte by byte";
    row.goal = bench::Goal{bench::Goal::Side::kAtMost, kGoal};
    row.reference = megabytes / floor_s;
  }
  bench::Row sample = row;
  sample.group = "decoding, a sample";
  sample.goal.reset();
  sample.value = 1e9 * decode_s / static_cast<double>(sink.n);
  sample.unit = "ns";
  sample.memory_mb.reset();
  return {row, sample};
}

/// Decoder and checksum once over the stream, and what they found: tools/benchmarks/decode_instructions counts.
void decode_once(const ProtocolStream& stream) {
  const auto decoder = stream.make_decoder();
  KeepingSink sink;
  push_in_reads(stream, kReadSize, *decoder, sink);
  const std::uint32_t checksum = stream.checksum ? stream.checksum(stream.bytes) : 0;
  fmt::print("{}\t{}\t{}\t{}\t{}\n", stream.name, stream.bytes.size(), decoder->counters().frames, sink.n,
             checksum);
}

/// What every decoder pays for a sample, whatever its bytes are: clock map and sink, ns.
double sample_alone_ns(int repetitions) {
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
  return 1e9 * alone_s / kSamples;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Decoding beside the protocol's own checksum over the same bytes"};
  int repetitions = 15;
  std::string only;
  std::string json;
  app.add_option("--repetitions", repetitions, "of which the fastest counts")->check(CLI::Range(1, 10000));
  app.add_option("--only", only, "only protocols whose name holds this");
  app.add_option("--json", json, "write the rows here")->type_name("FILE");
  bool once = false;
  app.add_flag("--once", once, "measure nothing: decode each once, print bytes, frames, samples, checksum");
  CLI11_PARSE(app, argc, argv);

  bool complete = true;
  std::vector<bench::Row> throughput;
  std::vector<bench::Row> samples;
  for (const ProtocolStream& stream : imuscope::test::protocol_streams(kSeconds)) {
    if (stream.name.find(only) == std::string::npos) continue;
    if (once) {
      decode_once(stream);
      continue;
    }
    const auto rows = measure(stream, repetitions, complete);
    throughput.push_back(rows[0]);
    samples.push_back(rows[1]);
  }
  if (once) return 0;
  const double alone_ns = sample_alone_ns(repetitions);
  for (bench::Row& row : samples) {
    row.ratio = row.value / alone_ns;
    row.against = "x clock map and sink alone";
    row.reference = alone_ns;
  }
  throughput.insert(throughput.end(), samples.begin(), samples.end());
  if (!complete) fmt::print(stderr, "a decoder lost samples of its stream\n");
  const int status = bench::finish(throughput, json);
  return complete ? status : 1;
}
