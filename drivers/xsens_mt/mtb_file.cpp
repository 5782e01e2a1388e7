#include "drivers/xsens_mt/mtb_file.h"

#include "drivers/xsens_mt/scanner.h"

namespace imuscope::xsens {

std::optional<std::size_t> data_offset_of_mtb(std::span<const std::uint8_t> beginning) noexcept {
  Scanner scanner;
  Frame frame;
  std::uint64_t chain_begin = 0;
  std::uint64_t chain_end = 0;
  int chained = 0;
  while (!beginning.empty()) {
    beginning = beginning.subspan(scanner.append(beginning, HostTime{}));
    while (scanner.next(frame)) {
      if (chained == 0 || frame.offset != chain_end) {
        chain_begin = frame.offset;
        chained = 0;
      }
      chain_end = frame.offset + frame.size;
      if (++chained == kChainedFrames) return static_cast<std::size_t>(chain_begin);
    }
  }
  return std::nullopt;
}

}  // namespace imuscope::xsens
