#pragma once

/// Logs of CAN frames for `imuscope decode`: as frames, or with a vehicle's DBC file as its messages.

#include "drivers/dbc/database.h"
#include "stream_protocols.h"

namespace imuscope::cli {

/// @param database  null: frames as they are
void decode_candump(std::span<const std::uint8_t> stream, const dbc::Database* database,
                    const Visitor& visitor);

}  // namespace imuscope::cli
