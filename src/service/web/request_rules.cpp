#include "service/web/request_rules.h"

#include <arpa/inet.h>
#include <algorithm>
#include <cstddef>

namespace imuscope::web {

namespace {

constexpr std::size_t kLongestHost = 261;  // a name of DNS, ':' and a port
constexpr std::size_t kTokenMin = 8;
constexpr std::size_t kTokenMax = 128;

char lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

std::string in_lower_case(std::string_view text) {
  std::string out(text);
  std::transform(out.begin(), out.end(), out.begin(), lower);
  return out;
}

/// What stands before the port; nothing where what follows is no port.
std::optional<std::string> name_of(std::string_view host) {
  if (host.empty() || host.size() > kLongestHost) return std::nullopt;
  std::size_t end = 0;
  if (host.front() == '[') {
    end = host.find(']');
    if (end == std::string_view::npos) return std::nullopt;
    ++end;
  } else {
    end = std::min(host.find(':'), host.size());
  }
  const std::string_view port = host.substr(end);
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  if (!port.empty() && (port.front() != ':' || port.size() < 2 || port.size() > 6 ||
                        !std::all_of(port.begin() + 1, port.end(), is_digit)))
    return std::nullopt;
  return in_lower_case(host.substr(0, end));
}

}  // namespace

bool is_host_allowed(std::string_view host, const HostNames& known) {
  const auto name = name_of(host);
  if (!name) return false;
  if (*name == "localhost") return true;
  if (std::find(known.names.begin(), known.names.end(), *name) != known.names.end()) return true;
  in_addr v4{};
  if (inet_pton(AF_INET, name->c_str(), &v4) == 1) {
    constexpr std::uint32_t kLoopbackNet = 127;
    return !known.loopback_alone || ntohl(v4.s_addr) >> 24U == kLoopbackNet;
  }
  if (name->size() < 2 || name->front() != '[') return false;
  in6_addr v6{};
  if (inet_pton(AF_INET6, name->substr(1, name->size() - 2).c_str(), &v6) != 1) return false;
  return !known.loopback_alone || IN6_IS_ADDR_LOOPBACK(&v6);
}

bool is_own_origin(std::string_view origin, std::string_view host) {
  constexpr std::string_view kScheme = "http://";
  if (host.empty() || !origin.starts_with(kScheme)) return false;
  return in_lower_case(origin.substr(kScheme.size())) == in_lower_case(host);
}

std::string_view path_of(std::string_view target) { return target.substr(0, target.find('?')); }

std::string_view token_of(std::string_view target) {
  constexpr std::string_view kKey = "token=";
  const std::size_t question = target.find('?');
  if (question == std::string_view::npos) return {};
  std::string_view rest = target.substr(question + 1);
  while (!rest.empty()) {
    const std::string_view pair = rest.substr(0, rest.find('&'));
    if (pair.starts_with(kKey)) return pair.substr(kKey.size());
    rest.remove_prefix(std::min(rest.size(), pair.size() + 1));
  }
  return {};
}

bool is_same_token(std::string_view given, std::string_view wanted) {
  if (given.size() != wanted.size()) return false;
  unsigned different = 0;
  for (std::size_t i = 0; i < given.size(); ++i)
    different |= static_cast<unsigned char>(given[i]) ^ static_cast<unsigned char>(wanted[i]);
  return different == 0;
}

bool is_token(std::string_view text) {
  return text.size() >= kTokenMin && text.size() <= kTokenMax &&
         std::all_of(text.begin(), text.end(), [](char c) {
           return (c >= '0' && c <= '9') || (lower(c) >= 'a' && lower(c) <= 'z') || c == '-' || c == '_' ||
                  c == '.' || c == '~';
         });
}

}  // namespace imuscope::web
