#include "drivers/xsens_mt/mtb_file.h"

#include "drivers/xsens_mt/scanner.h"

namespace imuscope::xsens {

namespace {

/// Frames of which each begins where the one before it ends.
struct Chain {
  std::uint64_t begin = 0;
  std::uint64_t end = 0;
  int frames = 0;

  void add(const Frame& frame) noexcept {
    if (frames == 0 || frame.offset != end) *this = {frame.offset, frame.offset, 0};
    end = frame.offset + frame.size;
    ++frames;
  }
};

}  // namespace

std::optional<std::size_t> data_offset_of_mtb(std::span<const std::uint8_t> beginning) noexcept {
  Scanner scanner;
  Frame frame;
  Chain outer;
  // Inside the last frame of the other: data of it that look like frames, or, where that frame is a false
  // one, the first good ones.
  Chain inner;
  while (!beginning.empty()) {
    beginning = beginning.subspan(scanner.append(beginning, HostTime{}));
    while (scanner.next(frame)) {
      if (frame.nested) {
        inner.add(frame);
        continue;
      }
      if (frame.offset != outer.end && frame.offset == inner.end) outer = inner;
      outer.add(frame);
      inner = {};
      if (outer.frames >= kChainedFrames) return static_cast<std::size_t>(outer.begin);
    }
  }
  return std::nullopt;
}

}  // namespace imuscope::xsens
