#pragma once

/// Systemd's journal with fields of its own: what is logged can be found by run, device and alarm
/// (`journalctl IMUSCOPE_DEVICE=mtx1`). docs/vehicle.md lists the fields.

#include <imuscope/alarm_t.hpp>
#include <memory>
#include <string>
#include <vector>

namespace spdlog::sinks {
class sink;
}

namespace imuscope {

/// Standard error is connected to the journal: systemd tells by JOURNAL_STREAM which file that is.
[[nodiscard]] bool logs_to_journal();

/// Where the log goes then; standard error with the priority before each line where no journal listens. A
/// line that begins with the name of a device and a colon has IMUSCOPE_DEVICE.
[[nodiscard]] std::shared_ptr<spdlog::sinks::sink> journal_sink();

/// Of the run whose log it is. Any non-real-time thread; nothing where the log does not go to the
/// journal.
void set_journal_run(const std::string& run, std::vector<std::string> devices);

/// One entry when an alarm begins and one when it is over, beside what the log says in words. Nothing where
/// the log does not go to the journal.
void tell_alarm(const alarm_t& alarm);

}  // namespace imuscope
