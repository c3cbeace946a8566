// SPDX-License-Identifier: Apache-2.0
#include "server/sinks.h"

#include <utility>

#include "base/counted.h"
#include "base/log.h"
#include "base/time.h"
#include "cli/service_manager.h"

namespace relievo {
namespace {

class DdsSink final : public FrameSink {
 public:
  explicit DdsSink(Publisher& publisher) : publisher_(publisher) {}
  Status consume(const FrameMessage& frame) override { return publisher_.publish(frame); }
  Status consume(const ServerStatus& status) override { return publisher_.publish(status); }

 private:
  Publisher& publisher_;
};

class GatewaySink final : public FrameSink {
 public:
  GatewaySink(Gateway& gateway, std::string stream) : gateway_(gateway), stream_(std::move(stream)) {}
  Status consume(const FrameMessage& frame) override {
    gateway_.publish(stream_, frame);
    return {};
  }
  Status consume(const ServerStatus& status) override {
    gateway_.publish(status);
    return {};
  }

 private:
  Gateway& gateway_;
  const std::string stream_;
};

class CallingSink final : public FrameSink {
 public:
  explicit CallingSink(std::function<void()> call) : call_(std::move(call)) {}
  Status consume(const FrameMessage&) override { return called(); }
  Status consume(const ServerStatus&) override { return called(); }

 private:
  Status called() {
    call_();
    return {};
  }

  const std::function<void()> call_;
};

class ServiceSink final : public FrameSink {
 public:
  ServiceSink(ServiceBoard& board, std::string stream) : board_(board), stream_(std::move(stream)) {}
  Status consume(const FrameMessage&) override { return {}; }
  Status consume(const ServerStatus& status) override {
    const std::uint64_t dropped = status.drops_reconstruct + status.drops_encode + status.drops_publish;
    const bool stuck = status.frames_published == published_ && dropped > dropped_;
    published_ = status.frames_published;
    dropped_ = dropped;
    std::string line = std::string(to_string(status.state)) + ", " + counted(published_, "frame");
    if (!status.message.empty()) line += ": " + status.message;
    board_.say(stream_, line, !stuck);
    return {};
  }

 private:
  ServiceBoard& board_;
  const std::string stream_;
  std::uint64_t published_ = 0, dropped_ = 0;
};

}  // namespace

void ServiceBoard::say(const std::string& stream, const std::string& line, bool alive) {
  const std::lock_guard lock(mutex_);
  const std::int64_t now_ns = steady_now_ns();
  streams_[stream] = {line, alive, now_ns};
  std::string all;
  bool all_alive = true;
  for (const auto& [name, entry] : streams_) {
    if (streams_.size() > 1) all += (all.empty() ? "" : "; ") + name + ": ";
    all += entry.line;
    all_alive = all_alive && entry.alive && now_ns - entry.heard_ns < kHeardWithin_ns;
  }
  tell_state(all, all_alive);
}

void ServiceBoard::forget(const std::string& stream) {
  const std::lock_guard lock(mutex_);
  streams_.erase(stream);
}

std::unique_ptr<FrameSink> make_service_sink(ServiceBoard& board, const std::string& stream) {
  return std::make_unique<ServiceSink>(board, stream);
}

std::function<void()> recorder_care(Recorder& recorder, std::function<void()> key_frame_wanted) {
  return [&recorder, key_frame_wanted = std::move(key_frame_wanted), said = false]() mutable {
    const std::int64_t now_ns = steady_now_ns();
    recorder.tick(now_ns);
    if (recorder.wants_key_frame(now_ns)) key_frame_wanted();
    if (said) return;
    if (const Status state = recorder.status(); !state) {
      said = true;  // when it happens; the command fails with it at its end
      log_warning(state.error().message + "; the stream goes on without a recording");
    }
  };
}

std::unique_ptr<FrameSink> make_calling_sink(std::function<void()> call) {
  return std::make_unique<CallingSink>(std::move(call));
}

std::unique_ptr<FrameSink> make_dds_sink(Publisher& publisher) {
  return std::make_unique<DdsSink>(publisher);
}

std::unique_ptr<FrameSink> make_gateway_sink(Gateway& gateway, const std::string& stream) {
  return std::make_unique<GatewaySink>(gateway, stream);
}

}  // namespace relievo
