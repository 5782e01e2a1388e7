#pragma once

/// The vehicle of config/demo.toml, or of another file, changed as a test wants it: read and written as TOML,
/// never patched as text. tests/campaigns/demo.py is its twin for programs in Python.
///
///   DemoVehicle()
///       .ports_in(folder / "ports")
///       .set("noise.refit_interval_s", 8.0)
///       .set_device("mtx2", "transport.baud", 921600)
///       .write(folder / "live.toml");
///
/// Every change returns the vehicle. A path is a key, or keys joined by dots; tables on its way that are not
/// there are made. A device that the vehicle does not have throws std::invalid_argument, which fails the test;
/// a key that nobody knows is refused by the programs.
///
/// Values, and the order of devices, are written as they were read. Comments are lost, and a table's keys come
/// in the order of the alphabet.

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <variant>
#include <vector>

namespace imuscope::test {

using TomlValue = std::variant<bool, int, double, std::string, std::vector<double>, std::vector<std::string>>;
/// A table of such values.
using TomlKeys = std::map<std::string, TomlValue>;

/// What a device's `transport` says of its line.
TomlKeys serial_line(const std::filesystem::path& port, int baud);
TomlKeys tcp_line(int port);  ///< to this machine
TomlKeys udp_line(int port);

class DemoVehicle {
 public:
  DemoVehicle();  ///< as config/demo.toml has it
  explicit DemoVehicle(const std::filesystem::path& file);
  ~DemoVehicle();
  DemoVehicle(const DemoVehicle&) = delete;
  DemoVehicle& operator=(const DemoVehicle&) = delete;

  /// Each device's pseudo-terminal in `folder`, under the device's name.
  DemoVehicle& ports_in(const std::filesystem::path& folder);
  /// The demo's mountings roughly known, so that every S-IMU is estimated from the first seconds on.
  DemoVehicle& with_priors();
  /// @param utc  of the simulation's begin, as TOML writes a date and time: 2026-03-14T09:30:00Z
  DemoVehicle& start_at(const std::string& utc);

  /// A key of the whole file, such as "lcm.url" or "record.mcap".
  DemoVehicle& set(const std::string& path, const TomlValue& value);
  /// A key of a device, such as "axes" or "prior.boresight_sd_deg".
  DemoVehicle& set_device(const std::string& name, const std::string& path, const TomlValue& value);
  /// A key of what imusim takes for the truth of an S-IMU: of its [[simulation.imu]], which is made where the
  /// file has none.
  DemoVehicle& set_truth(const std::string& name, const std::string& path, const TomlValue& value);

  /// Another line in place of the device's own.
  DemoVehicle& put_on_line(const std::string& name, const TomlKeys& line);
  /// One more device, after the others.
  DemoVehicle& add_device(const TomlKeys& keys, const TomlKeys& line);
  /// Takes out a device and its truth.
  DemoVehicle& without(const std::string& name);

  [[nodiscard]] std::string text() const;
  /// Returns `file`.
  std::filesystem::path write(const std::filesystem::path& file) const;

 private:
  struct Tables;  ///< of toml++, which the tests need not see
  std::unique_ptr<Tables> tables_;
};

}  // namespace imuscope::test
