#include "results/hdf5/json_tree.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "base/json_text.h"
#include "results/tables/columns.h"

namespace imuscope::hdf5 {
namespace {

using nlohmann::json;

std::size_t count_values(const json& value) {
  if (!value.is_structured()) return 1;
  std::size_t n = 1;
  for (const json& element : value) n += count_values(element);
  return n;
}

bool is_number(const json& value) { return value.is_number() || value.is_boolean() || value.is_null(); }

double number_of(const json& value) {
  if (value.is_boolean()) return value.get<bool>() ? 1.0 : 0.0;
  return value.is_null() ? std::numeric_limits<double>::quiet_NaN() : value.get<double>();
}

/// The shape of an array of numbers, or of arrays of numbers of one shape; nothing for any other.
std::optional<std::vector<hsize_t>> shape_of(const json& array) {
  if (!array.is_array() || array.empty()) return std::nullopt;
  const bool is_flat = std::all_of(array.begin(), array.end(), is_number);
  if (is_flat) return std::vector<hsize_t>{array.size()};
  const auto inner = shape_of(array.front());
  constexpr std::size_t kDimensionsMax = 8;
  if (!inner || inner->size() == kDimensionsMax) return std::nullopt;
  for (const json& element : array) {
    if (shape_of(element) != inner) return std::nullopt;
  }
  std::vector<hsize_t> shape{array.size()};
  shape.insert(shape.end(), inner->begin(), inner->end());
  return shape;
}

void flatten(const json& array, std::vector<double>& values) {
  for (const json& element : array) {
    if (element.is_array()) {
      flatten(element, values);
    } else {
      values.push_back(number_of(element));
    }
  }
}

bool is_single(const json& value) { return is_number(value) || value.is_string(); }

bool is_table(const json& array) {
  return std::all_of(array.begin(), array.end(), [](const json& row) {
    return row.is_object() && std::all_of(row.begin(), row.end(), is_single);
  });
}

std::string text_of(const json& value) {
  if (value.is_null()) return {};
  return value.is_string() ? value.get<std::string>() : json_text(value, kJsonOneLine);
}

/// What an element of an array is called: by what it says of itself, else by its place, from 1.
std::string name_of(const json& element, std::size_t place, const std::set<std::string>& taken) {
  std::string name;
  for (const char* key : {"name", "axis", "regime"}) {
    const auto at = element.is_object() ? element.find(key) : element.end();
    if (element.is_object() && at != element.end() && at->is_string())
      name += (name.empty() ? "" : "_") + at->get<std::string>();
  }
  name = name.empty() ? fmt::format("{:04}", place + 1) : link_name(name);
  return taken.contains(name) ? fmt::format("{}_{:04}", name, place + 1) : name;
}

class TreeWriter {
 public:
  Result<void> write(const Handle& parent, const std::string& name, const std::string& key,
                     const json& value) {
    if (value.is_object()) return write_object(parent, name, value);
    if (is_number(value)) return with_unit(write_number(parent, name, number_of(value)), key);
    if (value.is_string())
      return with_unit(write_text(parent, name, value.get_ref<const std::string&>()), {});
    return write_list(parent, name, key, value);
  }

 private:
  static Result<void> with_unit(Result<Handle> data_set, std::string_view key) {
    if (!data_set) return tl::unexpected<Error>(data_set.error());
    const auto unit = tables::unit_in_name(key);
    return unit.empty() ? Result<void>{} : set_attribute(*data_set, "unit", unit);
  }

  Result<void> write_object(const Handle& parent, const std::string& name, const json& object) {
    const auto group = create_group(parent, name);
    if (!group) return tl::unexpected<Error>(group.error());
    std::set<std::string> taken;
    std::size_t place = 0;
    for (const auto& [key, member] : object.items()) {
      std::string link = link_name(key);
      if (!taken.insert(link).second) link = fmt::format("{}_{:04}", link, ++place);
      taken.insert(link);
      if (auto written = write(*group, link, key, member); !written) return written;
    }
    return {};
  }

  Result<void> write_list(const Handle& parent, const std::string& name, const std::string& key,
                          const json& array) {
    if (const auto shape = shape_of(array)) {
      std::vector<double> values;
      flatten(array, values);
      return with_unit(write_array(parent, name, values, *shape), key);
    }
    if (std::all_of(array.begin(), array.end(), [](const json& v) { return v.is_string(); })) {
      std::vector<std::string> texts;
      for (const json& element : array) texts.push_back(text_of(element));
      if (texts.size() <= kTextsMax) return with_unit(write_texts(parent, name, texts), {});
    }
    if (is_table(array)) return write_columns(parent, name, array);
    const auto group = create_group(parent, name);
    if (!group) return tl::unexpected<Error>(group.error());
    std::set<std::string> taken;
    for (std::size_t i = 0; i < array.size(); ++i) {
      const std::string link = name_of(array[i], i, taken);
      if (!taken.insert(link).second) continue;
      if (auto written = write(*group, link, key, array[i]); !written) return written;
    }
    return {};
  }

  Result<void> write_columns(const Handle& parent, const std::string& name, const json& rows) {
    const auto group = create_group(parent, name);
    if (!group) return tl::unexpected<Error>(group.error());
    std::set<std::string> keys;
    for (const json& row : rows)
      for (const auto& [key, value] : row.items()) keys.insert(key);
    for (const std::string& key : keys) {
      json column = json::array();
      for (const json& row : rows) column.push_back(row.value(key, json()));
      const bool has_text =
          std::any_of(column.begin(), column.end(), [](const json& value) { return value.is_string(); });
      if (has_text) {
        for (json& value : column) value = text_of(value);
      }
      if (auto written = write(*group, link_name(key), key, column); !written) return written;
    }
    return {};
  }

  /// Texts of one list: as many as a code of theirs can count.
  static constexpr std::size_t kTextsMax = std::numeric_limits<std::int16_t>::max();
};

}  // namespace

Result<bool> write_json_tree(const Handle& parent, std::string_view name, const json& document) {
  if (count_values(document) > kValuesMax) return false;
  if (auto written = TreeWriter().write(parent, std::string(name), {}, document); !written)
    return tl::unexpected<Error>(written.error());
  return true;
}

}  // namespace imuscope::hdf5
