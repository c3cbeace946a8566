# SPDX-License-Identifier: Apache-2.0
# OpenCV's modules as imported targets opencv_core, ...: Debian's CMake package needs libopencv-dev, which
# pulls in every module and VTK; the module packages have headers and libraries alone.
include_guard(GLOBAL)
find_path(OPENCV_INCLUDE_DIR opencv2/core.hpp PATH_SUFFIXES opencv4)
foreach(module core imgproc imgcodecs calib3d aruco structured_light)
  find_library(OPENCV_${module}_LIBRARY opencv_${module})
  find_path(OPENCV_${module}_INCLUDE opencv2/${module}.hpp PATH_SUFFIXES opencv4)
  if(NOT OPENCV_${module}_INCLUDE OR NOT OPENCV_${module}_LIBRARY)
    set(package ${module})
    if(module MATCHES "aruco|structured_light")
      set(package contrib)
    endif()
    message(FATAL_ERROR "OpenCV's ${module} is missing: run scripts/setup, or apt-get install libopencv-${package}-dev")
  endif()
  add_library(opencv_${module} UNKNOWN IMPORTED GLOBAL)
  set_target_properties(opencv_${module} PROPERTIES
    IMPORTED_LOCATION ${OPENCV_${module}_LIBRARY}
    INTERFACE_INCLUDE_DIRECTORIES ${OPENCV_INCLUDE_DIR})
endforeach()
