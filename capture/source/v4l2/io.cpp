// SPDX-License-Identifier: Apache-2.0
#include "capture/source/v4l2/io.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <thread>

#include "base/time.h"

namespace relievo::v4l2 {
namespace {

class KernelIo final : public Io {
 public:
  int open(const std::string& path, int& fd) override {
    fd = ::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
    return fd < 0 ? errno : 0;
  }
  void close(int fd) override { ::close(fd); }
  int control(int fd, unsigned long request, void* argument) override {
    int result;
    do {
      result = ::ioctl(fd, request, argument);
    } while (result < 0 && errno == EINTR);
    return result < 0 ? errno : 0;
  }
  int map(int fd, std::size_t bytes, std::int64_t offset, std::uint8_t*& data) override {
    void* const at = ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd, offset);
    if (at == MAP_FAILED) return errno;
    data = static_cast<std::uint8_t*>(at);
    return 0;
  }
  void unmap(std::uint8_t* data, std::size_t bytes) override { ::munmap(data, bytes); }
  int wait(int fd, int timeout_ms) override {
    pollfd waited{fd, POLLIN, 0};
    const int ready = ::poll(&waited, 1, timeout_ms);
    if (ready < 0) return errno == EINTR ? EAGAIN : errno;
    return ready == 0 ? EAGAIN : 0;
  }
  void sleep_ms(int ms) override { std::this_thread::sleep_for(std::chrono::milliseconds(ms)); }
  std::int64_t monotonic_ns() override { return steady_now_ns(); }
  std::int64_t utc_ns() override { return utc_now_ns(); }
};

}  // namespace

Io& kernel_io() {
  static KernelIo io;
  return io;
}

}  // namespace relievo::v4l2
