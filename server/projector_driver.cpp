// SPDX-License-Identifier: Apache-2.0
#include "server/projector_driver.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <filesystem>
#include <utility>
#include <vector>

#include "base/log.h"
#include "base/time.h"
#include "base/whole_file.h"

namespace relievo {
namespace {

constexpr const char* kProgram = "/proc/self/exe";
constexpr std::size_t kMostSaid = 4096;  // bytes of what a process says that are kept
constexpr int kLook_ms = 100;            // at a process that says nothing, whether it was told to end
constexpr std::int64_t kHangs_ns = 2 * kNanosecondsPerSecond;  // after that it does not by itself
constexpr const char* kHow =
    "this server drives no projector: start it with --projector NAME (`relievo-server project --list` has "
    "the "
    "names) on a machine whose screen it may use";

/// A folder that goes with its content.
class Folder {
 public:
  Folder() {
    std::string name = (std::filesystem::temp_directory_path() / "relievo-projector-XXXXXX").string();
    if (mkdtemp(name.data()) != nullptr) path_ = name;
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  ~Folder() {
    std::error_code ignored;
    if (!path_.empty()) std::filesystem::remove_all(path_, ignored);
  }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;  // empty: it could not be made
};

/// What a calibration needs: `project --cycle`.
bool is_cycle(const std::string& shows) {
  return shows == "colours" || shows == "stripes";
}

/// What `project` knows.
bool known_picture(const std::string& shows, int slides) {
  if (shows == "pattern" || shows == "white" || shows == "black" || is_cycle(shows)) return true;
  for (int slide = 1; slide <= slides; ++slide) {
    const std::string name = "slide" + std::to_string(slide);
    if (shows == name || shows == name + "_complement") return true;
  }
  return false;
}

/// In the child, between fork and exec: only what is safe there.
[[noreturn]] void become(std::vector<char*>& arguments, int said) {
  prctl(PR_SET_PDEATHSIG, SIGTERM);  // a server that is killed leaves no projector on
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);
  const int nothing = open("/dev/null", O_RDWR);
  dup2(nothing, STDIN_FILENO);
  dup2(nothing, STDOUT_FILENO);
  dup2(said, STDERR_FILENO);
  execv(kProgram, arguments.data());
  _exit(127);
}

std::string last_line(std::string text) {
  while (!text.empty() && (text.back() == '\n' || text.back() == '\r')) text.pop_back();
  text = text.substr(text.find_last_of('\n') + 1);
  constexpr std::string_view kError = "error: ";
  const auto error = text.find(kError);
  return error == std::string::npos ? text : text.substr(error + kError.size());
}

}  // namespace

ProjectorDriver::ProjectorDriver(ProjectorConfig config) : config_(std::move(config)) {
  state_.output = config_.output;
  if (config_.output.empty()) {
    state_.message = kHow;
    return;
  }
  state_.activity = ProjectorActivity::kOff;
  thread_ = std::thread([this] { work(); });
}

ProjectorDriver::~ProjectorDriver() {
  if (!thread_.joinable()) return;
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
    end_child();
  }
  changed_.notify_all();
  thread_.join();
}

ProjectorState ProjectorDriver::state() const {
  const std::lock_guard lock(mutex_);
  return state_;
}

Status ProjectorDriver::start(Order order) {
  if (config_.output.empty()) return Error{kHow};
  if (!known_picture(order.shows, order.pattern.slides))
    return Error{"there is no picture '" + order.shows.substr(0, 32) +
                 "' to show: ask for pattern, white, black, slide1 or slide1_complement"};
  {
    const std::lock_guard lock(mutex_);
    state_ = {.activity = ProjectorActivity::kOn,
              .output = config_.output,
              .stream = order.stream,
              .shows = order.shows,
              .message = {}};
    next_ = std::move(order);
    end_child();
  }
  changed_.notify_all();
  return {};
}

Status ProjectorDriver::stop() {
  const std::lock_guard lock(mutex_);
  if (state_.activity != ProjectorActivity::kOn) return Error{"the projector shows nothing"};
  state_.activity = ProjectorActivity::kOff;
  next_.reset();
  end_child();
  return {};
}

/// With the lock held.
void ProjectorDriver::end_child() {
  if (child_ == 0) return;
  if (!std::exchange(told_to_end_, true)) ends_by_ns_ = steady_now_ns() + kHangs_ns;
  kill(child_, SIGTERM);
}

/// A display that hangs keeps a process from hearing.
void ProjectorDriver::look_at_child() {
  const std::lock_guard lock(mutex_);
  if (told_to_end_ && steady_now_ns() > ends_by_ns_) kill(child_, SIGKILL);
}

void ProjectorDriver::work() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return ending_ || next_; });
    if (ending_) return;
    const Order order = *std::exchange(next_, std::nullopt);
    told_to_end_ = false;
    lock.unlock();
    int exit_code = 0;
    const std::string said = run(order, exit_code);
    lock.lock();
    if (told_to_end_ || next_) continue;
    state_.activity = exit_code == 0 ? ProjectorActivity::kOff : ProjectorActivity::kFailed;
    state_.message = exit_code == 0 ? "its window was closed" : said;
    if (exit_code != 0) log_warning("the projector: " + said);
  }
}

std::string ProjectorDriver::run(const Order& order, int& exit_code) {
  exit_code = 1;
  const Folder folder;
  if (folder.path().empty()) return "no folder for its pattern can be made below the system's temporary one";
  const auto rig = folder.path() / "rig.yaml", pattern = folder.path() / "pattern.yaml";
  for (const auto& [file, text] :
       {std::pair(rig, to_yaml(order.rig)), std::pair(pattern, to_yaml(order.pattern))})
    if (const Status written = write_whole_file(file, text); !written) return written.error().message;
  std::vector<std::string> words{"relievo-server", "project",     "--quiet",
                                 "--rig",          rig.string(),  "--pattern",
                                 pattern.string(), "--refreshes", std::to_string(config_.refreshes)};
  if (config_.output != "auto") words.insert(words.end(), {"--output", config_.output});
  if (is_cycle(order.shows))
    words.insert(words.end(), {"--cycle", order.shows});
  else if (order.shows != "pattern")
    words.insert(words.end(), {"--still", order.shows});
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);

  std::array<int, 2> pipe_ends{};
  if (pipe2(pipe_ends.data(), O_CLOEXEC) != 0) return "no process can be started for it";
  {
    const std::lock_guard lock(mutex_);
    if (next_ || ending_ || state_.activity != ProjectorActivity::kOn) {  // overtaken meanwhile
      close(pipe_ends[0]);
      close(pipe_ends[1]);
      told_to_end_ = true;
      return {};
    }
    child_ = fork();
    if (child_ == 0) become(arguments, pipe_ends[1]);
    close(pipe_ends[1]);
    if (child_ < 0) {
      child_ = 0;
      close(pipe_ends[0]);
      return "no process can be started for it";
    }
  }
  std::string said;
  std::array<char, 512> part{};
  for (ssize_t n = 1; n > 0;) {
    pollfd more{.fd = pipe_ends[0], .events = POLLIN, .revents = 0};
    if (poll(&more, 1, kLook_ms) == 0) {
      look_at_child();
      continue;
    }
    n = read(pipe_ends[0], part.data(), part.size());
    if (n > 0) said.append(part.data(), static_cast<std::size_t>(n));
    if (said.size() > kMostSaid) said.erase(0, said.size() - kMostSaid);
  }
  close(pipe_ends[0]);
  siginfo_t ended{};
  waitid(P_PID, static_cast<id_t>(child_), &ended, WEXITED | WNOWAIT);
  const std::lock_guard lock(mutex_);  // nobody signals a number that may be another's from now on
  int status = 0;
  waitpid(child_, &status, 0);
  child_ = 0;
  exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 1;
  return last_line(std::move(said));
}

}  // namespace relievo
