// SPDX-License-Identifier: Apache-2.0
// The system calls that a V4L2 device needs, so that tests can stand in for the kernel.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace relievo::v4l2 {

/// Every function that returns int gives 0 or an errno.
class Io {
 public:
  virtual ~Io() = default;
  virtual int open(const std::string& path, int& fd) = 0;  // for reading and writing, not blocking
  virtual void close(int fd) = 0;
  virtual int control(int fd, unsigned long request, void* argument) = 0;  // ioctl, past signals
  virtual int map(int fd, std::size_t bytes, std::int64_t offset, std::uint8_t*& data) = 0;
  virtual void unmap(std::uint8_t* data, std::size_t bytes) = 0;
  /// Waits until a buffer or an error can be fetched; EAGAIN where none comes in time.
  virtual int wait(int fd, int timeout_ms) = 0;
  virtual void sleep_ms(int ms) = 0;
  virtual std::int64_t monotonic_ns() = 0;  // CLOCK_MONOTONIC, the clock of most drivers
  virtual std::int64_t utc_ns() = 0;
};

/// The running kernel. Any thread.
Io& kernel_io();

}  // namespace relievo::v4l2
