#include "service/recording/byte_source.h"

#include <fmt/format.h>
#include <algorithm>
#include <cctype>
#include <deque>
#include <fstream>
#include <functional>
#include <utility>
#include <vector>

#include "capture/capture_reader.h"
#include "drivers/xsens_mt/mtb_file.h"
#include "service/recording/read_ahead.h"

namespace imuscope {

namespace {

/// Bytes without stamps are handed out in pieces so small that what is decoded from one always fits a ring.
constexpr std::size_t kUnstampedPiece = 4096;

class RawDumpSource final : public ByteSource {
 public:
  /// @param header  bytes of a header at the beginning, not handed out
  RawDumpSource(RawDump dump, std::uint64_t total, std::size_t header)
      : dump_(std::move(dump)), total_(total - header), header_(header) {}

  Result<std::optional<RecordedRead>> next() override {
    if (rest_.empty()) {
      const auto read = dump_.next();
      if (!read) return std::optional<RecordedRead>{};
      arrival_ = read->arrival;
      rest_ = read->bytes;
      const std::size_t passed = std::min(header_, rest_.size());
      rest_ = rest_.subspan(passed);
      header_ -= passed;
      if (rest_.empty()) return next();
    }
    const std::size_t n = arrival_ ? rest_.size() : std::min(rest_.size(), kUnstampedPiece);
    const RecordedRead piece{arrival_, rest_.first(n)};
    rest_ = rest_.subspan(n);
    read_ += n;
    return std::optional<RecordedRead>{piece};
  }
  [[nodiscard]] std::uint64_t bytes_read() const override { return read_; }
  [[nodiscard]] std::uint64_t bytes_total() const override { return total_; }

 private:
  RawDump dump_;
  std::uint64_t total_;
  std::size_t header_;
  std::uint64_t read_ = 0;
  std::optional<HostTime> arrival_;
  std::span<const std::uint8_t> rest_;
};

/// Gives the next read or write, in the memory of one that is of no use any more; false at the end.
using TakeRead = std::function<bool(RawRead& read)>;

/// The reads of several devices, taken from one pass over a capture and kept until they are asked for.
class SharedReads {
 public:
  /// @param take  of the capture, of any device
  SharedReads(TakeRead take, const std::vector<std::string>& devices) : take_(std::move(take)) {
    for (const auto& device : devices) lines_.push_back({device, {}, true});
  }

  /// The next of line `i`, whatever its direction, as TakeRead gives it.
  bool next(std::size_t i, RawRead& read) {
    auto& waiting = lines_[i].waiting;
    while (waiting.empty() && !is_far_ahead()) {
      if (!take_(taken_)) return false;
      keep(taken_);
    }
    if (waiting.empty()) return false;
    std::swap(taken_, read);  // for its memory
    read = std::move(waiting.front());
    waiting.pop_front();
    held_ -= read.bytes.size();
    return true;
  }
  /// So much is kept for others that a line that has nothing waiting goes its own way.
  [[nodiscard]] bool is_far_ahead() const { return held_ > kHeldMost; }
  void leave(std::size_t i) {
    lines_[i].is_wanted = false;
    for (const RawRead& read : lines_[i].waiting) held_ -= read.bytes.size();
    lines_[i].waiting = {};
  }

 private:
  /// What five lines at their full rate bring in some minutes.
  static constexpr std::size_t kHeldMost = std::size_t{32} << 20U;
  struct Line {
    std::string device;
    std::deque<RawRead> waiting;
    bool is_wanted;
  };
  void keep(RawRead& read) {
    Line* last = nullptr;
    for (Line& line : lines_) {
      if (!line.is_wanted || line.device != read.device) continue;
      held_ += read.bytes.size();
      if (last != nullptr) last->waiting.push_back(read);
      last = &line;
    }
    if (last != nullptr) last->waiting.push_back(std::move(read));
  }
  TakeRead take_;
  RawRead taken_;
  std::vector<Line> lines_;
  std::size_t held_ = 0;
};

/// One device's reads out of a capture; what was written to devices is passed over.
class CaptureSource final : public ByteSource {
 public:
  /// The device's next, of any direction, as TakeRead gives it. May fail.
  using Take = std::function<Result<bool>(RawRead&)>;

  CaptureSource(Take take, std::uint64_t total) : take_(std::move(take)), total_(total) {}

  Result<std::optional<RecordedRead>> next() override {
    for (;;) {
      const auto taken = take_(current_);
      if (!taken) return tl::unexpected<Error>(taken.error());
      if (!*taken) return std::optional<RecordedRead>{};
      if (current_.direction == Direction::kLine) {
        const auto told = line_rate_of(current_.bytes);
        if (told) per_byte_ = told;
      }
      if (current_.direction != Direction::kRead) continue;
      read_ += current_.bytes.size();
      return std::optional<RecordedRead>{RecordedRead{
          current_.arrival, current_.bytes, std::exchange(per_byte_, std::nullopt), current_.received}};
    }
  }
  [[nodiscard]] std::uint64_t bytes_read() const override { return read_; }
  [[nodiscard]] std::uint64_t bytes_total() const override { return total_; }

 private:
  Take take_;
  std::uint64_t total_;
  std::uint64_t read_ = 0;
  std::optional<Duration> per_byte_;  ///< told, and no read since
  RawRead current_;
};

TakeRead reads_of(CaptureReader reader, Reading reading) {
  if (reading == Reading::kAhead)
    return
        [ahead = std::make_shared<ReadAhead>(std::move(reader))](RawRead& read) { return ahead->next(read); };
  return
      [own = std::make_shared<CaptureReader>(std::move(reader))](RawRead& read) { return own->next(read); };
}

/// Takes the reads of one device from a reader of its own.
class OwnReads {
 public:
  OwnReads(CaptureReader reader, std::string device, Reading reading)
      : take_(reads_of(std::move(reader), reading)), device_(std::move(device)) {}
  Result<bool> operator()(RawRead& read) {
    while (take_(read)) {
      if (read.device == device_) return true;
    }
    return false;
  }

 private:
  TakeRead take_;
  std::string device_;
};

/// Takes them from those that are shared, and by itself from where it went too far ahead.
class SharedLine {
 public:
  SharedLine(std::shared_ptr<SharedReads> shared, std::size_t index, std::filesystem::path capture,
             std::string device)
      : shared_(std::move(shared)),
        index_(index),
        capture_(std::move(capture)),
        device_(std::move(device)),
        leaves_(nullptr, [all = shared_, index](void*) { all->leave(index); }) {}
  Result<bool> operator()(RawRead& read) {
    if (own_) return (*own_)(read);
    if (shared_->next(index_, read)) {
      ++taken_;
      return true;
    }
    if (!shared_->is_far_ahead()) return false;
    shared_->leave(index_);
    auto reader = CaptureReader::open(capture_, device_);
    if (!reader) return tl::unexpected<Error>(reader.error());
    own_.emplace(std::move(*reader), device_, Reading::kWhenAsked);
    for (std::uint64_t i = 0; i < taken_; ++i) (void)(*own_)(read);
    return (*own_)(read);
  }

 private:
  std::shared_ptr<SharedReads> shared_;
  std::size_t index_;
  std::filesystem::path capture_;
  std::string device_;
  std::shared_ptr<void> leaves_;  ///< nothing is kept for a line that is gone
  std::uint64_t taken_ = 0;
  std::optional<OwnReads> own_;
};

/// Bytes of the header of a .mtb log; 0 for any other file.
Result<std::size_t> header_of(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char letter) { return static_cast<char>(std::tolower(letter)); });
  if (extension != ".mtb") return 0;
  constexpr std::size_t kLook = 1U << 20U;
  std::vector<std::uint8_t> beginning(kLook);
  std::ifstream in(file, std::ios::binary);
  in.read(reinterpret_cast<char*>(beginning.data()), static_cast<std::streamsize>(beginning.size()));
  beginning.resize(static_cast<std::size_t>(std::max<std::streamsize>(in.gcount(), 0)));
  const auto offset = xsens::data_offset_of_mtb(beginning);
  if (!offset) {
    return work_error(fmt::format("{}: no XSens message follows its header", file.string()),
                      "check that it is a log of an MT device");
  }
  return *offset;
}

}  // namespace

Result<std::unique_ptr<ByteSource>> open_raw_dump(const std::filesystem::path& file,
                                                  RawDump::Arrivals arrivals) {
  auto dump = RawDump::open(file, arrivals);
  if (!dump) return tl::unexpected<Error>(dump.error());
  std::error_code code;
  const auto size = std::filesystem::file_size(file, code);
  const auto header = header_of(file);
  if (!header) return tl::unexpected<Error>(header.error());
  return std::make_unique<RawDumpSource>(std::move(*dump), code ? *header : size, *header);
}

Result<std::unique_ptr<ByteSource>> open_captured_device(const std::filesystem::path& capture,
                                                         const std::string& device, std::uint64_t bytes,
                                                         Reading reading) {
  auto reader = CaptureReader::open(capture, device);
  if (!reader) return tl::unexpected<Error>(reader.error());
  return std::make_unique<CaptureSource>(OwnReads(std::move(*reader), device, reading), bytes);
}

Result<std::vector<std::unique_ptr<ByteSource>>> open_captured_lines(const std::filesystem::path& capture,
                                                                     const std::vector<CapturedLine>& lines,
                                                                     Reading reading) {
  auto reader = CaptureReader::open(capture);
  if (!reader) return tl::unexpected<Error>(reader.error());
  std::vector<std::string> devices;
  for (const auto& line : lines) devices.push_back(line.device);
  const auto shared = std::make_shared<SharedReads>(reads_of(std::move(*reader), reading), devices);
  std::vector<std::unique_ptr<ByteSource>> sources;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    sources.push_back(
        std::make_unique<CaptureSource>(SharedLine(shared, i, capture, lines[i].device), lines[i].bytes));
  }
  return sources;
}

}  // namespace imuscope
