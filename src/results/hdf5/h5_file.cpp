#include "results/hdf5/h5_file.h"

#include <algorithm>
#include <array>
#include <cstring>

namespace imuscope::hdf5 {
namespace {

/// Rows of a chunk: 128 kB of numbers, which is what one access to a disk brings anyway.
constexpr hsize_t kChunkRows = 16'384;
/// Of zlib's levels: above it, time grows faster than what is saved.
constexpr unsigned kDeflate = 4;
/// Arrays below this are stored as they are: a chunk costs more than it saves.
constexpr hsize_t kSmall = 512;

Result<Handle> checked(hid_t id, herr_t (*close)(hid_t)) {
  if (id < 0)
    return work_error("HDF5 cannot write the file", "look at the free space of the disk and its permissions");
  return Handle(id, close);
}

Result<void> checked(herr_t status) {
  if (status < 0)
    return work_error("HDF5 cannot write the file", "look at the free space of the disk and its permissions");
  return {};
}

/// Strings of one length, filled up with zeros. UTF-8, which the type does not say: Octave reads no string
/// that does, and the others take the bytes as they are.
Handle text_type(std::size_t length) {
  Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  (void)H5Tset_size(type.get(), std::max<std::size_t>(length, 1));
  (void)H5Tset_strpad(type.get(), H5T_STR_NULLPAD);
  return type;
}

/// How a data set is stored, chunked where it is worth it. No times of day: the same run gives the same file.
Handle storage(std::span<const hsize_t> shape, bool grows) {
  Handle storage(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  (void)H5Pset_obj_track_times(storage.get(), false);
  hsize_t size = 1;
  for (const hsize_t side : shape) size *= side;
  if (!grows && size < kSmall) return storage;
  std::vector<hsize_t> chunk(shape.begin(), shape.end());
  chunk[0] = grows ? kChunkRows : std::clamp<hsize_t>(chunk[0], 1, kChunkRows);
  (void)H5Pset_chunk(storage.get(), static_cast<int>(chunk.size()), chunk.data());
  (void)H5Pset_shuffle(storage.get());
  (void)H5Pset_deflate(storage.get(), kDeflate);
  (void)H5Pset_fletcher32(storage.get());
  return storage;
}

Result<Handle> create_data_set(const Handle& parent, std::string_view name, hid_t type, const Handle& space,
                               const Handle& how) {
  return checked(H5Dcreate2(parent.get(), link_name(name).c_str(), type, space.get(), H5P_DEFAULT, how.get(),
                            H5P_DEFAULT),
                 H5Dclose);
}

Result<Handle> write_all(const Handle& parent, std::string_view name, hid_t type,
                         const std::vector<hsize_t>& shape, const void* values) {
  const Handle space(H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr), H5Sclose);
  auto data_set = create_data_set(parent, name, type, space, storage(shape, false));
  if (!data_set) return data_set;
  if (auto written = checked(H5Dwrite(data_set->get(), type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values));
      !written)
    return tl::unexpected<Error>(written.error());
  return data_set;
}

Result<Handle> write_scalar(const Handle& parent, std::string_view name, hid_t type, const void* value) {
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  auto data_set = create_data_set(parent, name, type, space, storage({}, false));
  if (!data_set) return data_set;
  if (auto written = checked(H5Dwrite(data_set->get(), type, H5S_ALL, H5S_ALL, H5P_DEFAULT, value)); !written)
    return tl::unexpected<Error>(written.error());
  return data_set;
}

}  // namespace

std::string link_name(std::string_view name) {
  std::string link(name);
  std::replace(link.begin(), link.end(), '/', '_');
  std::replace(link.begin(), link.end(), '\0', '_');
  if (link.find_first_not_of('.') == std::string::npos) link = "_" + link;
  return link;
}

Result<Handle> create_file(const std::filesystem::path& file) {
  // What a full disk refused, the library would try again when the program ends, and crash.
  (void)H5dont_atexit();
  // Its own reports, of many lines on the terminal, say nothing to a person.
  (void)H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  (void)H5Pset_libver_bounds(access.get(), H5F_LIBVER_V18, H5F_LIBVER_LATEST);
  const Handle creation(H5Pcreate(H5P_FILE_CREATE), H5Pclose);
  (void)H5Pset_obj_track_times(creation.get(), false);
  return checked(H5Fcreate(file.c_str(), H5F_ACC_TRUNC, creation.get(), access.get()), H5Fclose);
}

Result<Handle> create_group(const Handle& parent, std::string_view name) {
  const Handle how(H5Pcreate(H5P_GROUP_CREATE), H5Pclose);
  (void)H5Pset_obj_track_times(how.get(), false);
  return checked(H5Gcreate2(parent.get(), link_name(name).c_str(), H5P_DEFAULT, how.get(), H5P_DEFAULT),
                 H5Gclose);
}

Result<void> set_attribute(const Handle& object, const char* name, std::string_view text) {
  const Handle type = text_type(text.size());
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  auto attribute =
      checked(H5Acreate2(object.get(), name, type.get(), space.get(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  if (!attribute) return tl::unexpected<Error>(attribute.error());
  const std::string value = text.empty() ? std::string(1, '\0') : std::string(text);
  return checked(H5Awrite(attribute->get(), type.get(), value.data()));
}

Result<Handle> write_number(const Handle& parent, std::string_view name, double value) {
  return write_scalar(parent, name, H5T_NATIVE_DOUBLE, &value);
}

Result<Handle> write_array(const Handle& parent, std::string_view name, std::span<const double> values,
                           const std::vector<hsize_t>& shape) {
  return write_all(parent, name, H5T_NATIVE_DOUBLE, shape, values.data());
}

Result<Handle> write_text(const Handle& parent, std::string_view name, std::string_view text) {
  const std::string value = text.empty() ? std::string(1, '\0') : std::string(text);
  const Handle type = text_type(value.size());
  return write_scalar(parent, name, type.get(), value.data());
}

Result<Handle> write_texts(const Handle& parent, std::string_view name,
                           const std::vector<std::string>& texts) {
  std::vector<std::int16_t> codes(texts.size());
  for (std::size_t i = 0; i < codes.size(); ++i) codes[i] = static_cast<std::int16_t>(i);
  return write_words(parent, name, codes, texts);
}

Result<GrowingColumn> GrowingColumn::create(const Handle& parent, std::string_view name) {
  const hsize_t none = 0;
  const hsize_t unlimited = H5S_UNLIMITED;
  const Handle space(H5Screate_simple(1, &none, &unlimited), H5Sclose);
  auto data_set = create_data_set(parent, name, H5T_NATIVE_DOUBLE, space,
                                  storage(std::array<hsize_t, 1>{kChunkRows}, true));
  if (!data_set) return tl::unexpected<Error>(data_set.error());
  return GrowingColumn(std::move(*data_set));
}

Result<void> GrowingColumn::append(std::span<const double> values) {
  const hsize_t count = values.size();
  if (count == 0) return {};
  const hsize_t begin = rows_;
  rows_ += count;
  if (auto grown = checked(H5Dset_extent(data_set_.get(), &rows_)); !grown) return grown;
  const Handle in_file(H5Dget_space(data_set_.get()), H5Sclose);
  (void)H5Sselect_hyperslab(in_file.get(), H5S_SELECT_SET, &begin, nullptr, &count, nullptr);
  const Handle in_memory(H5Screate_simple(1, &count, nullptr), H5Sclose);
  return checked(H5Dwrite(data_set_.get(), H5T_NATIVE_DOUBLE, in_memory.get(), in_file.get(), H5P_DEFAULT,
                          values.data()));
}

Result<Handle> write_words(const Handle& parent, std::string_view name, std::span<const std::int16_t> codes,
                           const std::vector<std::string>& words) {
  std::size_t longest = 1;
  for (const std::string& word : words) longest = std::max(longest, word.size());
  const Handle type = text_type(longest);
  const std::vector<hsize_t> shape{codes.size()};
  const Handle space(H5Screate_simple(1, shape.data(), nullptr), H5Sclose);
  auto data_set = create_data_set(parent, name, type.get(), space, storage(shape, false));
  if (!data_set) return data_set;
  // Block by block: the words as they are written are larger than their codes.
  for (hsize_t begin = 0; begin < codes.size(); begin += kChunkRows) {
    const hsize_t count = std::min<hsize_t>(kChunkRows, codes.size() - begin);
    std::vector<char> texts(count * longest, '\0');
    for (hsize_t i = 0; i < count; ++i) {
      const std::int16_t code = codes[begin + i];
      if (code >= 0)
        std::memcpy(&texts[i * longest], words[static_cast<std::size_t>(code)].data(),
                    words[static_cast<std::size_t>(code)].size());
    }
    const Handle in_memory(H5Screate_simple(1, &count, nullptr), H5Sclose);
    (void)H5Sselect_hyperslab(space.get(), H5S_SELECT_SET, &begin, nullptr, &count, nullptr);
    if (auto written = checked(
            H5Dwrite(data_set->get(), type.get(), in_memory.get(), space.get(), H5P_DEFAULT, texts.data()));
        !written)
      return tl::unexpected<Error>(written.error());
  }
  return data_set;
}

}  // namespace imuscope::hdf5
