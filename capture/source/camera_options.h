// SPDX-License-Identifier: Apache-2.0
// What can be asked of a real camera (docs/CAMERA.md). Other sources ignore it.
#pragma once

#include <string>
#include <vector>

namespace relievo {

/// A control by its name as `relievo-server devices` lists it, e.g. exposure_time_absolute; a menu's value by
/// its item's name or number.
struct CameraControl {
  std::string name;
  std::string value;

  bool operator==(const CameraControl&) const = default;
};

/// Empty and 0 leave the choice to the rig's file or else to the driver.
struct CameraOptions {
  std::string rig;                                // rig.yaml; empty: not calibrated, fit to calibrate only
  std::string pattern;                            // pattern.yaml; empty: the one beside the rig
  int projector_width = 0, projector_height = 0;  // pixels, of a camera without rig

  std::string input;                    // number or name
  std::string standard;                 // "NTSC-M", "PAL-B", ..., or "auto" for what is detected
  std::string format;                   // "YUYV", "RGB24", ...; empty: the best of what the driver has
  int width = 0, height = 0;            // pixels of a whole frame
  double rate = 0;                      // pictures a second; of interlaced video frames
  std::string field;                    // "progressive", "interlaced", "seq-tb", "seq-bt" or "alternate"
  std::string field_order;              // "top" or "bottom" first, where the driver is wrong
  bool odd_pairs = false;               // progressive: the pictures 1, 3, ... show slides, not 0, 2, ...
  bool dmabuf = false;                  // read through exported DMA-BUFs instead of the driver's own mapping
  int buffers = 6;                      // that the driver fills in turn
  std::vector<CameraControl> controls;  // set in this order

  bool operator==(const CameraOptions&) const = default;
};

}  // namespace relievo
