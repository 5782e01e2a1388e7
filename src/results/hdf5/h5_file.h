#pragma once

/// The few things of HDF5 that a run needs. An object of the library is closed at the end of its life. Errors
/// are of kind kWork.

#include <hdf5.h>

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/result.h"

namespace imuscope::hdf5 {

/// An identifier of the library with the function that closes it.
class Handle {
 public:
  Handle() = default;
  Handle(hid_t id, herr_t (*closes)(hid_t)) noexcept : id_(id), close_(closes) {}
  Handle(Handle&& other) noexcept : id_(std::exchange(other.id_, H5I_INVALID_HID)), close_(other.close_) {}
  Handle& operator=(Handle&& other) noexcept {
    std::swap(id_, other.id_);
    std::swap(close_, other.close_);
    return *this;
  }
  ~Handle() {
    if (is_open()) (void)close_(id_);
  }
  [[nodiscard]] hid_t get() const noexcept { return id_; }
  [[nodiscard]] bool is_open() const noexcept { return id_ >= 0; }
  /// @return whether it went well: what was not written yet is written now
  [[nodiscard]] bool close() noexcept { return close_(std::exchange(id_, H5I_INVALID_HID)) >= 0; }

 private:
  hid_t id_ = H5I_INVALID_HID;
  herr_t (*close_)(hid_t) = nullptr;
};

/// A name as HDF5 takes it: no '/', not empty, no dot alone.
std::string link_name(std::string_view name);

/// A new file, readable by every version of the library since 1.8.
Result<Handle> create_file(const std::filesystem::path& file);
Result<Handle> create_group(const Handle& parent, std::string_view name);

/// Text that belongs to a group or a data set.
Result<void> set_attribute(const Handle& object, const char* name, std::string_view text);

/// One value, an array of any shape, one text, several texts. Arrays are chunked, deflated and checksummed.
Result<Handle> write_number(const Handle& parent, std::string_view name, double value);
Result<Handle> write_array(const Handle& parent, std::string_view name, std::span<const double> values,
                           const std::vector<hsize_t>& shape);
Result<Handle> write_text(const Handle& parent, std::string_view name, std::string_view text);
Result<Handle> write_texts(const Handle& parent, std::string_view name,
                           const std::vector<std::string>& texts);

/// A column of numbers that grows.
class GrowingColumn {
 public:
  static Result<GrowingColumn> create(const Handle& parent, std::string_view name);
  [[nodiscard]] Result<void> append(std::span<const double> values);
  [[nodiscard]] const Handle& data_set() const { return data_set_; }

 private:
  explicit GrowingColumn(Handle data_set) : data_set_(std::move(data_set)) {}
  Handle data_set_;
  hsize_t rows_ = 0;
};

/// A column of words: `codes` are places in `words`, below zero for none.
Result<Handle> write_words(const Handle& parent, std::string_view name, std::span<const std::int16_t> codes,
                           const std::vector<std::string>& words);

}  // namespace imuscope::hdf5
