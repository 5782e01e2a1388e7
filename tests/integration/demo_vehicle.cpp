#include "demo_vehicle.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "careful_toml.h"
#include "programs.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {

struct DemoVehicle::Tables {
  toml::table root;
};

namespace {

/// Roughly how an S-IMU of the demo sits.
struct Turn {
  const char* imu;
  std::array<double, 3> rotation_vector_b_s_deg;
};
constexpr std::array<Turn, 3> kTurns{
    {{"mtx1", {0.0, 0.0, 0.0}}, {"mtx2", {0.0, 0.0, 91.0}}, {"mtx3", {179.0, 0.0, 0.0}}}};
// The truth lies within these of kTurns, of no lever arm and of no time offset.
constexpr double kBoresightSd_deg = 3.0;
constexpr double kLeverArmSd_m = 0.5;
constexpr double kTimeOffsetSd_ms = 10.0;

template <typename Value>
const Value& as_toml(const Value& value) {
  return value;
}

template <typename Value>
toml::array as_toml(const std::vector<Value>& values) {
  toml::array list;
  for (const auto& value : values) list.push_back(value);
  return list;
}

toml::table& table_in(toml::table& outer, const std::string& key) {
  toml::table* found = outer[key].as_table();
  if (found == nullptr) throw std::invalid_argument(key + " is no table");
  return *found;
}

toml::array& list_in(toml::table& outer, const std::string& key) {
  toml::array* found = outer[key].as_array();
  if (found == nullptr) throw std::invalid_argument(key + " is no list of tables");
  return *found;
}

void put(toml::table& table, const std::string& path, const TomlValue& value) {
  const auto dot = path.find('.');
  if (dot == std::string::npos) {
    std::visit([&](const auto& held) { table.insert_or_assign(path, as_toml(held)); }, value);
    return;
  }
  const std::string head = path.substr(0, dot);
  table.insert(head, toml::table{});  // where there is none
  put(table_in(table, head), path.substr(dot + 1), value);
}

toml::table table_of(const TomlKeys& keys) {
  toml::table table;
  for (const auto& [key, value] : keys) put(table, key, value);
  return table;
}

void put_line(toml::table& device, const TomlKeys& line) {
  toml::table transport = table_of(line);
  transport.is_inline(true);
  device.insert_or_assign("transport", std::move(transport));
}

toml::array& devices_of(toml::table& root) { return list_in(root, "device"); }

toml::array& truths_of(toml::table& root) { return list_in(table_in(root, "simulation"), "imu"); }

std::string name_of(toml::table& entry) { return entry["name"].value_or(std::string()); }

/// The entry of a list of tables by its name; the list's end where there is none.
toml::array::iterator named(toml::array& list, const std::string& name) {
  return std::find_if(list.begin(), list.end(),
                      [&](toml::node& entry) { return name_of(*entry.as_table()) == name; });
}

toml::table& device_of(toml::table& root, const std::string& name) {
  toml::array& devices = devices_of(root);
  const auto found = named(devices, name);
  if (found == devices.end()) throw std::invalid_argument("the vehicle has no device " + name);
  return *found->as_table();
}

}  // namespace

TomlKeys serial_line(const std::filesystem::path& port, int baud) {
  return {{"kind", "serial"}, {"port", port.string()}, {"baud", baud}};
}

TomlKeys tcp_line(int port) { return {{"kind", "tcp"}, {"host", "127.0.0.1"}, {"port", port}}; }

TomlKeys udp_line(int port) { return {{"kind", "udp"}, {"port", port}}; }

DemoVehicle::DemoVehicle() : DemoVehicle(source_path("config/demo.toml")) {}

DemoVehicle::DemoVehicle(const std::filesystem::path& file)
    : tables_(std::make_unique<Tables>(Tables{toml::parse(read_text(file), file.string())})) {}

DemoVehicle::~DemoVehicle() = default;

DemoVehicle& DemoVehicle::ports_in(const std::filesystem::path& folder) {
  for (toml::node& entry : devices_of(tables_->root)) {
    toml::table& device = *entry.as_table();
    put(device, "transport.port", (folder / name_of(device)).string());
  }
  return *this;
}

DemoVehicle& DemoVehicle::with_priors() {
  for (const auto& [imu, turn] : kTurns) {
    set_device(imu, "prior.rotation_vector_b_s_deg", std::vector<double>(turn.begin(), turn.end()));
    set_device(imu, "prior.boresight_sd_deg", kBoresightSd_deg);
    set_device(imu, "prior.lever_arm_sd_m", kLeverArmSd_m);
    set_device(imu, "prior.time_offset_ms", 0.0);
    set_device(imu, "prior.time_offset_sd_ms", kTimeOffsetSd_ms);
  }
  return *this;
}

DemoVehicle& DemoVehicle::start_at(const std::string& utc) {
  toml::table read = toml::parse("utc = " + utc);
  table_in(tables_->root, "simulation")
      .insert_or_assign("start_utc", read["utc"].value<toml::date_time>().value());
  return *this;
}

DemoVehicle& DemoVehicle::set(const std::string& path, const TomlValue& value) {
  put(tables_->root, path, value);
  return *this;
}

DemoVehicle& DemoVehicle::set_device(const std::string& name, const std::string& path,
                                     const TomlValue& value) {
  put(device_of(tables_->root, name), path, value);
  return *this;
}

DemoVehicle& DemoVehicle::set_truth(const std::string& name, const std::string& path,
                                    const TomlValue& value) {
  (void)device_of(tables_->root, name);
  toml::array& truths = truths_of(tables_->root);
  if (named(truths, name) == truths.end()) truths.push_back(table_of({{"name", name}}));
  put(*named(truths, name)->as_table(), path, value);
  return *this;
}

DemoVehicle& DemoVehicle::put_on_line(const std::string& name, const TomlKeys& line) {
  put_line(device_of(tables_->root, name), line);
  return *this;
}

DemoVehicle& DemoVehicle::add_device(const TomlKeys& keys, const TomlKeys& line) {
  toml::table device = table_of(keys);
  put_line(device, line);
  devices_of(tables_->root).push_back(std::move(device));
  return *this;
}

DemoVehicle& DemoVehicle::without(const std::string& name) {
  (void)device_of(tables_->root, name);
  for (toml::array* list : {&devices_of(tables_->root), &truths_of(tables_->root)}) {
    const auto found = named(*list, name);
    if (found != list->end()) list->erase(found);
  }
  return *this;
}

std::string DemoVehicle::text() const {
  // Without flags it is as a person writes it: texts in double quotes, tables not indented.
  std::ostringstream out;
  out << toml::toml_formatter(tables_->root, toml::format_flags::none) << '\n';
  return out.str();
}

std::filesystem::path DemoVehicle::write(const std::filesystem::path& file) const {
  std::ofstream out(file);
  out << text();
  out.close();
  if (!out) throw std::runtime_error("cannot write " + file.string());
  return file;
}

}  // namespace imuscope::test
