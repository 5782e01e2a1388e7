#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/mman.h>
#include <unistd.h>
#include <algorithm>
#include <boost/interprocess/file_mapping.hpp>
#include <boost/interprocess/mapped_region.hpp>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "base/json_text.h"
#include "commands.h"
#include "decode/candump.h"
#include "decode/stream_protocols.h"
#include "drivers/dbc/parser.h"
#include "print.h"
#include "progress.h"

namespace imuscope::cli {
namespace {

using Stream = std::span<const std::uint8_t>;

/// The protocol is found from this much of a recording's beginning.
constexpr std::size_t kLook = 1U << 20U;

struct DecodeCommand {
  std::string file;
  std::string protocol;
  std::string dbc;
  bool json = false;
};

struct Totals {
  std::uint64_t messages = 0;
  std::uint64_t bytes_skipped = 0;
};

/// A recording as the kernel maps it: of hours of bytes, only what is being looked at is in memory.
class MappedFile {
 public:
  static Result<MappedFile> open(const std::string& file) {
    std::error_code error;
    const auto status = std::filesystem::status(file, error);
    if (std::filesystem::is_directory(status))
      return usage_error(file + " is a folder", "give a raw recording");
    if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status))
      return usage_error(file + " is a device or a pipe", "record its bytes to a file first");
    MappedFile mapped;
    try {
      // An empty file cannot be mapped.
      if (std::filesystem::file_size(file) == 0) return mapped;
      const boost::interprocess::file_mapping mapping(file.c_str(), boost::interprocess::read_only);
      mapped.region_ = boost::interprocess::mapped_region(mapping, boost::interprocess::read_only);
    } catch (const std::exception& cause) {
      return work_error(fmt::format("{} cannot be read: {}", file, cause.what()), "check the name");
    }
    mapped.region_.advise(boost::interprocess::mapped_region::advice_sequential);
    return mapped;
  }
  [[nodiscard]] Stream bytes() const {
    return {static_cast<const std::uint8_t*>(region_.get_address()), region_.get_size()};
  }
  /// Gives the memory of everything before `offset` back; a look at it reads it again.
  void release(std::uint64_t offset) const {
    // posix_madvise(), which boost uses, leaves pages where they are.
    (void)::madvise(region_.get_address(), std::min<std::uint64_t>(offset, region_.get_size()),
                    MADV_DONTNEED);
  }

 private:
  boost::interprocess::mapped_region region_;
};

/// Bytes of messages that prove the protocol.
std::size_t proven_bytes(
    const StreamProtocol& protocol, Stream stream,
    const std::function<void(std::uint64_t)>& on_position = [](std::uint64_t) {}) {
  std::size_t proven = 0;
  const auto on_message = [&](const DecodedMessage& message) { proven += message.proven ? message.size : 0; };
  protocol.decode(stream, {on_message, on_position});
  return proven;
}

/// The protocol whose messages cover the most bytes; null where none covers any.
const StreamProtocol* find_protocol(Stream stream) {
  const StreamProtocol* best = nullptr;
  std::size_t most = 0;
  for (const StreamProtocol& protocol : stream_protocols()) {
    const std::size_t covered = proven_bytes(protocol, stream.first(std::min(stream.size(), kLook)));
    if (covered <= most) continue;
    most = covered;
    best = &protocol;
  }
  return best;
}

Result<const StreamProtocol*> choose_protocol(const DecodeCommand& options, Stream stream) {
  std::vector<std::string_view> names;
  for (const StreamProtocol& protocol : stream_protocols()) {
    if (protocol.name == options.protocol) return &protocol;
    names.push_back(protocol.name);
  }
  if (!options.protocol.empty()) {
    return usage_error(fmt::format("unknown protocol '{}'", options.protocol),
                       fmt::format("choose one of: {}", fmt::join(names, ", ")));
  }
  const StreamProtocol* found = find_protocol(stream);
  if (found != nullptr) return found;
  return work_error(fmt::format("no message of a known protocol in {}", options.file),
                    fmt::format("known are: {}", fmt::join(names, ", ")));
}

void print(const StreamProtocol& protocol, const DecodedMessage& message, bool json) {
  if (json) {
    nlohmann::ordered_json line = {
        {"offset", message.offset}, {"protocol", protocol.name}, {"message", message.message}};
    line.update(message.fields);
    say("{}\n", json_text(line, kJsonOneLine));
    return;
  }
  say("{:>10}  {}  {:<18}", message.offset, protocol.name, message.message);
  for (const auto& [key, value] : message.fields.items()) {
    say("  {}={}", key, json_text(value, kJsonOneLine));
  }
  say("\n");
}

/// Prints the messages of a recording in stream order: those of its protocol, and between them those of
/// others.
class Printer {
 public:
  Printer(const MappedFile& file, const StreamProtocol& protocol, bool json)
      : file_(file), stream_(file.bytes()), protocol_(protocol), json_(json) {
    // On a terminal the messages themselves show how far it is.
    if (::isatty(STDOUT_FILENO) == 0) bar_.emplace();
  }

  Totals run() {
    const auto on_message = [this](const DecodedMessage& message) {
      fill_gap(message.offset);
      print(protocol_, message, json_);
      ++totals_.messages;
      end_ = std::max<std::uint64_t>(end_, message.offset + message.size);
    };
    protocol_.decode(stream_, {on_message, [this](std::uint64_t offset) { pass("decoding", offset); }});
    fill_gap(stream_.size());
    return totals_;
  }

 private:
  /// What lies between the last message and `to` belongs to other protocols, or to nobody.
  void fill_gap(std::uint64_t to) {
    if (to <= end_) return;
    const Stream gap = stream_.subspan(end_, to - end_);
    const StreamProtocol* best = nullptr;
    std::size_t most = 0;
    for (const StreamProtocol& other : stream_protocols()) {
      if (!other.mixes_with_others || other.name == protocol_.name) continue;
      const auto on_position = [&](std::uint64_t offset) {
        pass(fmt::format("looking for {}", other.name), end_ + offset);
      };
      const std::size_t covered = proven_bytes(other, gap, on_position);
      if (covered > most) {
        most = covered;
        best = &other;
      }
    }
    if (best != nullptr) {
      const auto on_message = [&](DecodedMessage message) {
        message.offset += end_;
        print(*best, message, json_);
        ++totals_.messages;
      };
      best->decode(gap, {on_message, [this](std::uint64_t offset) { pass("decoding", end_ + offset); }});
    }
    totals_.bytes_skipped += gap.size() - most;
    end_ = to;
  }

  void pass(const std::string& step, std::uint64_t offset) {
    if (bar_) bar_->show(step, static_cast<double>(offset) / static_cast<double>(stream_.size()));
    file_.release(offset);
  }

  const MappedFile& file_;
  Stream stream_;
  const StreamProtocol& protocol_;
  bool json_;
  std::optional<ProgressBar> bar_;
  Totals totals_;
  std::uint64_t end_ = 0;  ///< of what was printed
};

/// A log of CAN frames as the messages of a vehicle's DBC file.
Result<Totals> decode_with_dbc(const DecodeCommand& options, const MappedFile& file) {
  const auto text = dbc::read_text(options.dbc);
  if (!text) return tl::unexpected<Error>(text.error());
  const auto database = dbc::parse(*text, options.dbc);
  if (!database) return tl::unexpected<Error>(database.error());
  const StreamProtocol candump{"candump", decode_candump_frames, false};
  Totals totals;
  std::uint64_t covered = 0;
  const auto on_message = [&](const DecodedMessage& message) {
    print(candump, message, options.json);
    ++totals.messages;
    covered += message.size;
  };
  decode_candump(file.bytes(), &*database, {on_message, [&](std::uint64_t offset) { file.release(offset); }});
  if (totals.messages == 0) {
    return work_error(fmt::format("no CAN frame in {}", options.file),
                      "--dbc wants a log as `candump -l` writes it");
  }
  totals.bytes_skipped = file.bytes().size() - covered;
  return totals;
}

Result<Totals> decode_stream(const DecodeCommand& options, const MappedFile& file) {
  if (!options.dbc.empty()) return decode_with_dbc(options, file);
  const auto protocol = choose_protocol(options, file.bytes());
  if (!protocol) return tl::unexpected<Error>(protocol.error());
  return Printer(file, **protocol, options.json).run();
}

Result<void> decode(const DecodeCommand& options) {
  const auto file = MappedFile::open(options.file);
  if (!file) return tl::unexpected<Error>(file.error());
  const auto totals = decode_stream(options, *file);
  if (!totals) return tl::unexpected<Error>(totals.error());
  if (options.json) {
    say("{{\"messages\": {}, \"bytes_skipped\": {}}}\n", totals->messages, totals->bytes_skipped);
  } else {
    say("{} messages, {} bytes skipped\n", totals->messages, totals->bytes_skipped);
  }
  return {};
}

}  // namespace

void add_decode(CLI::App& app, Work& chosen) {
  auto* command = app.add_subcommand("decode", "The messages of a raw recording, one a line");
  auto options = std::make_shared<DecodeCommand>();
  command->add_option("FILE", options->file, "raw bytes as a device sent them")->required();
  command->add_option("--protocol", options->protocol, "which one; found by itself where not given");
  command->add_option("--dbc", options->dbc,
                      "of a CAN log: the vehicle's DBC file, for signals instead of bytes");
  command->add_flag("--json", options->json, "one JSON object a line");
  on_chosen(*command, chosen, [options] { return decode(*options); });
}

}  // namespace imuscope::cli
