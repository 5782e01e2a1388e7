#include "doors/metrics_server.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <microhttpd.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <cerrno>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>

#include "doors/metrics_text.h"
#include "rt/host_clock.h"

namespace imuscope {

namespace {

/// Of one connection; a request has some hundred bytes.
constexpr std::size_t kMemoryPerClient = 16 * 1024;
constexpr std::size_t kStackBytes = 256 * 1024;

struct Address {
  sockaddr_storage storage{};
  bool is_ipv6 = false;
  bool is_loopback = false;
};

std::optional<Address> parse(const std::string& text, std::uint16_t port) {
  Address address;
  auto& v4 = reinterpret_cast<sockaddr_in&>(address.storage);
  if (inet_pton(AF_INET, text.c_str(), &v4.sin_addr) == 1) {
    constexpr std::uint32_t kLoopbackNet = 127;
    v4.sin_family = AF_INET;
    v4.sin_port = htons(port);
    address.is_loopback = ntohl(v4.sin_addr.s_addr) >> 24U == kLoopbackNet;
    return address;
  }
  auto& v6 = reinterpret_cast<sockaddr_in6&>(address.storage);
  if (inet_pton(AF_INET6, text.c_str(), &v6.sin6_addr) == 1) {
    v6.sin6_family = AF_INET6;
    v6.sin6_port = htons(port);
    address.is_ipv6 = true;
    address.is_loopback = IN6_IS_ADDR_LOOPBACK(&v6.sin6_addr);
    return address;
  }
  return std::nullopt;
}

/// Whether a Host header is this PC's own name for itself. A client without one is no browser.
bool is_of_this_pc(const char* host) {
  if (host == nullptr) return true;
  const std::string_view text(host);
  if (text.starts_with("[::1]")) return true;
  const auto name = text.substr(0, text.find(':'));
  return name == "localhost" || name.starts_with("127.");
}

}  // namespace

struct MetricsServer::Impl {
  explicit Impl(const StatusBoard& from) : board(from) {}
  ~Impl() {
    if (daemon != nullptr) MHD_stop_daemon(daemon);
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  static MHD_Result on_request(void* self, MHD_Connection* connection, const char* url, const char* method,
                               const char* /*version*/, const char* /*body*/, std::size_t* body_size,
                               void** /*of_request*/) {
    // Nobody has anything to tell: what is sent is read and forgotten, up to the memory of a client.
    if (*body_size != 0) return MHD_NO;
    return static_cast<const Impl*>(self)->answer(connection, url, method);
  }

  MHD_Result answer(MHD_Connection* connection, std::string_view url, std::string_view method) const {
    if (is_loopback &&
        !is_of_this_pc(MHD_lookup_connection_value(connection, MHD_HEADER_KIND, MHD_HTTP_HEADER_HOST)))
      return reply(connection, MHD_HTTP_FORBIDDEN, "ask this PC by its address or as localhost\n");
    if (method != MHD_HTTP_METHOD_GET && method != MHD_HTTP_METHOD_HEAD)
      return reply(connection, MHD_HTTP_METHOD_NOT_ALLOWED, "GET alone\n");
    if (url != "/metrics") return reply(connection, MHD_HTTP_NOT_FOUND, "see /metrics\n");
    const auto posted = board.newest();
    if (!posted) return reply(connection, MHD_HTTP_SERVICE_UNAVAILABLE, "the run has just begun\n");
    return reply(connection, MHD_HTTP_OK, metrics_text(posted->status, to_seconds(host_now() - posted->at)),
                 kMetricsContentType);
  }

  static MHD_Result reply(MHD_Connection* connection, unsigned status, std::string text,
                          const char* type = "text/plain; charset=utf-8") {
    MHD_Response* const response =
        MHD_create_response_from_buffer(text.size(), text.data(), MHD_RESPMEM_MUST_COPY);
    if (response == nullptr) return MHD_NO;
    MHD_add_response_header(response, MHD_HTTP_HEADER_CONTENT_TYPE, type);
    MHD_add_response_header(response, MHD_HTTP_HEADER_CONNECTION, "close");
    const MHD_Result queued = MHD_queue_response(connection, status, response);
    MHD_destroy_response(response);
    return queued;
  }

  const StatusBoard& board;
  bool is_loopback = true;
  MHD_Daemon* daemon = nullptr;
};

MetricsServer::MetricsServer(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
MetricsServer::~MetricsServer() = default;

Result<std::unique_ptr<MetricsServer>> MetricsServer::open(const std::string& address, std::uint16_t port,
                                                           const StatusBoard& board) {
  const auto parsed = parse(address, port);
  if (!parsed)
    return usage_error(fmt::format("[metrics] address = '{}' is no address", address),
                       "give 127.0.0.1, ::1 or an address of this PC; 0.0.0.0 is all of them");
  auto impl = std::make_unique<Impl>(board);
  impl->is_loopback = parsed->is_loopback;
  unsigned flags = MHD_USE_POLL_INTERNAL_THREAD;
  if (parsed->is_ipv6) flags |= MHD_USE_IPv6;
  errno = 0;
  impl->daemon =
      MHD_start_daemon(flags, port, nullptr, nullptr, &Impl::on_request, impl.get(), MHD_OPTION_SOCK_ADDR,
                       &parsed->storage, MHD_OPTION_CONNECTION_LIMIT, kClientsMax,
                       MHD_OPTION_CONNECTION_TIMEOUT, kPatience_s, MHD_OPTION_CONNECTION_MEMORY_LIMIT,
                       kMemoryPerClient, MHD_OPTION_THREAD_STACK_SIZE, kStackBytes, MHD_OPTION_END);
  if (impl->daemon == nullptr)
    return work_error(fmt::format("metrics cannot be offered at {} port {} ({})", address, port,
                                  std::generic_category().message(errno)),
                      "choose another port in [metrics]; ss -ltnp shows who has it");
  return std::unique_ptr<MetricsServer>(new MetricsServer(std::move(impl)));
}

}  // namespace imuscope
