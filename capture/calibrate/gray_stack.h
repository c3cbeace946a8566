// SPDX-License-Identifier: Apache-2.0
// Reads a folder of Gray-code pictures as other programs and our own write them. Two layouts:
//
// - tagged: names with [AXIS-BIT-INVERSE] or [AXIS-BIT-INVERSE_NUMBER], e.g. "123.4_[00-10-01_01]_img.jpg":
//   axis 0 columns, 1 rows; bit 0 the finest; 1 for the inverse. No white or black picture needed.
// - numbered: the pictures in the order of their names are gray_slides(): columns coarsest first, each before
//   its inverse, then rows. White and black come last or first, in either order, or are left out.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "base/result.h"
#include "capture/pattern/gray_decode.h"

namespace relievo {

/// Beside these, `relievo-server import gray` writes a picture of the scene where it is told to write into
/// the folder of pictures: it is none of them.
inline constexpr const char* kImportedPicture = "picture.png";
inline constexpr const char* kImportedColumns = "columns.npy";
inline constexpr const char* kImportedRows = "rows.npy";

/// Whether `folder` has what an import wrote, and so its kImportedPicture is no capture.
bool is_imported(const std::filesystem::path& folder);

/// `.png`, `.jpg`, `.jpeg`, `.bmp`, `.tif`, `.tiff` and `.pgm` directly in `folder`; other files, and
/// the picture of an import, are ignored.
/// Errors name the folder or the file, and the count of pictures expected.
/// `on_picture(done, of)` is called before each picture and stops the reading, with an error, by returning
/// false.
Result<GrayStack> read_gray_stack(const std::filesystem::path& folder, int projector_width,
                                  int projector_height,
                                  const std::function<bool(std::size_t, std::size_t)>& on_picture = {});

/// Bits whose picture and inverse differ by less than decode_gray() asks for at nine of ten lit pixels: one
/// is a copy of the other, or of the wrong slide, or they are out of focus.
std::vector<GraySlide> flat_bits(const GrayStack& stack, const GrayDecodeOptions& options);

/// The picture of slide `number` of gray_slides(), in the numbered layout.
std::string gray_slide_name(std::size_t number);

/// Writes every slide to project, named so. The folder is made where it is missing. `on_slide` as
/// `on_picture` above.
Status write_gray_slides(const std::filesystem::path& folder, int projector_width, int projector_height,
                         const std::function<bool(std::size_t, std::size_t)>& on_slide = {});

}  // namespace relievo
