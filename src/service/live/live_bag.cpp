#include "service/live/live_bag.h"

#include <fmt/format.h>
#include <algorithm>
#include <cctype>
#include <utility>

#include "base/text.h"
#include "base/units.h"
#include "logs/bag/message_json.h"
#include "models/noise/export.h"
#include "publish/channel_name.h"
#include "rt/thread_setup.h"
#include "service/pipeline/device_factory.h"
#include "service/pipeline/estimator_setup.h"
#include "service/run/bag_noise.h"

namespace imuscope {
namespace {

constexpr auto kPeriod = std::chrono::milliseconds(100);
/// Of what waits for the disk: a minute and more of nine devices.
constexpr std::size_t kWaitingMost = std::size_t{32} << 20U;
constexpr std::size_t kSnapshotBytes = sizeof(Snapshot);
/// What a run that is killed loses of its file.
constexpr Duration kChunkPeriod = std::chrono::seconds(2);
constexpr Duration kMountingPeriod = std::chrono::seconds(10);
/// Samples wait so long for a device to tell UTC; then the PC's clock says it.
constexpr Duration kUtcWait = std::chrono::seconds(10);
/// And never more than these.
constexpr std::size_t kSamplesMost = 200'000;

std::vector<std::string> names_of(const Configuration& configuration) {
  std::vector<std::string> names;
  for (const auto& device : configuration.devices) names.push_back(device.name);
  return names;
}

/// What the filter takes the white noise of a sample to be: a fast process counts by its density at low
/// frequencies.
Vector3 assumed(const TriadNoise& noise, double rate_hz) {
  Vector3 variance{};
  for (std::size_t i = 0; i < variance.size(); ++i) {
    variance[i] = noise.white_sd[i] * noise.white_sd[i] +
                  2.0 * noise.fast_sd[i] * noise.fast_sd[i] * noise.fast_time_constant_s[i] * rate_hz;
  }
  return variance;
}

std::array<bag::WhiteVariance, kRegimeCount> assumed_variances(const SImuConfig& study) {
  std::array<bag::WhiteVariance, kRegimeCount> variances;
  for (std::size_t regime = 0; regime < kRegimeCount; ++regime) {
    variances[regime] = {assumed(study.noise.gyro[regime], study.rate_hz),
                         assumed(study.noise.accel[regime], study.rate_hz)};
  }
  return variances;
}

bag::Correction correction_of(const SImuOutput& study) {
  return {study.C_b_s,      study.gyro_bias_radps, study.accel_bias_mps2,
          study.gyro_scale, study.accel_scale,     study.t_d_s};
}

}  // namespace

Result<std::unique_ptr<LiveBag>> LiveBag::start(const Configuration& configuration,
                                                const OutputFolder& folder, const std::string& version) {
  auto file = folder.begin(kBagFileName);
  if (!file) return tl::unexpected<Error>(file.error());
  std::unique_ptr<LiveBag> bag(new LiveBag(configuration, std::move(*file), version));
  bag->thread_ = std::thread([self = bag.get()] {
    (void)setup_this_thread({kBagThreadName, Scheduling::kNormal, 0, {}});
    self->loop();
  });
  return bag;
}

LiveBag::LiveBag(const Configuration& configuration, OutputFile file, const std::string& version)
    : configuration_(configuration),
      study_devices_(configuration.study_indices()),
      file_(std::move(file)),
      writer_(
          {"ros2", "imuscope " + version}, [this](std::string_view bytes) { file_.write(bytes); },
          names_of(configuration)),
      begun_(host_now()),
      unfinished_(configuration.devices.size()) {
  for (const auto& study : estimator_config(configuration).studies)
    variances_.push_back(assumed_variances(study));
  for (std::size_t i = 0; i < configuration.devices.size(); ++i)
    decoders_.push_back(
        make_decoder(configuration.devices[i], static_cast<DeviceIndex>(i), ClockMapConfig{}));
  writer_.add_metadata("imuscope", {{"version", version},
                                    {"run", configuration.run_name},
                                    {"configuration_sha256", configuration.sha256},
                                    {"times", "UTC"}});
}

LiveBag::~LiveBag() {
  stop_.store(true, std::memory_order_release);
  if (thread_.joinable()) thread_.join();
}

/// With the mutex held.
bool LiveBag::has_room(std::size_t bytes) {
  if (waiting_.bytes + bytes > kWaitingMost) {
    ++lost_;
    return false;
  }
  waiting_.bytes += bytes;
  return true;
}

void LiveBag::on_chunk(const RawChunk& chunk) {
  const RawChunkInfo& info = chunk.info;
  if (info.direction == Direction::kWrite) return;
  const std::lock_guard lock(mutex_);
  Read& read = unfinished_[info.device];
  std::span<const std::uint8_t> bytes = chunk.bytes;
  if (info.direction == Direction::kLine) {
    if (const auto told = line_rate_of(bytes)) read.per_byte = told;
    return;
  }
  if (read.bytes.empty()) read.received = info.arrival;
  if (info.direction == Direction::kStampedRead && bytes.size() >= kReceivedBytes) {
    read.received = host_time_from_ns(nanoseconds_of(bytes.first<kReceivedBytes>()));
    bytes = bytes.subspan(kReceivedBytes);
  }
  read.device = info.device;
  read.arrival = info.arrival;
  read.bytes.insert(read.bytes.end(), bytes.begin(), bytes.end());
  if (info.continues) return;
  if (has_room(read.bytes.size() + sizeof(Read))) waiting_.reads.push_back(std::move(read));
  read = {};
}

void LiveBag::on_snapshot(const Snapshot& snapshot) {
  const std::lock_guard lock(mutex_);
  if (has_room(kSnapshotBytes)) waiting_.snapshots.push_back(snapshot);
}

void LiveBag::on_refit(const Refit& refit) {
  const std::lock_guard lock(mutex_);
  waiting_.refits.push_back(refit);
}

void LiveBag::on_message(std::string_view channel, std::int64_t utime,
                         std::span<const std::uint8_t> message) {
  const std::lock_guard lock(mutex_);
  if (has_room(message.size() + sizeof(Message)))
    waiting_.messages.push_back({std::string(channel), utime, {message.begin(), message.end()}});
}

std::optional<Error> LiveBag::problem() const {
  const std::lock_guard lock(mutex_);
  if (disk_problem_) return disk_problem_;
  if (lost_ == 0) return std::nullopt;
  return Error{ErrorKind::kWork,
               fmt::format("{}: {} reads and messages were lost: the disk is too slow", kBagFileName, lost_),
               "the capture has them; imuscope export makes the file again"};
}

void LiveBag::loop() {
  while (!stop_.load(std::memory_order_acquire)) {
    heartbeat_.beat(host_now());
    write_waiting(false);
    std::this_thread::sleep_for(kPeriod);
  }
}

void LiveBag::write_waiting(bool at_end) {
  Waiting came;
  {
    const std::lock_guard lock(mutex_);
    std::swap(came, waiting_);
  }
  for (const Refit& refit : came.refits) take(refit);
  for (const Snapshot& snapshot : came.snapshots) take(snapshot);
  for (const Message& message : came.messages) take(message);
  for (const Read& read : came.reads) take(read);
  if (at_end) {
    for (auto& decoder : decoders_) decoder->finish(host_now(), decoded_);
  }
  write_samples(at_end);
  const HostTime now = host_now();
  if (now - chunk_ended_ >= kChunkPeriod) {
    writer_.end_chunk();
    chunk_ended_ = now;
  }
  if (auto problem = file_.problem()) {
    const std::lock_guard lock(mutex_);
    // A block that the disk refuses is a hole: what follows is found by the chunks alone.
    disk_problem_ = Error{ErrorKind::kWork, problem->what,
                          "free space on that disk; imuscope export makes the file again"};
  }
}

void LiveBag::take(const Snapshot& snapshot) {
  last_ = snapshot;
  if (snapshot.has_new_navigation) {
    const NavigationOutput& n = snapshot.navigation;
    const UtcStamp utc = snapshot.time_scale.at(n.time);
    if (utc.is_known && n.status == NavigationStatus::kNavigating) {
      writer_.add_navigation({n.latitude_rad * kDegPerRad, n.longitude_rad * kDegPerRad, n.height_m,
                              n.v_n_mps, n.rpy_rad, n.sd_position_m, n.sd_velocity_mps, n.sd_rpy_rad},
                             to_ns(utc.utc));
    }
  }
  if (snapshot.cut - mountings_told_ < kMountingPeriod) return;
  mountings_told_ = snapshot.cut;
  write_mountings();
}

void LiveBag::write_mountings() {
  if (!last_ || last_->time_scale.source == UtcSource::kNone) return;
  std::vector<bag::Mounting> mountings;
  for (std::size_t i = 0; i < last_->n_studies; ++i) {
    const SImuOutput& study = last_->studies[i];
    if (!has_estimate(study.status)) continue;
    mountings.push_back({configuration_.devices[study_devices_[i]].name, study.C_b_s, study.r_bs_b_m,
                         study.t_d_s, study.sd_psi_rad, study.sd_r_bs_b_m, study.sd_t_d_s,
                         std::string(words_of(study.status)),
                         study.status == CalibrationStatus::kCalibrated});
  }
  writer_.add_mountings(mountings, configuration_.devices[configuration_.reference_index()].name,
                        to_ns(last_->time_scale.at(last_->cut).utc));
}

void LiveBag::take(const Refit& refit) {
  constexpr std::size_t kTriad = 3;
  for (const AxisRefit& axis : refit.axes) {
    if (!axis.fit) continue;
    auto& variance = variances_[refit.study][static_cast<std::size_t>(axis.regime)];
    (axis.axis < kTriad ? variance.gyro : variance.accel)[axis.axis % kTriad] =
        noise::white_variance_of_sample(*axis.fit);
  }
}

/// "/imuscope/calibration/mtx1" of calibration_t on IMUSCOPE_CALIBRATION_MTX1.
std::string LiveBag::topic_of(const std::string& channel, const std::string& type) const {
  constexpr std::size_t kEnding = 2;  // "_t"
  const std::string kind = type.substr(0, type.size() - kEnding);
  std::string topic = "/imuscope/" + kind;
  std::string upper;
  for (const char c : kind) upper += static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  for (const auto& device : configuration_.devices) {
    if (channel.ends_with(channel_name("", upper, device.name))) return topic + "/" + device.name;
  }
  return topic;
}

void LiveBag::take(const Message& message) {
  const auto text = bag::message_text(message.bytes);
  if (!text) return;
  constexpr std::int64_t kNsPerUs = 1000;
  writer_.add_message(topic_of(message.channel, text->type), text->type, text->json,
                      message.utime * kNsPerUs);
}

void LiveBag::take(const Read& read) {
  for (std::size_t i = 0; i < decoders_.size(); ++i) {
    if (configuration_.devices[i].line_owner != read.device) continue;
    if (read.per_byte) decoders_[i]->set_per_byte(*read.per_byte);
    decoders_[i]->push(read.bytes, {read.arrival, read.received}, decoded_);
  }
}

void LiveBag::write_samples(bool at_end) {
  auto& samples = decoded_.samples;
  const bool is_told = last_ && is_told_by_device(last_->time_scale.source);
  const bool waits = !is_told && !at_end && host_now() - begun_ < kUtcWait && samples.size() < kSamplesMost;
  if (waits || !last_ || last_->time_scale.source == UtcSource::kNone) {
    while (samples.size() > kSamplesMost) samples.pop_front();
    return;
  }
  for (const Sample& sample : samples) {
    const bool is_tagged = sample.kind == SampleKind::kGnss && sample.has_utc;
    const std::int64_t utc_ns = to_ns(is_tagged ? sample.utc : last_->time_scale.at(sample.time).utc);
    writer_.add_sample(sample, utc_ns, configured_variance(configuration_.devices[sample.device].noise));
    if (sample.kind != SampleKind::kImu) continue;
    for (std::size_t i = 0; i < last_->n_studies; ++i) {
      const SImuOutput& study = last_->studies[i];
      if (study_devices_[i] == sample.device && has_estimate(study.status))
        writer_.add_corrected(sample, utc_ns, correction_of(study),
                              variances_[i][static_cast<std::size_t>(study.regime)]);
    }
  }
  samples.clear();
}

Result<void> LiveBag::finish(const OutputFolder& folder) {
  stop_.store(true, std::memory_order_release);
  if (thread_.joinable()) thread_.join();
  write_waiting(true);
  write_mountings();
  const std::int64_t now_ns = last_ ? to_ns(last_->time_scale.at(last_->cut).utc) : 0;
  writer_.attach("configuration.toml", "application/toml", now_ns, configuration_.text);
  constexpr std::array<std::pair<const char*, const char*>, 4> kDocuments{
      {{"calibration.json", "application/json"},
       {"run.json", "application/json"},
       {"models.json", "application/json"},
       {"report.html", "text/html"}}};
  for (const auto& [name, type] : kDocuments) {
    const auto text = read_text_file(folder.path() / name, "file of a run", "");
    if (text) writer_.attach(name, type, now_ns, *text);
  }
  // After a hole the places of an index would be wrong: without one readers go through what is there.
  if (!disk_problem_) writer_.finish();
  if (auto closed = file_.close(); !closed || disk_problem_) {
    return work_error(
        fmt::format("{} is not whole: the disk refused a part of it", kBagFileName),
        "free space and make it again from the capture: imuscope process, then imuscope export");
  }
  return {};
}

}  // namespace imuscope
