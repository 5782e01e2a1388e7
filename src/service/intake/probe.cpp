#include "service/intake/probe.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <poll.h>
#include <algorithm>
#include <array>
#include <future>
#include <span>
#include <string_view>

#include "base/bytes.h"
#include "drivers/greis/scanner.h"
#include "drivers/transport/serial_port.h"
#include "drivers/xsens_mt/messages.h"
#include "drivers/xsens_mt/scanner.h"
#include "rt/host_clock.h"
#include "service/intake/protocol_finder.h"

namespace imuscope {
namespace {

using std::chrono::milliseconds;

/// The usual ones first.
constexpr std::array<std::uint32_t, 14> kBauds{115200, 460800, 921600, 230400, 57600,   38400,   19200,
                                               9600,   76800,  28800,  14400,  2000000, 4000000, 4800};
/// Long enough for kMessagesToBelieve messages of a device at 10 Hz.
constexpr Duration kListen = milliseconds(450);
/// To measure a rate of 100 Hz to 1 %.
constexpr Duration kListenLonger = milliseconds(1200);
constexpr Duration kAnswerWithin = milliseconds(80);
constexpr Duration kGoToConfigEvery = milliseconds(150);
constexpr Duration kGoToConfigWithin = milliseconds(1500);
/// Fewer bytes than this in kListen are noise of an open line, not a device at another rate.
constexpr std::size_t kSpeaks = 16;

struct Heard {
  std::vector<std::uint8_t> bytes;
  double seconds = 0.0;  ///< from the first read to the last
  bool gone = false;
};

/// Reads for a while, or until `enough` says so of what has come.
template <typename Enough>
Heard listen(SerialPort& port, Duration how_long, Enough&& enough) {
  Heard heard;
  HostTime first{};
  std::array<std::uint8_t, 4096> buffer{};
  const HostTime end = host_now() + how_long;
  for (HostTime now = host_now(); now < end; now = host_now()) {
    const auto left = std::chrono::duration_cast<milliseconds>(end - now).count();
    pollfd ready{port.fd(), POLLIN, 0};
    (void)poll(&ready, 1, static_cast<int>(left) + 1);
    const IoResult read = port.read(buffer);
    if (read.status == IoStatus::kGone) {
      heard.gone = true;
      break;
    }
    if (read.status != IoStatus::kDone) continue;
    if (heard.bytes.empty()) first = host_now();
    heard.seconds = to_seconds(host_now() - first);
    heard.bytes.insert(heard.bytes.end(), buffer.begin(),
                       buffer.begin() + static_cast<std::ptrdiff_t>(read.n));
    if (enough(std::span(buffer).first(read.n))) break;
  }
  return heard;
}

Heard listen(SerialPort& port, Duration how_long) {
  return listen(port, how_long, [](std::span<const std::uint8_t>) { return false; });
}

void say(SerialPort& port, std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const IoResult written = port.write(bytes);
    if (written.status != IoStatus::kDone) return;  // a full or vanished line: no answer will come
    bytes = bytes.subspan(written.n);
  }
}

/// Sends a message and waits for its answer, skipping others. The answer's data, or nothing.
std::optional<std::vector<std::uint8_t>> ask_xsens(SerialPort& port, std::uint8_t mid, Duration within) {
  say(port, xsens::OutgoingFrame(xsens::kMasterBid, mid).bytes());
  xsens::Scanner scanner;
  std::optional<std::vector<std::uint8_t>> answer;
  listen(port, within, [&](std::span<const std::uint8_t> bytes) {
    xsens::Frame frame;
    while (!bytes.empty()) {
      bytes = bytes.subspan(scanner.append(bytes, HostTime{}));
      while (scanner.next(frame)) {
        if (frame.mid == xsens::mid::reply_to(mid)) answer.emplace(frame.data.begin(), frame.data.end());
      }
    }
    return answer.has_value();
  });
  return answer;
}

std::string device_id_of(const std::optional<std::vector<std::uint8_t>>& answer) {
  if (!answer || answer->size() < sizeof(std::uint32_t)) return {};
  return fmt::format("{:08X}", read_be<std::uint32_t>(*answer));
}

/// Interrupts a measuring device to ask for its id.
std::string identify_xsens(SerialPort& port) {
  std::string id;
  const HostTime end = host_now() + kGoToConfigWithin;
  while (host_now() < end) {
    if (!ask_xsens(port, xsens::mid::kGoToConfig, kGoToConfigEvery)) continue;
    id = device_id_of(ask_xsens(port, xsens::mid::kReqDid, kGoToConfigEvery));
    break;
  }
  (void)ask_xsens(port, xsens::mid::kGoToMeasurement, kGoToConfigEvery);
  return id;
}

/// Whether a GREIS receiver answers an empty command with its number.
bool answers_greis(SerialPort& port) {
  constexpr std::string_view kEmptyCommand = "\r\n%7%\r\n";
  say(port, {reinterpret_cast<const std::uint8_t*>(kEmptyCommand.data()), kEmptyCommand.size()});
  greis::Scanner scanner;
  bool answered = false;
  listen(port, kAnswerWithin, [&](std::span<const std::uint8_t> bytes) {
    greis::Frame frame;
    while (!bytes.empty()) {
      bytes = bytes.subspan(scanner.append(bytes, HostTime{}));
      while (scanner.next(frame)) answered |= frame.id == greis::kReply || frame.id == greis::kErrorReply;
    }
    return answered;
  });
  return answered;
}

/// One rate of one port. True where a device was understood.
bool probe_at(SerialPort& port, ProbedPort& result, std::size_t& most_bytes) {
  const Heard heard = listen(port, kListen);
  most_bytes = std::max(most_bytes, heard.bytes.size());
  if (const auto found = find_protocol(heard.bytes)) {
    result.protocol = found->protocol;
    const Heard longer = listen(port, kListenLonger);
    if (const auto again = find_protocol(longer.bytes); again && longer.seconds > 0.0) {
      const auto count = again->samples > 0 ? again->samples : again->messages;
      result.rate_hz = static_cast<double>(count - 1) / longer.seconds;
    }
    if (found->protocol == Protocol::kXsensMt) result.device_id = identify_xsens(port);
    return true;
  }
  if (heard.bytes.size() >= kSpeaks) return false;  // it speaks, at another rate: asking would disturb it
  const auto id = device_id_of(ask_xsens(port, xsens::mid::kReqDid, kAnswerWithin));
  if (!id.empty()) {
    result.protocol = Protocol::kXsensMt;
    result.device_id = id;
    return true;
  }
  if (!answers_greis(port)) return false;
  result.protocol = Protocol::kGreis;
  return true;
}

}  // namespace

ProbedPort probe_port(const std::string& path) {
  ProbedPort result;
  result.port = path;
  std::size_t most_bytes = 0;
  // A device that was just powered on may have been booting while its rate was looked at.
  for (int pass = 0; pass < 2; ++pass) {
    if (pass > 0 && most_bytes < kSpeaks) break;
    for (const std::uint32_t baud : kBauds) {
      auto port = SerialPort::open({path, baud, 1});
      if (!port) {
        // One rate that the adapter does not offer is no reason to give up; a port that is not there is.
        result.problem = port.error().text();
        if (baud == kBauds.front()) return result;
        continue;
      }
      result.problem.clear();
      if (!probe_at(*port, result, most_bytes)) continue;
      result.baud = baud;
      return result;
    }
  }
  std::vector<std::string_view> names;
  for (const ProtocolTraits& protocol : kProtocols) {
    if (protocol.is_stream) names.push_back(protocol.name);
  }
  result.problem = most_bytes >= kSpeaks
                       ? fmt::format(
                             "{} bytes came at best, and no message of {} at any baud rate; "
                             "set the device to one of these",
                             most_bytes, fmt::join(names, ", "))
                       : "nothing was heard at any baud rate; check the device's power and cable";
  return result;
}

std::vector<ProbedPort> probe_ports(const std::vector<std::string>& ports) {
  std::vector<std::future<ProbedPort>> work;
  work.reserve(ports.size());
  for (const std::string& port : ports) work.push_back(std::async(std::launch::async, probe_port, port));
  std::vector<ProbedPort> results;
  for (auto& one : work) results.push_back(one.get());
  return results;
}

}  // namespace imuscope
