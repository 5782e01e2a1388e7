#pragma once

/// A mounting as other tools write static transforms, each in its own frames and direction:
///
/// - urdf: a fixed joint from base_link (forward-left-up) to the sensor; rpy are rotations about fixed x, y,
///   z, one after the other, that turn base_link's axes into the sensor's
/// - tf: arguments of ROS 2's static_transform_publisher, the same transform as x, y, z and a quaternion
/// - kalibr: imu chain, T_i_b takes coordinates in the reference's own frame b (forward-right-down) to the
///   sensor's; time_offset is added to the sensor's times. Where the triads are known, its model
///   scale-misalignment: i is the accelerometer triad's frame, and M, A and C_gyro_i make w_read =
///   M C_gyro_i w_i + A C_gyro_i f_i and f_read = M f_i
/// - openvins: the same T_i_b; Tw and Ta are kalibr's two M, R_IMUtoGYRO is C_gyro_i, and Tg is A C_gyro_i,
///   as it takes forces in i
/// - json: all of it, with standard deviations

#include <optional>
#include <string>
#include <string_view>

#include "base/result.h"
#include "logs/bag/bag_writer.h"

namespace imuscope::bag {

enum class MountingFormat { kUrdf, kTf, kKalibr, kOpenVins, kJson };

/// Errors (kUsage): an unknown name, with those that exist.
Result<MountingFormat> parse_mounting_format(std::string_view text);

/// Both triads of a sensor, row-major: what it reads of w and f in its gyro triad's frame s is gyro_matrix w
/// + g_sensitivity f and accel_matrix C_s_accel f. The matrices are lower triangular.
struct Triads {
  Rotation gyro_matrix{1, 0, 0, 0, 1, 0, 0, 0, 1};
  Rotation accel_matrix{1, 0, 0, 0, 1, 0, 0, 0, 1};
  Rotation C_s_accel{1, 0, 0, 0, 1, 0, 0, 0, 1};
  std::array<double, 9> g_sensitivity{};  ///< rad/s per m/s^2
};

/// @param reference  the R-IMU's name, the frame of kalibr's body
/// @param scale      of the sensor, for those who take it
/// @param triads     where they are known, in place of `scale`
std::string mounting_text(const Mounting& mounting, const Correction& scale,
                          const std::optional<Triads>& triads, const std::string& reference,
                          MountingFormat format);

}  // namespace imuscope::bag
