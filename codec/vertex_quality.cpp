// SPDX-License-Identifier: Apache-2.0
#include "codec/vertex_quality.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <utility>

#include "codec/byte_io.h"

namespace relievo {
namespace {

constexpr int kLargestCode = 63;
constexpr float kSmallest_m = 1e-6F;
constexpr float kStepsPerOctave = 4;
constexpr std::size_t kHeaderBytes = 5;

/// What is said of one place in the picture.
struct Quality {
  std::uint32_t place = 0;  // row step << bits | column step
  std::uint8_t code = 0;
  bool interpolated = false;
};

/// Golomb-Rice with a parameter that follows the mean of what was coded, which is halved now and then.
class Adaptive {
 public:
  int parameter() const {
    int k = 0;
    while ((count_ << k) < sum_) ++k;
    return k;
  }
  void learn(std::uint32_t value) {
    sum_ += value;
    if (++count_ < 64) return;
    sum_ /= 2;
    count_ /= 2;
  }

 private:
  std::uint64_t sum_ = 2;
  std::uint64_t count_ = 1;
};

/// Most significant bit first.
class BitWriter {
 public:
  explicit BitWriter(Bytes& out) : out_(out) {}
  void bit(bool value) {
    if (free_ == 0) {
      out_.push_back(0);
      free_ = 8;
    }
    --free_;
    if (value) out_.back() = static_cast<std::uint8_t>(out_.back() | 1U << free_);
  }
  /// Elias' gamma code of a number from 1.
  void put_gamma(std::uint32_t value) {
    const int bits = std::bit_width(value);
    for (int i = 1; i < bits; ++i) bit(false);
    for (int i = bits - 1; i >= 0; --i) bit((value >> i & 1U) != 0);
  }
  void put(std::uint32_t value, Adaptive& model) {
    const int k = model.parameter();
    for (std::uint32_t i = value >> k; i > 0; --i) bit(true);
    bit(false);
    for (int i = k - 1; i >= 0; --i) bit((value >> i & 1U) != 0);
    model.learn(value);
  }

 private:
  Bytes& out_;
  int free_ = 0;
};

class BitReader {
 public:
  explicit BitReader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}
  bool ok() const { return ok_; }
  bool at_end() const { return at_ == bytes_.size(); }
  bool bit() {
    if (left_ == 0) {
      ok_ = ok_ && at_ < bytes_.size();
      if (!ok_) return false;
      byte_ = bytes_[at_++];
      left_ = 8;
    }
    return (byte_ >> --left_ & 1U) != 0;
  }
  std::uint32_t get_gamma() {
    int bits = 0;
    while (ok_ && !bit()) ok_ = ok_ && ++bits < 31;
    std::uint32_t value = 1;
    for (int i = 0; i < bits; ++i) value = value << 1 | (bit() ? 1U : 0U);
    return ok_ ? value : 1;
  }
  /// Fails on a number above `most`.
  std::uint32_t get(Adaptive& model, std::uint32_t most) {
    const int k = model.parameter();
    std::uint64_t value = 0;
    while (bit()) {
      if (++value << k > most) ok_ = false;
      if (!ok_) return 0;
    }
    for (int i = 0; i < k; ++i) value = value << 1 | (bit() ? 1U : 0U);
    if (value > most) ok_ = false;
    if (!ok_) return 0;
    model.learn(static_cast<std::uint32_t>(value));
    return static_cast<std::uint32_t>(value);
  }

 private:
  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
  std::uint8_t byte_ = 0;
  int left_ = 0;
  bool ok_ = true;
};

std::uint32_t place_of(const Vec2f& coordinates, int bits) {
  return coordinate_step(coordinates[1], bits) << bits | coordinate_step(coordinates[0], bits);
}

/// Vertex indices by place; vertices of one place in any order.
std::vector<std::pair<std::uint32_t, std::uint32_t>> by_place(const std::vector<Vec2f>& coordinates,
                                                              int bits) {
  using Item = std::pair<std::uint32_t, std::uint32_t>;
  std::vector<Item> items(coordinates.size());
  for (std::size_t i = 0; i < items.size(); ++i)
    items[i] = {place_of(coordinates[i], bits), static_cast<std::uint32_t>(i)};
  std::vector<Item> sorted(items.size());
  std::vector<std::uint32_t> start(1U << 16);
  for (int shift = 0; shift < 2 * bits; shift += bits) {
    start.assign((1U << bits) + 1, 0);
    const std::uint32_t mask = (1U << bits) - 1;
    for (const Item& item : items) ++start[(item.first >> shift & mask) + 1];
    for (std::size_t i = 1; i < start.size(); ++i) start[i] += start[i - 1];
    for (const Item& item : items) sorted[start[item.first >> shift & mask]++] = item;
    items.swap(sorted);
  }
  return items;
}

std::uint32_t zigzag(int difference) {
  return difference >= 0 ? 2U * static_cast<std::uint32_t>(difference)
                         : 2U * static_cast<std::uint32_t>(-difference) - 1U;
}
int unzigzag(std::uint32_t value) {
  return (value & 1U) != 0 ? -static_cast<int>(value / 2 + 1) : static_cast<int>(value / 2);
}

}  // namespace

std::uint8_t sigma_code(float sigma_m) {
  if (!(sigma_m > 0)) return 0;
  const float step = std::round(kStepsPerOctave * std::log2(sigma_m / kSmallest_m));
  return static_cast<std::uint8_t>(1 + std::clamp(step, 0.F, static_cast<float>(kLargestCode - 1)));
}

float sigma_of_code(std::uint8_t code) {
  return code == 0 ? 0 : kSmallest_m * std::exp2(static_cast<float>(code - 1) / kStepsPerOctave);
}

std::uint32_t coordinate_step(float coordinate, int bits) {
  const auto largest = static_cast<float>((1 << bits) - 1);
  return static_cast<std::uint32_t>(std::clamp(coordinate, 0.F, 1.F) * largest + 0.5F);
}

Bytes encode_vertex_quality(const Surface& surface, std::span<const std::uint32_t> sent, int bits) {
  Bytes out;
  if ((surface.sigmas_m.empty() && surface.interpolated.empty()) || sent.empty()) return out;
  std::vector<Quality> all;
  all.reserve(sent.size());
  for (const std::uint32_t v : sent) {
    all.push_back({place_of(surface.texture_coordinates[v], bits),
                   surface.sigmas_m.empty() ? std::uint8_t{0} : sigma_code(surface.sigmas_m[v]),
                   !surface.interpolated.empty() && surface.interpolated[v] != 0});
  }
  const auto before = [](const Quality& a, const Quality& b) { return a.place < b.place; };
  if (!std::is_sorted(all.begin(), all.end(), before)) std::sort(all.begin(), all.end(), before);
  // What two vertices of one place share is the worse of them.
  std::size_t count = 0;
  for (const Quality& q : all) {
    if (count > 0 && all[count - 1].place == q.place) {
      all[count - 1].code = std::max(all[count - 1].code, q.code);
      all[count - 1].interpolated |= q.interpolated;
    } else {
      all[count++] = q;
    }
  }
  all.resize(count);
  append(out, static_cast<std::uint8_t>(bits));
  append(out, static_cast<std::uint32_t>(count));
  BitWriter writer(out);
  bool flag = false;
  for (std::size_t i = 0; i < count;) {
    std::size_t end = i;
    while (end < count && all[end].interpolated == flag) ++end;
    writer.put_gamma(static_cast<std::uint32_t>(end - i) + 1);
    i = end;
    flag = !flag;
  }
  Adaptive differences;
  int previous = 0;
  for (const Quality& q : all) {
    writer.put(zigzag(q.code - previous), differences);
    previous = q.code;
  }
  return out;
}

Status decode_vertex_quality(std::span<const std::uint8_t> bytes, Surface& surface) {
  const Error broken{"frame has a vertex quality section that is not of its surface"};
  if (bytes.size() < kHeaderBytes || surface.texture_coordinates.size() != surface.positions.size() ||
      surface.positions.empty())
    return broken;
  ByteReader reader(bytes);
  const int bits = reader.read<std::uint8_t>();
  const auto declared = reader.read<std::uint32_t>();
  if (bits < 8 || bits > 16 || declared == 0 || declared > surface.positions.size() ||
      declared > 8 * (bytes.size() - kHeaderBytes))
    return broken;
  const auto order = by_place(surface.texture_coordinates, bits);
  std::size_t places = 1;
  for (std::size_t i = 1; i < order.size(); ++i) places += order[i].first != order[i - 1].first;
  if (places != declared) return broken;

  BitReader in(bytes.subspan(kHeaderBytes));
  std::vector<std::uint8_t> flags(places);
  bool flag = false;
  for (std::size_t i = 0; i < places;) {
    const std::uint32_t run = in.get_gamma() - 1;
    if (!in.ok() || run > places - i || (run == 0 && i > 0)) return broken;
    std::fill_n(flags.begin() + static_cast<std::ptrdiff_t>(i), run, flag);
    i += run;
    flag = !flag;
  }
  std::vector<std::uint8_t> codes(places);
  Adaptive differences;
  int previous = 0;
  for (std::uint8_t& code : codes) {
    previous += unzigzag(in.get(differences, 2 * kLargestCode));
    if (!in.ok() || previous < 0 || previous > kLargestCode) return broken;
    code = static_cast<std::uint8_t>(previous);
  }
  if (!in.at_end()) return broken;

  std::array<float, kLargestCode + 1> sigmas{};
  for (std::size_t c = 0; c < sigmas.size(); ++c) sigmas[c] = sigma_of_code(static_cast<std::uint8_t>(c));
  surface.sigmas_m.resize(order.size());
  surface.interpolated.resize(order.size());
  std::size_t place = 0;
  for (std::size_t i = 0; i < order.size(); ++i) {
    place += i > 0 && order[i].first != order[i - 1].first;
    surface.sigmas_m[order[i].second] = sigmas[codes[place]];
    surface.interpolated[order[i].second] = flags[place];
  }
  return {};
}

}  // namespace relievo
