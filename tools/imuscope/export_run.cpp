#include "export_run.h"

#include <fmt/format.h>

#include "print.h"
#include "progress.h"
#include "study/run_bag.h"

namespace imuscope::cli {

Result<void> export_mcap(const ExportRun& options) {
  RunBagOptions bag;
  bag.source = {options.run, options.inputs, options.config};
  bag.out = options.out.empty() ? options.run / "run.mcap" : std::filesystem::path(options.out);
  bag.version = IMUSCOPE_VERSION;
  const auto compression =
      options.compression == "none" ? mcap::Compression::kNone : mcap::compression_of(options.compression);
  if (!compression || (options.compression.empty()))
    return usage_error(fmt::format("--compression {} is not known", options.compression),
                       "give zstd, lz4 or none");
  bag.compression = *compression;
  bag.with_errors = options.with_errors;
  ProgressBar bar;
  bag.progress = [&bar](double share) { bar.show("export", share); };
  const auto written = write_run_bag(bag);
  bar.clear();
  if (!written) return tl::unexpected<Error>(written.error());
  for (const auto& remark : written->remarks) say("Note: {}\n", remark);
  if (!written->times_are_utc) say("Note: nobody told UTC in this run: times count from its first sample\n");
  constexpr double kBytesPerMb = 1e6;
  say("{}: {} messages, {:.1f} MB\n", bag.out.string(), written->messages,
      static_cast<double>(written->bytes) / kBytesPerMb);
  return {};
}

}  // namespace imuscope::cli
