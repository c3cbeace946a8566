// SPDX-License-Identifier: Apache-2.0
// A browser reduced to its connection:
// web_watcher ADDRESS PORT STREAM CREDIT FRAME_MS watches a stream until killed, takes so long for each
// frame, connects anew where it hears nothing, as the viewer does, and prints a line a frame: CONNECTION
// SEQUENCE DROPPED PUBLISHED_NS CAME_NS, where DROPPED is what the gateway says of this connection.
#include <unistd.h>

#include <cinttypes>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <thread>

#include "base/time.h"
#include "tests/support/patience.h"
#include "tests/support/socket_client.h"

namespace {

using namespace relievo;
using namespace relievo::test;

constexpr int kSilent_s = 12;        // kSilenceMs of web/viewer/src/connection.ts
constexpr auto kConnectTime = 1s;    // as long as a kernel waits before it asks a second time
constexpr auto kBeforeAnother = 1s;  // connection

struct Options {
  std::string address;
  std::uint16_t port;
  std::string stream;
  int credit;
  std::chrono::milliseconds frame_takes;
};

void tell(int connection, const WsMessage& frame) {
  std::printf("%d %" PRIu64 " %" PRIu64 " %" PRIu64 " %" PRId64 "\n", connection, u64_at(frame.data, 8),
              u64_at(frame.data, 40), u64_at(frame.data, 24), utc_now_ns());
  std::fflush(stdout);
}

void watch(const Options& options, int connection) {
  WsClient client(std::make_unique<TcpClient>(options.address, options.port, kConnectTime), options.port,
                  "/ws/" + options.stream);
  if (client.status() != 101 || !client.credit(options.credit)) return;
  // Counted in looks, so that who stood still himself looks once more before he thinks that others do.
  for (int silent_s = 0; silent_s < kSilent_s && !client.at_end();) {
    const auto message = client.next(1s);
    silent_s = message ? 0 : silent_s + 1;
    if (!message || message->opcode != 2) continue;
    tell(connection, *message);
    std::this_thread::sleep_for(options.frame_takes);
    client.credit(1);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 6) return 2;
  alarm(600);  // whatever happens to the test, this process ends
  const Options options{argv[1], static_cast<std::uint16_t>(std::atoi(argv[2])), argv[3], std::atoi(argv[4]),
                        std::chrono::milliseconds(std::atoi(argv[5]))};
  for (int connection = 1;; ++connection) {
    watch(options, connection);
    std::this_thread::sleep_for(kBeforeAnother);
  }
}
