# SPDX-License-Identifier: Apache-2.0
# Shared by scripts/*: messages, installing packages, building. Sourced, not run.
# shellcheck shell=bash

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
quiet=${quiet:-no}  # yes: only what takes long or went wrong

bold='' plain=''
if [[ -t 2 ]]; then bold=$'\033[1m' plain=$'\033[0m'; fi
say() { printf '%s==>%s %s\n' "$bold" "$plain" "$*" >&2; }
note() { [[ $quiet == yes ]] || say "$@"; }
fail() {
  printf 'relievo: %s\n' "$*" >&2
  exit 1
}
usage_error() {
  printf '%s: %s (see --help)\n' "${0##*/}" "$*" >&2
  exit 2
}

# One line that is rewritten on a terminal; nothing elsewhere.
progress() { [[ ! -t 2 ]] || printf '\r\033[K    %.70s' "$*" >&2; }
progress_end() { [[ ! -t 2 ]] || printf '\r\033[K' >&2; }

# --- installing -----------------------------------------------------------------------------------------

have_node() {
  command -v npm >/dev/null && command -v node >/dev/null &&
    [[ $(node --version 2>/dev/null) =~ ^v([0-9]+) ]] && ((BASH_REMATCH[1] >= 18))
}

# Names of packages.txt that are not installed, one a line.
missing_packages() {
  local -A installed=()
  local wanted=() name status
  while read -r name _; do
    [[ $name && $name != \#* ]] && wanted+=("$name")
  done <"$root/scripts/packages.txt"
  while read -r name status; do
    [[ $status == installed ]] && installed[$name]=1
  done < <(dpkg-query -W -f='${Package} ${db:Status-Status}\n' "${wanted[@]}" 2>/dev/null || true)
  local node=no
  have_node && node=yes
  for name in "${wanted[@]}"; do
    [[ $node == yes && ($name == nodejs || $name == npm) ]] && continue
    [[ ${installed[$name]:-} ]] || printf '%s\n' "$name"
  done
}

is_debian_12() {
  [[ -r /etc/os-release ]] && (. /etc/os-release && [[ ${ID:-} == debian && ${VERSION_ID:-} == 12 ]])
}

as_root() { if ((EUID == 0)); then "$@"; else sudo "$@"; fi; }

# apt-get with its output in $log and, on a terminal, its progress as one line.
apt_get() {
  local line
  as_root env DEBIAN_FRONTEND=noninteractive LC_ALL=C apt-get -q -y -o Dpkg::Use-Pty=0 \
    -o DPkg::Lock::Timeout=300 "$@" </dev/null 2>&1 | while IFS= read -r line; do
    printf '%s\n' "$line" >>"$log"
    case $line in Get:* | Hit:* | Unpacking* | Setting\ up*) progress "${line% (*}" ;; esac
  done
  local status=${PIPESTATUS[0]}
  progress_end
  return "$status"
}

apt_failed() {
  if grep -qE 'Temporary failure resolving|Could not (connect|resolve)|Unable to connect|Network is unreachable|Connection (timed out|failed|refused)' "$log"; then
    fail "cannot reach Debian's package servers: check the network connection and run this again (details: $log)"
  fi
  grep -E '^(E|W): ' "$log" | tail -5 >&2 || true
  fail "apt-get could not $1: see $log"
}

# install_packages: what packages.txt lists and this machine lacks. Touches nothing that is installed.
install_packages() {
  local missing
  mapfile -t missing < <(missing_packages)
  ((${#missing[@]})) || return 0
  if [[ $install == no ]]; then
    fail "missing Debian packages, and --no-install was given: apt-get install --no-install-recommends ${missing[*]}"
  fi
  is_debian_12 ||
    fail "this is not Debian 12, for which alone packages can be installed here; the missing ones are, by Debian's names: ${missing[*]}"
  if ((EUID != 0)); then
    command -v sudo >/dev/null ||
      fail "packages are missing and there is no sudo: as root, run: apt-get update && apt-get install --no-install-recommends ${missing[*]}"
    sudo -n true 2>/dev/null || [[ -t 0 ]] ||
      fail "packages are missing and sudo wants a password, but there is no terminal to ask on: run scripts/setup on one, or as root: apt-get install --no-install-recommends ${missing[*]}"
    sudo -v || fail "packages are missing and sudo was refused: as root, run: apt-get install --no-install-recommends ${missing[*]}"
  fi
  mkdir -p "$root/build"
  log=$root/build/setup-apt.log
  : >"$log"
  say "Installing ${#missing[@]} Debian packages with what they need: ${missing[*]}"
  apt_get update || apt_failed "update its package lists"
  local size
  size=$(as_root env LC_ALL=C apt-get install --no-install-recommends --assume-no "${missing[@]}" 2>/dev/null |
    sed -n 's/^Need to get \(.*\) of archives.*/\1 to download/p; s/^After this operation, \(.*\) of additional.*/\1 on disk/p' |
    paste -sd, | sed 's/,/, /' || true)
  say "This takes a few minutes, once${size:+: $size}"
  apt_get install --no-install-recommends "${missing[@]}" || apt_failed "install ${missing[*]}"
  packages_installed=yes
}

# install_node_modules FOLDER: npm ci, where package-lock.json or node has changed since the last one.
install_node_modules() {
  local folder=$1 stamp=$1/node_modules/.relievo-installed lock_state
  lock_state="$(sha256sum <"$folder/package-lock.json") $(node --version)"
  [[ -r $stamp && $(<"$stamp") == "$lock_state" ]] && return 0
  local name=${folder#"$root"/} log=$root/build/setup-npm.log
  if [[ $install == no ]]; then
    [[ -d $folder/node_modules ]] && return 0
    fail "npm packages of $name are missing, and --no-install was given: npm ci --prefix $name"
  fi
  mkdir -p "$root/build"
  say "Installing the npm packages of $name"
  if ! (cd "$folder" && npm ci --no-audit --no-fund --loglevel=error) >"$log" 2>&1; then
    if grep -qE 'EAI_AGAIN|ENOTFOUND|ECONNREFUSED|ETIMEDOUT|ENETUNREACH|ECONNRESET' "$log"; then
      fail "cannot reach the npm registry for $name: check the network connection and run this again (details: $log)"
    fi
    tail -5 "$log" >&2
    fail "npm ci failed in $name: see $log"
  fi
  mkdir -p "$folder/node_modules"
  printf '%s\n' "$lock_state" >"$stamp"
}

# --- building -------------------------------------------------------------------------------------------

# Compilers at a time: a core each, but 1.5 GB of memory each too.
jobs_for_machine() {
  local cores memory_kb by_memory
  cores=$(nproc)
  memory_kb=$(sed -n 's/^MemAvailable: *\([0-9]*\) kB/\1/p' /proc/meminfo)
  by_memory=$((${memory_kb:-1572864} / 1572864))
  ((by_memory >= 1)) || by_memory=1
  echo $((cores < by_memory ? cores : by_memory))
}

# Tests at a time: many wait for networks, time-outs and each other, and so two a core; those that need it to themselves
# say so by RUN_SERIAL.
tests_for_machine() { echo $((2 * $(jobs_for_machine))); }

# run_tests PRESET AT_A_TIME: ctest, whose status it returns. What failed stands thousands of lines above its summary, so the last
# lines that each such test printed follow that once more.
run_tests() {
  local logs=$root/build/$1/Testing/Temporary status=0 number name
  rm -f "$logs/LastTestsFailed.log"
  (cd "$root" && ctest --preset "$1" -j "$2") || status=$?
  [[ -r $logs/LastTestsFailed.log ]] || return "$status"
  while IFS=: read -r number name; do
    printf '\n--- %s, %s:\n' "$number" "$name"
    awk -v name="$name" '
      (at = index($0, " Test: ")) && substr($0, at + 7) == name { ours = 1 }
      $0 == "<end of output>" { ours = printing = 0 }
      printing { print }
      ours && $0 == "Output:" { getline; printing = 1 }' "$logs/LastTest.log" | tail -n 40
  done <"$logs/LastTestsFailed.log"
  return "$status"
}

# build PRESET [TARGET...]: configures where needed and builds.
build() {
  local preset=$1 dir=$root/build/$1 args=() log
  shift
  log=$root/build/setup-$preset.log
  mkdir -p "$root/build"
  if [[ -r $dir/CMakeCache.txt ]] && ! grep -qxF "CMAKE_HOME_DIRECTORY:INTERNAL=$root" "$dir/CMakeCache.txt"; then
    args=(--fresh)  # the sources were moved
  fi
  if [[ ${packages_installed:-no} == yes || ${#args[@]} -gt 0 || ! -r $dir/build.ninja ]]; then
    (cd "$root" && cmake --preset "$preset" "${args[@]}") >"$log" 2>&1 ||
      { grep -A12 'CMake Error' "$log" >&2 || tail -12 "$log" >&2; fail "configuring the $preset build failed: see $log"; }
  fi
  local jobs command=(cmake --build "$dir" -j "$(jobs_for_machine)")
  (($# == 0)) || command+=(--target "$@")
  if (cd "$root" && ninja -C "$dir" -n "$@" 2>/dev/null | grep -q 'no work to do'); then
    return 0
  fi
  [[ -r $dir/.ninja_log ]] || say "Building ($preset, ${command[4]} at a time); the first time takes several minutes"
  if [[ -t 1 && $quiet == no ]]; then
    NINJA_STATUS='    [%f/%t] ' "${command[@]}" || fail "building failed: the compiler's message is above"
  elif ! "${command[@]}" >"$log" 2>&1; then
    grep -E -m5 -A12 '^FAILED|error:|^CMake Error' "$log" | cut -c1-300 >&2 || tail -20 "$log" >&2
    fail "building failed: see $log"
  fi
}
