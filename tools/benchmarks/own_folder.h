#pragma once

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <system_error>

namespace bench {

/// A new folder of this object's own inside another one, for what a measurement writes: nothing else lies in
/// it, and several runs at once do not meet. Goes with the object, with all that is in it; the other folder
/// stays.
class OwnFolder {
 public:
  /// `parent` is made where it does not exist. Throws std::system_error, which tells the folder.
  explicit OwnFolder(const std::filesystem::path& parent) {
    std::filesystem::create_directories(parent);
    std::string name = parent / "imuscope_XXXXXX";
    if (::mkdtemp(name.data()) == nullptr)
      throw std::system_error(errno, std::generic_category(),
                              parent.string() + ": no folder can be made in it");
    path_ = name;
  }
  OwnFolder(const OwnFolder&) = delete;
  OwnFolder& operator=(const OwnFolder&) = delete;
  ~OwnFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace bench
