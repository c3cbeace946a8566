// SPDX-License-Identifier: Apache-2.0
#include "capture/calibrate/pictures.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

#include "base/whole_file.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;

bool is_picture(const fs::path& file) {
  static constexpr std::array kEndings = {".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm", ".ppm"};
  std::string ending = file.extension().string();
  for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return std::find(kEndings.begin(), kEndings.end(), ending) != kEndings.end();
}

/// What file systems and other programs keep beside pictures: "._00.png" of a Mac.
bool is_hidden(const fs::path& file) {
  return file.filename().native().starts_with('.');
}

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

/// Names with runs of digits compared as numbers.
bool natural_less(const std::string& a, const std::string& b) {
  std::size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    if (is_digit(a[i]) && is_digit(b[j])) {
      std::size_t ie = i, je = j;
      while (ie < a.size() && is_digit(a[ie])) ++ie;
      while (je < b.size() && is_digit(b[je])) ++je;
      while (i + 1 < ie && a[i] == '0') ++i;
      while (j + 1 < je && b[j] == '0') ++j;
      if (ie - i != je - j) return ie - i < je - j;
      for (; i < ie; ++i, ++j) {
        if (a[i] != b[j]) return a[i] < b[j];
      }
    } else {
      if (a[i] != b[j]) return a[i] < b[j];
      ++i;
      ++j;
    }
  }
  if (a.size() - i != b.size() - j) return a.size() - i < b.size() - j;
  return a < b;
}

}  // namespace

Result<std::vector<fs::path>> pictures_in(const fs::path& folder) {
  std::error_code code;
  if (!fs::is_directory(folder, code)) return Error{folder.string() + " is no folder"};
  std::vector<fs::path> files;
  for (fs::directory_iterator it(folder, code), end; !code && it != end; it.increment(code)) {
    std::error_code ignored;
    if (is_picture(it->path()) && !is_hidden(it->path()) && it->is_regular_file(ignored))
      files.push_back(it->path());
  }
  if (code) return Error{"cannot read the folder " + folder.string() + ": " + code.message()};
  std::sort(files.begin(), files.end(), [](const fs::path& a, const fs::path& b) {
    return natural_less(a.filename().string(), b.filename().string());
  });
  return files;
}

Image8 grey_of(const Image8& rgb) {
  Image8 grey(rgb.width(), rgb.height(), 1);
  const std::uint8_t* in = rgb.data();
  std::uint8_t* out = grey.data();
  for (std::size_t i = 0; i < grey.size(); ++i, in += 3) {
    out[i] = static_cast<std::uint8_t>((in[0] + 2 * in[1] + in[2] + 2) / 4);
  }
  return grey;
}

Status write_png(const fs::path& file, const Image8& picture) {
  std::vector<std::uint8_t> bytes;
  try {
    cv::Mat bgr(picture.height(), picture.width(), CV_8UC(picture.channels()),
                const_cast<std::uint8_t*>(picture.data()));  // only read
    if (picture.channels() == 3) cv::cvtColor(bgr, bgr, cv::COLOR_RGB2BGR);
    if (!cv::imencode(".png", bgr, bytes)) return Error{"cannot encode " + file.string()};
  } catch (const cv::Exception& e) {
    return Error{"cannot encode " + file.string() + ": " + e.err};
  }
  return write_whole_file(file, bytes);
}

}  // namespace relievo
