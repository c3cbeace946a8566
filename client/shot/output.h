// SPDX-License-Identifier: Apache-2.0
// Where the pictures of `relievo shot` go.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "base/frame3d.h"
#include "base/image.h"
#include "base/result.h"

namespace relievo {

/// One thread.
class ShotOutput {
 public:
  /// By the name's ending: .png: one picture; .mp4 or .mkv: a video; else a folder, which is made with the
  /// first picture, of one file a frame.
  static Result<std::unique_ptr<ShotOutput>> create(const std::string& out);
  virtual ~ShotOutput() = default;

  /// RGBA, of a frame later than the one before.
  Status add(const Frame3D& frame, const Image8& picture);
  /// After the last one; at least one was added. A video appears now.
  virtual Status finish() { return {}; }

  /// No further picture is wanted.
  virtual bool full() const { return false; }
  virtual bool has_transparency() const { return true; }
  std::uint64_t count() const { return count_; }
  const std::string& last() const { return last_; }  // file

 protected:
  virtual Result<std::string> write(const Frame3D& frame, const Image8& picture) = 0;

 private:
  std::uint64_t count_ = 0;
  std::string last_;
};

}  // namespace relievo
