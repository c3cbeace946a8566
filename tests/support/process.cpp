// SPDX-License-Identifier: Apache-2.0
#include "tests/support/process.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <system_error>
#include <thread>

namespace relievo::test {
namespace {

constexpr std::chrono::milliseconds kPoll{5};

std::filesystem::path make_folder() {
  std::string name = (std::filesystem::temp_directory_path() / "relievo-test-XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("cannot make a folder " + name);
  return name;
}

std::string read_file(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

[[noreturn]] void become(const std::filesystem::path& folder, char* const* argv, char* const* environment) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);  // a test that is killed for its time leaves nothing running
  const int in = open("/dev/null", O_RDONLY);
  const int out = open((folder / "out").c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  const int err = open((folder / "err").c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  if (in < 0 || out < 0 || err < 0) _exit(127);
  dup2(in, 0);
  dup2(out, 1);
  dup2(err, 2);
  for (char* const* e = environment; *e != nullptr; ++e) putenv(*e);
  execv(argv[0], argv);
  _exit(127);
}

std::vector<char*> pointers(std::vector<std::string>& texts) {
  std::vector<char*> result;
  for (std::string& text : texts) result.push_back(text.data());
  result.push_back(nullptr);
  return result;
}

}  // namespace

Process::Process(const std::vector<std::string>& command, const std::vector<std::string>& environment)
    : folder_(make_folder()) {
  auto arguments = command;
  auto variables = environment;
  const auto argv = pointers(arguments);
  const auto env = pointers(variables);
  pid_ = fork();
  if (pid_ < 0) throw std::system_error(errno, std::generic_category(), "fork");
  if (pid_ == 0) become(folder_, argv.data(), env.data());
}

Process::~Process() {
  if (!status_) {
    signal(SIGKILL);
    wait();
  }
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

void Process::signal(int number) const {
  if (!status_) kill(pid_, number);
}

std::optional<int> Process::wait(std::chrono::milliseconds timeout) {
  const auto end = std::chrono::steady_clock::now() + timeout;
  while (!status_) {
    int raw = 0;
    if (waitpid(pid_, &raw, WNOHANG) == pid_) {
      status_ = WIFEXITED(raw) ? WEXITSTATUS(raw) : 128 + WTERMSIG(raw);
    } else if (std::chrono::steady_clock::now() >= end) {
      return std::nullopt;
    } else {
      std::this_thread::sleep_for(kPoll);
    }
  }
  return status_;
}

std::string Process::out() const {
  return read_file(folder_ / "out");
}
std::string Process::err() const {
  return read_file(folder_ / "err");
}

bool Process::wait_for_text(const std::string& text) {
  const auto said = [&] { return (err() + out()).find(text) != std::string::npos; };
  eventually([&] { return said() || wait(0ms); });
  return said();
}

Finished run(const std::vector<std::string>& command, std::chrono::milliseconds timeout,
             const std::vector<std::string>& environment) {
  Process process(command, environment);
  const auto status = process.wait(timeout);
  return {status.value_or(-1), process.out(), process.err()};
}

std::uint16_t viewer_port(Process& process) {
  if (!process.wait_for_text("viewer http")) return 0;
  const std::string out = process.out();
  const std::string place = "127.0.0.1:";
  return static_cast<std::uint16_t>(std::stoi(out.substr(out.find(place) + place.size())));
}

std::filesystem::path program(const std::string& name) {
  return std::filesystem::read_symlink("/proc/self/exe").parent_path() / name;
}

}  // namespace relievo::test
