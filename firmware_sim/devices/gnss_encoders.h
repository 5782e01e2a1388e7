#pragma once

/// One epoch of a receiver as NMEA 0183 sentences, as UBX-NAV-PVT, and as a line of an RTKLIB solution.

#include "firmware_sim/devices/bytes.h"
#include "firmware_sim/devices/greis_encoder.h"
#include "firmware_sim/devices/utc.h"

namespace imusim {

/// GGA, GST, RMC and ZDA of an epoch, in this order, without those whose three letters are left out.
/// @param solution  its date and time are not looked at
Bytes encode_nmea(const greis::Solution& solution, Gps gps, const std::vector<std::string>& left_out);

/// The frame of NAV-PVT with preamble and checksum.
Bytes encode_ubx_nav_pvt(const greis::Solution& solution, Gps gps);

/// Header of an LLH solution in GPS time, as rtkrcv sends it to each client that connects.
Bytes rtklib_header();
/// A line of it, velocity included.
Bytes encode_rtklib(const greis::Solution& solution, Gps gps);

}  // namespace imusim
