#include "view/recorded_messages.h"

#include <optional>
#include <system_error>
#include <utility>

#include "capture/capture_files.h"
#include "view/run_folder_messages.h"

namespace imuscope::view {

namespace {

constexpr const char* kCaptureName = "capture.lcm";

class CaptureMessages final : public RecordedMessages {
 public:
  CaptureMessages(std::filesystem::path file, CaptureFiles files)
      : file_(std::move(file)), files_(std::move(files)) {}

  bool next(std::vector<std::uint8_t>& message) override {
    LogEventView event;
    if (!files_->next(event)) return false;
    message.assign(event.data.begin(), event.data.end());
    return true;
  }

  Result<void> rewind() override {
    auto again = CaptureFiles::open(file_);
    if (!again) return tl::unexpected<Error>(again.error());
    files_.emplace(std::move(*again));
    return {};
  }

  [[nodiscard]] std::optional<Place> place() const override {
    const auto place = files_->place();
    if (!place) return std::nullopt;
    return Place{{static_cast<std::uint64_t>(place->number), place->offset}};
  }
  Result<void> go_to(const Place& place) override {
    return files_->go_to({static_cast<int>(place.at.at(0)), place.at.at(1)});
  }

 private:
  std::filesystem::path file_;
  std::optional<CaptureFiles> files_;
};

}  // namespace

Result<std::unique_ptr<RecordedMessages>> open_recording(const std::filesystem::path& path) {
  std::error_code ignored;
  std::filesystem::path file = path;
  if (std::filesystem::is_directory(path, ignored)) {
    file = path / kCaptureName;
    if (!std::filesystem::exists(file, ignored)) return open_run_folder(path);
  }
  auto files = CaptureFiles::open(file);
  if (!files) return tl::unexpected<Error>(files.error());
  return std::make_unique<CaptureMessages>(std::move(file), std::move(*files));
}

}  // namespace imuscope::view
