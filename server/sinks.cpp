// SPDX-License-Identifier: Apache-2.0
#include "server/sinks.h"

#include "base/log.h"
#include "base/time.h"

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

class RecorderSink final : public FrameSink {
 public:
  explicit RecorderSink(Recorder& recorder) : recorder_(recorder) {}
  Status consume(const FrameMessage&) override { return tick(); }
  Status consume(const ServerStatus&) override { return tick(); }

 private:
  Status tick() {
    recorder_.tick(utc_now_ns());
    if (said_) return {};
    if (const Status state = recorder_.status(); !state) {
      said_ = true;  // when it happens; the command fails with it at its end
      log_warning(state.error().message + "; the stream goes on without a recording");
    }
    return {};
  }

  Recorder& recorder_;
  bool said_ = false;
};

}  // namespace

std::unique_ptr<FrameSink> make_recorder_sink(Recorder& recorder) {
  return std::make_unique<RecorderSink>(recorder);
}

std::unique_ptr<FrameSink> make_dds_sink(Publisher& publisher) {
  return std::make_unique<DdsSink>(publisher);
}

std::unique_ptr<FrameSink> make_gateway_sink(Gateway& gateway, const std::string& stream) {
  return std::make_unique<GatewaySink>(gateway, stream);
}

}  // namespace relievo
