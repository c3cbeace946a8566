// SPDX-License-Identifier: Apache-2.0
// Who joins a stream whose frames build on each other has a picture, over DDS and as a browser: the server
// makes a key frame for each, since the next one would come by itself when the patience of this test has
// ended. How long it took is printed: it is a figure of docs/OPERATION.md, no promise that a loaded machine
// keeps.
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <condition_variable>
#include <cstdio>
#include <mutex>
#include <optional>
#include <span>
#include <thread>
#include <vector>

#include "base/time.h"
#include "codec/frame3d_codec.h"
#include "codec/texture_codec.h"
#include "idl/transport.h"
#include "tests/support/own_domain.h"
#include "tests/support/process.h"
#include "tests/support/socket_client.h"

namespace relievo::test {
namespace {

const std::string kStream = "plane";
constexpr int kJoins = 20;
constexpr std::size_t kPrefix = 48;  // of a WebSocket frame

/// The first frame of after now that decodes: what is kept from before is a picture, too, but stands still.
class FirstPicture {
 public:
  /// False once there is one.
  bool look(std::span<const std::uint8_t> bytes, std::int64_t published_ns) {
    const std::lock_guard lock(mutex_);
    const bool decodes = decoder_.decode(bytes).ok();
    if (took_ms_ || !decodes || published_ns < joins_ns_) return !took_ms_;
    took_ms_ = milliseconds(utc_now_ns() - joins_ns_);
    changed_.notify_all();
    return false;
  }
  /// Milliseconds until it came; nothing where none does.
  std::optional<double> wait() {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, kPatience, [&] { return took_ms_.has_value(); });
    return took_ms_;
  }

 private:
  const std::int64_t joins_ns_ = utc_now_ns();
  std::mutex mutex_;
  std::condition_variable changed_;
  FrameDecoder decoder_;
  std::optional<double> took_ms_;
};

/// Frames of H.264 build on the one before; where this build has none, those of `metric` on their key frame.
std::vector<std::string> command() {
  const bool has_h264 = check_texture_codec(TextureCodec::kH264).ok();
  return {program("relievo-server"),
          "serve",
          "--source",
          "sim:plane,width=160,height=120,stripes=30,noise=2,rate=10",
          "--geometry",
          "metric",
          "--texture",
          has_h264 ? "h264" : "jpeg",
          "--key-interval",
          "1000",
          "--web",
          "127.0.0.1:0",
          "--domain",
          std::to_string(own_domain()),
          "--interface",
          "lo"};
}

class Join : public ::testing::Test {
 protected:
  void SetUp() override {
    port_ = viewer_port(server_);
    ASSERT_NE(port_, 0) << server_.err();
  }

  /// Checks that each of those who join in turn gets a picture. `join`: milliseconds until it came.
  template <typename Joins>
  void expect_pictures(const char* who, const Joins& join) {
    std::vector<double> took_ms;
    for (int i = 0; i < kJoins; ++i) {
      const std::optional<double> one_ms = join();
      ASSERT_TRUE(one_ms) << who << " " << i << ": " << server_.err();
      took_ms.push_back(*one_ms);
      // At every place between two frames.
      std::this_thread::sleep_for(std::chrono::milliseconds(37 * i % 100));
    }
    std::ranges::sort(took_ms);
    std::printf("%s: a picture after %.0f ms, %.0f at most\n", who, took_ms[took_ms.size() / 2],
                took_ms.back());
  }

  Process server_{command()};
  std::uint16_t port_ = 0;
};

TEST_F(Join, OverDds) {
  expect_pictures("DDS client", [] {
    FirstPicture picture;
    Subscriber::Callbacks callbacks;
    callbacks.frame = [&](const std::string&, const FrameMessage& frame) {
      picture.look(*frame.data, frame.publish_time_ns);
    };
    const auto subscriber = Subscriber::create({own_domain(), "lo"}, kStream, std::move(callbacks));
    EXPECT_TRUE(subscriber.ok());
    return picture.wait();
  });
}

TEST_F(Join, AsABrowser) {
  expect_pictures("browser", [&] {
    FirstPicture picture;
    WsClient client(port_, kStream);
    client.credit(2);
    while (const auto frame = client.next_of("frame")) {
      const auto* const data = reinterpret_cast<const std::uint8_t*>(frame->data.data());
      const auto published_ns = static_cast<std::int64_t>(u64_at(frame->data, 24));
      if (!picture.look({data + kPrefix, frame->data.size() - kPrefix}, published_ns)) break;
      client.credit(1);
    }
    return picture.wait();
  });
}

}  // namespace
}  // namespace relievo::test
