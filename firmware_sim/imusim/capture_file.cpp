#include "firmware_sim/imusim/capture_file.h"

#include <fmt/format.h>
#include <openssl/evp.h>
#include <algorithm>
#include <array>
#include <cctype>
#include <cstdio>
#include <fstream>
#include <memory>
#include <optional>

#include "firmware_sim/devices/bytes.h"
#include "firmware_sim/imusim/output_file.h"

namespace imusim {
namespace {

constexpr std::uint32_t kSync = 0xEDA1DA01;
// Fingerprints that lcm-gen gives the two types: they change with every change of a .lcm file.
constexpr std::uint64_t kRunFingerprint = 0xbd9ebcdaf0684f5f;
constexpr std::uint64_t kRawFingerprint = 0xbf141f513f154d6d;
constexpr std::int32_t kCaptureFormat = 1;
constexpr std::int64_t kTick_ns = 10'000'000;
constexpr std::int64_t kNsPerUs = 1000;
/// A live recorder cuts reads into pieces of this many bytes.
constexpr std::size_t kPieceBytes = 1024;

/// A string in a message: its length with the closing zero, the letters, the zero.
void put_string(Bytes& bytes, const std::string& text) {
  put_be(bytes, static_cast<std::int32_t>(text.size() + 1));
  put_text(bytes, text);
  bytes.push_back(0);
}

std::string sha256_of(const std::string& text) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int size = 0;
  EVP_Digest(text.data(), text.size(), digest.data(), &size, EVP_sha256(), nullptr);
  std::string hex;
  for (unsigned int i = 0; i < size; ++i) hex += fmt::format("{:02x}", digest[i]);
  return hex;
}

std::string channel_of(const std::string& prefix, const std::string& kind, const std::string& device) {
  std::string name = prefix + "_" + kind;
  if (!device.empty()) name += "_";
  for (const char letter : device) {
    const auto byte = static_cast<unsigned char>(letter);
    name += std::isalnum(byte) != 0 ? static_cast<char>(std::toupper(byte)) : '_';
  }
  constexpr std::size_t kLongestChannel = 63;
  name.resize(std::min(name.size(), kLongestChannel));
  return name;
}

/// The event log that is being written.
class EventLog {
 public:
  explicit EventLog(const std::filesystem::path& path) : file_(path) {}

  void add(const std::string& channel, std::int64_t utime, const Bytes& message) {
    record_.clear();
    put_be(record_, kSync);
    put_be(record_, number_++);
    put_be(record_, utime);
    put_be(record_, static_cast<std::int32_t>(channel.size()));
    put_be(record_, static_cast<std::int32_t>(message.size()));
    put_text(record_, channel);
    put_bytes(record_, message);
    file_.write(reinterpret_cast<const char*>(record_.data()), record_.size());
  }
  Outcome<void> close() { return file_.close(); }

 private:
  OutputFile file_;
  std::int64_t number_ = 0;
  Bytes record_;
};

/// The host's two clocks, which differ by a constant.
struct HostClocks {
  std::int64_t monotonic_ns;
  std::int64_t utc_ns;
  [[nodiscard]] std::int64_t utime(std::int64_t arrival_ns) const {
    const std::int64_t ns = utc_ns + (arrival_ns - monotonic_ns);
    return ns / kNsPerUs - (ns % kNsPerUs < 0 ? 1 : 0);
  }
  [[nodiscard]] std::int64_t monotonic(std::int64_t at_utc_ns) const {
    return monotonic_ns + (at_utc_ns - utc_ns);
  }
};

/// One device's reads, in order: out of its dump, or out of its log of candump.
class Reads {
 public:
  struct Read {
    std::int64_t arrival_ns = 0;
    Bytes bytes;
  };

  Reads(const std::filesystem::path& folder, const std::string& name, const HostClocks& clocks)
      : name_(name), clocks_(clocks), log_(folder / (name + ".log")) {
    if (!log_.is_open()) {
      bytes_.open(folder / (name + ".bin"), std::ios::binary);
      arrivals_.open(folder / (name + ".arrivals.csv"));
      std::string header;
      std::getline(arrivals_, header);
    }
    advance();
  }

  [[nodiscard]] const std::optional<Read>& head() const { return head_; }
  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] std::int64_t next_sequence() { return sequence_++; }

  void advance() {
    head_.reset();
    if (log_.is_open()) return advance_log();
    std::string line;
    unsigned long long offset = 0;
    unsigned long long count = 0;
    long long arrival_ns = 0;
    if (!std::getline(arrivals_, line)) return;
    if (std::sscanf(line.c_str(), "%llu,%llu,%lld", &offset, &count, &arrival_ns) != 3) return;
    Read read{arrival_ns, Bytes(count)};
    bytes_.read(reinterpret_cast<char*>(read.bytes.data()), static_cast<std::streamsize>(count));
    head_ = std::move(read);
  }

 private:
  /// A frame's record is what a read of a CAN interface holds: identifier, length, three zeros, receive time
  /// by the host's monotonic clock, all with the least significant byte first, and the data.
  void advance_log() {
    long long seconds = 0;
    long long us = 0;
    unsigned id = 0;
    std::array<char, 17> data{};
    std::string line;
    if (!std::getline(log_, line)) return;
    if (std::sscanf(line.c_str(), "(%lld.%lld) %*s %3X#%16s", &seconds, &us, &id, data.data()) < 3) return;
    constexpr std::int64_t kUsPerSecond = 1'000'000;
    Read read{clocks_.monotonic((seconds * kUsPerSecond + us) * kNsPerUs), {}};
    const std::string_view digits(data.data());
    put_le(read.bytes, std::uint32_t{id});
    put_le(read.bytes, static_cast<std::uint32_t>(digits.size() / 2));
    put_le(read.bytes, read.arrival_ns);
    for (std::size_t i = 0; i + 1 < digits.size(); i += 2) {
      read.bytes.push_back(
          static_cast<std::uint8_t>(std::stoul(std::string(digits.substr(i, 2)), nullptr, 16)));
    }
    head_ = std::move(read);
  }

  std::string name_;
  HostClocks clocks_;
  std::ifstream log_;
  std::ifstream bytes_;
  std::ifstream arrivals_;
  std::optional<Read> head_;
  std::int64_t sequence_ = 0;
};

Bytes run_message(const CaptureHeader& header, std::int64_t t0_ns, const HostClocks& clocks) {
  Bytes bytes;
  put_be(bytes, kRunFingerprint);
  put_be(bytes, clocks.utime(t0_ns));
  put_be(bytes, std::int64_t{0});  // first file of the capture
  put_be(bytes, kCaptureFormat);
  put_string(bytes, header.run_name);
  put_string(bytes, header.version);
  put_string(bytes, "simulated");
  put_string(bytes, "");
  put_be(bytes, t0_ns);
  put_be(bytes, kTick_ns);
  put_be(bytes, clocks.utime(t0_ns));
  put_string(bytes, header.configuration);
  put_string(bytes, sha256_of(header.configuration));
  put_be(bytes, static_cast<std::int32_t>(header.devices.size()));
  for (const std::string& device : header.devices) put_string(bytes, device);
  return bytes;
}

void put_read(Reads& reads, const std::string& channel, const HostClocks& clocks, EventLog& log) {
  const Reads::Read& read = *reads.head();
  std::span<const std::uint8_t> rest(read.bytes);
  while (!rest.empty()) {
    const auto piece = rest.first(std::min(rest.size(), kPieceBytes));
    rest = rest.subspan(piece.size());
    Bytes bytes;
    put_be(bytes, kRawFingerprint);
    put_be(bytes, clocks.utime(read.arrival_ns));
    put_be(bytes, reads.next_sequence());
    put_string(bytes, reads.name());
    put_be(bytes, std::int8_t{0});  // a read
    put_be(bytes, read.arrival_ns);
    put_be(bytes, static_cast<std::int8_t>(rest.empty() ? 0 : 1));
    put_be(bytes, static_cast<std::int32_t>(piece.size()));
    put_bytes(bytes, piece);
    log.add(channel, clocks.utime(read.arrival_ns), bytes);
  }
}

}  // namespace

Outcome<void> write_capture(const CaptureHeader& header, const std::filesystem::path& folder) {
  std::vector<std::unique_ptr<Reads>> devices;
  const HostClocks clocks{header.host_begin_ns, header.utc_begin.time_since_epoch().count()};
  for (const std::string& name : header.devices)
    devices.push_back(std::make_unique<Reads>(folder, name, clocks));
  // The oldest head is next; of equal arrivals the device that the configuration names first.
  const auto oldest = [&]() -> Reads* {
    Reads* found = nullptr;
    for (const auto& reads : devices) {
      if (!reads->head()) continue;
      if (found == nullptr || reads->head()->arrival_ns < found->head()->arrival_ns) found = reads.get();
    }
    return found;
  };

  const Reads* first = oldest();
  const std::int64_t begin_ns = first != nullptr ? first->head()->arrival_ns : header.host_begin_ns;
  const std::int64_t t0_ns = begin_ns / kTick_ns * kTick_ns;
  EventLog log(folder / "capture.lcm");
  log.add(channel_of(header.channel_prefix, "RUN", ""), clocks.utime(t0_ns),
          run_message(header, t0_ns, clocks));
  while (Reads* reads = oldest()) {
    put_read(*reads, channel_of(header.channel_prefix, "RAW", reads->name()), clocks, log);
    reads->advance();
  }
  return log.close();
}

}  // namespace imusim
