#include "study/run_bag.h"

#include <fmt/format.h>
#include <imuscope/message_fields.h>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <condition_variable>
#include <deque>
#include <fstream>
#include <future>
#include <limits>
#include <map>
#include <mutex>
#include <thread>

#include "base/line_reader.h"
#include "base/output_folder.h"
#include "base/text.h"
#include "base/units.h"
#include "base/utc_text.h"
#include "logs/bag/bag_writer.h"
#include "logs/bag/message_json.h"
#include "models/noise/export.h"
#include "results/tables/csv_reader.h"
#include "results/tables/json_fields.h"
#include "results/tables/json_file.h"
#include "service/pipeline/device_factory.h"
#include "service/pipeline/noise_series.h"
#include "service/run/bag_noise.h"
#include "service/run/models_file.h"
#include "study/mountings.h"

namespace imuscope {
namespace {

using nlohmann::json;
using tables::CsvReader;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
/// Files of a run may come from elsewhere: what is no time of a run would not fit into nanoseconds either.
constexpr double kTimeMost_s = 4e9;
bool is_time(double time_s) { return std::abs(time_s) < kTimeMost_s; }
constexpr std::size_t kChunkBytes = std::size_t{4} << 20U;

std::int64_t utime_of(std::int64_t utc_ns) { return utc_ns / 1000; }

/// Names in the first line of a file of a run; empty where there is none.
std::vector<std::string> header_of(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::string line;
  constexpr std::size_t kLongest = 65536;
  if (!read_line(in, line, kLongest) || line.size() > kLongest) return {};
  std::vector<std::string> names;
  std::string_view rest = line;
  while (!rest.empty()) {
    const auto comma = rest.find(',');
    names.emplace_back(rest.substr(0, comma));
    rest = comma == std::string_view::npos ? std::string_view{} : rest.substr(comma + 1);
  }
  return names;
}

/// UTC of the run's times: a line through points of navigation.csv, or from the run's beginning by its rate.
class RunUtc {
 public:
  RunUtc(const std::filesystem::path& folder, const json& run) {
    constexpr double kBetween_s = 10.0;
    const auto file = folder / "navigation.csv";
    if (auto rows = std::filesystem::exists(file) ? CsvReader::open(file, {"time_s", "utc_s"})
                                                  : Result<CsvReader>(work_error("none"))) {
      while (rows->next()) add(rows->number(0), rows->number(1), kBetween_s);
    }
    if (points_.size() > 1) return;
    const auto begin = parse_utc_text(tables::text_at(run, "t0_utc"));
    if (!begin || !is_time(begin->since_1970_s)) return;
    const double begin_s = begin->since_1970_s;
    const double ppm = tables::number_at(tables::field(run, "time_scale"), "host_clock_ppm").value_or(0.0);
    constexpr double kPpmMost = 1e4;  // of a quartz
    if (!(std::abs(ppm) < kPpmMost)) return;
    points_ = {{0.0, begin_s}, {1e3, begin_s + 1e3 - ppm * 1e-3}};
  }

  [[nodiscard]] bool is_known() const { return points_.size() > 1; }

  /// Nanoseconds since 1970, or since the run's beginning where nobody told UTC. Calls with rising times are
  /// cheap.
  [[nodiscard]] std::int64_t ns_at(Duration since_begin) const {
    if (!is_known()) return since_begin.count();
    const double time_s = to_seconds(since_begin);
    while (at_ + 2 < points_.size() && points_[at_ + 1].time_s < time_s) ++at_;
    while (at_ > 0 && points_[at_].time_s > time_s) --at_;
    const Point& a = points_[at_];
    const Point& b = points_[at_ + 1];
    const double rate = (b.utc_s - a.utc_s) / (b.time_s - a.time_s) - 1.0;
    // Large and small apart: seconds since 1970 have no nanoseconds in a double.
    return from_seconds(a.utc_s).count() + (since_begin - from_seconds(a.time_s)).count() +
           from_seconds(rate * (time_s - a.time_s)).count();
  }

 private:
  struct Point {
    double time_s;
    double utc_s;
  };
  void add(double time_s, double utc_s, double between_s) {
    if (!is_time(time_s) || !is_time(utc_s)) return;
    if (points_.empty()) {
      points_.push_back({time_s, utc_s});
      return;
    }
    // No quartz is as wrong: such a row is damaged.
    constexpr double kRateMost = 0.01;
    const double step_s = time_s - points_.back().time_s;
    const double utc_step_s = utc_s - points_.back().utc_s;
    if (step_s >= between_s && std::abs(utc_step_s / step_s - 1.0) < kRateMost)
      points_.push_back({time_s, utc_s});
  }

  std::vector<Point> points_;
  mutable std::size_t at_ = 0;
};

/// Samples of one device, as they are asked for.
class DeviceStream final : private SampleSink {
 public:
  DeviceStream(std::unique_ptr<ByteSource> source, std::unique_ptr<DeviceDecoder> decoder)
      : source_(std::move(source)), decoder_(std::move(decoder)) {}

  /// The next sample; null at the end.
  Result<const Sample*> front() {
    while (samples_.empty() && !at_end_) {
      auto read = source_->next();
      if (!read) return tl::unexpected<Error>(read.error());
      if (*read) {
        const RecordedRead& r = **read;
        if (r.per_byte) decoder_->set_per_byte(*r.per_byte);
        const HostTime arrival = r.arrival.value_or(HostTime{});
        decoder_->push(r.bytes, {arrival, r.received.value_or(arrival)}, *this);
        continue;
      }
      at_end_ = true;
      decoder_->finish(HostTime{}, *this);
    }
    return samples_.empty() ? nullptr : &samples_.front();
  }
  void pop() { samples_.pop_front(); }
  [[nodiscard]] const ByteSource& source() const { return *source_; }

 private:
  void on_sample(const Sample& sample) noexcept override { samples_.push_back(sample); }

  std::unique_ptr<ByteSource> source_;
  std::unique_ptr<DeviceDecoder> decoder_;
  std::deque<Sample> samples_;
  bool at_end_ = false;
};

/// Samples of all devices in the order of their times, read and decoded by a thread of its own while those
/// before them are written.
class SortedSamples {
 public:
  /// @param streams  by device; none where a device is not present. They are the thread's until the end.
  explicit SortedSamples(std::vector<std::optional<DeviceStream>>& streams)
      : streams_(streams), thread_([this] { read(); }) {}
  SortedSamples(const SortedSamples&) = delete;
  SortedSamples& operator=(const SortedSamples&) = delete;
  ~SortedSamples() {
    {
      const std::scoped_lock lock(mutex_);
      is_wanted_ = false;
    }
    changed_.notify_all();
    thread_.join();
  }

  /// The next ones; empty at the end.
  Result<std::vector<Sample>> next() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return !waiting_.empty() || is_done_; });
    if (waiting_.empty()) {
      if (error_) return tl::unexpected<Error>(*error_);
      return std::vector<Sample>{};
    }
    auto batch = std::move(waiting_.front());
    waiting_.pop_front();
    changed_.notify_all();
    return batch;
  }
  /// Of the recording, read so far.
  [[nodiscard]] double share() const noexcept { return share_.load(std::memory_order_relaxed); }

 private:
  static constexpr std::size_t kBatch = 4096;
  static constexpr std::size_t kBatchesMost = 8;

  void read() {
    std::vector<Sample> batch;
    auto done = read_sorted(batch);
    const std::scoped_lock lock(mutex_);
    if (!batch.empty()) waiting_.push_back(std::move(batch));
    if (!done) error_ = done.error();
    is_done_ = true;
    changed_.notify_all();
  }
  Result<void> read_sorted(std::vector<Sample>& batch) {
    for (;;) {
      DeviceStream* oldest = nullptr;
      const Sample* sample = nullptr;
      for (auto& stream : streams_) {
        if (!stream) continue;
        const auto front = stream->front();
        if (!front) return tl::unexpected<Error>(front.error());
        if (*front == nullptr || (sample != nullptr && (*front)->time >= sample->time)) continue;
        sample = *front;
        oldest = &*stream;
      }
      if (sample == nullptr) return {};
      batch.push_back(*sample);
      oldest->pop();
      if (batch.size() == kBatch && !hand_over(batch)) return {};
    }
  }
  /// False where nobody wants more.
  bool hand_over(std::vector<Sample>& batch) {
    double read = 0.0;
    double total = 0.0;
    for (const auto& stream : streams_) {
      if (!stream) continue;
      read += static_cast<double>(stream->source().bytes_read());
      total += static_cast<double>(stream->source().bytes_total());
    }
    share_.store(total > 0.0 ? read / total : 0.0, std::memory_order_relaxed);
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return waiting_.size() < kBatchesMost || !is_wanted_; });
    waiting_.push_back(std::move(batch));
    batch = {};
    batch.reserve(kBatch);
    changed_.notify_all();
    return is_wanted_;
  }

  std::vector<std::optional<DeviceStream>>& streams_;
  std::atomic<double> share_{0.0};
  std::mutex mutex_;  ///< of what follows
  std::condition_variable changed_;
  std::deque<std::vector<Sample>> waiting_;
  std::optional<Error> error_;
  bool is_done_ = false;
  bool is_wanted_ = true;
  std::thread thread_;  ///< last: it uses all of the above
};

/// Biases of an S-IMU over time, from the smoothed drive where there is one; between its rows along a line.
class BiasTrack {
 public:
  explicit BiasTrack(const std::filesystem::path& file) {
    auto rows = CsvReader::open(
        file, {"time_s", "bg_x_radps", "bg_y_radps", "bg_z_radps", "ba_x_mps2", "ba_y_mps2", "ba_z_mps2"});
    if (!rows) return;
    while (rows->next()) {
      Row row{};
      for (std::size_t i = 0; i < row.size(); ++i) row[i] = rows->number(i);
      const bool is_good = std::all_of(row.begin(), row.end(), [](double v) { return std::isfinite(v); });
      if (is_good && (rows_.empty() || row[0] > rows_.back()[0])) rows_.push_back(row);
    }
  }
  void at(double time_s, bag::Correction& correction) {
    if (rows_.empty()) return;
    while (at_ + 2 < rows_.size() && rows_[at_ + 1][0] < time_s) ++at_;
    const Row& a = rows_[at_];
    const Row& b = rows_[std::min(at_ + 1, rows_.size() - 1)];
    const double share = b[0] > a[0] ? std::clamp((time_s - a[0]) / (b[0] - a[0]), 0.0, 1.0) : 0.0;
    for (std::size_t i = 0; i < 3; ++i) {
      correction.gyro_bias_radps[i] = a[1 + i] + share * (b[1 + i] - a[1 + i]);
      correction.accel_bias_mps2[i] = a[4 + i] + share * (b[4 + i] - a[4 + i]);
    }
  }

 private:
  using Row = std::array<double, 7>;
  std::vector<Row> rows_;
  std::size_t at_ = 0;
};

/// White noise of an S-IMU in the regime in force.
class RegimeNoise {
 public:
  RegimeNoise(const json& models, const json& regimes, const std::string& name) {
    for (const json& regime : tables::field(regimes, "regimes")) {
      const bag::WhiteVariance variance = variance_of(models, name, tables::text_at(regime, "name"));
      for (const json& stretch : tables::field(regime, "stretches")) {
        const auto begin = tables::number_at(stretch, "begin_s");
        if (begin) stretches_.push_back({*begin, variance});
      }
    }
    std::sort(stretches_.begin(), stretches_.end(),
              [](const auto& a, const auto& b) { return a.begin_s < b.begin_s; });
    if (stretches_.empty()) whole_ = variance_of(models, name, "all");
  }
  /// Rising times; before the first stretch as in it.
  const bag::WhiteVariance& at(double time_s) {
    while (next_ < stretches_.size() && stretches_[next_].begin_s <= time_s) ++next_;
    if (stretches_.empty()) return whole_;
    return stretches_[next_ == 0 ? 0 : next_ - 1].variance;
  }

 private:
  struct Stretch {
    double begin_s;
    bag::WhiteVariance variance;
  };
  static bag::WhiteVariance variance_of(const json& models, const std::string& name,
                                        const std::string& regime) {
    bag::WhiteVariance variance;
    constexpr std::size_t kTriad = 3;
    for (std::size_t axis = 0; axis < 2 * kTriad; ++axis) {
      const auto fit = read_model(models, name, axis, regime);
      if (!fit) continue;
      (axis < kTriad ? variance.gyro : variance.accel)[axis % kTriad] = noise::white_variance_of_sample(*fit);
    }
    return variance;
  }
  std::vector<Stretch> stretches_;
  bag::WhiteVariance whole_;  ///< where the drive was not divided
  std::size_t next_ = 0;
};

/// By S-IMU. What a filter would feel of a model takes a while to find: it is done beside the first look at
/// the recording.
using RegimeNoises = std::map<std::string, RegimeNoise>;

RegimeNoises regime_noises(const std::filesystem::path& folder, const std::vector<std::string>& names) {
  const json models = tables::read_json_file(folder / "models.json");
  const json regimes = tables::read_json_file(folder / "regimes.json");
  RegimeNoises noises;
  for (const std::string& name : names)
    noises.emplace(name, RegimeNoise(tables::field(models, "models"), regimes, name));
  return noises;
}

/// Rows of a CSV file as messages of a type whose fields have the columns' names.
template <typename Message>
class RowStream {
 public:
  explicit RowStream(const std::filesystem::path& file) {
    const auto header = header_of(file);
    Message message{};
    visit_fields(message, [&](const char* name, auto& value, const char* /*sentence*/) {
      if constexpr (std::is_arithmetic_v<std::remove_reference_t<decltype(value)>>) {
        if (std::find(header.begin(), header.end(), name) != header.end()) columns_.emplace_back(name);
      }
    });
    if (header.empty() || columns_.empty()) return;
    if (auto rows = CsvReader::open(file, columns_)) rows_.emplace(std::move(*rows));
    pop();
  }
  /// The next row; null at the end.
  [[nodiscard]] const Message* front() const { return row_ ? &*row_ : nullptr; }
  void pop() {
    row_.reset();
    // Rows without a time are passed over.
    while (!row_ && rows_ && rows_->next()) take_row();
  }

 private:
  void take_row() {
    row_.emplace();
    std::size_t column = 0;
    visit_fields(*row_, [&](const char* name, auto& value, const char* /*sentence*/) {
      using Field = std::remove_reference_t<decltype(value)>;
      if constexpr (std::is_arithmetic_v<Field>) {
        const bool is_there = column < columns_.size() && columns_[column] == name;
        const double number = is_there ? rows_->number(column++) : kNan;
        if constexpr (std::is_floating_point_v<Field>)
          value = number;
        else
          value = std::abs(number) <= static_cast<double>(std::numeric_limits<Field>::max()) / 2.0
                      ? static_cast<Field>(number)
                      : Field{};
      }
    });
    row_->sequence = sequence_++;
    if (!is_time(row_->time_s)) row_.reset();
  }

  std::vector<std::string> columns_;
  std::optional<CsvReader> rows_;
  std::optional<Message> row_;
  std::int64_t sequence_ = 0;
};

/// One S-IMU of the run.
struct StudyBag {
  std::string name;
  DeviceIndex device = 0;
  bool has_mounting = false;
  bag::Correction correction;
  BiasTrack biases;
  std::optional<RegimeNoise> noise;  ///< where it has a mounting
  RowStream<calibration_t> calibrations;
};

/// Rows of the error process, a tenth of a second in a message as they are published.
class ErrorStream {
 public:
  ErrorStream(const std::filesystem::path& file, std::string name) : name_(std::move(name)) {
    static const std::vector<std::string> kColumns{
        "time_s",         "counter",        "e_gyro_x_radps", "e_gyro_y_radps", "e_gyro_z_radps",
        "e_accel_x_mps2", "e_accel_y_mps2", "e_accel_z_mps2", "utc_s",          "regime"};
    if (auto rows = CsvReader::open(file, kColumns)) rows_.emplace(std::move(*rows));
    more_ = rows_ && rows_->next();
  }
  std::optional<error_t> next() {
    if (!more_) return std::nullopt;
    error_t message{};
    message.name = name_;
    message.sequence = sequence_++;
    message.reference_age_s = kNan;
    message.gnss_age_s = kNan;
    message.regime = one_line(rows_->cell(9));
    const double tenth = std::floor(rows_->number(0) * 10.0);
    do {
      error_row_t row{};
      row.time_s = rows_->number(0);
      const double counter = rows_->number(1);
      row.counter = std::abs(counter) < 1e15 ? static_cast<std::int64_t>(counter) : 0;
      row.e_gyro_x_radps = rows_->number(2);
      row.e_gyro_y_radps = rows_->number(3);
      row.e_gyro_z_radps = rows_->number(4);
      row.e_accel_x_mps2 = rows_->number(5);
      row.e_accel_y_mps2 = rows_->number(6);
      row.e_accel_z_mps2 = rows_->number(7);
      const double utc_s = rows_->number(8);
      row.utime = is_time(utc_s) ? static_cast<std::int64_t>(std::llround(utc_s * 1e6)) : 0;
      message.rows.push_back(row);
      more_ = rows_->next();
    } while (more_ && std::floor(rows_->number(0) * 10.0) == tenth && rows_->cell(9) == message.regime &&
             message.rows.size() < 500);
    message.n_rows = static_cast<std::int32_t>(message.rows.size());
    message.utime = message.rows.front().utime;
    return message;
  }

 private:
  std::string name_;
  std::optional<CsvReader> rows_;
  bool more_ = false;
  std::int64_t sequence_ = 0;
};

class RunBagMaker {
 public:
  RunBagMaker(const RunBagOptions& options, const OpenedRecording& opened, const json& run,
              const std::vector<FoundCalibration>& found, RegimeNoises noises, OutputFile& out)
      : options_(options),
        opened_(opened),
        run_(run),
        folder_(options.source.run_dir),
        utc_(folder_, run),
        writer_(
            {"ros2", "imuscope " + options.version, options.compression, kChunkBytes, true},
            [this, &out](std::string_view bytes) {
              out.write(bytes);
              bag_.bytes += bytes.size();
            },
            device_names()),
        navigation_(std::filesystem::exists(folder_ / "smoothed_navigation.csv")
                        ? folder_ / "smoothed_navigation.csv"
                        : folder_ / "navigation.csv") {
    make_studies(found, noises);
  }

  Result<RunBag> run() {
    if (auto opened = open_streams(); !opened) return tl::unexpected<Error>(opened.error());
    bag_.times_are_utc = utc_.is_known();
    add_metadata();
    writer_.add_mountings(mountings_,
                          opened_.configuration.devices[opened_.configuration.reference_index()].name,
                          utc_.ns_at(Duration::zero()));
    if (auto merged = merge(); !merged) return tl::unexpected<Error>(merged.error());
    if (options_.with_errors) add_errors();
    attach();
    writer_.finish();
    bag_.messages = writer_.messages();
    return std::move(bag_);
  }

 private:
  std::vector<std::string> device_names() const {
    std::vector<std::string> names;
    for (const auto& device : opened_.configuration.devices) names.push_back(device.name);
    return names;
  }

  void make_studies(const std::vector<FoundCalibration>& found, RegimeNoises& noises) {
    const auto infos = study_file_infos(opened_.configuration, opened_.recording);
    const auto indices = opened_.configuration.study_indices();
    for (std::size_t i = 0; i < infos.size(); ++i) {
      const std::string& name = infos[i].name;
      const auto smoothed = folder_ / device_file_name("smoothed", name, ".csv");
      const auto filtered = folder_ / device_file_name("calibration", name, ".csv");
      StudyBag study{name,
                     static_cast<DeviceIndex>(indices[i]),
                     false,
                     {},
                     BiasTrack(std::filesystem::exists(smoothed) ? smoothed : filtered),
                     {},
                     RowStream<calibration_t>(filtered)};
      for (const FoundCalibration& of : found) {
        if (of.mounting.name != name) continue;
        study.has_mounting = true;
        study.noise = noises.at(name);
        study.correction = of.correction;
        study.correction.t_d_s -= infos[i].clock_shift_s;
        mountings_.push_back(of.mounting);
      }
      if (!study.has_mounting)
        bag_.remarks.push_back(
            fmt::format("{}: has no mounting, so its samples stand as they were sent alone", name));
      studies_.push_back(std::move(study));
    }
  }

  Result<void> open_streams() {
    const auto& devices = opened_.configuration.devices;
    streams_.resize(devices.size());
    auto sources = opened_.recording.open_side_by_side(Reading::kAhead);
    if (!sources) return tl::unexpected<Error>(sources.error());
    for (std::size_t i = 0; i < devices.size(); ++i) {
      if (!opened_.recording.present[i]) continue;
      const auto index = static_cast<DeviceIndex>(i);
      streams_[i].emplace(std::move((*sources)[i]),
                          make_decoder(devices[i], index, opened_.recording.clocks[i].map));
      variances_.resize(devices.size());
      variances_[i] = configured_variance(devices[i].noise);
    }
    // The run's times count from the reference's first sample.
    auto& reference = *streams_[opened_.configuration.reference_index()];
    for (;;) {
      auto first = reference.front();
      if (!first) return tl::unexpected<Error>(first.error());
      if (*first == nullptr) return work_error("the recording holds no sample of the reference");
      if ((*first)->kind == SampleKind::kImu) {
        begin_ = (*first)->time;
        return {};
      }
      reference.pop();
    }
  }

  /// Samples of all devices in the order of their times, and between them the rows of the run.
  Result<void> merge() {
    SortedSamples samples(streams_);
    for (;;) {
      const auto batch = samples.next();
      if (!batch) return tl::unexpected<Error>(batch.error());
      if (batch->empty()) break;
      for (const Sample& sample : *batch) {
        const double time_s = to_seconds(sample.time - begin_);
        add_rows(time_s);
        add_sample(sample, time_s);
      }
      if (options_.progress) options_.progress(samples.share());
    }
    add_rows(std::numeric_limits<double>::infinity());
    return {};
  }

  void add_sample(const Sample& sample, double time_s) {
    // A receiver's solution is of the instant that it tags, whenever it came.
    const bool is_tagged = sample.kind == SampleKind::kGnss && sample.has_utc && utc_.is_known();
    const std::int64_t utc_ns = is_tagged ? to_ns(sample.utc) : utc_.ns_at(sample.time - begin_);
    writer_.add_sample(sample, utc_ns, variances_[sample.device]);
    if (sample.kind != SampleKind::kImu) return;
    for (StudyBag& study : studies_) {
      if (study.device != sample.device || !study.has_mounting) continue;
      study.biases.at(time_s, study.correction);
      writer_.add_corrected(sample, utc_ns, study.correction, study.noise->at(time_s));
    }
  }

  void add_rows(double until_s) {
    while (navigation_.front() != nullptr && navigation_.front()->time_s <= until_s) {
      navigation_t row = *navigation_.front();
      navigation_.pop();
      const std::int64_t utc_ns = utc_.ns_at(from_seconds(row.time_s));
      if (utc_.is_known()) row.utime = utime_of(utc_ns);
      writer_.add_navigation(
          {row.lat_deg,
           row.lon_deg,
           row.height_m,
           {row.v_n_mps, row.v_e_mps, row.v_d_mps},
           {row.roll_deg * kRadPerDeg, row.pitch_deg * kRadPerDeg, row.heading_deg * kRadPerDeg},
           {row.sd_n_m, row.sd_e_m, row.sd_d_m},
           {row.sd_v_n_mps, row.sd_v_e_mps, row.sd_v_d_mps},
           {row.sd_roll_deg * kRadPerDeg, row.sd_pitch_deg * kRadPerDeg, row.sd_heading_deg * kRadPerDeg}},
          utc_ns);
      writer_.add_message("/imuscope/navigation", "navigation_t", bag::json_of(row), utc_ns);
    }
    for (StudyBag& study : studies_) {
      while (study.calibrations.front() != nullptr && study.calibrations.front()->time_s <= until_s) {
        calibration_t row = *study.calibrations.front();
        study.calibrations.pop();
        row.name = study.name;
        row.psi_x_observable = row.psi_y_observable = row.psi_z_observable =
            std::isfinite(row.psi_x_deg) ? 1 : 0;
        row.r_x_observable = row.r_y_observable = row.r_z_observable = std::isfinite(row.r_x_m) ? 1 : 0;
        row.t_d_observable = std::isfinite(row.t_d_ms) ? 1 : 0;
        const std::int64_t utc_ns = utc_.ns_at(from_seconds(row.time_s));
        if (utc_.is_known()) row.utime = utime_of(utc_ns);
        writer_.add_message("/imuscope/calibration/" + study.name, "calibration_t", bag::json_of(row),
                            utc_ns);
      }
    }
  }

  void add_errors() {
    for (const StudyBag& study : studies_) {
      ErrorStream errors(folder_ / device_file_name("errors", study.name, ".csv"), study.name);
      while (const auto message = errors.next()) {
        if (!is_time(message->rows.front().time_s)) continue;
        const std::int64_t utc_ns = utc_.ns_at(from_seconds(message->rows.front().time_s));
        writer_.add_message("/imuscope/error/" + study.name, "error_t", bag::json_of(*message), utc_ns);
      }
    }
  }

  void add_metadata() {
    writer_.add_metadata(
        "imuscope", {{"version", options_.version},
                     {"run", one_line(tables::text_at(run_, "name"))},
                     {"configuration_sha256", one_line(tables::text_at(run_, "configuration_sha256"))},
                     {"times", utc_.is_known() ? "UTC" : "since the run's first reference sample"},
                     {"utc_from", one_line(tables::text_at(tables::field(run_, "time_scale"), "utc_from"))}});
  }

  void attach() {
    const std::int64_t utc_ns = utc_.ns_at(Duration::zero());
    writer_.attach("configuration.toml", "application/toml", utc_ns, opened_.configuration.text);
    constexpr std::array<std::pair<const char*, const char*>, 7> kFiles{
        {{"calibration.json", "application/json"},
         {"run.json", "application/json"},
         {"models.json", "application/json"},
         {"regimes.json", "application/json"},
         {"comparison.json", "application/json"},
         {"evaluation.json", "application/json"},
         {"report.html", "text/html"}}};
    for (const auto& [name, type] : kFiles) {
      // A link may lead to a file that is none of the run's, and the bag goes to others.
      const auto status = std::filesystem::symlink_status(folder_ / name);
      if (!std::filesystem::is_regular_file(status)) continue;
      if (const auto text = read_text_file(folder_ / name, "file of a run", ""))
        writer_.attach(name, type, utc_ns, *text);
    }
  }

  const RunBagOptions& options_;
  const OpenedRecording& opened_;
  const json& run_;
  std::filesystem::path folder_;
  RunUtc utc_;
  RunBag bag_;
  bag::BagWriter writer_;
  RowStream<navigation_t> navigation_;
  std::vector<StudyBag> studies_;
  std::vector<bag::Mounting> mountings_;
  std::vector<std::optional<DeviceStream>> streams_;
  std::vector<bag::WhiteVariance> variances_;  ///< configured, by device
  HostTime begin_{};
};

Result<json> document(const std::filesystem::path& file) {
  if (!std::filesystem::exists(file))
    return usage_error(fmt::format("{} is not there", file.string()), "give the folder of a run");
  auto read = tables::read_json_file(file);
  if (read.is_discarded()) return work_error(file.string() + " is no JSON", "make the run again");
  return read;
}

}  // namespace

Result<RunBag> write_run_bag(const RunBagOptions& options) {
  const auto run = document(options.source.run_dir / "run.json");
  if (!run) return tl::unexpected<Error>(run.error());
  const auto calibration = document(options.source.run_dir / "calibration.json");
  if (!calibration) return tl::unexpected<Error>(calibration.error());
  return tables::with_documents_of(options.source.run_dir, [&]() -> Result<RunBag> {
    const auto found = found_calibrations(*calibration);
    std::vector<std::string> names;
    for (const FoundCalibration& one : found) names.push_back(one.mounting.name);
    auto noises = std::async(std::launch::async, regime_noises, options.source.run_dir, names);
    const auto opened = open_recording_of_run(options.source, *run);
    if (!opened) return tl::unexpected<Error>(opened.error());
    const auto folder = OutputFolder::open(options.out.parent_path());
    if (!folder) return tl::unexpected<Error>(folder.error());
    auto out = folder->begin(options.out.filename().string());
    if (!out) return tl::unexpected<Error>(out.error());
    auto bag = RunBagMaker(options, *opened, *run, found, noises.get(), *out).run();
    if (auto closed = out->close(); bag && !closed) return tl::unexpected<Error>(closed.error());
    if (bag) bag->remarks.insert(bag->remarks.begin(), opened->remarks.begin(), opened->remarks.end());
    return bag;
  });
}

}  // namespace imuscope
