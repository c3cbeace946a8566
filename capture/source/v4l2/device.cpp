// SPDX-License-Identifier: Apache-2.0
#include "capture/source/v4l2/device.h"

#include <cerrno>
#include <system_error>
#include <utility>

namespace relievo::v4l2 {
namespace {

std::string reason(int error) {
  return std::generic_category().message(error);
}

Error cannot_open(const std::string& path, int error) {
  switch (error) {
    case ENOENT:
    case ENODEV:
    case ENXIO:
      return Error{path +
                   ": there is no such device: is the camera plugged in? relievo-server devices lists "
                   "those there are"};
    case EACCES:
    case EPERM:
      return Error{path +
                   ": not permitted: add yourself to its group with: sudo usermod -aG video $USER, then "
                   "log in again"};
    case EBUSY:
      return Error{path + ": in use by another program: close that, fuser " + path + " names it"};
    default:
      return Error{path + ": cannot be opened: " + reason(error)};
  }
}

}  // namespace

Result<Device> Device::open(Io& io, const std::string& path) {
  int fd = -1;
  if (const int error = io.open(path, fd); error != 0) return cannot_open(path, error);
  Device device(io, path, fd);
  if (const int error = device.call(VIDIOC_QUERYCAP, &device.capability_); error != 0) {
    if (error == ENODEV) return cannot_open(path, error);
    return Error{path + ": is no video device: give one of those that relievo-server devices lists"};
  }
  const v4l2_capability& capability = device.capability_;
  const __u32 can = (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0 ? capability.device_caps
                                                                          : capability.capabilities;
  device.multiplanar_ = (can & V4L2_CAP_VIDEO_CAPTURE) == 0;
  if ((can & (V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_VIDEO_CAPTURE_MPLANE)) == 0)
    return Error{path +
                 ": is no camera but another part of one: give one of those that relievo-server devices "
                 "lists"};
  if ((can & V4L2_CAP_STREAMING) == 0)
    return Error{path +
                 ": cannot stream into mapped memory, which is needed; its driver only reads and writes"};
  return device;
}

Device::Device(Device&& other) noexcept
    : io_(other.io_),
      path_(std::move(other.path_)),
      fd_(std::exchange(other.fd_, -1)),
      capability_(other.capability_),
      multiplanar_(other.multiplanar_) {}

Device::~Device() {
  if (fd_ >= 0) io_->close(fd_);
}

Error Device::refused(const std::string& what, int error) const {
  if (error == EBUSY) return cannot_open(path_, error);
  if (error == ENODEV) return Error{path_ + ": was unplugged"};
  return Error{path_ + ": the driver refused to " + what + ": " + reason(error)};
}

}  // namespace relievo::v4l2
