#pragma once

/// What a capture on disk is worth, and a copy of all that is whole in it. Non-real-time.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

#include "base/result.h"
#include "capture/capture_reader.h"

namespace imuscope {

/// What the index at a file's end says.
enum class IndexVerdict : std::uint8_t {
  kNone,       ///< there is none: the file was cut off, or is of a version without
  kAgrees,     ///< the file is byte for byte what was recorded
  kDisagrees,  ///< bytes before it are not those that were recorded
};

struct FileCheck {
  CapturedFile file;
  std::uint64_t bytes = 0;
  IndexVerdict index = IndexVerdict::kNone;
};

struct CaptureCheck {
  CaptureSummary summary;
  std::vector<FileCheck> files;
  /// Every file is there and byte for byte what was recorded, and the recorder lost nothing.
  [[nodiscard]] bool is_whole() const;
};

/// Reads every byte of every file of the capture twice: the records against their seals, the files against
/// their indices. Unlike a replay it takes a first file whose beginning is damaged.
/// @param progress is told the share of the present file that has been read; may be empty
[[nodiscard]] Result<CaptureCheck> check_capture(const std::filesystem::path& first,
                                                 const std::function<void(double share)>& progress = {});

/// What a repair wrote.
struct Repaired {
  std::uint64_t records = 0;
  std::vector<std::filesystem::path> files;
};

/// Writes every record that is whole into a new capture of as many files, each with its header, and with
/// seals and an index of its own. What is lost stays lost: the numbers of the devices' records tell of it as
/// before.
/// @param checked  of the same capture
/// @param out      first file of the new one; an existing file is never overwritten
[[nodiscard]] Result<Repaired> repair_capture(const std::filesystem::path& first, const CaptureCheck& checked,
                                              const std::filesystem::path& out);

}  // namespace imuscope
