#include "fleet/content_hash.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <openssl/evp.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <memory>

#include "base/output_folder.h"

namespace imuscope::fleet {
namespace {

constexpr std::size_t kKeyDigits = 24;
constexpr std::size_t kProgramDigits = 12;
constexpr std::size_t kBlock = std::size_t{1} << 20U;

/// SHA-256 of what is added piece by piece.
class Sha256 {
 public:
  Sha256() : context_(EVP_MD_CTX_new(), &EVP_MD_CTX_free) {
    EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr);
  }
  void add(const void* bytes, std::size_t n) { EVP_DigestUpdate(context_.get(), bytes, n); }
  void add(std::string_view text) { add(text.data(), text.size()); }
  [[nodiscard]] std::string hex() {
    std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
    unsigned int size = 0;
    EVP_DigestFinal_ex(context_.get(), digest.data(), &size);
    std::string out;
    for (unsigned int i = 0; i < size; ++i) out += fmt::format("{:02x}", digest[i]);
    return out;
  }

 private:
  std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context_;
};

Result<void> add_file(Sha256& hash, const std::filesystem::path& file, std::vector<char>& block) {
  const Descriptor in(::open(file.c_str(), O_RDONLY | O_CLOEXEC));
  std::size_t total = 0;
  while (in.is_open()) {
    const ssize_t n = ::read(in.get(), block.data(), block.size());
    if (n == 0) {
      hash.add(fmt::format("\n{} bytes\n", total));
      return {};
    }
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) break;
    hash.add(block.data(), static_cast<std::size_t>(n));
    total += static_cast<std::size_t>(n);
  }
  return work_error(fmt::format("{} cannot be read: {}", file.string(), std::strerror(errno)));
}

}  // namespace

std::string sha256_of(std::string_view content) {
  Sha256 hash;
  hash.add(content);
  return hash.hex();
}

Result<std::string> sha256_of_files(const std::vector<std::filesystem::path>& files) {
  Sha256 hash;
  std::vector<char> block(kBlock);
  for (const auto& file : files) {
    if (auto added = add_file(hash, file, block); !added) return tl::unexpected<Error>(added.error());
  }
  return hash.hex();
}

std::string program_identity(std::string_view version) {
  const auto hash = sha256_of_files({"/proc/self/exe"});
  return fmt::format("{}+{}", version, hash ? hash->substr(0, kProgramDigits) : "unknown");
}

std::string key_of(const std::vector<std::string>& parts) {
  std::string all;
  for (const auto& part : parts) all += fmt::format("{}:{}\n", part.size(), part);
  return sha256_of(all).substr(0, kKeyDigits);
}

}  // namespace imuscope::fleet
