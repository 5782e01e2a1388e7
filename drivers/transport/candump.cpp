#include "drivers/transport/candump.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstring>
#include <system_error>
#include <utility>

#include "base/line_reader.h"

namespace imuscope {
namespace {

// As in <linux/can.h>: an error frame is logged with this bit of its 8-digit identifier set.
constexpr std::uint32_t kErrorFlag = 0x2000'0000;
constexpr std::uint32_t kErrorMask = 0x1FFF'FFFF;
constexpr std::size_t kStandardDigits = 3;
constexpr std::size_t kExtendedDigits = 8;
constexpr std::size_t kClassicMaxData = 8;
constexpr std::uint8_t kFdBitRateSwitch = 0x1;
constexpr std::uint8_t kFdErrorState = 0x2;
constexpr std::int64_t kNsPerSecond = 1'000'000'000;
constexpr std::size_t kNsDigits = 9;
/// Lines in which a log must show its first frame.
constexpr int kLinesToLookAt = 100;
constexpr std::size_t kLongestLine = 512;
constexpr std::size_t kLongestInterface = 15;  // IFNAMSIZ, less the zero at its end

int hex_digit(char c) noexcept {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  return -1;
}

/// A line on its way through the reader: what is left of it, and what is wrong with it once something is.
class Cursor {
 public:
  explicit Cursor(std::string_view text) : rest_(text) {}

  [[nodiscard]] bool ok() const { return why_.empty(); }
  [[nodiscard]] std::string_view why() const { return why_; }
  [[nodiscard]] std::string_view rest() const { return rest_; }
  void fail(std::string_view why) {
    if (ok()) why_ = why;
  }

  bool skip(char c) {
    if (!ok() || rest_.empty() || rest_.front() != c) return false;
    rest_.remove_prefix(1);
    return true;
  }
  void expect(char c, std::string_view why) {
    if (!skip(c)) fail(why);
  }
  /// Everything up to one of `ends`, or to the end.
  std::string_view word(std::string_view ends) {
    const auto n = std::min(rest_.find_first_of(ends), rest_.size());
    const auto found = rest_.substr(0, n);
    rest_.remove_prefix(n);
    return found;
  }

 private:
  std::string_view rest_;
  std::string_view why_;
};

std::optional<std::uint64_t> decimal(std::string_view text) {
  std::uint64_t value = 0;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || code != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

/// "(1772000000.010100)"
HostTime read_stamp(Cursor& in) {
  constexpr std::string_view kWhy = "a line begins with its time in brackets, as in (1772000000.010100)";
  constexpr std::uint64_t kLatest_s = 9'000'000'000;  // what 64 bits of nanoseconds hold
  in.expect('(', kWhy);
  const auto seconds = decimal(in.word(".)"));
  std::string_view fraction;
  if (in.skip('.')) fraction = in.word(")");
  in.expect(')', kWhy);
  if (!seconds || *seconds > kLatest_s || fraction.size() > kNsDigits) in.fail(kWhy);
  std::int64_t ns = 0;
  for (std::size_t i = 0; in.ok() && i < kNsDigits; ++i) {
    const char digit = i < fraction.size() ? fraction[i] : '0';
    if (digit < '0' || digit > '9') in.fail(kWhy);
    ns = 10 * ns + (digit - '0');
  }
  return in.ok() ? host_time_from_ns(static_cast<std::int64_t>(*seconds) * kNsPerSecond + ns) : HostTime{};
}

void read_id(Cursor& in, CanFrame& frame) {
  const auto digits = in.word("#");
  if (digits.size() != kStandardDigits && digits.size() != kExtendedDigits) {
    return in.fail("an identifier has 3 or 8 hexadecimal digits");
  }
  std::uint32_t id = 0;
  for (const char c : digits) {
    const int digit = hex_digit(c);
    if (digit < 0) return in.fail("an identifier has 3 or 8 hexadecimal digits");
    id = id << 4U | static_cast<std::uint32_t>(digit);
  }
  if (digits.size() == kStandardDigits) {
    if (id > kCanStandardIdMax) in.fail("an identifier of 3 digits is at most 7FF");
    frame.id = id;
    return;
  }
  frame.is_error = (id & kErrorFlag) != 0 && id <= (kErrorFlag | kErrorMask);
  frame.is_extended = !frame.is_error;
  frame.id = frame.is_error ? id & kErrorMask : id;
  if (frame.id > kCanExtendedIdMax) in.fail("an identifier is at most 1FFFFFFF");
}

void read_data(Cursor& in, CanFrame& frame) {
  const std::size_t most = frame.is_fd ? kCanMaxData : kClassicMaxData;
  std::size_t n = 0;
  for (;;) {
    (void)in.skip('.');  // cansend's way of setting bytes apart
    const auto rest = in.rest();
    if (rest.empty() || hex_digit(rest[0]) < 0) break;
    if (rest.size() < 2 || hex_digit(rest[1]) < 0) return in.fail("a byte has two hexadecimal digits");
    if (n == most) {
      return in.fail(frame.is_fd ? "a CAN FD frame holds at most 64 bytes"
                                 : "a classic frame holds at most 8 bytes");
    }
    frame.data[n++] = static_cast<std::uint8_t>(hex_digit(rest[0]) << 4 | hex_digit(rest[1]));
    (void)in.skip(rest[0]);
    (void)in.skip(rest[1]);
  }
  frame.length = static_cast<std::uint8_t>(n);
  if (!is_can_length(n, frame.is_fd)) in.fail("no CAN FD frame has this length");
}

/// "#..." after the identifier.
void read_content(Cursor& in, CanFrame& frame) {
  in.expect('#', "after the identifier stands a #");
  if (in.skip('#')) {
    const int flags = in.rest().empty() ? -1 : hex_digit(in.rest()[0]);
    if (flags < 0) return in.fail("after ## stands one digit of CAN FD flags");
    (void)in.skip(in.rest()[0]);
    frame.is_fd = true;
    frame.bit_rate_switched = (flags & kFdBitRateSwitch) != 0;
    frame.sender_error_state = (flags & kFdErrorState) != 0;
    return read_data(in, frame);
  }
  if (in.skip('R')) {
    frame.is_remote = true;
    if (!in.rest().empty() && in.rest()[0] >= '0' && in.rest()[0] <= '8') {
      frame.length = static_cast<std::uint8_t>(in.rest()[0] - '0');
      (void)in.skip(in.rest()[0]);
    }
  } else {
    read_data(in, frame);
  }
  if (frame.length == kClassicMaxData && in.skip('_')) {
    const int dlc = in.rest().empty() ? -1 : hex_digit(in.rest()[0]);
    if (dlc <= static_cast<int>(kClassicMaxData)) return in.fail("a raw DLC is one digit from 9 to F");
    (void)in.skip(in.rest()[0]);
    frame.raw_dlc = static_cast<std::uint8_t>(dlc);
  }
}

std::uint64_t drops_in(std::string_view remark) {
  constexpr std::string_view kTotal = "total drops ";
  const auto at = remark.find(kTotal);
  if (at == std::string_view::npos) return 0;
  remark.remove_prefix(at + kTotal.size());
  return decimal(remark.substr(0, remark.find(')'))).value_or(0);
}

Error unreadable(const std::filesystem::path& file, const std::string& why) {
  return {ErrorKind::kWork, fmt::format("{}: {}", file.string(), why), "give a log of candump -l"};
}

}  // namespace

CandumpLine read_candump_line(std::string_view line) {
  CandumpLine read;
  while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.remove_suffix(1);
  if (line.empty()) return read;
  if (line.starts_with("DROPCOUNT")) {
    read.drops_total = drops_in(line);
    return read;
  }
  Cursor in(line);
  CanFrame& frame = read.frame.frame;
  frame.stamp = read_stamp(in);
  in.expect(' ', "between time, interface and frame stands a blank");
  read.frame.interface = in.word(" ");
  if (read.frame.interface.empty()) in.fail("between time and frame stands the interface");
  if (read.frame.interface.size() > kLongestInterface)
    in.fail("the name of an interface has at most 15 letters");
  in.expect(' ', "between time, interface and frame stands a blank");
  if (in.ok()) read_id(in, frame);
  if (in.ok()) read_content(in, frame);
  if (in.ok() && !in.rest().empty() && in.rest() != " R" && in.rest() != " T") {
    in.fail("after the data stands nothing but a direction, R or T");
  }
  read.kind = in.ok() ? CandumpLine::Kind::kFrame : CandumpLine::Kind::kError;
  read.why = in.why();
  return read;
}

Result<CandumpLog> CandumpLog::open(const std::filesystem::path& file) {
  std::error_code error;
  const auto status = std::filesystem::status(file, error);
  if (std::filesystem::is_directory(status)) return tl::unexpected<Error>(unreadable(file, "is a folder"));
  if (!std::filesystem::is_regular_file(status)) {
    const bool is_absent = !error || error == std::errc::no_such_file_or_directory;
    return tl::unexpected<Error>(unreadable(file, is_absent ? "there is no such file" : error.message()));
  }
  std::ifstream in(file, std::ios::binary);
  if (!in) return tl::unexpected<Error>(unreadable(file, std::strerror(errno)));
  if (!looks_like_one(file)) {
    CandumpLog log(std::move(in));
    const bool comes_late = log.next() != nullptr;
    if (!log.first_problem_.empty()) return tl::unexpected<Error>(unreadable(file, log.first_problem_));
    return tl::unexpected<Error>(
        unreadable(file, comes_late      ? fmt::format("its first {} lines hold no frame", kLinesToLookAt)
                         : log.line_ > 0 ? "it holds no frame"
                                         : "the file is empty"));
  }
  return CandumpLog(std::move(in));
}

bool CandumpLog::looks_like_one(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::string text(kLongestLine, '\0');
  for (int i = 0; i < kLinesToLookAt; ++i) {
    in.getline(text.data(), static_cast<std::streamsize>(text.size()));
    const auto n = static_cast<std::size_t>(in.gcount());
    if (n == 0 || (in.fail() && !in.eof())) return false;
    const std::string_view line(text.data(), in.eof() ? n : n - 1);
    if (read_candump_line(line).kind == CandumpLine::Kind::kFrame) return true;
  }
  return false;
}

const CandumpFrame* CandumpLog::next() {
  while (read_line(in_, text_, kLongestLine, bytes_read_)) {
    ++line_;
    current_ = read_candump_line(text_);
    if (current_.kind == CandumpLine::Kind::kFrame) return &current_.frame;
    drops_total_ = std::max(drops_total_, current_.drops_total);
    if (current_.kind != CandumpLine::Kind::kError) continue;
    if (bad_lines_++ == 0) first_problem_ = fmt::format("line {}: {}", line_, current_.why);
  }
  return nullptr;
}

std::string candump_line(const CandumpFrame& entry) {
  const CanFrame& frame = entry.frame;
  const auto ns = to_ns(frame.stamp);
  constexpr std::int64_t kNsPerMicrosecond = 1000;
  std::string line =
      ns % kNsPerMicrosecond == 0
          ? fmt::format("({:010}.{:06})", ns / kNsPerSecond, ns % kNsPerSecond / kNsPerMicrosecond)
          : fmt::format("({:010}.{:09})", ns / kNsPerSecond, ns % kNsPerSecond);
  const std::uint32_t id = frame.id | (frame.is_error ? kErrorFlag : 0U);
  const int digits =
      static_cast<int>(frame.is_extended || frame.is_error ? kExtendedDigits : kStandardDigits);
  line += fmt::format(" {} {:0{}X}#", entry.interface, id, digits);
  if (frame.is_fd) {
    line += fmt::format("#{:X}", (frame.bit_rate_switched ? kFdBitRateSwitch : 0) |
                                     (frame.sender_error_state ? kFdErrorState : 0));
  }
  if (frame.is_remote) {
    line += 'R';
    if (frame.length > 0) line += fmt::format("{}", frame.length);
  }
  for (const std::uint8_t byte : frame.payload()) line += fmt::format("{:02X}", byte);
  if (frame.raw_dlc > 0) line += fmt::format("_{:X}", frame.raw_dlc);
  return line;
}

}  // namespace imuscope
