#pragma once

/// Who is answered. A browser runs scripts of every page that its user has open: such a script can
/// reach a server on this PC, and a name of its own can lead there. Pure functions of what a request says.

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace imuscope::web {

/// Names by which a server may be asked for, beside numeric addresses and localhost: a name that leads here
/// by somebody else's name server is none of them.
struct HostNames {
  std::vector<std::string> names;  ///< in lower case
  bool loopback_alone = true;      ///< numeric addresses other than this PC's own loopback are refused
};

/// @param host  a Host header: name or address, and perhaps a port
[[nodiscard]] bool is_host_allowed(std::string_view host, const HostNames& known);

/// Whether a script of that origin comes from the server's own page: http:// and the same Host.
[[nodiscard]] bool is_own_origin(std::string_view origin, std::string_view host);

/// Path of a request's target, without its query.
[[nodiscard]] std::string_view path_of(std::string_view target);

/// The token in the query of a target, "?token=..."; empty where there is none.
[[nodiscard]] std::string_view token_of(std::string_view target);

/// Takes as long for every wrong token of a length.
[[nodiscard]] bool is_same_token(std::string_view given, std::string_view wanted);

/// A token is 8 to 128 letters of ASCII, digits, '-', '_', '.' or '~': what a URL holds without escapes.
[[nodiscard]] bool is_token(std::string_view text);

}  // namespace imuscope::web
