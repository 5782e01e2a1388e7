/// What comes over the network before `imuscope top`: datagrams, and messages whose content is invented. What
/// is shown moves no cursor, whatever they say, and what is written for programs is JSON.

#include <nlohmann/json.hpp>

#include "base/text.h"
#include "publish/lcm_datagram.h"
#include "publish/message_codec.h"
#include "tests/fuzz/fuzz.h"
#include "tools/imuscope/top/view.h"

namespace imuscope::fuzz {
namespace {

/// The message with the fingerprint of its type, so that its content is read.
template <typename Message>
std::optional<Message> decode_as(std::vector<std::uint8_t> bytes) {
  constexpr std::size_t kFingerprint = 8;
  if (bytes.size() < kFingerprint) return std::nullopt;
  const auto fingerprint = static_cast<std::uint64_t>(Message::getHash());
  for (std::size_t i = 0; i < kFingerprint; ++i)
    bytes[i] = static_cast<std::uint8_t>(fingerprint >> (56U - 8U * i));
  return decode_message<Message>(bytes);
}

void read_datagram(std::span<const std::uint8_t> datagram) {
  const auto heard = read_short_message(datagram);
  if (!heard) return;
  require(heard->channel.size() <= kMaxChannelBytes, "a channel has a name that LCM permits");
  require(heard->channel.find('\0') == std::string_view::npos, "a channel's name ends at its zero");
  require(kShortHeaderBytes + heard->channel.size() + 1 + heard->message.size() == datagram.size(),
          "every byte is the header's, the channel's or the message's");
}

void show(const std::vector<std::uint8_t>& bytes) {
  top::Heard heard;
  heard.status = decode_as<status_t>(bytes).value_or(status_t{});  // JSON is of a status
  heard.odometry = decode_as<odometry_t>(bytes);
  heard.virtual_imu = decode_as<virtual_imu_t>(bytes);
  if (auto message = decode_as<calibration_t>(bytes)) heard.calibrations.emplace(message->name, *message);
  if (auto message = decode_as<noise_model_t>(bytes)) heard.models.emplace(message->name, *message);
  for (const auto& line : top::lines_of(heard))
    require(printable(line) == line, "a line holds nothing that a terminal obeys");
  require(nlohmann::json::accept(top::json_of(heard)), "programs get JSON");
}

}  // namespace
}  // namespace imuscope::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  imuscope::fuzz::read_datagram({data, size});
  imuscope::fuzz::show({data, data + size});
  return 0;
}
