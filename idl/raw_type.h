// SPDX-License-Identifier: Apache-2.0
// Samples that are already CDR onto the network, through Cyclone's serialised-data interface. Internal to
// idl/.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <utility>

#include "base/result.h"
#include "idl/entity.h"

struct ddsi_serdata;
struct ddsi_sertype;

namespace relievo {

/// How a topic's samples are made of CDR. Move-only; any thread, one at a time.
class RawType {
 public:
  /// A reader or writer of the topic in a DDS group.
  using Create = std::function<Result<Entity>(std::int32_t group)>;
  /// `sample`: any that its C type allows. It is written to ourselves, in a partition that nobody else reads,
  /// since Cyclone 0.10 tells the serialiser of a topic only through a sample.
  static Result<RawType> find(std::int32_t participant, const Create& create_reader,
                              const Create& create_writer, const void* sample);

  RawType() = default;
  RawType(RawType&& other) noexcept : type_(std::exchange(other.type_, nullptr)) {}
  RawType& operator=(RawType&& other) noexcept {
    std::swap(type_, other.type_);
    return *this;
  }
  ~RawType();

  /// A ddsi_serdata for dds_writecdr() or dds_forwardcdr(), which take it; null where the bytes, with their
  /// encapsulation header, are none of this type.
  ddsi_serdata* make(std::span<const std::uint8_t> cdr) const;

 private:
  explicit RawType(ddsi_sertype* type) : type_(type) {}

  ddsi_sertype* type_ = nullptr;  // a reference of ours
};

}  // namespace relievo
