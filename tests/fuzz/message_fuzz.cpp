/// What the network or a log says is a message of ours: each type gets the bytes behind its own fingerprint.

#include <algorithm>
#include <imuscope/applied_model_t.hpp>
#include <imuscope/calibration_t.hpp>
#include <imuscope/dynamics_t.hpp>
#include <imuscope/error_t.hpp>
#include <imuscope/event_t.hpp>
#include <imuscope/exception_t.hpp>
#include <imuscope/navigation_t.hpp>
#include <imuscope/noise_model_t.hpp>
#include <imuscope/odometry_t.hpp>
#include <imuscope/pc_clock_t.hpp>
#include <imuscope/raw_t.hpp>
#include <imuscope/run_t.hpp>
#include <imuscope/status_t.hpp>
#include <imuscope/virtual_imu_t.hpp>
#include <imuscope/wavelet_variance_t.hpp>

#include "publish/message_codec.h"
#include "tests/fuzz/fuzz.h"

namespace imuscope::fuzz {
namespace {

template <typename Message>
void decode_as(std::vector<std::uint8_t> bytes) {
  constexpr std::size_t kFingerprint = 8;
  if (bytes.size() < kFingerprint) return;
  const auto fingerprint = static_cast<std::uint64_t>(Message::getHash());
  for (std::size_t i = 0; i < kFingerprint; ++i)
    bytes[i] = static_cast<std::uint8_t>(fingerprint >> (56U - 8U * i));
  const auto message = decode_message<Message>(bytes);
  if (!message) return;
  const auto again = decode_message<Message>(encode_message(*message));
  require(again.has_value(), "what was understood can be written and understood again");
}

}  // namespace
}  // namespace imuscope::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace imuscope;
  const std::vector<std::uint8_t> bytes(data, data + size);
  fuzz::decode_as<applied_model_t>(bytes);
  fuzz::decode_as<calibration_t>(bytes);
  fuzz::decode_as<dynamics_t>(bytes);
  fuzz::decode_as<imuscope::error_t>(bytes);
  fuzz::decode_as<event_t>(bytes);
  fuzz::decode_as<exception_t>(bytes);
  fuzz::decode_as<navigation_t>(bytes);
  fuzz::decode_as<noise_model_t>(bytes);
  fuzz::decode_as<odometry_t>(bytes);
  fuzz::decode_as<virtual_imu_t>(bytes);
  fuzz::decode_as<pc_clock_t>(bytes);
  fuzz::decode_as<raw_t>(bytes);
  fuzz::decode_as<run_t>(bytes);
  fuzz::decode_as<status_t>(bytes);
  fuzz::decode_as<wavelet_variance_t>(bytes);
  return 0;
}
