#include "log_format.h"

#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <memory>
#include <string>
#include <utility>

#include "base/text.h"
#include "service/doors/journal.h"

namespace imuscope::cli {

namespace {

/// The message, with nothing in it that the terminal would obey: it may quote what came from a device or a
/// network.
class PrintableFlag final : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg& message, const std::tm& /*time*/,
              spdlog::memory_buf_t& out) override {
    const std::string text = printable({message.payload.data(), message.payload.size()});
    out.append(text.data(), text.data() + text.size());
  }
  [[nodiscard]] std::unique_ptr<custom_flag_formatter> clone() const override {
    return std::make_unique<PrintableFlag>();
  }
};

}  // namespace

void set_up_log() {
  if (logs_to_journal()) {
    spdlog::set_default_logger(std::make_shared<spdlog::logger>("imuscope", journal_sink()));
    return;
  }
  spdlog::set_default_logger(spdlog::stderr_color_mt("imuscope"));
  auto formatter = std::make_unique<spdlog::pattern_formatter>();
  formatter->add_flag<PrintableFlag>('?');
  formatter->set_pattern("%H:%M:%S.%e %^%l%$ %?");
  spdlog::set_formatter(std::move(formatter));
}

std::string_view error_prefix() {
  // The level as sd-daemon(3) has it.
  return logs_to_journal() ? std::string_view("<3>") : std::string_view{};
}

}  // namespace imuscope::cli
