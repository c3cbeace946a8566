// SPDX-License-Identifier: Apache-2.0
#include "codec/chunk_compression.h"

#include <lz4frame.h>
#include <zstd.h>

#include <algorithm>
#include <memory>

namespace relievo::mcap {
namespace {

constexpr std::uint64_t kStep = 1 << 20;

struct Step {
  std::size_t taken = 0, given = 0;
  bool ok = false;
};

/// `step(in, out)` decodes what `out` has room for.
template <typename Decode>
Result<Bytes> decode(std::span<const std::uint8_t> in, std::uint64_t size, const Decode& step) {
  const Error damaged{"what is compressed in it is damaged"};
  Bytes out;
  std::uint64_t done = 0;
  for (;;) {
    // One byte more than there may be, so that more is seen.
    out.resize(static_cast<std::size_t>(std::min(size + 1, std::max<std::uint64_t>(2 * done, kStep))));
    const Step made = step(in, std::span(out).subspan(static_cast<std::size_t>(done)));
    if (!made.ok) return damaged;
    in = in.subspan(made.taken);
    done += made.given;
    if (done > size || (made.taken == 0 && made.given == 0)) break;
  }
  if (done != size || !in.empty()) return Error{"its sizes disagree"};
  out.resize(static_cast<std::size_t>(size));
  return out;
}

Result<Bytes> from_zstd(std::span<const std::uint8_t> bytes, std::uint64_t size) {
  const std::unique_ptr<ZSTD_DCtx, decltype(&ZSTD_freeDCtx)> context(ZSTD_createDCtx(), ZSTD_freeDCtx);
  return decode(bytes, size, [&](std::span<const std::uint8_t> in, std::span<std::uint8_t> out) {
    ZSTD_inBuffer from{in.data(), in.size(), 0};
    ZSTD_outBuffer to{out.data(), out.size(), 0};
    const bool ok = ZSTD_isError(ZSTD_decompressStream(context.get(), &to, &from)) == 0;
    return Step{from.pos, to.pos, ok};
  });
}

Result<Bytes> from_lz4(std::span<const std::uint8_t> bytes, std::uint64_t size) {
  LZ4F_dctx* made = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&made, LZ4F_VERSION)) != 0) return Error{"no memory"};
  const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> context(
      made, LZ4F_freeDecompressionContext);
  return decode(bytes, size, [&](std::span<const std::uint8_t> in, std::span<std::uint8_t> out) {
    Step step{in.size(), out.size(), false};
    step.ok = LZ4F_isError(LZ4F_decompress(context.get(), out.data(), &step.given, in.data(), &step.taken,
                                           nullptr)) == 0;
    return step;
  });
}

}  // namespace

Result<Bytes> decompress(const std::string& how, std::span<const std::uint8_t> bytes, std::uint64_t size) {
  if (how == "zstd") return from_zstd(bytes, size);
  if (how == "lz4") return from_lz4(bytes, size);
  if (!how.empty())
    return Error{"it is compressed with " + how + ", which is not supported: rewrite the file without"};
  if (bytes.size() != size) return Error{"its sizes disagree"};
  return Bytes(bytes.begin(), bytes.end());
}

}  // namespace relievo::mcap
