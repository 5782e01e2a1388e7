#pragma once

/// A mounting as other tools write static transforms, each in its own frames and direction:
///
/// - urdf: a fixed joint from base_link (forward-left-up) to the sensor; rpy are rotations about fixed x, y,
/// z, one after
///   the other, that turn base_link's axes into the sensor's
/// - tf: arguments of ROS 2's static_transform_publisher, the same transform as x, y, z and a quaternion
/// - kalibr: imu chain, T_i_b takes coordinates in the reference's own frame b (forward-right-down) to the
/// sensor's;
///   time_offset is added to the sensor's times
/// - openvins: the same T_i_b, and Tw and Ta, which take what happens to what is read, so that their diagonal
/// is one plus
///   the scale error
/// - json: all of it, with standard deviations

#include <string>
#include <string_view>

#include "bag/bag_writer.h"
#include "base/result.h"

namespace imuscope::bag {

enum class MountingFormat { kUrdf, kTf, kKalibr, kOpenVins, kJson };

/// Errors (kUsage): an unknown name, with those that exist.
Result<MountingFormat> parse_mounting_format(std::string_view text);

/// @param reference  the R-IMU's name, the frame of kalibr's body
/// @param scale      of the sensor, for those who take it
std::string mounting_text(const Mounting& mounting, const Correction& scale, const std::string& reference,
                          MountingFormat format);

}  // namespace imuscope::bag
