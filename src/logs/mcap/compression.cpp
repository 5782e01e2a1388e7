#include "logs/mcap/compression.h"

#include <lz4frame.h>
#include <zstd.h>
#include <algorithm>
#include <array>

namespace imuscope::mcap {
namespace {

constexpr std::array<std::string_view, 3> kNames{"", "zstd", "lz4"};
/// Covariances and frames repeat: more effort gains little and costs the second that an export has.
constexpr int kZstdLevel = 1;

/// Room is made as bytes come, so that a chunk that claims much and holds little takes little.
constexpr std::size_t kGrow = std::size_t{4} << 20U;

struct ZstdIn {
  ZSTD_DStream* stream = ZSTD_createDStream();
  ZstdIn() = default;
  ZstdIn(const ZstdIn&) = delete;
  ZstdIn& operator=(const ZstdIn&) = delete;
  ~ZstdIn() { ZSTD_freeDStream(stream); }
};

struct Lz4In {
  LZ4F_dctx* context = nullptr;
  Lz4In() { LZ4F_createDecompressionContext(&context, LZ4F_VERSION); }
  Lz4In(const Lz4In&) = delete;
  Lz4In& operator=(const Lz4In&) = delete;
  ~Lz4In() { LZ4F_freeDecompressionContext(context); }
};

/// Calls `step` for room until all is there or nothing more comes.
/// @param step  fills [data, data + room), says how much it wrote and whether it can go on
template <typename Step>
void fill(std::size_t size, std::string& out, Step&& step) {
  std::size_t filled = 0;
  while (filled < size) {
    if (filled == out.size()) out.resize(std::min(size, out.size() + std::max(kGrow, out.size())));
    std::size_t written = 0;
    const bool goes_on = step(out.data() + filled, out.size() - filled, written);
    filled += written;
    if (!goes_on) break;
  }
  out.resize(filled);
}

bool unpack_zstd(Bytes packed, std::size_t size, std::string& out) {
  const ZstdIn in;
  ZSTD_inBuffer source{packed.data(), packed.size(), 0};
  fill(size, out, [&](char* data, std::size_t room, std::size_t& written) {
    ZSTD_outBuffer target{data, room, 0};
    const std::size_t before = source.pos;
    const std::size_t left = ZSTD_decompressStream(in.stream, &target, &source);
    written = target.pos;
    if (ZSTD_isError(left) != 0) return false;
    if (left == 0) return source.pos < source.size;  // another frame may follow
    return written > 0 || source.pos > before;
  });
  return out.size() == size && source.pos == source.size;
}

bool unpack_lz4(Bytes packed, std::size_t size, std::string& out) {
  const Lz4In in;
  std::size_t at = 0;
  fill(size, out, [&](char* data, std::size_t room, std::size_t& written) {
    std::size_t taken = packed.size() - at;
    written = room;
    const std::size_t left = LZ4F_decompress(in.context, data, &written, packed.data() + at, &taken, nullptr);
    if (LZ4F_isError(left) != 0) {
      written = 0;
      return false;
    }
    at += taken;
    return written > 0 || taken > 0;
  });
  return out.size() == size;
}

}  // namespace

std::string_view name_of(Compression compression) noexcept {
  return kNames[static_cast<std::size_t>(compression)];
}

std::optional<Compression> compression_of(std::string_view name) noexcept {
  const auto found = std::find(kNames.begin(), kNames.end(), name);
  if (found == kNames.end()) return std::nullopt;
  return static_cast<Compression>(found - kNames.begin());
}

struct Packer::State {
  ZSTD_CCtx* zstd = ZSTD_createCCtx();
  State() = default;
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  ~State() { ZSTD_freeCCtx(zstd); }
};

Packer::Packer(Compression compression) : compression_(compression), state_(std::make_unique<State>()) {}
Packer::~Packer() = default;

void Packer::pack(std::string_view chunk, std::string& out) {
  switch (compression_) {
    case Compression::kNone:
      out = chunk;
      return;
    case Compression::kZstd:
      out.resize(ZSTD_compressBound(chunk.size()));
      out.resize(
          ZSTD_compressCCtx(state_->zstd, out.data(), out.size(), chunk.data(), chunk.size(), kZstdLevel));
      return;
    case Compression::kLz4:
      out.resize(LZ4F_compressFrameBound(chunk.size(), nullptr));
      out.resize(LZ4F_compressFrame(out.data(), out.size(), chunk.data(), chunk.size(), nullptr));
      return;
  }
}

bool unpack(Compression compression, Bytes packed, std::size_t size, std::string& out) {
  out.clear();
  switch (compression) {
    case Compression::kNone:
      out = text_of(packed.first(std::min(size, packed.size())));
      return packed.size() == size;
    case Compression::kZstd:
      return unpack_zstd(packed, size, out);
    case Compression::kLz4:
      return unpack_lz4(packed, size, out);
  }
  return false;
}

}  // namespace imuscope::mcap
