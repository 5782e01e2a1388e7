#include "service/recording/decoded_lines.h"

#include <utility>

#include "service/pipeline/device_factory.h"

namespace imuscope {

Result<DecodedLines> DecodedLines::open(const Configuration& configuration, const Recording& recording,
                                        const std::vector<bool>& is_wanted, Reading reading) {
  auto sources = recording.open_side_by_side(reading);
  if (!sources) return tl::unexpected<Error>(sources.error());
  DecodedLines lines;
  lines.lines_.resize(sources->size());
  for (std::size_t i = 0; i < sources->size(); ++i) {
    if (!(*sources)[i] || !is_wanted[i]) continue;
    auto decoder =
        make_decoder(configuration.devices[i], static_cast<DeviceIndex>(i), recording.clocks[i].map);
    lines.lines_[i].reads =
        std::make_unique<DecodedReads>(std::move((*sources)[i]), std::move(decoder),
                                       reading == Reading::kAhead && recording.has_lines_apart);
  }
  return lines;
}

Result<void> DecodedLines::fetch(Line& line) {
  if (!line.reads || (line.pending && !line.is_given)) return {};
  auto read = line.reads->next();
  line.pending = read ? *read : std::nullopt;
  line.is_given = false;
  if (!line.pending) line.reads.reset();
  if (!read) return tl::unexpected<Error>(read.error());
  return {};
}

Result<std::optional<LineRead>> DecodedLines::next() {
  std::optional<std::size_t> first;
  const auto arrival = [&](std::size_t i) { return lines_[i].pending->arrival.value_or(HostTime::min()); };
  for (std::size_t i = 0; i < lines_.size(); ++i) {
    if (auto fetched = fetch(lines_[i]); !fetched) return tl::unexpected<Error>(fetched.error());
    if (lines_[i].reads && (!first || arrival(i) < arrival(*first))) first = i;
  }
  if (!first) return std::optional<LineRead>{};
  return next_of(*first);
}

Result<std::optional<LineRead>> DecodedLines::next_of(std::size_t device) {
  Line& line = lines_[device];
  if (auto fetched = fetch(line); !fetched) return tl::unexpected<Error>(fetched.error());
  if (!line.reads) return std::optional<LineRead>{};
  line.is_given = true;
  return std::optional<LineRead>{LineRead{device, line.pending->samples}};
}

void DecodedLines::leave(std::size_t device) { lines_[device] = {}; }

}  // namespace imuscope
