#pragma once

/// Chunks packed and unpacked: zstd and the frame format of lz4, or neither.

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "base/result.h"
#include "logs/mcap/records.h"

namespace imuscope::mcap {

enum class Compression : std::uint8_t { kNone, kZstd, kLz4 };

/// As chunks write it: "", "zstd", "lz4".
[[nodiscard]] std::string_view name_of(Compression compression) noexcept;
[[nodiscard]] std::optional<Compression> compression_of(std::string_view name) noexcept;

/// Packs chunk after chunk. Thread: one.
class Packer {
 public:
  explicit Packer(Compression compression);
  ~Packer();
  Packer(const Packer&) = delete;
  Packer& operator=(const Packer&) = delete;
  /// Replaces the content of `out`.
  void pack(std::string_view chunk, std::string& out);

 private:
  struct State;
  Compression compression_;
  std::unique_ptr<State> state_;
};

/// Unpacks into `out` what there is, up to `size` bytes and never more; less where the packed bytes end
/// before or are damaged.
/// @return whether all `size` bytes came, and no more would
bool unpack(Compression compression, Bytes packed, std::size_t size, std::string& out);

}  // namespace imuscope::mcap
