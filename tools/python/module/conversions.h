#pragma once

/// Between values of imuscope and those of Python. Whoever computes lets go of Python's lock.

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cstdint>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "base/result.h"

namespace imuscope::python {

/// Becomes imuscope.Error, with the sentence that the program would print.
class Failure : public std::runtime_error {
 public:
  explicit Failure(const Error& error) : std::runtime_error(error.text()) {}
};

/// The value; a Failure where there is none.
template <typename T>
T take(Result<T>&& result) {
  if (!result) throw Failure(result.error());
  if constexpr (!std::is_void_v<T>) return std::move(*result);
}

/// float64, in one piece: the memory that Python holds is read where it is.
using Numbers = pybind11::array_t<double, pybind11::array::c_style>;
using Truths = pybind11::array_t<bool, pybind11::array::c_style>;

inline std::span<const double> span_of(const Numbers& x) {
  return {x.data(), static_cast<std::size_t>(x.size())};
}
/// NumPy's truths are bytes of 0 and 1.
inline std::span<const std::uint8_t> span_of(const Truths& x) {
  return {reinterpret_cast<const std::uint8_t*>(x.data()), static_cast<std::size_t>(x.size())};
}

/// An array that owns what the vector held; nothing is copied. With `columns` above 0 it has so many.
template <typename T>
pybind11::array_t<T> array_of(std::vector<T>&& values, std::size_t columns = 0) {
  auto kept = std::make_unique<std::vector<T>>(std::move(values));
  const auto size = static_cast<pybind11::ssize_t>(kept->size());
  T* const data = kept->data();
  const pybind11::capsule owner(kept.release(),
                                [](void* vector) { delete static_cast<std::vector<T>*>(vector); });
  if (columns == 0) return pybind11::array_t<T>({size}, data, owner);
  const auto width = static_cast<pybind11::ssize_t>(columns);
  return pybind11::array_t<T>({size / width, width}, data, owner);
}

// Each binds what its file has.
void bind_noise(pybind11::module_& module);
void bind_runs(pybind11::module_& module);
void bind_captures(pybind11::module_& module);
void bind_studies(pybind11::module_& module);
void bind_live(pybind11::module_& module);

}  // namespace imuscope::python
