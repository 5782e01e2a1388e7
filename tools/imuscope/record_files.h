#pragma once

/// Files of a sensor at rest as the records of its axes: CSV in anyone's columns and units, raw float64, a
/// topic of an MCAP file, the IMUs of a capture, a run folder.

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "models/certificate/axis_certificate.h"
#include "signal_file.h"

namespace imuscope::cli {

struct RecordChoice {
  SignalChoice signal;                      ///< time, counter, where, rate; its column is not used
  std::map<std::string, std::string> axes;  ///< "gyro_x" -> column, in place of the names' own meaning
  std::string gyro_unit;                    ///< where the names do not say
  std::string accel_unit;
  std::string temperature;        ///< column; empty: by its name; "none": none
  std::string imu;                ///< of a run folder or capture with several
  std::string regime = "static";  ///< of a run folder
};

/// All axes of one sensor in one log.
struct SensorRecord {
  std::string name;                ///< of the file or the IMU
  std::vector<std::string> files;  ///< names without folders
  std::string selection;           ///< "regime static"; empty: all
  std::vector<certificate::AxisRecord> axes;
  std::vector<std::string> warnings{};  ///< what is missing of the file
};

/// Raw files (.f64) named after axes, as "gyro_x_degps.f64", make one sensor; every CSV file, every run
/// folder and every IMU of a capture is one of its own. Raw files beyond a hundred megabytes stay where they
/// are until an axis is fetched. Errors: those of read_signal(), a file without an
/// axis that can be told (columns listed), units that neither names nor gravity tell, an IMU that a run
/// folder does not have.
Result<std::vector<SensorRecord>> read_records(const std::vector<std::filesystem::path>& files,
                                               const RecordChoice& choice);

}  // namespace imuscope::cli
