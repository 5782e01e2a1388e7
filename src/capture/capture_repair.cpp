#include "capture/capture_repair.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <variant>

#include "capture/capture_writer.h"
#include "capture/record_codec.h"
#include "capture/seal.h"

namespace imuscope {
namespace {

constexpr std::size_t kFlushBytes = std::size_t{64} << 10U;
constexpr std::string_view kRunSuffix = "_RUN";

/// Whether the index describes these bytes.
bool agrees(const std::filesystem::path& path, const capture_index_t& index) {
  constexpr std::size_t kBlockBytes = std::size_t{256} << 10U;
  std::ifstream file(path, std::ios::binary);
  std::vector<std::uint8_t> block(kBlockBytes);
  std::uint32_t checksum = 0;
  std::int64_t left = index.n_bytes;
  while (left > 0 && file) {
    const auto wanted = std::min<std::int64_t>(left, static_cast<std::int64_t>(block.size()));
    file.read(reinterpret_cast<char*>(block.data()), static_cast<std::streamsize>(wanted));
    const auto n = static_cast<std::size_t>(file.gcount());
    checksum = crc32_of(std::span(block).first(n), checksum);
    left -= static_cast<std::int64_t>(n);
  }
  return left == 0 && static_cast<std::int32_t>(checksum) == index.file_checksum;
}

FileCheck check_file(const std::filesystem::path& first, const CapturedFile& file) {
  const auto path = capture_file(first, file.number);
  FileCheck check;
  check.file = file;
  std::error_code ignored;
  check.bytes = std::filesystem::file_size(path, ignored);
  if (const auto& index = file.health.index)
    check.index = agrees(path, *index) ? IndexVerdict::kAgrees : IndexVerdict::kDisagrees;
  return check;
}

/// Writes the files of the new capture one after another.
class Copy {
 public:
  Copy(const CaptureCheck& checked, std::filesystem::path out) : checked_(checked), out_(std::move(out)) {}

  Result<void> add(int number, const LogEventView& event) {
    // A seal that does not stand where it was put was read as any record. In the copy it might stand so
    // again, and the copy has seals of its own.
    if (decode_seal(event.data) || decode_index(event.data)) return {};
    const bool is_header = channel_of_header(event).has_value();
    if (!writer_ || number != number_) {
      if (auto begun = begin(number, event, is_header); !begun) return begun;
    }
    writer_->append(event.channel, event.utime, event.data);
    repaired_.records += 1;
    return writer_->pending_bytes() > kFlushBytes ? writer_->flush() : Result<void>{};
  }

  Result<Repaired> finish() {
    if (auto closed = close(); !closed) return tl::unexpected<Error>(closed.error());
    return std::move(repaired_);
  }

 private:
  static std::optional<std::string> channel_of_header(const LogEventView& event) {
    const auto record = decode_record(event.data);
    if (!record || !std::holds_alternative<RunHeader>(*record)) return std::nullopt;
    return std::string(event.channel);
  }

  Result<void> begin(int number, const LogEventView& event, bool is_header) {
    if (auto closed = close(); !closed) return closed;
    if (is_header && event.channel.ends_with(kRunSuffix))
      prefix_ = event.channel.substr(0, event.channel.size() - kRunSuffix.size());
    const auto path = capture_file(out_, number);
    auto created = CaptureWriter::create(path, prefix_, number);
    if (!created) return tl::unexpected<Error>(created.error());
    writer_.emplace(std::move(*created));
    number_ = number;
    repaired_.files.push_back(path);
    if (is_header || !checked_.summary.has_run) return {};
    const RunHeader& run = checked_.summary.run;
    const RecordClock clock{run.t0, run.t0_wall};
    writer_->append(channel_name(prefix_, "RUN"), clock.utime(run.t0), encode(run, number));
    return {};
  }

  Result<void> close() {
    if (!writer_) return {};
    auto closed = writer_->close();
    writer_.reset();
    return closed;
  }

  const CaptureCheck& checked_;
  std::filesystem::path out_;
  std::string prefix_{kDefaultChannelPrefix};
  std::optional<CaptureWriter> writer_;
  int number_ = 0;
  Repaired repaired_;
};

}  // namespace

bool CaptureCheck::is_whole() const {
  return summary.breaks.empty() && summary.losses.empty() &&
         std::all_of(files.begin(), files.end(),
                     [](const FileCheck& check) { return check.index == IndexVerdict::kAgrees; });
}

Result<CaptureCheck> check_capture(const std::filesystem::path& first,
                                   const std::function<void(double share)>& progress) {
  auto summary = summarise_capture(first, progress, EventLogReader::Beginning::kMayBeDamaged);
  if (!summary) return tl::unexpected<Error>(summary.error());
  CaptureCheck check;
  check.summary = std::move(*summary);
  for (const CapturedFile& file : check.summary.files) check.files.push_back(check_file(first, file));
  return check;
}

Result<Repaired> repair_capture(const std::filesystem::path& first, const CaptureCheck& checked,
                                const std::filesystem::path& out) {
  auto log = CaptureFiles::open(first, EventLogReader::Beginning::kMayBeDamaged);
  if (!log) return tl::unexpected<Error>(log.error());
  Copy copy(checked, out);
  LogEventView event;
  while (log->next(event)) {
    if (auto added = copy.add(log->number(), event); !added) return tl::unexpected<Error>(added.error());
  }
  return copy.finish();
}

}  // namespace imuscope
