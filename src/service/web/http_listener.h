#pragma once

/// What every HTTP server of ours does alike: it listens, holds a bounded number of connections, and answers once.
/// Boost.Beast takes long to compile: for the source of a server alone, which is built by itself.

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <chrono>
#include <cstddef>
#include <functional>
#include <list>
#include <memory>
#include <string_view>
#include <utility>

namespace imuscope::web {

using Request = boost::beast::http::request<boost::beast::http::empty_body>;
using Response = boost::beast::http::response<boost::beast::http::string_body>;

inline std::string_view view_of(boost::beast::string_view text) { return {text.data(), text.size()}; }

/// Accepts connections, so many at a time: one more, and the oldest goes.
/// @tparam Client  one connection, with read() and drop(); it lives as long as an operation of it is under way
template <class Client>
class HttpListener {
 public:
  using Socket = boost::asio::ip::tcp::socket;
  using Begin = std::function<std::shared_ptr<Client>(Socket&&)>;

  HttpListener(boost::asio::io_context& io, std::size_t clients_max, Begin begin)
      : acceptor_(io), again_(io), clients_max_(clients_max), begin_(std::move(begin)) {}

  /// Connections are accepted once `io` runs.
  [[nodiscard]] boost::beast::error_code open(const boost::asio::ip::tcp::endpoint& endpoint) {
    boost::beast::error_code error;
    acceptor_.open(endpoint.protocol(), error);
    if (!error) acceptor_.set_option(boost::asio::socket_base::reuse_address(true), error);
    if (!error) acceptor_.bind(endpoint, error);
    if (!error) acceptor_.listen(boost::asio::socket_base::max_listen_connections, error);
    if (!error) accept();
    return error;
  }
  [[nodiscard]] std::uint16_t port() const { return acceptor_.local_endpoint().port(); }

 private:
  static constexpr std::chrono::milliseconds kAcceptAgain{100};  // after the system had no socket left

  void accept() {
    acceptor_.async_accept([this](boost::beast::error_code error, Socket socket) {
      if (!error) {
        take(std::move(socket));
        return accept();
      }
      if (error == boost::asio::error::operation_aborted) return;
      again_.expires_after(kAcceptAgain);
      again_.async_wait([this](boost::beast::error_code stopped) {
        if (!stopped) accept();
      });
    });
  }

  void take(Socket&& socket) {
    clients_.remove_if([](const std::weak_ptr<Client>& one) { return one.expired(); });
    if (clients_.size() >= clients_max_) {
      if (const auto oldest = clients_.front().lock()) oldest->drop();
      clients_.pop_front();
    }
    const auto one = begin_(std::move(socket));
    clients_.push_back(one);
    one->read();
  }

  boost::asio::ip::tcp::acceptor acceptor_;
  boost::asio::steady_timer again_;
  std::size_t clients_max_;
  Begin begin_;
  std::list<std::weak_ptr<Client>> clients_;  // oldest first
};

/// Writes an answer and says that nothing follows it. To HEAD the header goes alone, which says how long the body is.
/// @param owner  whose stream it is, which lives until then
template <class Owner>
void answer(boost::beast::tcp_stream& stream, const Request& request, Response&& made,
            std::shared_ptr<Owner> owner, std::chrono::seconds patience) {
  namespace http = boost::beast::http;
  const auto response = std::make_shared<Response>(std::move(made));
  response->keep_alive(false);
  response->content_length(response->body().size());
  stream.expires_after(patience);
  const auto written = [&stream, owner = std::move(owner), response](boost::beast::error_code, std::size_t) {
    boost::beast::error_code ignored;
    stream.socket().shutdown(boost::asio::ip::tcp::socket::shutdown_send, ignored);
  };
  if (request.method() == http::verb::head) {
    const auto serializer = std::make_shared<http::response_serializer<http::string_body>>(*response);
    http::async_write_header(
        stream, *serializer,
        [written, serializer](boost::beast::error_code error, std::size_t n) { written(error, n); });
    return;
  }
  http::async_write(stream, *response, written);
}

}  // namespace imuscope::web
