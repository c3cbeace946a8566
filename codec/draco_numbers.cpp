// SPDX-License-Identifier: Apache-2.0
#include "codec/draco_numbers.h"

#include <draco/compression/decode.h>
#include <draco/compression/expert_encode.h>
#include <draco/point_cloud/point_cloud.h>

#include <exception>
#include <memory>
#include <stdexcept>
#include <string>

#include "codec/draco_stream.h"

namespace relievo {
namespace {

using Numbers = std::vector<std::int32_t>;

void add_list(const Numbers& numbers, draco::PointCloud& cloud) {
  draco::GeometryAttribute layout;
  layout.Init(draco::GeometryAttribute::GENERIC, nullptr, 1, draco::DT_INT32, false, sizeof(std::int32_t), 0);
  const int id = cloud.AddAttribute(layout, true, static_cast<std::uint32_t>(numbers.size()));
  cloud.attribute(id)->buffer()->Write(0, numbers.data(), numbers.size() * sizeof(std::int32_t));
}

/// Draco makes room for whatever attributes a stream declares, and tells the cloud first: the only place to
/// refuse.
class GuardedCloud final : public draco::PointCloud {
 public:
  explicit GuardedCloud(std::size_t lists) : lists_(lists) {}

  void SetAttribute(int id, std::unique_ptr<draco::PointAttribute> attribute) override {
    const bool is_next = static_cast<std::size_t>(id) == found_ && found_ < lists_;
    if (!is_next || attribute->attribute_type() != draco::GeometryAttribute::GENERIC ||
        attribute->num_components() != 1 || attribute->data_type() != draco::DT_INT32)
      throw std::runtime_error("an attribute that the format does not allow");
    ++found_;
    draco::PointCloud::SetAttribute(id, std::move(attribute));
  }
  bool complete() const { return found_ == lists_; }

 private:
  std::size_t lists_, found_ = 0;
};

}  // namespace

Result<Bytes> encode_numbers(std::span<const Numbers> lists) {
  try {
    draco::PointCloud cloud;
    cloud.set_num_points(static_cast<std::uint32_t>(lists.front().size()));
    for (const Numbers& numbers : lists) add_list(numbers, cloud);
    draco::ExpertEncoder encoder(cloud);
    encoder.SetEncodingMethod(draco::POINT_CLOUD_SEQUENTIAL_ENCODING);
    for (std::size_t i = 0; i < lists.size(); ++i)
      encoder.SetAttributePredictionScheme(static_cast<int>(i), draco::PREDICTION_NONE);
    draco::EncoderBuffer buffer;
    const draco::Status status = encoder.EncodeToBuffer(&buffer);
    if (!status.ok()) return Error{"Draco cannot encode this grid: " + status.error_msg_string()};
    return Bytes(buffer.data(), buffer.data() + buffer.size());
  } catch (const std::exception& e) {
    return Error{std::string("Draco cannot encode this grid: ") + e.what()};
  }
}

Status decode_numbers(std::span<const std::uint8_t> bytes, std::uint32_t count, std::span<Numbers> lists) {
  const auto declared = allowed_draco_counts(bytes);
  if (!declared) return declared.error();
  if (declared->triangles != 0 || declared->vertices != count)
    return Error{"geometry holds a list of " + std::to_string(declared->vertices) + " numbers, but " +
                 std::to_string(count) + " are declared"};
  try {
    draco::DecoderBuffer buffer;
    buffer.Init(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    GuardedCloud cloud(lists.size());
    draco::Decoder decoder;  // one a buffer: a decoder cannot be used again
    const draco::Status status = decoder.DecodeBufferToGeometry(&buffer, &cloud);
    if (!status.ok()) return Error{"geometry cannot be decoded: " + status.error_msg_string()};
    if (!cloud.complete() || cloud.num_points() != count || buffer.remaining_size() != 0)
      return Error{"geometry does not hold the lists that the format asks for"};
    for (std::size_t i = 0; i < lists.size(); ++i) {
      const draco::PointAttribute* attribute = cloud.attribute(static_cast<int>(i));
      if (attribute->size() != count || !attribute->is_mapping_identity())
        return Error{"geometry holds a list of a wrong length"};
      lists[i].resize(count);
      attribute->buffer()->Read(attribute->byte_offset(), lists[i].data(), count * sizeof(std::int32_t));
    }
    return {};
  } catch (const std::exception& e) {
    return Error{std::string("geometry cannot be decoded: ") + e.what()};
  }
}

}  // namespace relievo
