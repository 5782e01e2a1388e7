#include "service/recording/message_log.h"

#include <fmt/format.h>
#include <algorithm>
#include <array>
#include <fstream>
#include <map>
#include <vector>

#include "base/line_reader.h"
#include "base/text.h"
#include "logs/flight_log/dataflash_reader.h"
#include "logs/flight_log/ulog_reader.h"
#include "logs/mcap/format.h"
#include "logs/mcap/reader.h"
#include "logs/rosbag/reader.h"

namespace imuscope {
namespace {

using mcap::MessageReader;
using Opened = Result<std::unique_ptr<MessageReader>>;

constexpr const char* kMetadata = "metadata.yaml";

/// The files of a folder of rosbag2, one after the other.
class ChainReader final : public MessageReader {
 public:
  explicit ChainReader(std::vector<std::unique_ptr<MessageReader>> parts) : parts_(std::move(parts)) {}
  std::optional<mcap::Message> next() override {
    while (at_ < parts_.size()) {
      if (auto message = parts_[at_]->next()) return message;
      ++at_;
    }
    return std::nullopt;
  }
  [[nodiscard]] std::vector<std::string> losses() const override {
    std::vector<std::string> losses;
    for (const auto& part : parts_) {
      const auto of_part = part->losses();
      losses.insert(losses.end(), of_part.begin(), of_part.end());
    }
    return losses;
  }
  [[nodiscard]] std::uint64_t bytes_read() const noexcept override {
    std::uint64_t bytes = 0;
    for (std::size_t i = 0; i < std::min(at_ + 1, parts_.size()); ++i) bytes += parts_[i]->bytes_read();
    return bytes;
  }
  [[nodiscard]] std::uint64_t bytes_total() const noexcept override {
    std::uint64_t bytes = 0;
    for (const auto& part : parts_) bytes += part->bytes_total();
    return bytes;
  }

 private:
  std::vector<std::unique_ptr<MessageReader>> parts_;
  std::size_t at_ = 0;
};

template <typename Reader>
Opened as_base(Result<Reader> reader) {
  if (!reader) return tl::unexpected<Error>(reader.error());
  return std::make_unique<Reader>(std::move(*reader));
}

/// What stands behind "- " in the list of files of a metadata.yaml; without what leads out of the folder.
Result<std::vector<std::string>> files_of(const std::filesystem::path& folder) {
  constexpr std::size_t kLongest = 4096;
  constexpr std::size_t kFilesMost = 1000;
  constexpr std::string_view kList = "relative_file_paths:";
  std::ifstream in(folder / kMetadata);
  std::vector<std::string> files;
  std::string line;
  bool is_list = false;
  while (read_line(in, line, kLongest) && files.size() < kFilesMost) {
    const auto begin = std::min(line.find_first_not_of(' '), line.size());
    std::string_view text = std::string_view(line).substr(begin);
    while (!text.empty() && (text.back() == ' ' || text.back() == '\r')) text.remove_suffix(1);
    if (is_list && !text.starts_with("- ")) break;
    if (text == kList) is_list = true;
    if (!is_list || !text.starts_with("- ")) continue;
    text.remove_prefix(2);
    if (text.size() > 1 && (text.front() == '"' || text.front() == '\'') && text.back() == text.front())
      text = text.substr(1, text.size() - 2);
    // Early versions wrote the folder's own name before the file's.
    const auto name = std::filesystem::path(text).filename();
    if (name.empty() || name == "." || name == "..") continue;
    files.push_back(name.string());
  }
  if (files.empty())
    return work_error(fmt::format("{} names no file of the bag", (folder / kMetadata).string()),
                      "give the .mcap in the folder");
  return files;
}

Opened open_folder(const std::filesystem::path& folder) {
  if (!std::filesystem::exists(folder / kMetadata)) {
    return work_error(fmt::format("{}: is a folder without {}", folder.string(), kMetadata),
                      "give an MCAP file, or a folder of rosbag2");
  }
  const auto files = files_of(folder);
  if (!files) return tl::unexpected<Error>(files.error());
  std::vector<std::unique_ptr<MessageReader>> parts;
  for (const std::string& name : *files) {
    const auto file = folder / name;
    const std::string shown = one_line(file.string());
    if (name.ends_with(".db3"))
      return work_error(fmt::format("{}: is a bag of rosbag2 in SQLite", shown),
                        "convert it: mcap convert, ros2 bag convert or rosbags-convert make an .mcap of it");
    if (name.ends_with(".zstd"))
      return work_error(fmt::format("{}: is packed as a whole", shown), "unpack it: zstd -d");
    auto part = mcap::Reader::open(file);
    if (!part) return tl::unexpected<Error>(part.error());
    parts.push_back(std::make_unique<mcap::Reader>(std::move(*part)));
  }
  return std::make_unique<ChainReader>(std::move(parts));
}

/// A file by its first bytes.
std::optional<Protocol> find_in_file(const std::filesystem::path& file) {
  std::array<char, 16> bytes{};
  std::ifstream in(file, std::ios::binary);
  in.read(bytes.data(), bytes.size());
  const std::string_view begin(bytes.data(),
                               static_cast<std::size_t>(std::max<std::streamsize>(in.gcount(), 0)));
  const auto begins = [&](const auto& magic) {
    return begin.size() >= magic.size() &&
           std::equal(magic.begin(), magic.end(), begin.begin(),
                      [](auto a, char b) { return static_cast<char>(a) == b; });
  };
  if (begins(mcap::kMagic)) return Protocol::kMcap;
  if (begins(rosbag::kMagic)) return Protocol::kRosbag;
  if (begins(flight_log::kUlogMagic)) return Protocol::kUlog;
  if (begins(flight_log::kDataflashMark) && begin.size() > 2 &&
      static_cast<std::uint8_t>(begin[2]) == flight_log::kDataflashFormat)
    return Protocol::kDataflash;
  return std::nullopt;
}

/// SQLite and packed files, which people give first.
Result<void> refuse_known(const std::filesystem::path& file) {
  std::array<char, 16> bytes{};
  std::ifstream in(file, std::ios::binary);
  in.read(bytes.data(), bytes.size());
  const std::string_view begin(bytes.data(),
                               static_cast<std::size_t>(std::max<std::streamsize>(in.gcount(), 0)));
  if (begin.starts_with("SQLite format 3"))
    return work_error(fmt::format("{}: is a bag of rosbag2 in SQLite", file.string()),
                      "convert it: mcap convert, ros2 bag convert or rosbags-convert make an .mcap of it");
  if (begin.starts_with("\x28\xB5\x2F\xFD"))
    return work_error(fmt::format("{}: is packed as a whole", file.string()), "unpack it: zstd -d");
  if (begin.starts_with("\x1F\x8B"))
    return work_error(fmt::format("{}: is packed as a whole", file.string()), "unpack it: gunzip");
  return {};
}

}  // namespace

std::optional<Protocol> find_message_log(const std::filesystem::path& file) {
  std::error_code error;
  if (std::filesystem::is_directory(file, error))
    return std::filesystem::exists(file / kMetadata, error) ? std::optional(Protocol::kMcap) : std::nullopt;
  return std::filesystem::is_regular_file(file, error) ? find_in_file(file) : std::nullopt;
}

Result<std::unique_ptr<MessageReader>> open_message_log(const std::filesystem::path& file,
                                                        Protocol protocol) {
  std::error_code error;
  if (std::filesystem::is_regular_file(file, error)) {
    const auto found = find_in_file(file);
    if (found && *found != protocol) {
      return usage_error(
          fmt::format("{}: is of {}, not of {}", file.string(), name_of(*found), name_of(protocol)),
          fmt::format("write protocol = \"{}\"", name_of(*found)));
    }
    if (!found) {
      if (auto refused = refuse_known(file); !refused) return tl::unexpected<Error>(refused.error());
    }
  }
  switch (protocol) {
    case Protocol::kRosbag:
      return as_base(rosbag::Reader::open(file));
    case Protocol::kUlog:
      return as_base(flight_log::UlogReader::open(file));
    case Protocol::kDataflash:
      return as_base(flight_log::DataflashReader::open(file));
    default:
      if (std::filesystem::is_directory(file, error)) return open_folder(file);
      return as_base(mcap::Reader::open(file));
  }
}

std::string plain_type(std::string_view schema) {
  std::string type(schema);
  std::replace(type.begin(), type.end(), '.', '/');
  if (const auto at = type.find("/msg/"); at != std::string::npos) type.erase(at, 4);
  return type;
}

Result<std::vector<FoundTopic>> find_topics(const std::filesystem::path& file, Protocol protocol) {
  auto reader = open_message_log(file, protocol);
  if (!reader) return tl::unexpected<Error>(reader.error());
  struct Span {
    std::uint64_t first;
    std::uint64_t last;
  };
  std::vector<FoundTopic> topics;
  std::vector<Span> spans;
  std::map<const mcap::Topic*, std::size_t> index;
  while (const auto message = (*reader)->next()) {
    const auto [at, is_new] = index.try_emplace(message->topic, topics.size());
    if (is_new) {
      topics.push_back({message->topic->name, plain_type(message->topic->schema)});
      spans.push_back({message->log_time, message->log_time});
    }
    ++topics[at->second].messages;
    spans[at->second].first = std::min(spans[at->second].first, message->log_time);
    spans[at->second].last = std::max(spans[at->second].last, message->log_time);
  }
  constexpr double kNs_s = 1e-9;
  for (std::size_t i = 0; i < topics.size(); ++i) {
    const double span_s = static_cast<double>(spans[i].last - spans[i].first) * kNs_s;
    if (span_s > 0.0) topics[i].rate_hz = static_cast<double>(topics[i].messages - 1) / span_s;
  }
  return topics;
}

}  // namespace imuscope
