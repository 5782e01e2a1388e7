/// One message of ROS, in CDR and in JSON, as every type.

#include "logs/mcap/ros_messages.h"
#include "tests/fuzz/fuzz.h"

namespace {

template <typename Message>
void read_both(imuscope::mcap::Bytes bytes) {
  Message message;
  (void)imuscope::mcap::read(bytes, message);
  (void)imuscope::mcap::read_json(bytes, message);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace imuscope::mcap;
  const Bytes bytes(data, size);
  read_both<Imu>(bytes);
  read_both<NavSatFix>(bytes);
  read_both<Odometry>(bytes);
  read_both<TwistStamped>(bytes);
  read_both<TimeReference>(bytes);
  return 0;
}
