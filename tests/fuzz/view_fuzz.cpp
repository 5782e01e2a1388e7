/// What comes from outside before the page: messages of a bus, what a page or a stranger in its place sends,
/// and the files of a stranger's run folder. The first byte says which. Whatever it is, pages get JSON of a
/// bounded size.

#include <array>
#include <imuscope/calibration_t.hpp>
#include <imuscope/error_t.hpp>
#include <imuscope/event_t.hpp>
#include <imuscope/navigation_t.hpp>
#include <imuscope/noise_model_t.hpp>
#include <imuscope/odometry_t.hpp>
#include <imuscope/status_t.hpp>
#include <imuscope/wavelet_variance_t.hpp>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>

#include "base/text.h"
#include "service/web/request_rules.h"
#include "tests/fuzz/folder_in_memory.h"
#include "view/page_command.h"
#include "view/picture.h"
#include "view/player.h"
#include "view/recorded_messages.h"

namespace imuscope::fuzz {
namespace {

/// Of a picture; what the picture bounds adds up to less.
constexpr std::size_t kPictureMax = std::size_t{16} << 20U;

std::span<const std::uint8_t> bytes_of(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

void show(const view::Picture& picture) {
  const std::string whole = picture.whole();
  require(whole.size() < kPictureMax, "a picture is bounded");
  require(nlohmann::json::accept(whole), "a page gets JSON");
}

template <typename Message>
void hear_as(view::Picture& picture, std::vector<std::uint8_t> bytes) {
  constexpr std::size_t kFingerprint = 8;
  if (bytes.size() < kFingerprint) return;
  const auto fingerprint = static_cast<std::uint64_t>(Message::getHash());
  for (std::size_t i = 0; i < kFingerprint; ++i)
    bytes[i] = static_cast<std::uint8_t>(fingerprint >> (56U - 8U * i));
  (void)picture.hear(bytes);
}

void hear(const std::vector<std::uint8_t>& bytes) {
  view::Picture picture;
  (void)picture.hear(bytes);
  hear_as<status_t>(picture, bytes);
  hear_as<calibration_t>(picture, bytes);
  hear_as<navigation_t>(picture, bytes);
  hear_as<odometry_t>(picture, bytes);
  hear_as<imuscope::error_t>(picture, bytes);
  hear_as<wavelet_variance_t>(picture, bytes);
  hear_as<noise_model_t>(picture, bytes);
  hear_as<event_t>(picture, bytes);
  show(picture);
  require(nlohmann::json::accept(picture.part()), "a page gets JSON");
}

void ask(std::string_view text) {
  if (const auto command = view::read_page_command(text)) {
    if (const auto* mark = std::get_if<view::Mark>(&*command))
      require(mark->text.size() <= view::kMarkTextMax && printable(mark->text) == mark->text,
              "a mark is a line that no terminal obeys");
    if (const auto* play = std::get_if<view::Play>(&*command))
      require(play->speed >= view::kSlowest && play->speed <= view::kFastest, "a speed is bounded");
  }
  const web::HostNames loopback{{"car"}, true};
  const web::HostNames network{{"car"}, false};
  require(!web::is_host_allowed(text, loopback) || web::is_host_allowed(text, network),
          "whoever may ask on this PC may ask from the network");
  require(!web::is_own_origin(text, "127.0.0.1:8088") || text.size() == 21,
          "one origin alone is the page's own");
  require(web::token_of(text).size() <= text.size(), "a token is a part of the target");
}

struct File {
  const char* name;
  std::string_view content;
};

constexpr std::array kFiles{
    File{"run.json", R"({"name":"r","duration_s":1,"devices":[{"name":"m","role":"study","samples":3}]})"},
    File{"models.json",
         R"({"models":[{"name":"m","axis":"gyro_x","regime":"static","unit":"rad/s","n":9,"model":"WN",)"
         R"("identifiable":true,"j_test":{"p_value":0.5},"wv":[{"tau_s":0.02,"value":1e-6,"ci_low":1e-7,)"
         R"("ci_high":1e-5,"fitted":1e-6}],"parameters":[{"process":"WN","name":"sigma2","value":1e-6}]}]})"},
    File{"navigation.csv",
         "time_s,lat_deg,lon_deg,height_m,v_n_mps,v_e_mps,v_d_mps,roll_deg,pitch_deg,heading_deg,sd_n_m,sd_e_"
         "m,"
         "sd_heading_deg\n0.1,46,6,400,1,0,0,1,2,3,0.1,0.1,1\n1,46,6,400,1,0,0,1,2,3,0.1,0.1,1\n"},
    File{"calibration_m.csv",
         "time_s,psi_x_deg,psi_y_deg,psi_z_deg,q_w,q_x,q_y,q_z,r_x_m,r_y_m,r_z_m,t_d_ms,sd_psi_x_deg,"
         "sd_psi_y_deg,sd_psi_z_deg,sd_r_x_m,sd_r_y_m,sd_r_z_m,sd_t_d_ms\n"
         "0,1,2,3,1,0,0,0,4,5,6,7,1,2,3,4,5,6,7\n"},
    File{"errors_m.csv",
         "time_s,e_gyro_x_radps,e_gyro_y_radps,e_gyro_z_radps,e_accel_x_mps2,e_accel_y_mps2,"
         "e_accel_z_mps2,regime\n0,1,2,3,4,5,6,static\n0.1,1,2,3,4,5,6,dynamic\n"}};

/// A folder one of whose files is damaged: which, where, how much is missing, and what stands there instead.
void play(std::span<const std::uint8_t> input) {
  constexpr std::size_t kChoices = 4;
  static const FolderInMemory folder;
  static const bool whole = [] {
    for (const File& file : kFiles) folder.put(file.name, bytes_of(file.content));
    auto recording = view::open_recording(folder.path());
    return recording && view::Player::open(std::move(*recording));
  }();
  require(whole, "the folder that the inputs damage plays");
  if (input.size() < kChoices) return;
  const File& damaged = kFiles[input[0] % kFiles.size()];
  const std::size_t at = (input[1] | std::size_t{input[2]} << 8U) % (damaged.content.size() + 1);
  std::string content(damaged.content.substr(0, at));
  content.append(reinterpret_cast<const char*>(input.data()) + kChoices, input.size() - kChoices);
  content.append(damaged.content.substr(std::min(at + input[3], damaged.content.size())));
  folder.put(damaged.name, bytes_of(content));
  if (auto recording = view::open_recording(folder.path())) {
    if (auto player = view::Player::open(std::move(*recording))) {
      (*player)->on_said(R"({"seek_s":1e308})");
      require(nlohmann::json::accept((*player)->turn(0.1)), "a page gets JSON");
      require(nlohmann::json::accept((*player)->whole()), "a page gets JSON");
    }
  }
  folder.put(damaged.name, bytes_of(damaged.content));
}

}  // namespace
}  // namespace imuscope::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::span<const std::uint8_t> rest(data + 1, size - 1);
  switch (data[0] % 3) {
    case 0:
      imuscope::fuzz::hear({rest.begin(), rest.end()});
      break;
    case 1:
      imuscope::fuzz::ask({reinterpret_cast<const char*>(rest.data()), rest.size()});
      break;
    default:
      imuscope::fuzz::play(rest);
      break;
  }
  return 0;
}
