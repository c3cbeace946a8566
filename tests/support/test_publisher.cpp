// SPDX-License-Identifier: Apache-2.0
// A stream's server reduced to its publishing:
// test_publisher STREAM DOMAIN BYTES RATE_HZ FRAMES [READERS [INTERFACE]] waits for READERS readers,
// publishes FRAMES example frames, prints "done" and stays until killed. BYTES 0: real frames of 3D video
// instead of bytes that only differ.
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>

#include "base/time.h"
#include "codec/frame3d_codec.h"
#include "idl/transport.h"
#include "tests/support/make_surface.h"
#include "tests/support/streams.h"

namespace {

relievo::FrameMessage real_frame(std::uint64_t sequence) {
  relievo::FrameMessage message = relievo::test::example_frame(sequence, 0);
  relievo::Frame3D frame = relievo::test::frame(20, 15);
  frame.number = message.number;
  frame.time_ns = message.capture_time_ns;
  auto bytes = relievo::encode_frame(frame, {});
  if (!bytes) std::abort();
  message.data = std::make_shared<const relievo::Bytes>(std::move(bytes).value());
  return message;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace relievo;
  if (argc < 6) return 2;
  alarm(600);  // whatever happens to the test, this process ends
  const std::string stream = argv[1];
  const std::size_t bytes = std::strtoul(argv[3], nullptr, 10);
  const auto period =
      std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 / std::strtod(argv[4], nullptr)));
  const std::uint64_t frames = std::strtoul(argv[5], nullptr, 10);
  const int readers = argc > 6 ? std::atoi(argv[6]) : 0;

  const std::string interface = argc > 7 ? argv[7] : "lo";

  auto publisher = Publisher::create({std::atoi(argv[2]), interface}, test::example_info(stream));
  if (!publisher) {
    std::fprintf(stderr, "%s\n", publisher.error().message.c_str());
    return 1;
  }
  std::fprintf(stderr, "live\n");
  while ((*publisher)->matched_readers() < readers) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  auto due = std::chrono::steady_clock::now();
  ServerStatus status;
  status.stream = stream;
  status.state = StreamState::kRunning;
  for (std::uint64_t i = 0; i < frames; ++i, due += period) {
    std::this_thread::sleep_until(due);
    if (auto sent = (*publisher)->publish(bytes == 0 ? real_frame(i) : test::example_frame(i, bytes));
        !sent) {
      std::fprintf(stderr, "%s\n", sent.error().message.c_str());
    }
    status.time_ns = utc_now_ns();
    status.frames_captured = status.frames_published = i + 1;
    if (i % 10 == 0 && !(*publisher)->publish(status)) return 1;
  }
  std::fprintf(stderr, "done\n");
  for (;;) pause();
}
