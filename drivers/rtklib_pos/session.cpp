#include "drivers/rtklib_pos/session.h"

#include "drivers/rtklib_pos/messages.h"

namespace imuscope::rtklib_pos {
namespace {

/// Without a good message for this long something is wrong: the slowest usual output is 1 Hz.
constexpr Duration kSilence = std::chrono::seconds(5);

}  // namespace

Session::Session() noexcept : ListeningSession(kSilence) {}

bool Session::hear(std::span<const std::uint8_t> bytes, HostTime now) noexcept {
  return scanner_hears<Frame>(scanner_, bytes, now, [this](const Frame& frame) {
    if (frame.line[0] != kCommentMark) return parse_solution(frame.line, format_).has_value();
    (void)read_comment(frame.line, format_, base_);
    return true;
  });
}

std::string_view Session::nothing_comes() const noexcept {
  return "no solution comes: check that rtkrcv (or str2str) runs, and that its "
         "output stream is a TCP server here";
}

std::string_view Session::nothing_is_understood() const noexcept {
  return "bytes arrive but no RTKLIB solution: set the output format to llh, xyz or enu";
}

}  // namespace imuscope::rtklib_pos
