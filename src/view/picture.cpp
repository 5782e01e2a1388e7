#include "view/picture.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <imuscope/event_t.hpp>
#include <iterator>
#include <limits>
#include <utility>

#include "base/json_text.h"
#include "base/units.h"
#include "base/wgs84_ellipsoid.h"
#include "publish/message_codec.h"
#include "results/page/mounting_drawing.h"
#include "view/message_json.h"

namespace imuscope::view {

namespace {

constexpr std::size_t kFingerprintBytes = 8;

std::uint64_t fingerprint_of(std::span<const std::uint8_t> message) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < kFingerprintBytes; ++i) value = value << 8U | message[i];
  return value;
}

template <typename Message>
bool is(std::uint64_t fingerprint) {
  return static_cast<std::uint64_t>(Message::getHash()) == fingerprint;
}

/// C_b_s, row-major, of a Hamilton quaternion, scalar first (Sola 2017, eq. 115); nothing where it is none.
std::optional<std::array<double, 9>> rotation_of(const calibration_t& c) {
  constexpr double kRounding = 1e-3;  // of a message's norm
  const double w = c.q_w;
  const double x = c.q_x;
  const double y = c.q_y;
  const double z = c.q_z;
  if (!(std::abs(w * w + x * x + y * y + z * z - 1.0) < kRounding)) return std::nullopt;
  return std::array{1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
                    2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                    2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
}

std::array<double, 6> axes_of(const error_row_t& row) {
  return {row.e_gyro_x_radps, row.e_gyro_y_radps, row.e_gyro_z_radps,
          row.e_accel_x_mps2, row.e_accel_y_mps2, row.e_accel_z_mps2};
}

double largest(double a, double b, double c) { return std::max({a, b, c}); }

void append_time(std::string& out, double time_s) {
  if (std::isfinite(time_s)) {
    fmt::format_to(std::back_inserter(out), "{:.3f}", time_s);
  } else {
    out += "null";
  }
}

void append_key(std::string& out, std::string_view key) {
  out += json_text(nlohmann::json(key), kJsonOneLine);
  out += ':';
}

/// Members of an object, with commas between them.
class Members {
 public:
  explicit Members(std::string& out) : out_(out) { out_ += '{'; }
  void key(std::string_view name) {
    if (!first_) out_ += ',';
    first_ = false;
    append_key(out_, name);
  }
  void close() { out_ += '}'; }

 private:
  std::string& out_;
  bool first_ = true;
};

template <typename Message>
void append_json(std::string& out, const Message& message) {
  out += json_text(to_json(message), kJsonOneLine);
}

}  // namespace

bool Picture::hear(std::span<const std::uint8_t> message) {
  if (message.size() < kFingerprintBytes) return false;
  const std::uint64_t fingerprint = fingerprint_of(message);
  const auto try_as = [&]<typename Message>(const Message* /*type*/) {
    if (!is<Message>(fingerprint)) return false;
    auto decoded = decode_message<Message>(message);
    if (!decoded) return false;
    take(std::move(*decoded));
    news_ = true;
    return true;
  };
  if (is<event_t>(fingerprint)) {
    const auto event = decode_message<event_t>(message);
    if (!event) return false;
    take_event(event->text);
    news_ = true;
    return true;
  }
  return try_as(static_cast<const imuscope::error_t*>(nullptr)) ||
         try_as(static_cast<const calibration_t*>(nullptr)) ||
         try_as(static_cast<const navigation_t*>(nullptr)) ||
         try_as(static_cast<const odometry_t*>(nullptr)) || try_as(static_cast<const status_t*>(nullptr)) ||
         try_as(static_cast<const wavelet_variance_t*>(nullptr)) ||
         try_as(static_cast<const noise_model_t*>(nullptr));
}

void Picture::become(const Picture& other) {
  const std::uint64_t number = number_;
  *this = other;
  number_ = number + 1;
  tell_all_next();
}

void Picture::begin_anew() {
  const std::uint64_t number = number_;
  *this = Picture();
  number_ = number + 1;
  news_ = true;
}

Picture::Imu* Picture::imu(const std::string& name) {
  const std::string known_as = shown(name);
  const auto found = imus_.find(known_as);
  if (found != imus_.end()) return &found->second;
  if (imus_.size() >= kNamesMax) return nullptr;
  return &imus_[known_as];
}

void Picture::advance(double time_s) {
  if (std::isfinite(time_s)) time_s_ = std::max(time_s_, time_s);
}

void Picture::take(status_t&& status) {
  // Another run of the service counts its messages and its time from the beginning.
  if (status_ && status.uptime_s < status_->uptime_s && status.sequence <= status_->sequence) begin_anew();
  status_ = std::move(status);
  new_status_ = true;
}

void Picture::take(calibration_t&& calibration) {
  Imu* const of = imu(calibration.name);
  if (of == nullptr) return;
  advance(calibration.time_s);
  of->convergence.add({calibration.time_s,
                       largest(calibration.sd_psi_x_deg, calibration.sd_psi_y_deg, calibration.sd_psi_z_deg),
                       largest(calibration.sd_r_x_m, calibration.sd_r_y_m, calibration.sd_r_z_m),
                       calibration.sd_t_d_ms});
  of->calibration = std::move(calibration);
  of->new_calibration = true;
}

void Picture::take(const navigation_t& navigation) {
  advance(navigation.time_s);
  if (std::abs(navigation.lat_deg) <= 90.0 && std::abs(navigation.lon_deg) <= 360.0) {
    if (!origin_) {
      const RadiiOfCurvature radii = radii_of_curvature(navigation.lat_deg * kRadPerDeg);
      origin_ = Origin{navigation.lat_deg, navigation.lon_deg, radii.meridian_m * kRadPerDeg,
                       radii.transverse_m * std::cos(navigation.lat_deg * kRadPerDeg) * kRadPerDeg};
    }
    const std::array<double, 2> here{
        std::remainder(navigation.lon_deg - origin_->lon_deg, 360.0) * origin_->east_m_per_deg,
        (navigation.lat_deg - origin_->lat_deg) * origin_->north_m_per_deg};
    const double moved_m = std::hypot(here[0] - last_track_[0], here[1] - last_track_[1]);
    if (track_.points().empty() || moved_m >= kTrackStep_m) {
      track_.add(here);
      if (new_track_.size() < kTrackPointsMax) new_track_.push_back(here);
      last_track_ = here;
    }
  }
  navigation_ = navigation;
  new_navigation_ = true;
}

void Picture::take(const odometry_t& odometry) {
  odometry_ = odometry;
  new_odometry_ = true;
}

void Picture::take(imuscope::error_t&& errors) {
  Imu* const of = imu(errors.name);
  if (of == nullptr) return;
  // A count that begins anew is another run's, not a loss.
  if (of->next_sequence >= 0 && errors.sequence > of->next_sequence)
    messages_lost_ += static_cast<std::uint64_t>(errors.sequence - of->next_sequence);
  of->next_sequence =
      errors.sequence < std::numeric_limits<std::int64_t>::max() ? errors.sequence + 1 : errors.sequence;
  of->regime = shown(errors.regime);
  of->validity = errors.validity;
  if (errors.rows.empty()) return;
  Extremes extremes{errors.rows.back().time_s, axes_of(errors.rows.front()), axes_of(errors.rows.front())};
  for (const auto& row : errors.rows) {
    advance(row.time_s);
    const auto axes = axes_of(row);
    for (std::size_t i = 0; i < axes.size(); ++i) {
      extremes.least[i] = std::fmin(extremes.least[i], axes[i]);
      extremes.most[i] = std::fmax(extremes.most[i], axes[i]);
    }
    ++rows_;
    if (all_next_) continue;  // the whole picture holds them
    if (of->rows.size() < kRowsMax) {
      of->rows.push_back(row);
    } else {
      ++rows_left_out_;
    }
  }
  of->past.push_back(extremes);
  if (of->past.size() > kPastMax) of->past.pop_front();
}

void Picture::take(wavelet_variance_t&& variances) {
  Imu* const of = imu(variances.name);
  if (of == nullptr) return;
  of->variances = std::move(variances);
  of->new_variances = true;
}

void Picture::take(noise_model_t&& models) {
  Imu* const of = imu(models.name);
  if (of == nullptr) return;
  of->models = std::move(models);
  of->new_models = true;
}

void Picture::take_event(std::string_view text) {
  marks_.push_back({time_s_, shown(text)});
  new_marks_ = std::min(new_marks_ + 1, kMarksMax);
  if (marks_.size() > kMarksMax) marks_.pop_front();
}

std::string Picture::part(std::string_view extra) {
  draw_mounting();
  std::string out;
  append_head(out, all_next_, extra);
  for (auto& [name, one] : imus_) {
    one.rows.clear();
    one.new_calibration = one.new_variances = one.new_models = false;
  }
  new_track_.clear();
  new_marks_ = 0;
  new_status_ = new_navigation_ = new_odometry_ = new_mounting_ = news_ = all_next_ = false;
  return out;
}

std::string Picture::whole(std::string_view extra) const {
  std::string out;
  append_head(out, true, extra);
  return out;
}

void Picture::append_head(std::string& out, bool whole, std::string_view extra) const {
  fmt::format_to(std::back_inserter(out),
                 R"({{"kind":"{}","picture":{},"rows":{},"rows_left_out":{},"messages_lost":{},"time_s":)",
                 whole ? "whole" : "part", number_, rows_, rows_left_out_, messages_lost_);
  append_time(out, time_s_);
  if (status_ && (whole || new_status_)) {
    out += R"(,"status":)";
    append_json(out, *status_);
  }
  if (odometry_ && (whole || new_odometry_)) {
    out += R"(,"odometry":)";
    append_json(out, *odometry_);
  }
  append_navigation(out, whole);
  append_imus(out, whole);
  append_mounting(out, whole);
  append_errors(out, whole);
  append_marks(out, whole);
  out += extra;
  out += '}';
}

/// The same from one message to the next once the mounting is known to the drawing's width of a line.
void Picture::draw_mounting() {
  if (std::none_of(imus_.begin(), imus_.end(), [](const auto& imu) { return imu.second.new_calibration; }))
    return;
  std::vector<page::DrawnImu> drawn;
  for (const auto& [name, imu] : imus_) {
    if (!imu.calibration) continue;
    const auto C_b_s = rotation_of(*imu.calibration);
    const std::array r_bs_b_m{imu.calibration->r_x_m, imu.calibration->r_y_m, imu.calibration->r_z_m};
    const bool is_placed =
        std::all_of(r_bs_b_m.begin(), r_bs_b_m.end(), [](double r) { return std::isfinite(r); });
    if (C_b_s && is_placed) drawn.push_back({name, *C_b_s, r_bs_b_m});
  }
  std::string drawing = page::mounting_drawing(drawn).str();
  new_mounting_ = new_mounting_ || drawing != mounting_;
  mounting_ = std::move(drawing);
}

void Picture::append_mounting(std::string& out, bool whole) const {
  if (!(whole ? !mounting_.empty() : new_mounting_)) return;
  out += R"(,"mounting":)";
  out += json_text(mounting_, kJsonOneLine);
}

void Picture::append_navigation(std::string& out, bool whole) const {
  if (!navigation_ || !(whole || new_navigation_)) return;
  out += R"(,"navigation":)";
  append_json(out, *navigation_);
  const auto& points = whole ? track_.points() : new_track_;
  out += R"(,"track":[)";
  for (std::size_t i = 0; i < points.size(); ++i)
    fmt::format_to(std::back_inserter(out), "{}{:.1f},{:.1f}", i == 0 ? "" : ",", points[i][0], points[i][1]);
  out += ']';
}

void Picture::append_imus(std::string& out, bool whole) const {
  out += R"(,"imus":)";
  Members imus(out);
  for (const auto& [name, one] : imus_) {
    const bool calibration = one.calibration && (whole || one.new_calibration);
    const bool variances = one.variances && (whole || one.new_variances);
    const bool models = one.models && (whole || one.new_models);
    if (!calibration && !variances && !models) continue;
    imus.key(name);
    Members members(out);
    if (calibration) {
      members.key("calibration");
      append_json(out, *one.calibration);
      if (whole) {
        members.key("convergence");
        out += '[';
        bool first = true;
        for (const auto& point : one.convergence.points()) {
          if (!first) out += ',';
          first = false;
          append_time(out, point[0]);
          for (std::size_t i = 1; i < point.size(); ++i) {
            out += ',';
            append_number(out, point[i]);
          }
        }
        out += ']';
      }
    }
    if (variances) {
      members.key("variances");
      append_json(out, *one.variances);
    }
    if (models) {
      members.key("models");
      append_json(out, *one.models);
    }
    members.close();
  }
  imus.close();
}

void Picture::append_errors(std::string& out, bool whole) const {
  out += R"(,"errors":)";
  Members errors(out);
  for (const auto& [name, one] : imus_) {
    if (whole ? one.past.empty() : one.rows.empty()) continue;
    errors.key(name);
    Members members(out);
    members.key("regime");
    out += json_text(nlohmann::json(one.regime), kJsonOneLine);
    members.key("validity");
    out += std::to_string(static_cast<int>(one.validity));
    members.key(whole ? "past" : "rows");
    out += '[';
    if (whole) {
      for (std::size_t k = 0; k < one.past.size(); ++k) {
        if (k > 0) out += ',';
        append_time(out, one.past[k].time_s);
        for (std::size_t i = 0; i < one.past[k].least.size(); ++i) {
          out += ',';
          append_number(out, one.past[k].least[i]);
          out += ',';
          append_number(out, one.past[k].most[i]);
        }
      }
    } else {
      for (std::size_t k = 0; k < one.rows.size(); ++k) {
        if (k > 0) out += ',';
        append_time(out, one.rows[k].time_s);
        for (const double value : axes_of(one.rows[k])) {
          out += ',';
          append_number(out, value);
        }
      }
    }
    out += ']';
    members.close();
  }
  errors.close();
}

void Picture::append_marks(std::string& out, bool whole) const {
  const std::size_t n = whole ? marks_.size() : std::min(new_marks_, marks_.size());
  if (n == 0) return;
  nlohmann::json list = nlohmann::json::array();
  for (std::size_t i = marks_.size() - n; i < marks_.size(); ++i)
    list.push_back({{"time_s", marks_[i].time_s}, {"text", marks_[i].text}});
  out += R"(,"marks":)" + json_text(list, kJsonOneLine);
}

}  // namespace imuscope::view
