#include "service/byte_source.h"

#include <fmt/format.h>
#include <algorithm>
#include <cctype>
#include <fstream>
#include <utility>
#include <vector>

#include "capture/capture_reader.h"
#include "capture/raw_dump.h"
#include "drivers/xsens_mt/mtb_file.h"

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

/// One device's reads out of a capture; what was written to devices is passed over.
class CaptureSource final : public ByteSource {
 public:
  CaptureSource(CaptureReader reader, std::string device, std::uint64_t total)
      : reader_(std::move(reader)), device_(std::move(device)), total_(total) {}

  Result<std::optional<RecordedRead>> next() override {
    for (;;) {
      auto read = reader_.next();
      if (!read) return std::optional<RecordedRead>{};
      if (read->device != device_) continue;
      if (read->direction == Direction::kLine) {
        const auto told = line_rate_of(read->bytes);
        if (told) per_byte_ = told;
      }
      if (read->direction != Direction::kRead) continue;
      current_ = std::move(*read);
      read_ += current_.bytes.size();
      return std::optional<RecordedRead>{RecordedRead{
          current_.arrival, current_.bytes, std::exchange(per_byte_, std::nullopt), current_.received}};
    }
  }
  [[nodiscard]] std::uint64_t bytes_read() const override { return read_; }
  [[nodiscard]] std::uint64_t bytes_total() const override { return total_; }

 private:
  CaptureReader reader_;
  std::string device_;
  std::uint64_t total_;
  std::uint64_t read_ = 0;
  std::optional<Duration> per_byte_;  ///< told, and no read since
  RawRead current_;
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

Result<std::unique_ptr<ByteSource>> open_raw_dump(const std::filesystem::path& file) {
  auto dump = RawDump::open(file);
  if (!dump) return tl::unexpected<Error>(dump.error());
  std::error_code code;
  const auto size = std::filesystem::file_size(file, code);
  const auto header = header_of(file);
  if (!header) return tl::unexpected<Error>(header.error());
  return std::make_unique<RawDumpSource>(std::move(*dump), code ? *header : size, *header);
}

Result<std::unique_ptr<ByteSource>> open_captured_device(const std::filesystem::path& capture,
                                                         const std::string& device, std::uint64_t bytes) {
  auto reader = CaptureReader::open(capture, device);
  if (!reader) return tl::unexpected<Error>(reader.error());
  return std::make_unique<CaptureSource>(std::move(*reader), device, bytes);
}

}  // namespace imuscope
