#include "service/doors/metrics_server.h"

// Boost.Beast takes long to compile: this file is built alone.
#include <fmt/format.h>
#include <chrono>
#include <string_view>
#include <thread>
#include <utility>

#include "rt/host_clock.h"
#include "rt/thread_setup.h"
#include "service/doors/metrics_text.h"
#include "service/web/http_listener.h"
#include "service/web/request_rules.h"

namespace imuscope {

namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using asio::ip::tcp;
using beast::error_code;

using web::Request;
using web::Response;
using web::view_of;

/// What a client may say; a request has some hundred bytes.
constexpr std::uint32_t kRequestMax = 16 * 1024;
constexpr const char* kPlainText = "text/plain; charset=utf-8";

/// A client that names no host is no browser, where a page could have its own name lead here.
bool is_of_this_pc(std::string_view host) { return host.empty() || web::is_host_allowed(host, {}); }

}  // namespace

struct MetricsServer::Impl {
  class Client;

  explicit Impl(const StatusBoard& from) : board(from) {}
  ~Impl() {
    io.stop();
    if (thread.joinable()) thread.join();
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  std::shared_ptr<Client> begin(tcp::socket&& socket);
  void serve() {
    (void)setup_this_thread({kMetricsThreadName, Scheduling::kNormal, 0, {}});
    io.run();
  }

  const StatusBoard& board;
  bool is_loopback = true;
  asio::io_context io{1};
  web::HttpListener<Client> listener{io, kClientsMax,
                                     [this](tcp::socket&& socket) { return begin(std::move(socket)); }};
  std::thread thread;
};

/// One connection: one request, one answer. Lives as long as an operation of it is under way.
class MetricsServer::Impl::Client : public std::enable_shared_from_this<Client> {
 public:
  Client(const Impl& server, tcp::socket&& socket) : server_(server), stream_(std::move(socket)) {
    parser_.header_limit(kRequestMax);
    parser_.body_limit(0);  // nobody has anything to tell
  }

  void read() {
    stream_.expires_after(std::chrono::seconds(kPatience_s));
    http::async_read(stream_, buffer_, parser_, [self = shared_from_this()](error_code error, std::size_t) {
      if (!error) self->answer();
    });
  }

  void drop() {
    error_code ignored;
    stream_.socket().close(ignored);
  }

 private:
  void answer() {
    const Request request = parser_.release();
    if (server_.is_loopback && !is_of_this_pc(view_of(request[http::field::host])))
      return reply(request, http::status::forbidden, "ask this PC by its address or as localhost\n");
    if (request.method() != http::verb::get && request.method() != http::verb::head)
      return reply(request, http::status::method_not_allowed, "GET alone\n");
    if (request.target() != "/metrics") return reply(request, http::status::not_found, "see /metrics\n");
    const auto posted = server_.board.newest();
    if (!posted) return reply(request, http::status::service_unavailable, "the run has just begun\n");
    reply(request, http::status::ok, metrics_text(posted->status, to_seconds(host_now() - posted->at)),
          kMetricsContentType);
  }

  void reply(const Request& request, http::status status, std::string text, const char* type = kPlainText) {
    Response response(status, request.version());
    response.set(http::field::content_type, type);
    response.body() = std::move(text);
    web::answer(stream_, request, std::move(response), shared_from_this(), std::chrono::seconds(kPatience_s));
  }

  const Impl& server_;
  beast::tcp_stream stream_;
  beast::flat_buffer buffer_{kRequestMax};
  http::request_parser<http::empty_body> parser_;
};

std::shared_ptr<MetricsServer::Impl::Client> MetricsServer::Impl::begin(tcp::socket&& socket) {
  return std::make_shared<Client>(*this, std::move(socket));
}

MetricsServer::MetricsServer(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
MetricsServer::~MetricsServer() = default;

Result<std::unique_ptr<MetricsServer>> MetricsServer::open(const std::string& address, std::uint16_t port,
                                                           const StatusBoard& board) {
  error_code error;
  const auto parsed = asio::ip::make_address(address, error);
  if (error)
    return usage_error(fmt::format("[metrics] address = '{}' is no address", address),
                       "give 127.0.0.1, ::1 or an address of this PC; 0.0.0.0 is all of them");
  auto impl = std::make_unique<Impl>(board);
  impl->is_loopback = parsed.is_loopback();
  if (error = impl->listener.open({parsed, port}); error)
    return work_error(
        fmt::format("metrics cannot be offered at {} port {} ({})", address, port, error.message()),
        "choose another port in [metrics]; ss -ltnp shows who has it");
  impl->thread = std::thread([raw = impl.get()] { raw->serve(); });
  return std::unique_ptr<MetricsServer>(new MetricsServer(std::move(impl)));
}

namespace {

constexpr std::string_view kOwnFirstFamily = "# HELP imuscope_info";
/// All of a run's metrics have some ten kilobytes.
constexpr std::size_t kPageMax = std::size_t{1} << 20U;

/// Asks for /metrics, and keeps what is answered.
class Visitor {
 public:
  explicit Visitor(asio::io_context& io) : stream_(io) {
    request_.set(http::field::host, "localhost");
    parser_.body_limit(kPageMax);
  }

  void ask(const tcp::endpoint& endpoint) {
    stream_.expires_after(std::chrono::seconds(MetricsServer::kPatience_s));
    stream_.async_connect(endpoint, [this](error_code refused) {
      if (refused) return;
      http::async_write(stream_, request_, [this](error_code unsent, std::size_t) {
        if (unsent) return;
        http::async_read(stream_, buffer_, parser_,
                         [this](error_code cut, std::size_t) { is_whole_ = !cut; });
      });
    });
  }
  [[nodiscard]] bool met_a_run() const {
    return is_whole_ && std::string_view(parser_.get().body()).starts_with(kOwnFirstFamily);
  }

 private:
  beast::tcp_stream stream_;
  Request request_{http::verb::get, "/metrics", 11};
  beast::flat_buffer buffer_{kPageMax};
  http::response_parser<http::string_body> parser_;
  bool is_whole_ = false;
};

}  // namespace

bool offers_metrics(const std::string& address, std::uint16_t port) {
  error_code error;
  auto parsed = asio::ip::make_address(address, error);
  if (error) return false;
  // What is offered at every address is offered at this PC's own.
  if (parsed.is_unspecified())
    parsed = parsed.is_v6() ? asio::ip::address(asio::ip::address_v6::loopback())
                            : asio::ip::address(asio::ip::address_v4::loopback());
  asio::io_context io{1};
  Visitor visitor(io);
  visitor.ask({parsed, port});
  io.run();
  return visitor.met_a_run();
}

}  // namespace imuscope
