#include "export_hdf5.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include <array>

#include "print.h"
#include "results/hdf5/module.h"

namespace imuscope::cli {
namespace {

constexpr const char* kModule = "lib/imuscope/imuscope_hdf5.so";
constexpr const char* kRemedy =
    "install it: sudo apt install ./imuscope-hdf5_*.deb, or in a source tree "
    "tools/setup --doors, then build again";

/// The module lies beside the program's own folder, installed or built.
Result<hdf5::ExportFunction> load() {
  std::error_code failed;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", failed);
  const auto module = program.parent_path().parent_path() / kModule;
  if (failed || !std::filesystem::exists(module, failed)) {
    return usage_error("the export to HDF5 is a part of its own (imuscope-hdf5), which is not here", kRemedy);
  }
  void* const loaded = dlopen(module.c_str(), RTLD_NOW | RTLD_LOCAL);
  void* const function = loaded != nullptr ? dlsym(loaded, hdf5::kExportFunction) : nullptr;
  if (function == nullptr)
    return work_error(fmt::format("the export to HDF5 cannot be loaded: {}", dlerror()), kRemedy);
  return reinterpret_cast<hdf5::ExportFunction>(function);
}

}  // namespace

Result<void> export_hdf5(const std::filesystem::path& run_folder, std::filesystem::path file, bool force) {
  if (file.empty()) file = run_folder / "run.h5";
  std::error_code failed;
  if (!force && std::filesystem::exists(file, failed))
    return usage_error(fmt::format("{} is there already", file.string()), "give --force, or another --out");
  const auto function = load();
  if (!function) return tl::unexpected<Error>(function.error());
  std::array<char, hdf5::kProblemMax> problem{};
  const int status = (*function)(run_folder.c_str(), file.c_str(), IMUSCOPE_VERSION, problem.data());
  if (status == 2) return usage_error(problem.data());
  if (status != 0) return work_error(problem.data());
  say("{}\n", file.string());
  return {};
}

}  // namespace imuscope::cli
