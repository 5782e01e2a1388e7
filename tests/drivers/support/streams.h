#pragma once

/// What tests of device drivers share: protocol vectors, recordings, a sink that keeps what it gets, and the
/// properties that every scanner must have, tried at every position of a stream.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sample/sample.h"

namespace imuscope::test {

using Bytes = std::vector<std::uint8_t>;

struct Vector {
  std::string name;
  Bytes bytes;
};

/// "NAME: hex" lines; lines with # are comments.
std::vector<Vector> load_vectors(const std::filesystem::path& file);
const Bytes& vector_named(const std::vector<Vector>& vectors, std::string_view name);
nlohmann::json load_json(const std::filesystem::path& file);
Bytes load_bytes(const std::filesystem::path& file);
Bytes bytes_of(std::string_view text);

class CollectingSink final : public SampleSink {
 public:
  void on_sample(const Sample& sample) noexcept override { samples.push_back(sample); }
  [[nodiscard]] std::vector<Sample> of_kind(SampleKind kind) const;
  std::vector<Sample> samples;
};

/// Scans a stream that comes in the given reads, to its end; returns the bytes of each valid frame.
using Scan = std::function<std::vector<Bytes>(std::span<const Bytes> reads)>;

/// The properties. `frames` stand one after the other, each followed by `separator`; they must be distinct.
/// Required: a frame that a fault does not touch is found; no frame appears that was not sent, unless
/// `may_appear` allows it (a protocol whose messages are not all protected).
struct StreamUnderTest {
  std::string name;  ///< of the protocol
  std::vector<Bytes> frames;
  Bytes separator;
  Scan scan;
  std::function<bool(const Bytes&)> may_appear = [](const Bytes&) { return false; };
  /// Share of cuts and insertions whose debris may pass for a frame and hide what it swallows: what the
  /// protocol's checksum lets through, 1/256 for one of 8 bits, with room for the small number of trials.
  double accidents_max = 0.0;
  /// Bytes before a frame that it cannot do without, such as the end of the line before it.
  std::size_t lead = 0;
  bool has_start_mark = true;
  /// Bytes that begin a frame, for garbage that is rich in them.
  std::string_view lures;
};
void expect_every_split_keeps_all_frames(const StreamUnderTest& stream);
void expect_every_bit_flip_loses_only_its_frame(const StreamUnderTest& stream);
void expect_every_cut_loses_only_its_frames(const StreamUnderTest& stream);
void expect_every_insertion_loses_only_its_frame(const StreamUnderTest& stream, std::uint32_t seed);
/// Random bytes, rich in the stream's lures, before, between and after the frames.
void expect_no_frame_in_garbage_is_lost(const StreamUnderTest& stream, std::uint32_t seed);

}  // namespace imuscope::test
