#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include "conversions.h"

namespace imuscope::python {
namespace {

/// Warnings of the library go to stderr, as those of Python do; what it only remarks is not said.
void set_up_log() {
  auto log = std::make_shared<spdlog::logger>("imuscope", std::make_shared<spdlog::sinks::stderr_sink_mt>());
  log->set_pattern("imuscope: %v");
  log->set_level(spdlog::level::warn);
  spdlog::set_default_logger(std::move(log));
}

}  // namespace
}  // namespace imuscope::python

PYBIND11_MODULE(_imuscope, module) {
  using namespace imuscope::python;
  module.doc() = "What imuscope's package for Python does in C++.";
  module.attr("version") = IMUSCOPE_VERSION;
  pybind11::register_exception<Failure>(module, "Error").attr("__module__") = "imuscope";
  set_up_log();
  bind_noise(module);
  bind_runs(module);
  bind_captures(module);
  bind_studies(module);
  bind_live(module);
}
