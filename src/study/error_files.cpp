#include "study/error_files.h"

#include <tbb/parallel_for.h>

#include <algorithm>

namespace imuscope {

void write_errors(HostTime origin, const RunRegimes& regimes, const std::vector<ScaleError>& scales,
                  std::vector<RowSpool>& rows, RunFolder& folder, StudiedRows& studied) {
  const std::size_t n = rows.size();
  const RegimeTrack& chosen = regimes.chosen;
  studied.series.resize(n);
  for (RowSpool& of_study : rows) of_study.rewind();
  std::vector<std::vector<ErrorRow>> blocks(n);
  const auto write = [&](std::size_t i) {
    for (const ErrorRow& row : blocks[i]) {
      const auto regime = chosen.at(row.time);
      folder.write_error({i, origin, row, {}, {}},
                         regime ? std::string_view(chosen.names()[*regime]) : std::string_view());
    }
  };
  const auto gather = [&](std::size_t i) {
    for (const ErrorRow& with_scale : blocks[i]) {
      const ErrorRow row = without_scale_error(with_scale, scales[i]);
      studied.series[i].add(row, chosen.at(row.time));
      studied.rows[i].add(row);
    }
  };
  // By blocks, and of each S-IMU text and numbers apart: three S-IMUs keep two threads busy, and each file and series
  // is in order of time.
  while (true) {
    tbb::parallel_for(std::size_t{0}, n, [&](std::size_t i) { read_block(blocks[i], rows[i]); });
    if (std::ranges::all_of(blocks, [](const auto& block) { return block.empty(); })) return;
    tbb::parallel_for(
        std::size_t{0}, 2 * n, [&](std::size_t job) { job < n ? write(job) : gather(job - n); },
        tbb::simple_partitioner());
  }
}

}  // namespace imuscope
