#include "view/view_server.h"

// Boost.Beast takes long to compile: this file is built alone.
#include <unistd.h>
#include <array>
#include <boost/asio/post.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <deque>
#include <mutex>
#include <set>
#include <thread>
#include <utility>

#include "base/text.h"
#include "service/web/http_listener.h"
#include "service/web/request_rules.h"
#include "view/content_policy.h"
#include "view/page_command.h"

namespace imuscope::view {

namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using asio::ip::tcp;
using beast::error_code;
using std::chrono::seconds;
using std::chrono::steady_clock;

using web::Request;
using web::Response;
using web::view_of;
using Part = std::shared_ptr<const std::string>;

/// What the system keeps for a page that takes nothing: more would only be older.
constexpr int kSendBufferBytes = 128 * 1024;

/// This PC's own names, lower case.
std::vector<std::string> own_names() {
  std::array<char, 256> buffer{};
  if (gethostname(buffer.data(), buffer.size() - 1) != 0) return {};
  std::string name = buffer.data();
  for (char& c : name)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  if (name.empty()) return {};
  return {name, name + ".local"};
}

}  // namespace

struct ViewServer::Impl {
  class Asking;
  class Page;

  Impl(const ViewDoor& door_in, std::string page_in, Whole whole_in, Said said_in)
      : door(door_in),
        page(std::move(page_in)),
        policy(content_policy(page)),
        whole(std::move(whole_in)),
        said(std::move(said_in)),
        hosts{own_names(), true} {}
  ~Impl() {
    io.stop();
    if (thread.joinable()) thread.join();
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  Result<void> listen();
  std::shared_ptr<Asking> begin(tcp::socket&& socket);
  void count(const std::function<void(ViewCounters&)>& change) {
    const std::scoped_lock lock(counters_mutex);
    change(counters);
  }

  ViewDoor door;
  std::string page;
  std::string policy;
  Whole whole;
  Said said;
  web::HostNames hosts;
  std::uint16_t port = 0;
  // Connections hold sockets of io: they go first.
  asio::io_context io{1};
  web::HttpListener<Asking> listener{io, kAskingMax,
                                     [this](tcp::socket&& socket) { return begin(std::move(socket)); }};
  std::set<std::shared_ptr<Page>> pages;
  std::thread thread;
  std::mutex counters_mutex;
  ViewCounters counters;
};

/// A browser that has the page open. Lives as long as it is in the server's list or an operation is under
/// way.
class ViewServer::Impl::Page : public std::enable_shared_from_this<Page> {
 public:
  Page(Impl& server, beast::tcp_stream&& stream) : server_(server), socket_(std::move(stream)) {}

  void open(const Request& request) {
    beast::get_lowest_layer(socket_).expires_never();  // the websocket has timers of its own
    websocket::stream_base::timeout patience{};
    patience.handshake_timeout = seconds(kPatience_s);
    patience.idle_timeout = seconds(kSilence_s);
    patience.keep_alive_pings = true;
    socket_.set_option(patience);
    socket_.read_message_max(kPageMessageMax);
    socket_.text(true);
    socket_.auto_fragment(false);  // a part is a frame
    socket_.async_accept(request, [self = shared_from_this()](error_code error) {
      if (error) return self->close();
      self->is_open_ = true;
      self->server_.count([](ViewCounters& c) { ++c.pages_opened; });
      self->is_behind_ = true;  // it knows nothing yet
      self->write_next();
      self->read_next();
    });
  }

  void send(const Part& part) {
    if (!is_open_) return;
    if (is_behind_) {  // it gets the whole picture, which holds this part
      server_.count([](ViewCounters& c) { ++c.parts_left_out; });
    } else if (queue_.size() >= kQueueMax) {
      server_.count([n = queue_.size()](ViewCounters& c) { c.parts_left_out += n; });
      queue_.clear();
      is_behind_ = true;
    } else {
      queue_.push_back(part);
    }
    write_next();
  }

  void close() {
    is_open_ = false;
    server_.pages.erase(shared_from_this());
    server_.count([n = server_.pages.size()](ViewCounters& c) { c.pages = n; });
    error_code ignored;
    beast::get_lowest_layer(socket_).socket().close(ignored);
  }

 private:
  void write_next() {
    if (writing_ || !is_open_) return;
    if (is_behind_) {
      writing_ = std::make_shared<const std::string>(server_.whole());
      is_behind_ = false;
    } else if (!queue_.empty()) {
      writing_ = std::move(queue_.front());
      queue_.pop_front();
    } else {
      return;
    }
    socket_.async_write(asio::buffer(*writing_), [self = shared_from_this()](error_code error, std::size_t) {
      self->writing_.reset();
      if (error) return self->close();
      self->write_next();
    });
  }

  void read_next() {
    socket_.async_read(buffer_, [self = shared_from_this()](error_code error, std::size_t) {
      if (error) {
        if (error != websocket::error::closed && self->is_open_)
          self->server_.count([](ViewCounters& c) { ++c.clients_dropped; });
        return self->close();
      }
      if (!self->socket_.got_text() || self->is_flooding()) {
        self->server_.count([](ViewCounters& c) { ++c.clients_dropped; });
        return self->close();
      }
      const auto bytes = self->buffer_.cdata();
      self->server_.said({static_cast<const char*>(bytes.data()), bytes.size()});
      self->buffer_.consume(self->buffer_.size());
      self->read_next();
    });
  }

  bool is_flooding() {
    const auto now = steady_clock::now();
    if (now - second_ >= seconds(1)) {
      second_ = now;
      messages_ = 0;
    }
    return ++messages_ > kMessagesPerSecond;
  }

  Impl& server_;
  websocket::stream<beast::tcp_stream> socket_;
  beast::flat_buffer buffer_;
  std::deque<Part> queue_;
  Part writing_;
  bool is_open_ = false;
  bool is_behind_ = false;
  steady_clock::time_point second_{};
  int messages_ = 0;
};

/// A connection that is no page yet: one request, one answer.
class ViewServer::Impl::Asking : public std::enable_shared_from_this<Asking> {
 public:
  Asking(Impl& server, tcp::socket&& socket) : server_(server), stream_(std::move(socket)) {
    parser_.header_limit(kHeaderMax);
    parser_.body_limit(0);
  }

  void read() {
    stream_.expires_after(seconds(kPatience_s));
    http::async_read(stream_, buffer_, parser_, [self = shared_from_this()](error_code error, std::size_t) {
      if (error) {
        if (error != http::error::end_of_stream)
          self->server_.count([](ViewCounters& c) { ++c.clients_dropped; });
        return;
      }
      self->answer();
    });
  }

  void drop() {
    error_code ignored;
    stream_.socket().close(ignored);
  }

 private:
  void answer() {
    const Request request = parser_.release();
    const auto target = view_of(request.target());
    const auto host = view_of(request[http::field::host]);
    if (!web::is_host_allowed(host, server_.hosts))
      return refuse(request, http::status::forbidden, "ask this PC by its address or its own name\n");
    const auto origin = request.find(http::field::origin);
    if (origin != request.end() && !web::is_own_origin(view_of(origin->value()), host))
      return refuse(request, http::status::forbidden, "a page of another origin may not ask\n");
    if (!server_.door.token.empty() && !web::is_same_token(web::token_of(target), server_.door.token))
      return refuse(request, http::status::unauthorized,
                    "this page wants the token that `imuscope view` was started with: /?token=...\n");
    if (web::path_of(target) == "/live") return upgrade(request);
    if (request.method() != http::verb::get && request.method() != http::verb::head)
      return refuse(request, http::status::method_not_allowed, "GET alone\n");
    if (web::path_of(target) != "/")
      return refuse(request, http::status::not_found, "there is one page: /\n");
    reply(request, http::status::ok, server_.page, "text/html; charset=utf-8");
  }

  void upgrade(const Request& request) {
    if (!websocket::is_upgrade(request))
      return refuse(request, http::status::upgrade_required, "a websocket alone\n");
    if (server_.pages.size() >= kPagesMax)
      return refuse(request, http::status::service_unavailable, "too many pages are open\n");
    const auto page = std::make_shared<Page>(server_, std::move(stream_));
    server_.pages.insert(page);
    server_.count([n = server_.pages.size()](ViewCounters& c) { c.pages = n; });
    page->open(request);
  }

  void refuse(const Request& request, http::status status, std::string_view why) {
    server_.count([](ViewCounters& c) { ++c.requests_refused; });
    reply(request, status, std::string(why), "text/plain; charset=utf-8");
  }

  void reply(const Request& request, http::status status, std::string body, const char* type) {
    Response response(status, request.version());
    response.set(http::field::content_type, type);
    response.set(http::field::cache_control, "no-store");
    response.set("Content-Security-Policy", server_.policy);
    response.set(http::field::x_frame_options, "DENY");
    response.set("X-Content-Type-Options", "nosniff");
    response.set("Referrer-Policy", "no-referrer");
    response.set("Cross-Origin-Opener-Policy", "same-origin");
    response.set("Cross-Origin-Resource-Policy", "same-origin");
    response.body() = std::move(body);
    web::answer(stream_, request, std::move(response), shared_from_this(), seconds(kPatience_s));
  }

  Impl& server_;
  beast::tcp_stream stream_;
  beast::flat_buffer buffer_{kHeaderMax};
  http::request_parser<http::empty_body> parser_;
};

Result<void> ViewServer::Impl::listen() {
  if (!door.token.empty() && !web::is_token(door.token))
    return usage_error("this is no token for a page", "give 8 to 128 letters, digits, '-', '_', '.' or '~'");
  error_code error;
  const auto address = asio::ip::make_address(door.address, error);
  if (error)
    return usage_error("'" + one_line(door.address) + "' is no address to open the page at",
                       "give 127.0.0.1, ::1 or an address of this PC; 0.0.0.0 is all of them");
  hosts.loopback_alone = address.is_loopback();
  error = listener.open({address, door.port});
  if (error)
    return work_error("the page cannot be opened at " + door.address + " port " + std::to_string(door.port) +
                          " (" + error.message() + ")",
                      "choose another --port; ss -ltnp shows who has it");
  port = listener.port();
  thread = std::thread([this] { io.run(); });
  return {};
}

std::shared_ptr<ViewServer::Impl::Asking> ViewServer::Impl::begin(tcp::socket&& socket) {
  error_code ignored;
  socket.set_option(tcp::no_delay(true), ignored);
  socket.set_option(asio::socket_base::send_buffer_size(kSendBufferBytes), ignored);
  return std::make_shared<Asking>(*this, std::move(socket));
}

ViewServer::ViewServer(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
ViewServer::~ViewServer() = default;

Result<std::unique_ptr<ViewServer>> ViewServer::open(const ViewDoor& door, std::string page, Whole whole,
                                                     Said said) {
  auto impl = std::make_unique<Impl>(door, std::move(page), std::move(whole), std::move(said));
  if (auto listening = impl->listen(); !listening) return tl::unexpected<Error>(listening.error());
  return std::unique_ptr<ViewServer>(new ViewServer(std::move(impl)));
}

void ViewServer::send(std::string part) {
  asio::post(impl_->io, [impl = impl_.get(), part = std::make_shared<const std::string>(std::move(part))] {
    const auto pages = impl->pages;  // one that fails leaves the list
    for (const auto& page : pages) page->send(part);
  });
}

std::uint16_t ViewServer::port() const noexcept { return impl_->port; }

ViewCounters ViewServer::counters() const {
  const std::scoped_lock lock(impl_->counters_mutex);
  return impl_->counters;
}

}  // namespace imuscope::view
