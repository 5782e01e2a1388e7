#pragma once

/// The checks of `imuscope doctor`, one function each. Those that read /proc or /sys take the folder in which
/// these lie, so that a test can show them another PC.

#include <cstdint>
#include <filesystem>
#include <imuscope/device_status_t.hpp>
#include <string>
#include <vector>

#include "base/result.h"
#include "base/time.h"
#include "configuration/config.h"
#include "service/doctor/finding.h"

namespace imuscope::doctor {

/// SCHED_FIFO, as the I/O and estimator threads want it.
[[nodiscard]] Finding check_real_time();

/// mlockall: a page fault may otherwise delay the core.
[[nodiscard]] Finding check_memory_lock();

/// Processor cores that this process may use.
[[nodiscard]] Finding check_cores();

/// Reading the clock must cost nanoseconds: the TSC or a hypervisor's page, not a chip on a bus.
[[nodiscard]] Finding check_clock_source(const std::filesystem::path& root);

/// A core that changes its frequency wakes up late.
[[nodiscard]] Finding check_governor(const std::filesystem::path& root);

/// The largest receive buffer that LCM may ask for.
[[nodiscard]] Finding check_receive_buffer(const std::filesystem::path& root);

/// The way to the multicast group.
[[nodiscard]] Finding check_lcm(const std::string& url);

/// udev announces devices that are plugged in later.
[[nodiscard]] Finding check_udev(const std::filesystem::path& root);

/// A service that is installed starts with the PC, and with the ignition.
/// @return nothing where the package is not installed
[[nodiscard]] std::vector<Finding> check_unit(const std::filesystem::path& root);

/// The PC's own clock names folders and decides which runs are old.
[[nodiscard]] Finding check_wall_clock(UtcTime now);

/// [metrics]: is the port free, or does a run offer them there already, and who may read?
/// @return nothing where the configuration asks for none
[[nodiscard]] std::vector<Finding> check_metrics(const MetricsOptions& options);

/// One configured line: does it open? It is opened and closed again.
[[nodiscard]] Finding check_line(const std::string& device, const Result<void>& opened);

/// One configured line while a run of this configuration goes on, which has it open.
/// @param device  as that run tells
[[nodiscard]] Finding check_line_of_run(const device_status_t& device);

/// FTDI bridges hold bytes back for 16 ms unless told otherwise.
/// @param ports  of the configuration, as paths; empty: every USB serial port of this PC
[[nodiscard]] std::vector<Finding> check_ftdi_latency(const std::filesystem::path& root,
                                                      const std::vector<std::string>& ports);

/// CAN interfaces: there, up.
/// @param wanted  of the configuration; empty: every CAN interface of this PC
[[nodiscard]] std::vector<Finding> check_can(const std::filesystem::path& root,
                                             const std::vector<std::string>& wanted);

/// A disk as it was measured.
struct Disk {
  std::filesystem::path folder;
  std::string problem;  ///< why it could not be measured; empty when it could
  double free_bytes = 0.0;
  double write_bytes_per_s = 0.0;
};
/// Writes 8 MB into `folder` (or its nearest parent that exists), waits until the disk has them, and removes
/// them again.
[[nodiscard]] Disk measure_disk(const std::filesystem::path& folder);
/// @param recorded_bytes_per_s  what a run writes
[[nodiscard]] Finding check_disk(const Disk& disk, double recorded_bytes_per_s);

}  // namespace imuscope::doctor
