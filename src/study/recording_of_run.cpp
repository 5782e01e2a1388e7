#include "study/recording_of_run.h"

namespace imuscope {

Result<OpenedRecording> open_recording_of_run(const RunSource& source, const nlohmann::json& run,
                                              const OpeningProgress& progress) {
  std::vector<std::string> inputs = source.inputs;
  if (inputs.empty()) inputs = run.value("inputs", std::vector<std::string>{});
  if (inputs == std::vector<std::string>{"live"}) inputs = {(source.run_dir / "capture.lcm").string()};
  if (!source.configuration.empty()) return open_recording(inputs, source.configuration, progress);
  const bool dumps = !inputs.empty() && inputs.front().find('=') != std::string::npos;
  if (!dumps) return open_recording(inputs, std::nullopt, progress);
  const auto text = run.value("configuration_text", std::string{});
  if (text.empty()) return usage_error("run.json holds no configuration", "give it with --config");
  auto configuration = parse_configuration(text, run.value("configuration", std::string{"run.json"}));
  if (!configuration) return tl::unexpected<Error>(configuration.error());
  return open_dumps(inputs, std::move(*configuration), progress);
}

}  // namespace imuscope
