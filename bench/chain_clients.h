// SPDX-License-Identifier: Apache-2.0
// The readers of the chain suite: what each received, when, and at what cost.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/result.h"
#include "base/stream.h"
#include "idl/transport.h"

namespace relievo::bench {

/// A frame as one reader saw it.
struct Seen {
  std::uint64_t sequence = 0;
  std::int64_t time_ns = 0;  // UTC, when the reader was done with it
  double latency_ms = 0;     // since its capture
  double decode_ms = 0;      // of which decoding; 0 where the reader does not
};

/// Runs from creation to finish(), on a thread of its own.
class ChainClient {
 public:
  virtual ~ChainClient() = default;
  /// Frames so far, also those lost on the way. Any thread.
  virtual std::uint64_t accounted() const = 0;
  /// Of the client's own thread so far. Any thread.
  virtual std::int64_t cpu_ns() const = 0;
  /// Ends the thread. What follows is for after it.
  virtual void finish() = 0;
  virtual const std::vector<Seen>& seen() const = 0;
  virtual std::uint64_t lost() const = 0;
  /// The first failure: a frame that does not decode, a connection that breaks.
  virtual Status status() const = 0;
};

/// A DDS subscriber that decodes every frame.
Result<std::unique_ptr<ChainClient>> make_dds_client(const DomainOptions& domain, const std::string& stream);

/// A WebSocket client of the gateway on 127.0.0.1 that keeps two frames of credit, as the viewer, and does
/// not decode.
Result<std::unique_ptr<ChainClient>> make_web_client(std::uint16_t port, const std::string& stream);

}  // namespace relievo::bench
