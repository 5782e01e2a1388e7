#pragma once

/// Logs of can-utils' candump (`candump -l`, `-L`), line by line:
///
///     (1772000000.010100) can0 0AA#1A6F1A6F1A6F1A6F
///
/// Classic frames of 11 (3 hexadecimal digits) and 29 bits (8 digits), with a raw DLC ("_B"), remote frames
/// ("#R5"), CAN FD ("##" and one digit of flags), error frames, stamps of microseconds or nanoseconds, a
/// direction at the end (" R", " T"), and candump's own remarks on what it dropped.

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <string_view>

#include "base/result.h"
#include "drivers/device/can_frame.h"

namespace imuscope {

/// One frame of a log. frame.stamp is the log's own time as it stands there.
struct CandumpFrame {
  std::string interface;
  CanFrame frame;
};

/// What a line of a log holds.
struct CandumpLine {
  enum class Kind : std::uint8_t {
    kFrame,
    kRemark,  ///< empty, or a count of frames that candump itself lost
    kError,
  };
  Kind kind = Kind::kRemark;
  CandumpFrame frame;             ///< kFrame
  std::uint64_t drops_total = 0;  ///< kRemark: what candump lost on this interface so far; 0 elsewhere
  std::string_view why;           ///< kError, static storage
};

/// @param line  without its end
[[nodiscard]] CandumpLine read_candump_line(std::string_view line);

/// Iterates over the frames of a log. Lines that cannot be read are passed over and counted: a log that was
/// cut off or damaged is still a log. Thread: one, non-real-time.
class CandumpLog {
 public:
  /// Errors name the file: it cannot be read, or its beginning holds no frame at all (with the first line and
  /// what is wrong with it).
  static Result<CandumpLog> open(const std::filesystem::path& file);

  /// The next frame; nothing at the end. Valid until the next call.
  [[nodiscard]] const CandumpFrame* next();

  /// A look at the beginning tells logs from everything else.
  [[nodiscard]] static bool looks_like_one(const std::filesystem::path& file);

  [[nodiscard]] std::uint64_t line() const noexcept { return line_; }
  [[nodiscard]] std::uint64_t bytes_read() const noexcept { return bytes_read_; }
  [[nodiscard]] std::uint64_t bad_lines() const noexcept { return bad_lines_; }
  /// Number and fault of the first bad line; empty where there is none.
  [[nodiscard]] const std::string& first_problem() const noexcept { return first_problem_; }
  /// Frames that candump itself says it lost.
  [[nodiscard]] std::uint64_t drops_total() const noexcept { return drops_total_; }

 private:
  explicit CandumpLog(std::ifstream in) : in_(std::move(in)) {}

  std::ifstream in_;
  std::string text_;
  CandumpLine current_;
  std::uint64_t line_ = 0;
  std::uint64_t bytes_read_ = 0;
  std::uint64_t bad_lines_ = 0;
  std::string first_problem_;
  std::uint64_t drops_total_ = 0;
};

/// The line that candump would have logged, without its end. The stamp has nine decimals where it is no whole
/// number of microseconds.
[[nodiscard]] std::string candump_line(const CandumpFrame& frame);

}  // namespace imuscope
