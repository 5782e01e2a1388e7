#include "drivers/greis/session.h"

#include <algorithm>
#include <charconv>

namespace imuscope::greis {
namespace {

using namespace std::chrono_literals;

/// Replies come within a few epochs; a receiver busy with another port takes longer.
constexpr Duration kReplyTimeout = 500ms;
constexpr int kTriesMax = 3;
/// Nothing pauses for so long in the midst of a message, whatever buffers it comes through.
constexpr Duration kLineQuiet = 100ms;
/// Without a complete epoch for this long, or ten periods, something is wrong.
constexpr Duration kSilenceMin = 5s;
constexpr int kSilencePeriods = 10;
/// Slowest internal epoch that receivers are run at here; the output period is a multiple of it.
constexpr std::int64_t kInternalEpochMaxMs = 100;

constexpr std::string_view kMessages = "{RT,RD,ST,PG,VG,SG,TO,UO,DP,ET}";

constexpr std::string_view kNoBytes =
    "no data from the receiver: check cable and port, and that the port's input mode is 'cmd'";
constexpr std::string_view kNoEpoch =
    "bytes arrive but no complete GREIS epoch: check the baud rate, and that the "
    "receiver puts out RT, PG or PV, and ET";

/// Writes text and numbers one after the other.
class TextWriter {
 public:
  explicit TextWriter(std::span<char> out) noexcept : out_(out) {}
  TextWriter& operator<<(std::string_view text) noexcept {
    for (const char c : text) {
      if (size_ < out_.size()) out_[size_++] = c;
    }
    return *this;
  }
  TextWriter& operator<<(std::int64_t number) noexcept {
    std::array<char, 24> digits{};
    const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), number).ptr;
    return *this << std::string_view(digits.data(), static_cast<std::size_t>(end - digits.data()));
  }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }

 private:
  std::span<char> out_;
  std::size_t size_ = 0;
};

/// Seconds with three decimals: 0.100.
TextWriter& write_seconds(TextWriter& writer, std::int64_t ms) noexcept {
  const std::int64_t fraction = ms % 1000;
  writer << ms / 1000 << ".";
  if (fraction < 100) writer << "0";
  if (fraction < 10) writer << "0";
  return writer << fraction;
}

std::string_view text_of(std::span<const std::uint8_t> bytes) noexcept {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace

Session::Session(const SessionConfig& config) noexcept : config_(config) {
  const auto period_ms = std::chrono::duration_cast<std::chrono::milliseconds>(config.period).count();
  // A command's number between % signs makes the receiver answer it.
  TextWriter stop(commands_[0].text);
  stop << "%0%dm\r\n";
  commands_[0].size = stop.size();
  TextWriter internal(commands_[1].text);
  internal << "%1%set,/par/raw/msint," << std::min(period_ms, kInternalEpochMaxMs) << "\r\n";
  commands_[1].size = internal.size();
  TextWriter enable(commands_[2].text);
  enable << "%2%em,,jps/" << kMessages << ":";
  write_seconds(enable, period_ms) << "\r\n";
  commands_[2].size = enable.size();
}

std::string_view Session::problem() const noexcept { return {problem_.data(), problem_size_}; }

void Session::set_problem(std::string_view text) noexcept {
  TextWriter writer(problem_);
  writer << text;
  problem_size_ = writer.size();
}

void Session::start(HostTime now) noexcept {
  started_ = true;
  command_ = config_.send_commands ? 0 : kCommands;
  tries_ = 0;
  refused_ = false;
  last_epoch_ = now;
  last_bytes_ = now;
  bytes_since_epoch_ = 0;
}

void Session::on_bytes(std::span<const std::uint8_t> bytes, HostTime now) noexcept {
  if (!started_) start(now);
  bytes_since_epoch_ += bytes.size();
  last_bytes_ = now;
  while (!bytes.empty()) {
    bytes = bytes.subspan(scanner_.append(bytes, now));
    drain(now, false);
  }
}

void Session::drain(HostTime now, bool at_end) noexcept {
  Frame frame;
  while (scanner_.next(frame, at_end)) {
    ++frames_;
    if (frame.kind == Frame::Kind::kMessage) on_message(frame, now);
  }
}

void Session::on_message(const Frame& frame, HostTime now) noexcept {
  switch (frame.id) {
    case kReply:
    case kErrorReply:
      on_reply(frame);
      break;
    case kPositionGeodetic:
    case kPositionEcef:
    case kPositionVelocityEcef:
      has_position_ = true;
      break;
    case kReceiverTime:
    case kEpochTime:
      if (has_position_) on_complete_epoch(now);
      has_position_ = false;
      break;
    default:
      break;
  }
}

void Session::on_reply(const Frame& frame) noexcept {
  if (command_ >= kCommands || tries_ == 0) return;
  const std::array<char, 3> mark{'%', static_cast<char>('0' + command_), '%'};
  const std::string_view reply = text_of(frame.body);
  if (!reply.starts_with(std::string_view(mark.data(), mark.size()))) return;
  if (frame.id == kErrorReply) {
    const Command& command = commands_[command_];
    const std::string_view sent(command.text.data(), command.size);
    const std::size_t line_end = std::min(reply.find_first_of("\r\n"), reply.size());
    TextWriter writer(problem_);
    writer << "the receiver refused '" << sent.substr(mark.size(), sent.size() - mark.size() - 2)
           << "': " << reply.substr(mark.size(), line_end - mark.size())
           << "; check that its options allow this rate and these messages";
    problem_size_ = writer.size();
    refused_ = true;
  }
  next_command();
}

void Session::next_command() noexcept {
  ++command_;
  tries_ = 0;
}

void Session::on_complete_epoch(HostTime now) noexcept {
  last_epoch_ = now;
  bytes_since_epoch_ = 0;
  if (command_ < kCommands) return;
  state_ = SessionState::kStreaming;
  if (!refused_) problem_size_ = 0;
}

std::span<const std::uint8_t> Session::poll(HostTime now) noexcept {
  if (!started_) start(now);
  if (command_ < kCommands) {
    // A message cut off by the opening of the line would take the replies for its rest: the stop has been
    // heard, and nothing else comes that could fill it.
    if (now - last_bytes_ >= kLineQuiet) drain(now, true);
  }
  if (command_ < kCommands) {
    if (tries_ > 0 && now - sent_ < kReplyTimeout) return {};
    if (tries_ == kTriesMax) next_command();
  }
  if (command_ < kCommands) {
    if (state_ == SessionState::kConnecting) state_ = SessionState::kConfiguring;
    ++tries_;
    sent_ = now;
    if (command_ + 1 == kCommands) last_epoch_ = now;
    const Command& command = commands_[command_];
    return {reinterpret_cast<const std::uint8_t*>(command.text.data()), command.size};
  }
  if (now - last_epoch_ > std::max(kSilenceMin, config_.period * kSilencePeriods)) {
    state_ = SessionState::kFailed;
    if (!refused_) set_problem(bytes_since_epoch_ == 0 ? kNoBytes : kNoEpoch);
    wants_other_baud_ = bytes_since_epoch_ > 0 && frames_ == 0;
    // The receiver may have been switched off and on: ask again. The problem stays told meanwhile.
    start(now);
  }
  return {};
}

}  // namespace imuscope::greis
