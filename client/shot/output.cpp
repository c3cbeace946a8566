// SPDX-License-Identifier: Apache-2.0
#include "client/shot/output.h"

#include <filesystem>
#include <utility>

#include "base/new_folder.h"
#include "client/picture_video.h"
#include "codec/export.h"
#include "codec/frame_names.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;

class OnePicture final : public ShotOutput {
 public:
  explicit OnePicture(std::string file) : file_(std::move(file)) {}
  bool full() const override { return count() > 0; }

 private:
  Result<std::string> write(const Frame3D&, const Image8& picture) override {
    if (auto status = write_png(file_, picture.view()); !status) return status.error();
    return file_;
  }

  std::string file_;
};

class Folder final : public ShotOutput {
 public:
  explicit Folder(std::string folder) : folder_(std::move(folder)) {}

 private:
  Result<std::string> write(const Frame3D& frame, const Image8& picture) override {
    if (const Status made = made_.make(folder_); !made) return made.error();
    const fs::path file = folder_ / (names_.name(frame) + ".png");
    if (auto status = write_png(file, picture.view()); !status) return status.error();
    return file.string();
  }

  fs::path folder_;
  NewFolder made_;
  FrameNames names_;
};

class Video final : public ShotOutput {
 public:
  Video(std::string name, VideoFile file) : name_(std::move(name)), video_(std::move(file)) {}
  bool has_transparency() const override { return false; }
  Status finish() override { return video_.finish(); }

 private:
  Result<std::string> write(const Frame3D& frame, const Image8& picture) override {
    if (opaque_.empty()) opaque_ = Image8(picture.width(), picture.height(), 3);
    const View8 from = picture.view();
    for (int y = 0; y < from.height; ++y) {
      const std::uint8_t* in = from.row(y);
      std::uint8_t* out = opaque_.row(y);
      for (int x = 0; x < from.width; ++x, in += 4, out += 3) {
        out[0] = in[0];
        out[1] = in[1];
        out[2] = in[2];
      }
    }
    if (auto status = video_.add(opaque_.view(), frame.time_ns); !status) return status.error();
    return name_;
  }

  std::string name_;
  PictureVideo video_;
  Image8 opaque_;
};

}  // namespace

Result<std::unique_ptr<ShotOutput>> ShotOutput::create(const std::string& out) {
  if (out.ends_with(".png")) return std::unique_ptr<ShotOutput>(std::make_unique<OnePicture>(out));
  if (!is_video_name(out)) return std::unique_ptr<ShotOutput>(std::make_unique<Folder>(out));
  auto file = VideoFile::create(out);
  if (!file) return file.error();
  return std::unique_ptr<ShotOutput>(std::make_unique<Video>(out, *std::move(file)));
}

Status ShotOutput::add(const Frame3D& frame, const Image8& picture) {
  auto file = write(frame, picture);
  if (!file) return file.error();
  last_ = *std::move(file);
  ++count_;
  return {};
}

}  // namespace relievo
