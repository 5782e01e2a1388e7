#include "service/run/virtual_imu.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "publish/message_values.h"
#include "sample/eigen_arrays.h"
#include "service/run/telemetry.h"

namespace imuscope {

namespace {

/// In sample intervals: one lost sample is interpolated over, two are a gap.
constexpr double kMostInterval = 2.5;
/// How long an instant waits for the samples of all members, by the newest of any.
constexpr double kWait_s = 1.0;
constexpr double kKept_s = 2.0;
static_assert(kKept_s > kWait_s);

void set(double (&to)[3], const Eigen::Vector3d& v) { std::copy_n(v.data(), 3, to); }

}  // namespace

VirtualImu::VirtualImu(const Configuration& configuration) {
  const auto studies = configuration.study_indices();
  for (const VirtualImuMember& member : configuration.virtual_imu) {
    const DeviceConfig& device = configuration.devices[member.device];
    names_.push_back(device.name);
    const auto study = std::find(studies.begin(), studies.end(), member.device) - studies.begin();
    Triads weights;
    weights << to_eigen(member.gyro), to_eigen(member.accel);
    members_.push_back({static_cast<std::size_t>(study), kMostInterval / device.rate_hz, weights, {}});
  }
}

VirtualImu::Sample VirtualImu::sample_of(const ErrorRecord& record) {
  const ErrorRow& row = record.row;
  const Eigen::Matrix3d C_s_b = to_eigen(record.mounting.C_b_s).transpose();
  Sample sample;
  sample.time_s = to_seconds(row.time - record.first_reference_time) + record.t_d_s;
  sample.utime = utime_of(row.utc);
  sample.error << C_s_b * to_eigen(row.e_gyro_radps), C_s_b * to_eigen(row.e_accel_mps2);
  sample.reading << C_s_b * to_eigen(row.predicted_omega_s_radps), C_s_b * to_eigen(row.predicted_f_s_mps2);
  sample.reading += sample.error;
  for (const auto& [triad, valid] : {std::pair{0, row.gyro_valid}, std::pair{1, row.accel_valid}}) {
    if (valid) continue;
    sample.error.col(triad).setConstant(kUnknown);
    sample.reading.col(triad).setConstant(kUnknown);
  }
  sample.place_b_m = to_eigen(record.mounting.r_bs_b_m);
  sample.validity = record.validity;
  return sample;
}

std::vector<virtual_imu_t> VirtualImu::add(const ErrorRecord& record) {
  std::vector<virtual_imu_t> messages;
  const auto member = std::find_if(members_.begin(), members_.end(),
                                   [&](const Member& one) { return one.study == record.study; });
  if (member == members_.end()) return messages;
  Sample sample = sample_of(record);
  // A clock that began anew, or a time offset that was found: what was before belongs to another time.
  if (!member->samples.empty() && sample.time_s <= member->samples.back().time_s) {
    for (Member& any : members_) any.samples.clear();
    newest_s_ = sample.time_s;
  }
  newest_s_ = std::max(newest_s_, sample.time_s);
  member->samples.push_back(std::move(sample));
  emit(messages);
  forget();
  return messages;
}

/// Whether no sample that may still come changes what is said of this instant.
bool VirtualImu::is_decided(double time_s) const {
  if (newest_s_ - time_s > kWait_s) return true;
  return std::all_of(members_.begin() + 1, members_.end(), [&](const Member& member) {
    return !member.samples.empty() && member.samples.back().time_s >= time_s;
  });
}

/// What the member says at an instant. Lets go of what is older than it needs.
std::optional<VirtualImu::Sample> VirtualImu::at(Member& member, double time_s) {
  auto& samples = member.samples;
  while (samples.size() > 1 && samples[1].time_s <= time_s) samples.pop_front();
  if (samples.empty() || samples.front().time_s > time_s) return std::nullopt;
  const Sample& before = samples.front();
  if (before.time_s == time_s) return before;
  if (samples.size() < 2) return std::nullopt;
  const Sample& after = samples[1];
  const double interval_s = after.time_s - before.time_s;
  if (interval_s > member.gap_s) return std::nullopt;
  const double share = (time_s - before.time_s) / interval_s;
  Sample between = after;
  between.reading = (1.0 - share) * before.reading + share * after.reading;
  between.error = (1.0 - share) * before.error + share * after.error;
  between.validity = std::max(before.validity, after.validity);
  return between;
}

void VirtualImu::emit(std::vector<virtual_imu_t>& messages) {
  auto& instants = members_.front().samples;
  while (!instants.empty() && is_decided(instants.front().time_s)) {
    std::vector<Sample> together{instants.front()};
    instants.pop_front();
    for (std::size_t i = 1; i < members_.size(); ++i) {
      auto sample = at(members_[i], together.front().time_s);
      if (!sample) break;
      together.push_back(std::move(*sample));
    }
    if (together.size() == members_.size())
      append(together, messages);
    else
      ++missing_;
  }
}

void VirtualImu::append(const std::vector<Sample>& samples, std::vector<virtual_imu_t>& messages) {
  Triads reading = Triads::Zero();
  Triads error = Triads::Zero();
  Eigen::Matrix3d places = Eigen::Matrix3d::Zero();  // a column a component
  Validity validity = Validity::kUsable;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const Triads& weights = members_[i].weights;
    // A triad that says nothing spoils nothing where it has no weight.
    const auto weighted = [&](const Triads& of) {
      return (weights.array() == 0.0).select(0.0, weights.array() * of.array()).matrix();
    };
    reading += weighted(samples[i].reading);
    error += weighted(samples[i].error);
    places += samples[i].place_b_m * weights.col(1).transpose();
    validity = std::max(validity, samples[i].validity);
  }
  const Sample& instant = samples.front();
  const MessageTenth tenth(instant.time_s);
  const auto as_told = static_cast<std::int8_t>(validity);
  if (pending_ &&
      (tenth != tenth_ || pending_->validity != as_told || pending_->rows.size() == ErrorBatch::kRowsMax))
    messages.push_back(*take());
  if (!pending_) {
    pending_.emplace();
    tenth_ = tenth;
    pending_->utime = instant.utime;
    pending_->imus = names_;
    pending_->n_imus = element_count(names_);
    pending_->validity = as_told;
    set(pending_->place_of_x_m, places.col(0));
    set(pending_->place_of_y_m, places.col(1));
    set(pending_->place_of_z_m, places.col(2));
  }
  pending_->rows.push_back({instant.utime, instant.time_s, reading(0, 0), reading(1, 0), reading(2, 0),
                            reading(0, 1), reading(1, 1), reading(2, 1), error(0, 0), error(1, 0),
                            error(2, 0), error(0, 1), error(1, 1), error(2, 1)});
}

std::optional<virtual_imu_t> VirtualImu::take() {
  if (!pending_) return std::nullopt;
  virtual_imu_t whole = std::move(*pending_);
  pending_.reset();
  whole.missing = missing_;
  whole.n_rows = element_count(whole.rows);
  return whole;
}

std::optional<virtual_imu_t> VirtualImu::take_old(double time_s) {
  return pending_ && tenth_.is_old(time_s) ? take() : std::nullopt;
}

/// Samples that no instant will ask for any more: the first member is silent.
void VirtualImu::forget() {
  for (Member& member : members_) {
    while (!member.samples.empty() && newest_s_ - member.samples.front().time_s > kKept_s)
      member.samples.pop_front();
  }
}

}  // namespace imuscope
