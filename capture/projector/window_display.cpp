// SPDX-License-Identifier: Apache-2.0
#include "capture/projector/window_display.h"

#define GLFW_INCLUDE_GLEXT
#include <GL/glx.h>
#include <GLFW/glfw3.h>
#undef Status  // Xlib's macros
#undef Bool

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>

#include "base/time.h"

namespace relievo {
namespace {

std::string glfw_error() {
  const char* text = nullptr;
  glfwGetError(&text);
  return text != nullptr ? text : "no reason given";
}

/// GLFW is a process's own: one user at a time.
class Library {
 public:
  static Result<std::unique_ptr<Library>> open() {
    glfwInitHint(GLFW_JOYSTICK_HAT_BUTTONS, GLFW_FALSE);
    if (glfwInit() != GLFW_TRUE)
      return Error{"there is no desktop to project on (" + glfw_error() +
                   "): log in on the machine's own screen, or set DISPLAY"};
    return std::unique_ptr<Library>(new Library);
  }
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;
  ~Library() { glfwTerminate(); }

 private:
  Library() = default;
};

DisplayMode mode_of(const GLFWvidmode& mode) {
  return {mode.width, mode.height, static_cast<double>(mode.refreshRate)};
}

std::vector<GLFWmonitor*> monitors() {
  int count = 0;
  GLFWmonitor** all = glfwGetMonitors(&count);
  return {all, all + count};
}

DisplayOutput describe(GLFWmonitor* monitor) {
  DisplayOutput out;
  out.name = glfwGetMonitorName(monitor);
  out.primary = monitor == glfwGetPrimaryMonitor();
  if (const GLFWvidmode* now = glfwGetVideoMode(monitor)) out.mode = mode_of(*now);
  int count = 0;
  const GLFWvidmode* modes = glfwGetVideoModes(monitor, &count);
  for (int i = 0; i < count; ++i) {
    const DisplayMode mode = mode_of(modes[i]);
    if (std::find(out.modes.begin(), out.modes.end(), mode) == out.modes.end()) out.modes.push_back(mode);
  }
  return out;
}

std::string text_of(const DisplayMode& mode) {
  return std::to_string(mode.width) + "x" + std::to_string(mode.height) + " at " +
         std::to_string(std::lround(mode.refresh_hz)) + " Hz";
}

Result<GLFWmonitor*> choose_monitor(const std::string& name) {
  const std::vector<GLFWmonitor*> all = monitors();
  if (all.empty()) return Error{"no output is connected: plug the projector in and switch it on"};
  std::string names;
  GLFWmonitor* second = nullptr;
  for (GLFWmonitor* monitor : all) {
    if (glfwGetMonitorName(monitor) == name) return monitor;
    names += (names.empty() ? "" : ", ") + std::string(glfwGetMonitorName(monitor));
    if (monitor != glfwGetPrimaryMonitor()) second = monitor;
  }
  if (!name.empty()) return Error{"there is no output " + name + ": there are " + names};
  // The projector is the screen that the person does not work on.
  if (all.size() == 2 && second != nullptr) return second;
  if (all.size() == 1) return all.front();
  return Error{"there are several outputs: choose one with --output, of " + names};
}

Result<DisplayMode> choose_mode(const DisplayOutput& output, const DisplayChoice& choice) {
  DisplayMode wanted = output.mode;
  if (choice.width > 0) wanted = {choice.width, choice.height, 0};
  if (choice.refresh_hz > 0) wanted.refresh_hz = choice.refresh_hz;
  const DisplayMode* best = nullptr;
  std::string all;
  for (const DisplayMode& mode : output.modes) {
    all += (all.empty() ? "" : ", ") + text_of(mode);
    if (mode.width != wanted.width || mode.height != wanted.height) continue;
    // The system rounds: 59.94 is 59 or 60.
    if (wanted.refresh_hz > 0 && std::fabs(mode.refresh_hz - wanted.refresh_hz) > 1) continue;
    if (best == nullptr || mode.refresh_hz > best->refresh_hz) best = &mode;
  }
  if (best != nullptr) return *best;
  return Error{output.name + " has no mode " + text_of(wanted) + ": it has " + all};
}

using WaitForSwap = int (*)(::Display*, GLXDrawable, std::int64_t target, std::int64_t* time_us,
                            std::int64_t* refresh, std::int64_t* swaps);

/// Functions beyond OpenGL 1.1, which libGL need not export.
struct Functions {
  PFNGLGENFRAMEBUFFERSPROC gen_framebuffers = nullptr;
  PFNGLBINDFRAMEBUFFERPROC bind_framebuffer = nullptr;
  PFNGLFRAMEBUFFERTEXTURE2DPROC framebuffer_texture = nullptr;
  PFNGLBLITFRAMEBUFFERPROC blit_framebuffer = nullptr;
  WaitForSwap wait_for_swap = nullptr;  // GLX_OML_sync_control, where there is it

  bool load() {
    const auto get = [](auto& function, const char* name) {
      function = reinterpret_cast<std::remove_reference_t<decltype(function)>>(glfwGetProcAddress(name));
      return function != nullptr;
    };
    if (glfwExtensionSupported("GLX_OML_sync_control") == GLFW_TRUE) get(wait_for_swap, "glXWaitForSbcOML");
    return get(gen_framebuffers, "glGenFramebuffers") && get(bind_framebuffer, "glBindFramebuffer") &&
           get(framebuffer_texture, "glFramebufferTexture2D") && get(blit_framebuffer, "glBlitFramebuffer");
  }
};

class WindowDisplay final : public Display {
 public:
  WindowDisplay(std::unique_ptr<Library> library, GLFWwindow* window, DisplayOutput output,
                const Functions& functions)
      : library_(std::move(library)), window_(window), output_(std::move(output)), gl_(functions) {}
  ~WindowDisplay() override { glfwDestroyWindow(window_); }

  const DisplayOutput& output() const override { return output_; }

  Status load(const std::vector<Image8>& pictures) override {
    const auto [width, height, rate] = output_.mode;
    glDeleteTextures(static_cast<int>(textures_.size()), textures_.data());
    textures_.assign(pictures.size(), 0);
    glGenTextures(static_cast<int>(textures_.size()), textures_.data());
    glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
    Image8 upside_down(width, height, 3);  // OpenGL's first row is the lowest
    for (std::size_t i = 0; i < pictures.size(); ++i) {
      const Image8& picture = pictures[i];
      if (picture.width() != width || picture.height() != height || picture.channels() != 3)
        return Error{"a picture of " + std::to_string(picture.width()) + "x" +
                     std::to_string(picture.height()) + " does not fit " + text_of(output_.mode)};
      for (int y = 0; y < height; ++y)
        std::copy_n(picture.row(y), picture.stride(), upside_down.row(height - 1 - y));
      glBindTexture(GL_TEXTURE_2D, textures_[i]);
      glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
      glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
      glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, width, height, 0, GL_RGB, GL_UNSIGNED_BYTE,
                   upside_down.data());
    }
    if (framebuffer_ == 0) gl_.gen_framebuffers(1, &framebuffer_);
    if (const unsigned code = glGetError(); code != GL_NO_ERROR)
      return Error{"the graphics driver does not take the pictures (OpenGL error " + std::to_string(code) +
                   ")"};
    return {};
  }

  Result<Flip> show(std::size_t picture, int refreshes) override {
    const auto [width, height, rate] = output_.mode;
    if (refreshes != interval_) glfwSwapInterval(interval_ = refreshes);
    gl_.bind_framebuffer(GL_READ_FRAMEBUFFER, framebuffer_);
    gl_.framebuffer_texture(GL_READ_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, textures_[picture], 0);
    gl_.bind_framebuffer(GL_DRAW_FRAMEBUFFER, 0);
    gl_.blit_framebuffer(0, 0, width, height, 0, 0, width, height, GL_COLOR_BUFFER_BIT, GL_NEAREST);
    glfwSwapBuffers(window_);
    glfwPollEvents();
    Flip flip;
    std::int64_t time_us = 0;
    std::int64_t refresh = 0;
    std::int64_t swaps = 0;
    if (gl_.wait_for_swap != nullptr && gl_.wait_for_swap(glXGetCurrentDisplay(), glXGetCurrentDrawable(), 0,
                                                          &time_us, &refresh, &swaps) != 0) {
      flip.refresh = static_cast<std::uint64_t>(refresh);
    } else {
      glFinish();  // or else the driver queues several swaps and their times say nothing
    }
    flip.time_ns = steady_now_ns();
    if (const unsigned code = glGetError(); code != GL_NO_ERROR)
      return Error{"the graphics driver failed to show a slide (OpenGL error " + std::to_string(code) + ")"};
    return flip;
  }

  bool closed() override {
    return glfwWindowShouldClose(window_) == GLFW_TRUE ||
           glfwGetKey(window_, GLFW_KEY_ESCAPE) == GLFW_PRESS ||
           glfwGetKey(window_, GLFW_KEY_Q) == GLFW_PRESS;
  }

 private:
  std::unique_ptr<Library> library_;
  GLFWwindow* window_;
  const DisplayOutput output_;
  const Functions gl_;
  std::vector<unsigned> textures_;
  unsigned framebuffer_ = 0;
  int interval_ = -1;
};

}  // namespace

Result<std::vector<DisplayOutput>> window_outputs() {
  const auto library = Library::open();
  if (!library) return library.error();
  std::vector<DisplayOutput> out;
  for (GLFWmonitor* monitor : monitors()) out.push_back(describe(monitor));
  return out;
}

Result<std::unique_ptr<Display>> open_window_display(const DisplayChoice& choice) {
  auto library = Library::open();
  if (!library) return library.error();
  const auto monitor = choose_monitor(choice.output);
  if (!monitor) return monitor.error();
  DisplayOutput output = describe(*monitor);
  const auto mode = choose_mode(output, choice);
  if (!mode) return mode.error();
  output.mode = *mode;

  glfwWindowHint(GLFW_RED_BITS, 8);
  glfwWindowHint(GLFW_GREEN_BITS, 8);
  glfwWindowHint(GLFW_BLUE_BITS, 8);
  glfwWindowHint(GLFW_REFRESH_RATE, static_cast<int>(std::lround(mode->refresh_hz)));
  glfwWindowHint(GLFW_SRGB_CAPABLE, GLFW_FALSE);
  glfwWindowHint(GLFW_SAMPLES, 0);
  glfwWindowHint(GLFW_AUTO_ICONIFY,
                 GLFW_FALSE);  // it stays on the projector while the person works elsewhere
  glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
  glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 0);
  GLFWwindow* window = glfwCreateWindow(mode->width, mode->height, "Relievo projector", *monitor, nullptr);
  if (window == nullptr)
    return Error{"no full-screen OpenGL 3.0 window on " + output.name + ": " + glfw_error()};
  glfwSetInputMode(window, GLFW_CURSOR, GLFW_CURSOR_HIDDEN);
  glfwSetGamma(*monitor, 1);  // restored at the end; an output without a ramp has none to undo
  glfwGetError(nullptr);
  glfwMakeContextCurrent(window);
  Functions functions;
  const bool loaded = functions.load();
  auto display = std::make_unique<WindowDisplay>(*std::move(library), window, output, functions);
  if (!loaded) return Error{"the graphics driver has no framebuffer objects (OpenGL 3.0)"};
  int width = 0;
  int height = 0;
  glfwGetFramebufferSize(window, &width, &height);
  if (width != mode->width || height != mode->height)
    return Error{"the desktop scales " + output.name + ": its window has " + std::to_string(width) + "x" +
                 std::to_string(height) + " pixels and not " + text_of(*mode) + ": set its scale to 100 %"};
  glDisable(GL_DITHER);
  glViewport(0, 0, width, height);
  return std::unique_ptr<Display>(std::move(display));
}

}  // namespace relievo
