// SPDX-License-Identifier: Apache-2.0
#include "tests/support/socket_client.h"

#include <netdb.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <utility>

namespace relievo::test {
namespace {

std::chrono::milliseconds left_until(std::chrono::steady_clock::time_point deadline) {
  return std::chrono::duration_cast<std::chrono::milliseconds>(deadline - std::chrono::steady_clock::now());
}

bool is_v6(const std::string& address) {
  return address.find(':') != std::string::npos;
}

}  // namespace

TcpClient::TcpClient(std::uint16_t port, int receive_buffer_bytes)
    : fd_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  if (receive_buffer_bytes > 0) {
    setsockopt(fd_, SOL_SOCKET, SO_RCVBUF, &receive_buffer_bytes, sizeof receive_buffer_bytes);
  }
  connect_to("127.0.0.1", port);
}

TcpClient::TcpClient(const std::string& address, std::uint16_t port, std::chrono::milliseconds patience)
    : fd_(socket(is_v6(address) ? AF_INET6 : AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  timeval time{};
  time.tv_sec = std::chrono::duration_cast<std::chrono::seconds>(patience).count();
  time.tv_usec = std::chrono::duration_cast<std::chrono::microseconds>(patience % 1s).count();
  setsockopt(fd_, SOL_SOCKET, SO_SNDTIMEO, &time, sizeof time);  // connect(2) keeps it too
  connect_to(address, port);
}

void TcpClient::connect_to(const std::string& address, std::uint16_t port) {
  addrinfo* place = nullptr;
  addrinfo numbers{};
  numbers.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV;
  numbers.ai_socktype = SOCK_STREAM;
  const bool known = getaddrinfo(address.c_str(), std::to_string(port).c_str(), &numbers, &place) == 0;
  const bool connected = known && connect(fd_, place->ai_addr, place->ai_addrlen) == 0;
  if (known) freeaddrinfo(place);
  if (connected) return;
  close(fd_);
  fd_ = -1;
}

TcpClient::TcpClient(TcpClient&& other) noexcept
    : fd_(std::exchange(other.fd_, -1)), at_end_(other.at_end_), buffer_(std::move(other.buffer_)) {}

TcpClient::~TcpClient() {
  if (fd_ >= 0) close(fd_);
}

bool TcpClient::send(const std::string& bytes) {
  std::size_t done = 0;
  while (done < bytes.size()) {
    const auto n = ::send(fd_, bytes.data() + done, bytes.size() - done, MSG_NOSIGNAL);
    if (n <= 0) return false;
    done += static_cast<std::size_t>(n);
  }
  return true;
}

bool TcpClient::receive(std::chrono::milliseconds timeout) {
  if (fd_ < 0 || at_end_) return false;
  pollfd waiting{fd_, POLLIN, 0};
  if (!has_more() && poll(&waiting, 1, static_cast<int>(timeout.count())) <= 0) return false;
  std::string chunk(65536, '\0');
  const auto n = read(chunk.data(), chunk.size());
  if (n <= 0) {
    at_end_ = true;
    return false;
  }
  buffer_.append(chunk, 0, static_cast<std::size_t>(n));
  return true;
}

long TcpClient::read(char* into, std::size_t bytes) {
  return recv(fd_, into, bytes, 0);
}

Response read_response(TcpClient& client, bool head) {
  Response response;
  std::string& buffer = client.buffer();
  std::size_t end;
  while ((end = buffer.find("\r\n\r\n")) == std::string::npos) {
    if (!client.receive()) return response;
  }
  std::size_t line = buffer.find("\r\n");
  response.status = std::stoi(buffer.substr(9, 3));
  while (line < end) {
    const std::size_t next = buffer.find("\r\n", line + 2);
    const std::string field = buffer.substr(line + 2, next - line - 2);
    const std::size_t colon = field.find(": ");
    std::string name = field.substr(0, colon);
    std::transform(name.begin(), name.end(), name.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    response.headers[name] = field.substr(colon + 2);
    line = next;
  }
  buffer.erase(0, end + 4);
  const auto length = response.headers.find("content-length");
  if (head || length == response.headers.end()) return response;
  const std::size_t size = std::stoul(length->second);
  while (buffer.size() < size && client.receive()) {
  }
  response.body = buffer.substr(0, size);
  buffer.erase(0, size);
  return response;
}

Response request(std::uint16_t port, const std::string& method, const std::string& target,
                 const std::string& headers) {
  TcpClient client(port);
  return request(client, port, method, target, headers);
}

Response request(TcpClient& client, std::uint16_t port, const std::string& method, const std::string& target,
                 const std::string& headers) {
  if (!client.connected()) return {};
  client.send(method + " " + target + " HTTP/1.1\r\nHost: 127.0.0.1:" + std::to_string(port) +
              "\r\nConnection: close\r\n" + headers + "\r\n");
  return read_response(client, method == "HEAD");
}

Response post_json(std::uint16_t port, const std::string& target, const std::string& body,
                   const std::string& headers) {
  TcpClient client(port);
  if (!client.connected()) return {};
  client.send("POST " + target + " HTTP/1.1\r\nHost: 127.0.0.1:" + std::to_string(port) +
              "\r\nConnection: close\r\nContent-Type: application/json\r\nContent-Length: " +
              std::to_string(body.size()) + "\r\n" + headers + "\r\n" + body);
  return read_response(client);
}

std::string ws_message(const std::string& text, int opcode) {
  std::string frame(1, static_cast<char>(0x80 | opcode));
  if (text.size() < 126) {
    frame += static_cast<char>(0x80 | text.size());
  } else {
    frame += static_cast<char>(0x80 | 126);
    frame += static_cast<char>(text.size() >> 8);
    frame += static_cast<char>(text.size() & 0xff);
  }
  const char mask[4] = {0x11, 0x22, 0x33, 0x44};
  frame.append(mask, 4);
  for (std::size_t i = 0; i < text.size(); ++i) frame += static_cast<char>(text[i] ^ mask[i % 4]);
  return frame;
}

WsClient::WsClient(std::uint16_t port, const std::string& stream, const std::string& headers,
                   int receive_buffer_bytes)
    : WsClient(std::make_unique<TcpClient>(port, receive_buffer_bytes), port, "/ws/" + stream, headers) {}

WsClient::WsClient(std::unique_ptr<TcpClient> tcp, std::uint16_t port, const std::string& target,
                   const std::string& headers, const std::string& early)
    : tcp_(std::move(tcp)) {
  if (!tcp_->connected()) return;
  tcp_->send(
      "GET " + target + " HTTP/1.1\r\nHost: 127.0.0.1:" + std::to_string(port) +
      "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
      "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Extensions: permessage-deflate\r\n" +
      headers + "\r\n" + early);
  const Response response = read_response(*tcp_);
  status_ = response.status;
  if (const auto agreed = response.headers.find("sec-websocket-protocol"); agreed != response.headers.end())
    subprotocol_ = agreed->second;
  if (response.headers.count("sec-websocket-extensions") != 0) status_ = -1;  // nobody asked for deflate here
}

bool WsClient::send(const std::string& text, int opcode) {
  return tcp_->send(ws_message(text, opcode));
}

std::optional<WsMessage> WsClient::next(std::chrono::milliseconds timeout) {
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  std::string& buffer = tcp_->buffer();
  const auto need = [&](std::size_t bytes) {
    while (buffer.size() < bytes) {
      const auto left = left_until(deadline);
      if (left < 0ms || !tcp_->receive(left)) return false;
    }
    return true;
  };
  for (;;) {
    if (!need(2)) return std::nullopt;
    const int opcode = buffer[0] & 0x0f;
    std::size_t size = static_cast<unsigned char>(buffer[1]) & 0x7f;
    std::size_t head = 2;
    const int extra = size == 126 ? 2 : size == 127 ? 8 : 0;
    if (extra > 0) {
      if (!need(2 + static_cast<std::size_t>(extra))) return std::nullopt;
      size = 0;
      for (int i = 0; i < extra; ++i) size = size << 8 | static_cast<unsigned char>(buffer[head++]);
    }
    if (!need(head + size)) return std::nullopt;
    WsMessage message{opcode, buffer.substr(head, size)};
    buffer.erase(0, head + size);
    if (opcode != 9 && opcode != 10) return message;
    if (opcode == 9) send(message.data, 10);
  }
}

std::optional<WsMessage> WsClient::next_of(const std::string& kind, std::chrono::milliseconds timeout) {
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  for (;;) {
    const auto left = left_until(deadline);
    if (left < 0ms) return std::nullopt;
    auto message = next(left);
    if (!message) return std::nullopt;
    if (kind == "frame" && message->opcode == 2) return message;
    const bool match = message->data.find(R"("type":")" + kind + '"') != std::string::npos;
    if (message->opcode == 1 && match) return message;
  }
}

std::uint64_t u64_at(const std::string& bytes, std::size_t at) {
  std::uint64_t value = 0;
  for (std::size_t i = 8; i-- > 0;) value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
  return value;
}

}  // namespace relievo::test
