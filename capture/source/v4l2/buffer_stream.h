// SPDX-License-Identifier: Apache-2.0
// The driver's buffers, mapped, filled by it in turn and given back.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/result.h"
#include "capture/source/v4l2/device.h"

namespace relievo::v4l2 {

/// A filled buffer. Its memory is the driver's again after BufferStream::give_back().
struct Filled {
  struct Plane {
    const std::uint8_t* data = nullptr;
    std::size_t used = 0;      // bytes that hold the picture
    std::size_t capacity = 0;  // bytes that are mapped
  };
  std::uint32_t index = 0;
  std::array<Plane, 2> planes;
  std::uint32_t sequence = 0;
  std::uint32_t field = 0;     // V4L2's
  bool damaged = false;        // the driver says that the picture is not whole
  std::int64_t time_ns = 0;    // the driver's time stamp
  bool monotonic = false;      // of CLOCK_MONOTONIC
  bool stamped_at_end = true;  // when the last of the picture came, not when its exposure began
};

/// Why no more buffers come.
enum class StreamEnd {
  kUnplugged,  // the device is gone
  kBroken,     // the driver gave up; streaming has to be started again
};

/// Move-only; stops streaming and unmaps in its destructor. One thread at a time.
class BufferStream {
 public:
  struct Options {
    int buffers = 6;
    bool dmabuf = false;  // map the buffers' exported DMA-BUFs instead of the device
  };
  /// `device` must outlive it. Streams when it returns.
  static Result<BufferStream> start(const Device& device, const Options& options);
  BufferStream(BufferStream&& other) noexcept;
  BufferStream& operator=(BufferStream&&) = delete;
  ~BufferStream();

  /// The next filled buffer; nothing where none comes in time, or where ended() says that none will.
  std::optional<Filled> take(int timeout_ms);
  /// A buffer that the driver refuses is offered again later.
  void give_back(const Filled& filled);

  std::optional<StreamEnd> ended() const { return ended_; }
  std::uint64_t refused() const { return refused_count_; }  // times that the driver refused a buffer

 private:
  struct Mapping {
    std::uint8_t* data = nullptr;
    std::size_t bytes = 0;
    int dmabuf = -1;
  };
  struct Buffer {
    std::array<Mapping, 2> planes;
    std::size_t plane_count = 0;
    bool queued = false;
    bool with_us = false;  // taken and not given back
  };

  explicit BufferStream(const Device& device) : device_(&device) {}
  Status map(std::uint32_t index, bool dmabuf);
  Status map_plane(std::uint32_t index, std::uint32_t plane, std::int64_t offset, bool dmabuf,
                   Mapping& mapping);
  int queue(std::uint32_t index);
  void sync(const Buffer& buffer, std::uint64_t flags) const;
  void end(int error);

  const Device* device_;
  std::vector<Buffer> buffers_;
  bool streaming_ = false;
  std::optional<StreamEnd> ended_;
  std::uint64_t refused_count_ = 0;
};

}  // namespace relievo::v4l2
