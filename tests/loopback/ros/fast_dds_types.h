// SPDX-License-Identifier: Apache-2.0
// fast_dds_types.h — messages of ROS 2 for Fast DDS: poses and wrenches both ways, every other one
// as words. Written from the message definitions; nothing of deploy/ros is used.
#pragma once

#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <functional>
#include <string>
#include <vector>

namespace palpate::peer {

namespace dds = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;
using eprosima::fastcdr::Cdr;
using eprosima::fastcdr::FastBuffer;

/// A header and numbers: seven of a pose (position, quaternion), six of a wrench.
template <std::size_t kCount>
struct Stamped {
  std::int32_t sec = 0;
  std::uint32_t nanosec = 0;
  std::string frame = "world";
  std::array<double, kCount> numbers{};
};
using Pose = Stamped<7>;
using Wrench = Stamped<6>;

template <std::size_t kCount>
class StampedType final : public dds::TopicDataType {
 public:
  explicit StampedType(const char* name) {
    setName(name);
    m_typeSize = 256;
    m_isGetKeyDefined = false;
  }
  bool serialize(void* data, rtps::SerializedPayload_t* payload) override {
    const auto& message = *static_cast<Stamped<kCount>*>(data);
    FastBuffer buffer(reinterpret_cast<char*>(payload->data), payload->max_size);
    Cdr cdr(buffer, Cdr::LITTLE_ENDIANNESS, Cdr::DDS_CDR);
    payload->encapsulation = CDR_LE;
    cdr.serialize_encapsulation();
    cdr << message.sec << message.nanosec << message.frame;
    for (const double number : message.numbers) cdr << number;
    payload->length = static_cast<std::uint32_t>(cdr.getSerializedDataLength());
    return true;
  }
  bool deserialize(rtps::SerializedPayload_t* payload, void* data) override {
    auto& message = *static_cast<Stamped<kCount>*>(data);
    FastBuffer buffer(reinterpret_cast<char*>(payload->data), payload->length);
    Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
    try {
      cdr.read_encapsulation();
      cdr >> message.sec >> message.nanosec >> message.frame;
      for (double& number : message.numbers) cdr >> number;
    } catch (const eprosima::fastcdr::exception::Exception&) {
      return false;
    }
    return true;
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void* /*data*/) override {
    return [] { return 256U; };
  }
  void* createData() override { return new Stamped<kCount>; }
  void deleteData(void* data) override { delete static_cast<Stamped<kCount>*>(data); }
  bool getKey(void* /*data*/, rtps::InstanceHandle_t* /*handle*/, bool /*force_md5*/) override {
    return false;
  }
};

/// What an arm tells beside its pose.
struct ArmNews {
  std::string state = "ENABLED";
  bool is_homed = true;
  std::vector<std::int32_t> buttons;
};
inline void write_state(Cdr& cdr, const ArmNews& news) {
  cdr << std::int32_t{0} << std::uint32_t{0} << std::string("base") << news.state << news.is_homed
      << false;
}
inline void write_joy(Cdr& cdr, const ArmNews& news) {
  cdr << std::int32_t{0} << std::uint32_t{0} << std::string("base") << std::vector<float>{}
      << news.buttons;
}

/// Is only sent.
class NewsType final : public dds::TopicDataType {
 public:
  using Write = void (*)(Cdr& cdr, const ArmNews& news);
  NewsType(const char* name, Write write) : write_(write) {
    setName(name);
    m_typeSize = 256;
    m_isGetKeyDefined = false;
  }
  bool serialize(void* data, rtps::SerializedPayload_t* payload) override {
    FastBuffer buffer(reinterpret_cast<char*>(payload->data), payload->max_size);
    Cdr cdr(buffer, Cdr::LITTLE_ENDIANNESS, Cdr::DDS_CDR);
    payload->encapsulation = CDR_LE;
    cdr.serialize_encapsulation();
    write_(cdr, *static_cast<ArmNews*>(data));
    payload->length = static_cast<std::uint32_t>(cdr.getSerializedDataLength());
    return true;
  }
  bool deserialize(rtps::SerializedPayload_t* /*payload*/, void* /*data*/) override {
    return false;
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void* /*data*/) override {
    return [] { return 256U; };
  }
  void* createData() override { return new ArmNews; }
  void deleteData(void* data) override { delete static_cast<ArmNews*>(data); }
  bool getKey(void* /*data*/, rtps::InstanceHandle_t* /*handle*/, bool /*force_md5*/) override {
    return false;
  }

 private:
  Write write_;
};

/// The rest of a message in words.
using Read = std::string (*)(Cdr& cdr);

inline std::string number_text(double number) {
  std::array<char, 32> digits{};
  std::snprintf(digits.data(), digits.size(), "%.4f", number);
  return digits.data();
}
template <class T>
T next(Cdr& cdr) {
  T value{};
  cdr >> value;
  return value;
}
inline std::string numbers_text(Cdr& cdr, int count) {
  std::string text;
  for (int i = 0; i < count; ++i) text += " " + number_text(next<double>(cdr));
  return text;
}
inline std::string header_text(Cdr& cdr) {
  next<std::int32_t>(cdr);
  next<std::uint32_t>(cdr);
  return "frame=" + next<std::string>(cdr);
}
inline std::string sequence_text(Cdr& cdr) {
  std::string text = " [";
  for (const double number : next<std::vector<double>>(cdr)) text += " " + number_text(number);
  return text + " ]";
}
inline std::string read_twist(Cdr& cdr) {
  const std::string text = header_text(cdr);
  return text + numbers_text(cdr, 6);
}
inline std::string read_wrench(Cdr& cdr) { return read_twist(cdr); }
inline std::string read_number(Cdr& cdr) { return number_text(next<double>(cdr)); }
inline std::string read_state(Cdr& cdr) {
  std::string text = header_text(cdr);
  text += " " + next<std::string>(cdr);
  if (next<bool>(cdr)) text += " homed";
  if (next<bool>(cdr)) text += " busy";
  return text;
}
inline std::string read_joints(Cdr& cdr) {
  std::string text = header_text(cdr);
  for (const std::string& name : next<std::vector<std::string>>(cdr)) text += " " + name;
  for (int i = 0; i < 3; ++i) text += sequence_text(cdr);
  return text;
}
inline std::string read_frames(Cdr& cdr) {
  std::string text;
  for (std::uint32_t left = next<std::uint32_t>(cdr); left > 0; --left) {
    text += header_text(cdr);
    text += " child=" + next<std::string>(cdr);
    text += numbers_text(cdr, 7);
  }
  return text;
}
inline std::string read_marker(Cdr& cdr) {
  std::string text = header_text(cdr);
  text += " ns=" + next<std::string>(cdr);
  text += " id=" + std::to_string(next<std::int32_t>(cdr));
  text += " type=" + std::to_string(next<std::int32_t>(cdr));
  text += " action=" + std::to_string(next<std::int32_t>(cdr));
  text += " pose" + numbers_text(cdr, 7);
  text += " scale" + numbers_text(cdr, 3) + " color";
  for (int i = 0; i < 4; ++i) text += " " + number_text(next<float>(cdr));
  next<std::int32_t>(cdr);  // lifetime
  next<std::uint32_t>(cdr);
  next<bool>(cdr);
  const std::uint32_t points = next<std::uint32_t>(cdr);
  double lowest_z = 0.0;
  for (std::uint32_t i = 0; i < points; ++i) {
    next<double>(cdr);
    next<double>(cdr);
    lowest_z = std::min(lowest_z, next<double>(cdr));
  }
  text += " points=" + std::to_string(points) + " lowest=" + number_text(lowest_z);
  const std::uint32_t colors = next<std::uint32_t>(cdr);
  next<std::string>(cdr);  // texture
  header_text(cdr);
  next<std::string>(cdr);
  const std::size_t texels = next<std::vector<std::uint8_t>>(cdr).size();
  const std::uint32_t places = next<std::uint32_t>(cdr);
  next<std::string>(cdr);  // text
  next<std::string>(cdr);  // mesh
  next<std::string>(cdr);
  const std::size_t bytes = next<std::vector<std::uint8_t>>(cdr).size();
  next<bool>(cdr);
  return text + (colors + texels + places + bytes == 0 ? "" : " more");
}

struct Words {
  std::string text;
  std::string cdr;  ///< bytes of the message as it came
};
/// Any type, read by `read`; what is left over is told.
class WordsType final : public dds::TopicDataType {
 public:
  WordsType(const char* name, Read read) : read_(read) {
    setName(name);
    m_typeSize = 8U << 20U;
    m_isGetKeyDefined = false;
  }
  bool serialize(void* /*data*/, rtps::SerializedPayload_t* /*payload*/) override { return false; }
  bool deserialize(rtps::SerializedPayload_t* payload, void* data) override {
    FastBuffer buffer(reinterpret_cast<char*>(payload->data), payload->length);
    Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
    std::string& text = static_cast<Words*>(data)->text;
    static_cast<Words*>(data)->cdr.assign(reinterpret_cast<char*>(payload->data), payload->length);
    try {
      cdr.read_encapsulation();
      text = read_(cdr);
    } catch (const eprosima::fastcdr::exception::Exception& error) {
      text = std::string("unreadable: ") + error.what();
      return true;
    }
    if (payload->length - cdr.getSerializedDataLength() > 3) text += " left over";
    return true;
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void* /*data*/) override {
    return [] { return 0U; };
  }
  void* createData() override { return new Words; }
  void deleteData(void* data) override { delete static_cast<Words*>(data); }
  bool getKey(void* /*data*/, rtps::InstanceHandle_t* /*handle*/, bool /*force_md5*/) override {
    return false;
  }

 private:
  Read read_;
};

}  // namespace palpate::peer
