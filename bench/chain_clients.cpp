// SPDX-License-Identifier: Apache-2.0
#include "bench/chain_clients.h"

#include <time.h>

#include <chrono>
#include <thread>
#include <utility>

#include "base/thread_name.h"
#include "base/time.h"
#include "codec/frame3d_codec.h"
#include "idl/transport.h"
#include "tests/support/socket_client.h"

namespace relievo::bench {
namespace {

constexpr int kCredit = 2;
constexpr std::chrono::milliseconds kWait{100};  // until a client without frames looks whether it should end

std::int64_t thread_cpu_ns() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return now.tv_sec * kNanosecondsPerSecond + now.tv_nsec;
}

class DdsClient final : public ChainClient {
 public:
  Status start(const DomainOptions& domain, const std::string& stream) {
    stream_ = stream;
    Subscriber::Callbacks callbacks;
    callbacks.frame = [this](const std::string&, const FrameMessage& frame) { decode(frame); };
    callbacks.lost = [this](const std::string&, std::uint64_t count) { lost_ += count; };
    auto subscriber = Subscriber::create(domain, stream, std::move(callbacks));
    if (!subscriber) return subscriber.error();
    subscriber_ = *std::move(subscriber);
    asked_ = subscriber_.get();
    return {};
  }

  std::uint64_t accounted() const override { return received_ + lost_; }
  std::int64_t cpu_ns() const override { return cpu_ns_; }
  void finish() override { subscriber_.reset(); }
  const std::vector<Seen>& seen() const override { return seen_; }
  std::uint64_t lost() const override { return lost_; }
  Status status() const override { return status_; }

 private:
  void decode(const FrameMessage& frame) {
    const std::int64_t begin = steady_now_ns();
    if (!decoder_.can_decode(*frame.data)) {  // it builds on one from before this client was found
      ++lost_;
      if (Subscriber* const subscriber = asked_) subscriber->request_key_frame(stream_);
      return;
    }
    const Status done = decoder_.decode(*frame.data, decoded_);
    const std::int64_t end = steady_now_ns();
    const std::int64_t now = utc_now_ns();
    if (!done && status_) status_ = done.error();
    seen_.push_back(
        {frame.sequence, now, milliseconds(now - frame.capture_time_ns), milliseconds(end - begin)});
    cpu_ns_ = thread_cpu_ns();
    ++received_;
  }

  std::string stream_;
  FrameDecoder decoder_;
  Frame3D decoded_;
  std::vector<Seen> seen_;
  std::atomic<std::uint64_t> received_{0};
  std::atomic<std::uint64_t> lost_{0};
  std::atomic<std::int64_t> cpu_ns_{0};
  std::atomic<Subscriber*> asked_{nullptr};  // for key frames, by the thread that it ends with
  Status status_;
  std::unique_ptr<Subscriber> subscriber_;  // last: its thread uses the others
};

class WebClient final : public ChainClient {
 public:
  WebClient(std::uint16_t port, const std::string& stream) : socket_(port, stream) {}
  ~WebClient() override { finish(); }

  Status start() {
    if (socket_.status() != 101 || !socket_.credit(kCredit))
      return Error{"the gateway refused a WebSocket client (status " + std::to_string(socket_.status()) +
                   ")"};
    thread_ = std::thread([this] { work(); });
    return {};
  }

  std::uint64_t accounted() const override { return received_ + lost_; }
  std::int64_t cpu_ns() const override { return cpu_ns_; }
  void finish() override {
    ending_ = true;
    if (thread_.joinable()) thread_.join();
  }
  const std::vector<Seen>& seen() const override { return seen_; }
  std::uint64_t lost() const override { return lost_; }
  Status status() const override { return status_; }

 private:
  void work() {
    name_this_thread("web client");
    while (!ending_) {
      const auto message = socket_.next_of("frame", kWait);
      cpu_ns_ = thread_cpu_ns();
      if (!message) {
        if (!socket_.at_end()) continue;
        status_ = Error{"the gateway closed a WebSocket client"};
        return;
      }
      const std::int64_t now = utc_now_ns();
      const auto captured = static_cast<std::int64_t>(test::u64_at(message->data, 16));
      seen_.push_back({test::u64_at(message->data, 8), now, milliseconds(now - captured), 0});
      lost_ = test::u64_at(message->data, 40);
      ++received_;
      socket_.credit(1);
    }
  }

  test::WsClient socket_;
  std::vector<Seen> seen_;
  std::atomic<std::uint64_t> received_{0};
  std::atomic<std::uint64_t> lost_{0};
  std::atomic<std::int64_t> cpu_ns_{0};
  std::atomic<bool> ending_{false};
  Status status_;
  std::thread thread_;
};

}  // namespace

Result<std::unique_ptr<ChainClient>> make_dds_client(const DomainOptions& domain, const std::string& stream) {
  auto client = std::make_unique<DdsClient>();
  if (const Status started = client->start(domain, stream); !started) return started.error();
  return std::unique_ptr<ChainClient>(std::move(client));
}

Result<std::unique_ptr<ChainClient>> make_web_client(std::uint16_t port, const std::string& stream) {
  auto client = std::make_unique<WebClient>(port, stream);
  if (const Status started = client->start(); !started) return started.error();
  return std::unique_ptr<ChainClient>(std::move(client));
}

}  // namespace relievo::bench
