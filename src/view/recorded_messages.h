#pragma once

/// A recording as the messages that a service published, one after another: those that a capture holds, or
/// such as the files of a run folder would have been published as.

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "base/result.h"

namespace imuscope::view {

/// Thread: one.
class RecordedMessages {
 public:
  RecordedMessages() = default;
  RecordedMessages(const RecordedMessages&) = delete;
  RecordedMessages& operator=(const RecordedMessages&) = delete;
  virtual ~RecordedMessages() = default;
  /// The next message, encoded; false at the end.
  [[nodiscard]] virtual bool next(std::vector<std::uint8_t>& message) = 0;
  /// Goes back to the first one.
  [[nodiscard]] virtual Result<void> rewind() = 0;
  /// A place in the recording that can be gone to without reading what stands before it.
  struct Place {
    std::vector<std::uint64_t> at;  ///< offsets in files, as the recording means them
  };
  /// Before the next message; nothing where the recording cannot be entered here.
  [[nodiscard]] virtual std::optional<Place> place() const { return std::nullopt; }
  [[nodiscard]] virtual Result<void> go_to(const Place& /*place*/) { return rewind(); }
};

/// @param path  of a capture's first file, or of a run folder: its capture where it has one, else its files
/// @return an error that says what the path is where it is neither
[[nodiscard]] Result<std::unique_ptr<RecordedMessages>> open_recording(const std::filesystem::path& path);

}  // namespace imuscope::view
